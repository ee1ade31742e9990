//! Times of repeats, in short.

use serde::{Deserialize, Serialize};

/// Quantiles of times in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Half of the repeats took no longer.
    pub p50_ms: f64,
    /// 95 % of the repeats took no longer; of fewer than 20, none.
    pub p95_ms: f64,
    /// Repeats.
    pub repeats: usize,
}

impl Spread {
    /// Of times in seconds; `None` where there are none.
    pub fn of(mut seconds: Vec<f64>) -> Option<Self> {
        seconds.sort_unstable_by(f64::total_cmp);
        let repeats = seconds.len();
        let quantile = |share: f64| {
            let rank = (share * repeats as f64).ceil() as usize;
            seconds.get(rank.max(1) - 1).map(|s| s * 1e3)
        };
        Some(Self {
            p50_ms: quantile(0.5)?,
            p95_ms: quantile(0.95)?,
            repeats,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 1 to 100 ms.
    #[test]
    fn quantiles_are_ranks() {
        let of = |n: usize| Spread::of((1..=n).rev().map(|k| k as f64 * 1e-3).collect());
        let ms = |n: usize| of(n).map(|s| (s.p50_ms.round(), s.p95_ms.round()));
        assert_eq!(ms(100), Some((50.0, 95.0)));
        assert_eq!(ms(3), Some((2.0, 3.0)));
        assert_eq!(ms(1), Some((1.0, 1.0)));
        assert_eq!(of(0), None);
    }
}
