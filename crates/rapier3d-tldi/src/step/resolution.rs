//! The size of the pixels in which pairs are compared: given, or chosen by a budget.

use std::time::Duration;
use tldi::plan::stride;

/// Factor by which pixels grow at once under [`Resolution::Time`]. It halves their number.
const COARSER: f32 = std::f32::consts::SQRT_2;

/// Largest pixel, in mean radii, that saves time while clouds are not thinned. Larger pixels reach
/// farther from the contact and take more points (`cargo run --release --bin budgets`). Half or twice: tests of
/// budgets fail.
const CHEAPEST: f32 = 1.5;

/// Largest pixel under [`Resolution::Time`], in mean radii. Beyond it, most of the time does not
/// depend on the pixels. Half: the test of budgets of time fails; twice: none does.
const COARSEST: f32 = 8.0;

/// Pixels shrink again if a step takes less than this share of the budget. The finer pixels are
/// twice as many, and then still fit into it.
const LEFT: f32 = 0.4;

/// What decides the edge of the pixels of a [`TldiPipeline`](crate::TldiPipeline).
///
/// Cost follows the number of pixels and points in the contact zone. Clouds that are much finer
/// than the pixels are thinned to what the pixels can show. Bodies of only a few pixels get finer
/// pixels, whatever this says.
///
/// ```
/// use rapier3d_tldi::prelude::*;
/// // A scan of millimetres, for bodies whose contacts may err by a centimetre.
/// let resolution = Resolution::Error(0.01);
/// let config = TldiConfig { resolution, ..TldiConfig::default() };
/// let pipeline = TldiPipeline::new(config)?;
/// # Ok::<(), TldiError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// The edge of a pixel in mean radii of the pair's coarser cloud, greater than 0. 1 shows all
    /// that the points tell.
    Radii(f32),
    /// An error budget in metres, greater than 0. It is the edge of the pixels, because gaps err by
    /// less than a pixel, most at corners. Pixels are not smaller than a mean radius. Between 1.5
    /// and 4.1 radii, 1.5 is taken: larger pixels cost more, until at 4.1 radii only a part of the
    /// points is read.
    Error(f32),
    /// A time budget for the comparisons of a step, longer than zero. Pixels begin with a mean
    /// radius and grow while a step takes longer, up to 8 radii and not between 1.5 and 4.1. The
    /// pass over the near points remains. Results depend on the machine and its load, so do not use
    /// this in simulations that must be repeatable.
    Time(Duration),
}

impl Default for Resolution {
    /// `Radii(1.0)`.
    fn default() -> Self {
        Self::Radii(1.0)
    }
}

impl Resolution {
    /// The setting's number, and whether comparisons can use it.
    pub(crate) fn check(self) -> (f32, bool) {
        let value = match self {
            Self::Radii(value) | Self::Error(value) => value,
            Self::Time(budget) => budget.as_secs_f32(),
        };
        (value, value.is_finite() && value > 0.0)
    }

    /// Edge of a pixel in metres, for a cloud of this mean radius, metres; with a time budget, as
    /// long as nothing was measured.
    pub(crate) fn pixel_size(self, mean_radius: f32) -> f32 {
        match self {
            Self::Radii(radii) => radii * mean_radius,
            Self::Error(error) if saves_nothing(error / mean_radius) => CHEAPEST * mean_radius,
            Self::Error(error) => mean_radius.max(error),
            Self::Time(_) => mean_radius,
        }
    }

    /// Mean radii of a pixel for the next step, after a step whose comparisons with pixels of
    /// `coarsening` mean radii took `seconds`.
    pub(crate) fn coarsened(self, coarsening: f32, seconds: f64) -> f32 {
        let Self::Time(budget) = self else {
            return 1.0;
        };
        let share = (seconds / budget.as_secs_f64()) as f32;
        let step = match share {
            _ if share > 1.0 => COARSER,
            _ if share < LEFT => COARSER.recip(),
            _ => return coarsening,
        };
        let mut next = step * coarsening;
        while saves_nothing(next) {
            next *= step;
        }
        next.clamp(1.0, COARSEST)
    }
}

/// Whether pixels of so many mean radii cost more than smaller ones.
fn saves_nothing(radii: f32) -> bool {
    radii > CHEAPEST && stride(1.0, radii) == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_decide_the_pixels() {
        let radius = 0.01;
        assert_eq!(Resolution::Radii(2.0).pixel_size(radius), 0.02);
        // No finer than the points.
        assert_eq!(Resolution::Error(0.001).pixel_size(radius), radius);
        assert_eq!(Resolution::Error(0.012).pixel_size(radius), 0.012);
        assert_eq!(Resolution::Error(0.03).pixel_size(radius), 0.015);
        assert_eq!(Resolution::Error(0.05).pixel_size(radius), 0.05);
    }

    /// A step that takes time in proportion to the number of pixels settles at the finest ones that
    /// the budget allows, and becomes fine again where the load is gone.
    #[test]
    fn time_settles_within_the_budget() {
        let time = Resolution::Time(Duration::from_millis(10));
        let mut coarsening = 1.0;
        let mut run = |seconds_at_one: f64| {
            let mut last = [0.0; 2];
            for _ in 0..20 {
                let seconds = seconds_at_one / f64::from(coarsening).powi(2);
                last = [last[1], seconds];
                coarsening = time.coarsened(coarsening, seconds);
                // Larger pixels without fewer points: they cost more.
                assert!(coarsening <= CHEAPEST || stride(1.0, coarsening) > 1);
            }
            (last, coarsening)
        };
        let (last, coarsening) = run(0.015);
        assert!(
            last[0] == last[1] && (0.005..=0.01).contains(&last[1]),
            "{last:?}"
        );
        assert!((coarsening - COARSER).abs() < 1e-5, "{coarsening}");
        assert_eq!(run(10.0).1, COARSEST);
        assert_eq!(run(0.003).1, 1.0);
        assert_eq!(Resolution::Radii(2.0).coarsened(1.0, 9.0), 1.0);
    }

    #[test]
    fn what_no_comparison_can_use() {
        for (resolution, is_valid) in [
            (Resolution::Radii(0.5), true),
            (Resolution::Radii(0.0), false),
            (Resolution::Error(f32::NAN), false),
            (Resolution::Error(f32::INFINITY), false),
            (Resolution::Time(Duration::from_micros(1)), true),
            (Resolution::Time(Duration::ZERO), false),
        ] {
            assert_eq!(resolution.check().1, is_valid, "{resolution:?}");
        }
    }
}
