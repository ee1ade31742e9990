//! What is told of many numbers.

/// The median, the lower one of two, and the largest number; 0 without any.
pub(crate) fn median_and_most(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    [last / 2, last].map(|k| values.get(k).copied().unwrap_or(0.0))
}
