//! Round numbers along an axis.

use super::figure::Axis;

/// Values that get a line, and their labels.
pub(super) fn ticks(axis: &Axis) -> Vec<(f64, String)> {
    let [low, high] = axis.range;
    let mut all = match &axis.ticks {
        Some(given) => return given.clone(),
        None if axis.is_log => logarithmic(low, high),
        None => linear(low, high),
    };
    if axis.has_zero {
        all.insert(0, 0.0);
    }
    all.into_iter().map(|value| (value, label(value))).collect()
}

/// Powers of ten, with 2 and 5 of them where there is room.
fn logarithmic(low: f64, high: f64) -> Vec<f64> {
    let factors: &[f64] = if high / low < 30.0 {
        &[1.0, 2.0, 3.0, 5.0]
    } else if high / low < 3_000.0 {
        &[1.0, 3.0]
    } else {
        &[1.0]
    };
    let exponents = low.log10().floor() as i32..=high.log10().ceil() as i32;
    exponents
        .flat_map(|exponent| factors.iter().map(move |f| f * 10f64.powi(exponent)))
        .filter(|value| (low..=high).contains(value))
        .collect()
}

/// Between four and eleven steps of 1, 2 or 5 of some power of ten.
fn linear(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 6.0;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|step| *step >= 0.8 * rough)
        .unwrap_or(rough);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// As short as it can be: 0.05, 3, 20k, 5M.
pub(super) fn label(value: f64) -> String {
    let rounded = |value: f64| {
        let text = format!("{value:.4}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        text.to_owned()
    };
    match value.abs() {
        v if v >= 1e6 => rounded(value / 1e6) + "M",
        v if v >= 1e4 => rounded(value / 1e3) + "k",
        _ => rounded(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(linear(0.0, 3.1), [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]);
        assert_eq!(logarithmic(0.5, 2_000.0), [1.0, 10.0, 100.0, 1_000.0]);
        assert_eq!(logarithmic(0.9, 6.0), [1.0, 2.0, 3.0, 5.0]);
        for (low, high) in [(0.0, 1e-3), (0.0, 7.0), (-3.0, 90.0), (0.0, 1e6)] {
            let all = linear(low, high);
            assert!((4..=11).contains(&all.len()), "{low} {high}: {all:?}");
            assert!(all.iter().all(|v| (low..=high).contains(v)), "{all:?}");
        }
    }

    #[test]
    fn labels_are_short() {
        let labels = [0.05, 3.0, 2_048.0, 20_000.0, 5e6, 0.001, 544_000.0].map(label);
        assert_eq!(labels, ["0.05", "3", "2048", "20k", "5M", "0.001", "544k"]);
    }
}
