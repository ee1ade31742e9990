//! Point radii: validation, and the spherical cover from nearest neighbours.

use crate::{Aabb, CloudError, KdTree};
use glamx::Vec3;
use std::borrow::Cow;
use std::ops::RangeInclusive;

/// Radius of the ball around each point, in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Radii<'a> {
    /// The same for all points.
    Global(f32),
    /// One for each point.
    PerPoint(Cow<'a, [f32]>),
}

/// Radii in metres that a cloud accepts: with [`COORDINATE_PER_RADIUS`], squares and cubes of all
/// lengths stay within the range of `f32`.
pub(crate) const RADIUS_RANGE: RangeInclusive<f32> = 1e-12..=1e12;

/// Largest coordinate in units of the point's radius: 2¹⁹, where a step of `f32` (2⁻²³ of the
/// coordinate, at most) is a sixteenth of the radius.
pub(crate) const COORDINATE_PER_RADIUS: f32 = 524_288.0;

/// Largest radius from nearest neighbours, in units of the median one. Half or twice: no change.
const CAP_PER_MEDIAN: f32 = 10.0;

/// Whether a cloud accepts the radius.
pub(crate) fn is_valid(radius: f32) -> bool {
    RADIUS_RANGE.contains(&radius)
}

/// Fails for the first radius that a cloud does not accept. `given_index` turns an index of
/// `radii` into the user's.
pub(crate) fn check_radii(
    radii: &Radii<'_>,
    given_index: impl Fn(usize) -> usize,
) -> Result<(), CloudError> {
    let bad = |index, radius| Err(CloudError::BadRadius { index, radius });
    match radii {
        Radii::Global(r) if !is_valid(*r) => bad(0, *r),
        Radii::Global(_) => Ok(()),
        Radii::PerPoint(r) => match r.iter().position(|r| !is_valid(*r)) {
            Some(i) => bad(given_index(i), r[i]),
            None => Ok(()),
        },
    }
}

/// Fails for the first point whose coordinates are too coarse for its radius. `given_index` turns
/// an index of the coordinates into the user's.
pub(crate) fn check_coordinates(
    points: &[Vec3],
    bounds: Aabb,
    radii: &Radii<'_>,
    given_index: impl Fn(usize) -> usize,
) -> Result<(), CloudError> {
    let largest = |i: usize| points[i].abs().max_element();
    let too_large = match radii {
        Radii::Global(r) => {
            let limit = COORDINATE_PER_RADIUS * r;
            if bounds.min.abs().max(bounds.max.abs()).max_element() <= limit {
                return Ok(());
            }
            (0..points.len()).find(|&i| largest(i) > limit)
        }
        Radii::PerPoint(r) => {
            (0..points.len()).find(|&i| largest(i) > COORDINATE_PER_RADIUS * r[i])
        }
    };
    match too_large {
        None => Ok(()),
        Some(i) => Err(CloudError::CoordinateTooLarge {
            index: given_index(i),
            coordinate: (points[i].to_array().into_iter())
                .fold(0.0, |a: f32, b| if b.abs() > a.abs() { b } else { a }),
            radius: match radii {
                Radii::Global(r) => *r,
                Radii::PerPoint(r) => r[i],
            },
        }),
    }
}

/// Mean and largest radius in metres.
pub(crate) fn mean_and_max(radii: &Radii<'_>) -> (f32, f32) {
    match radii {
        Radii::Global(r) => (*r, *r),
        Radii::PerPoint(r) => {
            let sum: f64 = r.iter().copied().map(f64::from).sum();
            let mean = (sum / r.len() as f64) as f32;
            (mean, r.iter().copied().fold(0.0, f32::max))
        }
    }
}

/// Radii that cover a surface: of those of distinct positions, from the distance to a neighbour, let m be the
/// median. Radii above [`CAP_PER_MEDIAN`] × m are lowered
/// to it. Radii that [`check_coordinates`] would refuse are raised to what it accepts, but not
/// above m. So a few points that nearly coincide do not make a cloud unusable, but coordinates too
/// large for its typical spacing do.
pub(crate) fn covering_radii(tree: &KdTree, mut radii: Vec<f32>) -> Result<Vec<f32>, CloudError> {
    if radii.iter().all(|radius| *radius == 0.0) {
        return Err(CloudError::NoSpacing { count: tree.len() });
    }
    let mut sorted = radii.clone();
    let middle = (sorted.len() - 1) / 2;
    let (_, median, _) = sorted.select_nth_unstable_by(middle, f32::total_cmp);
    for (entry, radius) in radii.iter_mut().enumerate() {
        let largest = tree.position(entry).abs().max_element();
        let floor = (largest / COORDINATE_PER_RADIUS).min(*median);
        *radius = radius.min(CAP_PER_MEDIAN * *median).max(floor);
    }
    Ok(radii)
}
