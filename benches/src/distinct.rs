//! Each value once.

use std::collections::BTreeSet;

/// In the order in which they first come.
pub(crate) fn distinct<T: PartialEq>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut all = Vec::new();
    for value in values {
        if !all.contains(&value) {
            all.push(value);
        }
    }
    all
}

/// Rising.
pub(crate) fn rising<T: Ord>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    let all: BTreeSet<T> = values.into_iter().collect();
    all.into_iter().collect()
}
