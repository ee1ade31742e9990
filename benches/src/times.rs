//! Times of several frames, in short.

/// Ranks of a list of times, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    /// The least.
    pub least: f64,
    /// A quarter is less than the first, and a quarter is more than the second.
    pub quartiles: [f64; 2],
    /// Half is less.
    pub median: f64,
    /// The most.
    pub most: f64,
}

impl Times {
    /// Of at least one time.
    pub fn of(times: impl IntoIterator<Item = f64>) -> Self {
        let mut times: Vec<f64> = times.into_iter().collect();
        times.sort_unstable_by(f64::total_cmp);
        let rank = |quarters: usize| times[(quarters * (times.len() - 1) + 2) / 4];
        Self {
            least: rank(0),
            quartiles: [rank(1), rank(3)],
            median: rank(2),
            most: rank(4),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_are_ranks() {
        let of = |n: usize| {
            // In another order: 7 has no divisor in common with the numbers below.
            let Times {
                least,
                quartiles: [lower, upper],
                median,
                most,
            } = Times::of((0..n).map(|k| (7 * k % n) as f64));
            [least, lower, median, upper, most]
        };
        assert_eq!(of(9), [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(of(5), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(of(101), [0.0, 25.0, 50.0, 75.0, 100.0]);
        assert_eq!(of(1), [0.0; 5]);
    }
}
