//! What is told of many numbers.

/// The least and the largest.
pub(crate) fn range(values: impl Iterator<Item = f32>) -> [f32; 2] {
    values.fold([f32::MAX, f32::MIN], |[least, most], value| {
        [least.min(value), most.max(value)]
    })
}

/// The median, the upper one of two.
pub(crate) fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// The median, the lower one of two, and the largest number; 0 without any.
pub(crate) fn median_and_most(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    [last / 2, last].map(|k| values.get(k).copied().unwrap_or(0.0))
}
