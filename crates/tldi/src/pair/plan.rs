//! What is known about a pair before any of its points is read. All backends start from here.

use crate::cloud::reach::{Ring, farthest};
use crate::cpu::normals;
use crate::{Aabb, PairQuery, Params, Surface, View};
use glamx::{Pose3, Vec3};

pub use crate::cpu::crossings::CROSSED;
pub use crate::cpu::cull::Region;
pub use crate::cpu::normals::SUPPORT;
pub use crate::cpu::splat::DepthScale;
pub use crate::cpu::zone::ZoneGrid;
pub use crate::pair::further_views::{asks_for_spare, settle_spare};
pub use crate::pair::pixels::{largest_pixel, least_pixel};
pub use crate::pair::sampling::{AIM_SAMPLES, first_taken, is_aim_sample, stride};
pub use crate::pair::stage_constants::stage_constants;
pub use crate::pair::surface::first_is_smaller;
pub use crate::view::approach::{Approach, Body, moved_along};
pub use crate::view::camera_policy::MAX_VIEWS;

/// Tangent of the largest angle (60°) between a normal and the view at which a contact at the prediction distance is
/// found: beyond it, depths along the view are no distances. There, the surfaces are twice as far apart along the view.
/// Half or twice: no row changes.
const STEEPEST: f32 = 1.732_050_8;

/// Depth in pixels to which a body is searched that has sunk below all of a surface. Points that are culled in vain
/// cost little, but two large clouds have many deeper points. Half: 13 % fewer culled points; twice: 22 % more; else no
/// change.
const SUNK: f32 = 16.0;

/// What a pair's stages `cull`, `zone` and `aim` need beside the points.
#[derive(Clone, Debug)]
pub struct PairPlan {
    /// Where the points of both sides can touch, in the frame of the first surface.
    pub overlap: Aabb,
    /// What is kept of each side.
    pub sides: [SidePlan; 2],
    /// Distance in metres up to which points of both sides are near each other. In [uneven
    /// clouds](crate::PointCloud::is_uneven) it is longer by the amount by which radii exceed the
    /// mean.
    pub zone_reach: f32,
    /// Distance in metres along a view up to which the surfaces of a column can matter to each
    /// other.
    pub column_reach: f32,
    /// What is known of where the second surface lies and comes from.
    pub approach: Approach,
}

/// One side of a [`PairPlan`].
#[derive(Clone, Debug)]
pub struct SidePlan {
    /// From the frame of the surface into that of the query.
    pub frame_from_surface: Pose3,
    /// Which of its points are kept.
    pub region: Region,
    /// Its bounds, in its own frame, if it is the smaller surface of the pair. It then counts as a body that fills them. `None`
    /// for the larger one.
    pub body: Option<Aabb>,
}

impl PairPlan {
    /// The plan of a pair; `None` where the bounds say that nothing can touch. Cost: O(1).
    ///
    /// ```
    /// use tldi::plan::PairPlan;
    /// use tldi::{PairQuery, Params, PointCloud, Surface, View};
    /// use tldi::glamx::{Pose3, Vec3};
    ///
    /// let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::X]).radius(0.5).build()?;
    /// let query = |distance| PairQuery {
    ///     a: Surface::Cloud(&cloud),
    ///     b: Surface::Cloud(&cloud),
    ///     a_from_b: Pose3::translation(distance, 0.0, 0.0),
    ///     view: View::aimed(),
    ///     params: Params::for_radius(0.5),
    /// };
    /// assert!(PairPlan::new(&query(1.0)).is_some());
    /// assert!(PairPlan::new(&query(10.0)).is_none());
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn new(query: &PairQuery) -> Option<Self> {
        let (a, b) = (&query.a, &query.b);
        let prediction = query.params.prediction;
        if !within_reach(query, prediction + farthest(a) + farthest(b)) {
            return None;
        }
        let rings = [ring(a, &query.params), ring(b, &query.params)];
        let [bounds_a, bounds_b] = bounds_with_inside(query);
        let b_in_frame = bounds_b.transformed(&query.a_from_b);
        let overlap =
            |margin| (bounds_a.loosened(margin)).intersection(b_in_frame.loosened(margin));
        let widest = overlap(prediction + rings[0].widest().max(rings[1].widest()));
        if widest.is_empty() {
            return None;
        }
        let bodies = bodies(query);
        let side = |k: usize, frame_from_surface, other_from_frame, other_bounds: Aabb| {
            let included = rings[k].beside(&rings[1 - k]);
            let margin = prediction + included;
            SidePlan {
                frame_from_surface,
                region: Region {
                    overlap: overlap(margin),
                    other_from_frame,
                    other_bounds: other_bounds.loosened(margin),
                    ring: rings[k],
                    included,
                },
                body: bodies[k],
            }
        };
        let b_from_a = query.a_from_b.inverse();
        Some(Self {
            overlap: widest,
            sides: [
                side(0, Pose3::IDENTITY, b_from_a, bounds_b),
                side(1, query.a_from_b, Pose3::IDENTITY, bounds_a),
            ],
            zone_reach: prediction + a.mean_radius() + b.mean_radius(),
            column_reach: column_reach(&query.params),
            approach: {
                let (motion, last_axis) = match query.view {
                    View::Fixed(_) => (Vec3::ZERO, None),
                    View::Aim {
                        motion, last_axis, ..
                    } => (motion, last_axis),
                };
                let (a, b) = (query.a.bounds(), query.b.bounds());
                Approach::new(&a, &b, &query.a_from_b, motion, last_axis)
            },
        })
    }
}

/// See [`PairPlan::column_reach`].
///
/// It is the distance between the nearest points of both in a tile and around it, at least a pixel on all sides. Surfaces
/// that are inclined by 60° come nearer there, each by as much as it rises over this pixel.
pub(crate) fn column_reach(params: &Params) -> f32 {
    let rise = STEEPEST * params.pixel_size;
    let inclined = 2.0 * (params.seen_gap() - rise);
    params.thickness.max(params.seen_gap()).max(inclined)
}

/// Whether the bounds are within `reach` metres of each other in the frames of both surfaces.
fn within_reach(query: &PairQuery, reach: f32) -> bool {
    let (a, b) = (query.a.bounds().loosened(reach), query.b.bounds());
    a.intersects(&b.transformed(&query.a_from_b))
        && a.transformed(&query.a_from_b.inverse()).intersects(&b)
}

/// How far beyond the touching region points are kept, metres. Splats reach a radius beyond their
/// points, on both sides. Estimated normals need their neighbours, or they would err at the rim. And where no outside is
/// known, the places of the near points tell the side: all of them must be there, also on the side away from a body.
pub(crate) fn ring(surface: &Surface, params: &Params) -> Ring {
    let is_exact = matches!(surface, Surface::Exact(_));
    let support = if !is_exact && !surface.is_oriented() {
        normals::SUPPORT * (stride(surface.mean_radius(), params.pixel_size) as f32).sqrt()
    } else {
        0.0
    };
    Ring::new(surface, 2.0 + support)
}

/// Bounds of both surfaces, each in its own frame. Those of the larger one include the part of the
/// body that may be behind it, where a floor's bounds do not reach. For a body that passes through
/// the bounds, that is all of it. For others, it is the part up to their middle, but no more than
/// [`SUNK`] and their motion.
fn bounds_with_inside(query: &PairQuery) -> [Aabb; 2] {
    let (a, b) = (query.a.bounds(), query.b.bounds());
    let moved = match query.view {
        View::Aim { motion, .. } => motion.length(),
        View::Fixed(_) => 0.0,
    };
    let with_inside = |larger: Aabb, body: Aabb, body_in_larger: Aabb| {
        let to_middle = 0.5 * body.extents().min_element();
        let sunk = to_middle.min(SUNK * query.params.pixel_size + moved);
        larger.reached_through(body_in_larger).loosened(sunk)
    };
    if first_is_smaller([a.extents(), b.extents()]) {
        let a_in_b = a.transformed(&query.a_from_b.inverse());
        [a, with_inside(b, a, a_in_b)]
    } else {
        [with_inside(a, b, b.transformed(&query.a_from_b)), b]
    }
}

/// See [`SidePlan::body`]. Two that are equal are both bodies.
fn bodies(query: &PairQuery) -> [Option<Aabb>; 2] {
    let (a, b) = (query.a.bounds(), query.b.bounds());
    let is_smaller = |one: Aabb, other: Aabb| first_is_smaller([one.extents(), other.extents()]);
    [
        (!is_smaller(b, a)).then_some(a),
        (!is_smaller(a, b)).then_some(b),
    ]
}
