//! Point radii: validation, and the spherical cover from nearest neighbours.

use crate::cloud::gather::{BLOCK, extremes};
use crate::{Aabb, CloudError, KdTree};
use glamx::Vec3;
use std::borrow::Cow;
use std::ops::{Range, RangeInclusive};

/// Radius of the ball around each point, in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Radii<'a> {
    /// The same for all points.
    Global(f32),
    /// One for each point.
    PerPoint(Cow<'a, [f32]>),
}

impl Radii<'_> {
    /// Of the i-th point.
    pub(crate) fn of(&self, i: usize) -> f32 {
        match self {
            Self::Global(radius) => *radius,
            Self::PerPoint(radii) => radii[i],
        }
    }
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

/// Fails for the first radius that a cloud does not accept, then for the first point whose coordinates are too coarse for
/// its radius. `blocks` are the [bounds](crate::cloud::gather::bounds_of_blocks) of the points; `given_index` turns an
/// index of the points into the user's.
///
/// Cost: a pass over the radii; points are looked at only where a block may have a fault.
pub(crate) fn check_radii(
    points: &[Vec3],
    blocks: &[Aabb],
    radii: &Radii<'_>,
    given_index: impl Fn(usize) -> usize,
) -> Result<(), CloudError> {
    let is_coarse = |coordinate: f32, radius: f32| coordinate > COORDINATE_PER_RADIUS * radius;
    let may_have_fault = |(k, block): (usize, &Aabb)| {
        let of_block = k * BLOCK..points.len().min((k + 1) * BLOCK);
        let [least, largest] = least_and_largest(radii, of_block);
        let coordinate = block.min.abs().max(block.max.abs()).max_element();
        !is_valid(least) | !is_valid(largest) | is_coarse(coordinate, least)
    };
    if !blocks.iter().enumerate().any(may_have_fault) {
        return Ok(());
    }
    if let Some(i) = (0..points.len()).find(|&i| !is_valid(radii.of(i))) {
        let radius = radii.of(i);
        // One for all has no index.
        let index = match radii {
            Radii::Global(_) => 0,
            Radii::PerPoint(_) => given_index(i),
        };
        return Err(CloudError::BadRadius { index, radius });
    }
    let of_point = |i: &usize| is_coarse(points[*i].abs().max_element(), radii.of(*i));
    match (0..points.len()).find(of_point) {
        None => Ok(()),
        Some(i) => Err(CloudError::CoordinateTooLarge {
            index: given_index(i),
            coordinate: (points[i].to_array().into_iter())
                .fold(0.0, |a: f32, b| if b.abs() > a.abs() { b } else { a }),
            radius: radii.of(i),
        }),
    }
}

/// Mean and largest of valid radii in metres.
pub(crate) fn mean_and_max(radii: &Radii<'_>) -> (f32, f32) {
    let Radii::PerPoint(all) = radii else {
        let radius = radii.of(0);
        return (radius, radius);
    };
    // As many sums as are added at once, always in the same order.
    let mut sums = [0.0; 8];
    let (chunks, rest) = all.as_chunks::<8>();
    for chunk in chunks {
        for (sum, radius) in sums.iter_mut().zip(chunk) {
            *sum += f64::from(*radius);
        }
    }
    let sum: f64 = sums
        .into_iter()
        .chain(rest.iter().copied().map(f64::from))
        .sum();
    let [_, largest] = least_and_largest(radii, 0..all.len());
    ((sum / all.len() as f64) as f32, largest)
}

/// Least and largest of some radii: where one is negative, the least one is negative or NaN; where one is NaN, one of both
/// is.
fn least_and_largest(radii: &Radii<'_>, points: Range<usize>) -> [f32; 2] {
    match radii {
        Radii::Global(radius) => [*radius; 2],
        Radii::PerPoint(radii) => extremes(&radii[points]),
    }
}

/// Radii that cover a surface: of those of distinct positions, from the distance to a neighbour, let m be the
/// median. Radii above [`CAP_PER_MEDIAN`] × m are lowered
/// to it. Radii that [`check_radii`] would refuse are raised to what it accepts, but not
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
