//! Larger pixels for what is deep: a contact may err by a share of its depth.
//!
//! Cost follows pixels and points, so bodies deep in each other would cost the most, and their
//! contacts would be found to a hundredth of what a solver can use. They are compared coarsely first,
//! with every n-th point, and that is the answer where it finds a contact as deep as its pixels want.

use crate::{Aabb, ContactPixel, PairQuery, PairResult, Params, Variant, View};

/// Least factor by which larger pixels spare more than a comparison in vain costs: four times fewer.
const LEAST_COARSER: f32 = 2.0;

/// Comparisons with larger pixels at the most. The first knows the bounds, the second a depth.
const MOST_TRIES: usize = 2;

/// Share of the greatest possible depth that is tried: first of what the bounds allow, then of what
/// was found, which is known within a few pixels.
const EXPECTED: [f32; MOST_TRIES] = [0.9, 0.8];

/// Share of the pixels with contacts of which one must be deep: of bodies that only touch each other,
/// with limbs around which rays go astray, at most 6 % seemed to be.
const DEEP_SHARE: f32 = 0.25;

/// Finds the contacts of a pair that may be deep with `compare`, which fills the empty result that it
/// is given; `false`, and an empty result, where they are to be found with the pixels of the query.
pub(crate) fn compare_deep(
    query: &PairQuery,
    result: &mut PairResult,
    mut compare: impl FnMut(&PairQuery, &mut PairResult),
) -> bool {
    if matches!(query.view, View::Fixed(_)) || query.params.variant() == Variant::Paper {
        return false;
    }
    let mut most = most_depth(query);
    for share in EXPECTED {
        let depth = share * most;
        let Some(params) = coarser(&query.params, depth) else {
            return false;
        };
        compare(&PairQuery { params, ..*query }, result);
        let found = -result.gap.unwrap_or(0.0);
        if result.collides && found >= depth && is_deep_widely(result, depth) {
            return true;
        }
        result.clear();
        most = most.min(found);
    }
    false
}

/// Whether in enough of the pixels with contacts one is half of `depth` metres deep. A few may be where a
/// ray missed a layer and seems to run inside as far as the next one, which larger pixels and fewer
/// points make likelier.
fn is_deep_widely(result: &PairResult, depth: f32) -> bool {
    let (mut pixels, mut deep) = (0, 0);
    // They are in the order of their views and pixels.
    let same_pixel = |c: &ContactPixel, d: &ContactPixel| (c.view, c.pixel) == (d.view, d.pixel);
    for pixel in result.contacts.chunk_by(same_pixel) {
        pixels += 1;
        deep += usize::from(pixel.iter().any(|c| c.gap <= -0.5 * depth));
    }
    deep as f32 >= DEEP_SHARE * pixels as f32
}

/// The parameters with pixels that a contact `depth` metres deep needs, if they are much larger.
fn coarser(params: &Params, depth: f32) -> Option<Params> {
    let factor = params.depth_error * depth / params.pixel_size;
    (factor >= LEAST_COARSER && factor.is_finite()).then_some(Params {
        pixel_size: factor * params.pixel_size,
        merge_gap: factor * params.merge_gap,
        points_per_pixel: 1.0,
        ..*params
    })
}

/// Depth in metres that no contact of the pair exceeds, by the bounds as the frames of both see them.
fn most_depth(query: &PairQuery) -> f32 {
    let least = |a: Aabb, b: Aabb| a.intersection(b).extents().min_element();
    let (a, b) = (query.a.bounds(), query.b.bounds());
    let in_a = least(a, b.transformed(&query.a_from_b));
    in_a.min(least(a.transformed(&query.a_from_b.inverse()), b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PointCloud, Surface};
    use glamx::{Pose3, Vec3};

    const RADIUS: f32 = 0.01;

    /// A cube of 1 m, of which only the corners matter here.
    fn cube() -> PointCloud<'static> {
        let corner = |k: u32| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32);
        let corners: Vec<Vec3> = (0..8).map(corner).collect();
        let builder = PointCloud::builder(corners).radius(RADIUS);
        builder.build().expect("the corners are finite")
    }

    /// The edges of the pixels that are tried, in metres, where contacts are `deep` metres deep, but for
    /// `shallow` of 100; and whether one settled it.
    fn tried(overlap: f32, deep: f32, shallow: usize, params: Params) -> (Vec<f32>, bool) {
        let cube = cube();
        let query = PairQuery {
            a: Surface::Cloud(&cube),
            b: Surface::Cloud(&cube),
            a_from_b: Pose3::translation(0.0, 1.0 - overlap, 0.0),
            view: View::aimed(),
            params,
        };
        let (mut pixels, mut result) = (Vec::new(), PairResult::default());
        let is_settled = compare_deep(&query, &mut result, |query, result| {
            assert_eq!(*result, PairResult::default());
            pixels.push(query.params.pixel_size);
            assert_eq!(query.params.merge_gap, 2.0 * query.params.pixel_size);
            result.collides = deep > 0.0;
            result.gap = Some(-deep);
            result.contacts.extend((0..100).map(|k| {
                let gap = if k < shallow { 0.0 } else { -deep };
                ContactPixel {
                    pixel: [k as i32, 0],
                    view: 0,
                    point_a: Vec3::ZERO,
                    point_b: Vec3::ZERO,
                    normal_a: Vec3::Y,
                    normal_b: -Vec3::Y,
                    gap,
                }
            }));
        });
        assert_eq!(result.collides, is_settled);
        (pixels, is_settled)
    }

    #[test]
    fn pixels_grow_with_the_depth_that_is_found() {
        let params = Params {
            depth_error: 0.08,
            ..Params::for_radius(RADIUS)
        };
        let pixel = |depth: f32| params.depth_error * depth;
        // Nearly what the bounds allow, then nearly what was found.
        for (overlap, deep, shallow, depths, settles) in [
            (1.0, 0.95, 0, vec![0.9], true),
            (1.0, 0.5, 70, vec![0.9, 0.4], true),
            (1.0, 0.2, 0, vec![0.9], false),
            (1.0, 0.0, 0, vec![0.9], false),
            (0.25, 0.25, 0, vec![], false),
            // Too few pixels are deep.
            (1.0, 0.95, 80, vec![0.9, 0.76], false),
        ] {
            let (pixels, is_settled) = tried(overlap, deep, shallow, params);
            assert_eq!(is_settled, settles, "{overlap} {deep}");
            assert_eq!(pixels.len(), depths.len(), "{overlap} {deep}: {pixels:?}");
            for (tried, depth) in pixels.into_iter().zip(depths) {
                assert!((tried - pixel(depth)).abs() < 1e-6, "{tried} for {depth}");
            }
        }
        assert_eq!(
            tried(1.0, 0.9, 0, Params::for_radius(RADIUS)),
            (vec![], false)
        );
    }
}
