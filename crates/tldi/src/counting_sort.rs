//! Counting sorts: from counts to places, and items to their places.

use std::ops::AddAssign;

/// Sorts items by their bins: tells `put` the place of each. Afterwards `starts` holds where each of the bins starts, and
/// where the last one ends. Within a bin, the items are in reverse order.
pub(crate) fn sort_by_bin<T>(
    items: impl Iterator<Item = (u32, T)> + Clone,
    bins: usize,
    starts: &mut Vec<u32>,
    mut put: impl FnMut(usize, T),
) {
    starts.clear();
    starts.resize(bins + 1, 0);
    for (bin, _) in items.clone() {
        starts[bin as usize] += 1;
    }
    ends_of(starts);
    // Filled from the end, so that each start ends up where it belongs.
    for (bin, item) in items {
        let place = &mut starts[bin as usize];
        *place -= 1;
        put(*place as usize, item);
    }
}

/// Turns the number of items in each bin into where the bin ends.
pub(crate) fn ends_of(counts: &mut [u32]) {
    let mut end = 0;
    for count in counts {
        end += *count;
        *count = end;
    }
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
