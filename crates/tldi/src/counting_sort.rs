//! From counts to places: the middle step of a counting sort.

use std::ops::AddAssign;

/// Turns the number of items in each bin into where the bin ends, and returns the end of all. To place the items, last
/// one first, count the end of their bin down: it ends up where the bin starts.
pub(crate) fn ends_of(counts: &mut [u32]) -> u32 {
    let mut end = 0;
    for count in counts {
        end += *count;
        *count = end;
    }
    end
}

/// Turns the number of items in each bin into where the bin starts, and returns the end of all.
pub(crate) fn starts_of<T: Copy + Default + AddAssign>(counts: &mut [T]) -> T {
    let mut end = T::default();
    for count in counts {
        let start = end;
        end += std::mem::replace(count, start);
    }
    end
}
