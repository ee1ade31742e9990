//! Stage `aim`: the axes from which a pair is looked at.
//!
//! A camera should see the touching surfaces face on, because depths along its axis are then
//! distances. So the first axis is the main eigenvector of Σ n nᵀ over the near points of both
//! surfaces. An axis along the motion suits an impact, but looks along the surface when bodies
//! slide, spin or rest. Up to two more axes follow if the surfaces also meet on faces that the
//! first axis sees edge-on, as in a corner or a groove. Axes that only one surface faces are spare: they are looked along
//! where the others show a contact that is too deep to be true, as of a sheet's rim in the side of a box.
//!
//! The sign of the axis says on which side of `a` the body `b` lies. The last axis, the near points, the
//! motion, the bounds and the outsides of the surfaces decide it.

use crate::AXIS_HYSTERESIS;
use crate::view::approach::Approach;
use crate::view::main_axis::{outer, top_eigenvector, turned_to_face, zone_covariance};
use crate::view::zone_normals::{LEAST_SHARE, SUPPORTED, ZoneNormals, side_by_places};
use arrayvec::ArrayVec;
use glamx::Vec3;

/// How the axes of a pair's views are chosen.
///
/// The first is for contacts, the second for the question whether surfaces meet. The others exist
/// for comparison: see the chart of contact errors against the angle of motion, and the stability
/// suite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum CameraPolicy {
    /// By the normals of the contact zone; kept from frame to frame while they agree with it within
    /// [`AXIS_HYSTERESIS`]; up to three views.
    #[default]
    ContactZone,
    /// As [`ContactZone`](Self::ContactZone), whose views give all contacts. If they show no
    /// crossing, up to two more views follow, until three axes span all directions. So a query
    /// whether surfaces meet does not miss walls that the first views see edge-on.
    AllDirections,
    /// One view along the motion of `b` relative to `a`, plus the way from `b` to where the bounds meet.
    Motion,
    /// One view by the normals of the contact zone, anew in every frame.
    Covariance,
    /// One view along the axis of the larger surface's frame in which the bounds overlap least.
    SmallestExtent,
    /// One view along the last axis; the first time up to three, by the normals of the contact zone.
    LastNormal,
}

/// Most views of one pair: three axes span all directions.
pub const MAX_VIEWS: usize = 3;

/// A normal within this of the axis is well seen: cos 50°. Depth errors of splats grow as the tangent beyond. Half the
/// angle: no change; twice: a ball in a groove fails with each of 6 seeds instead of none. The last axis also tells the side of
/// one that it is within this of; within 72°, beasts with legs fell through the ground beside rocks.
const WELL_SEEN: f32 = 0.643;

/// Mean of n·v, over the normals that face an axis, below which their signs say nothing about the side. (A ring around
/// a deep contact has normals all around the axis.) Half or twice: no change.
const CONCLUSIVE: f32 = 0.3;

/// Weight of the direction to `b`, if `b` plainly lies or comes from there, beside the normals of a
/// surface. It matters if bodies are deep in each other or their sides are flush, because normals
/// then point all around. It turns the axis of a flat contact by 8° at most. Half: 19 of 636 stability
/// rows fail instead of 3, although normals are 23 % better; twice: normals 18 % worse.
const HINT_WEIGHT: f32 = 0.5;

/// Weight of the last axis beside the normals of a surface. Half or twice: no change.
const MEMORY_WEIGHT: f32 = 0.5;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 6] = [
    ("MAX_VIEWS", MAX_VIEWS as f64),
    ("WELL_SEEN", WELL_SEEN as f64),
    ("CONCLUSIVE", CONCLUSIVE as f64),
    ("HINT_WEIGHT", HINT_WEIGHT as f64),
    ("MEMORY_WEIGHT", MEMORY_WEIGHT as f64),
    ("AXIS_HYSTERESIS", AXIS_HYSTERESIS as f64),
];

/// Fills `axes`, unit vectors from `b` towards `a`; at least one. Empty normals on either side give
/// the axis of the approach. Returns the spare axes.
pub(crate) fn aim(
    policy: CameraPolicy,
    sides: [ZoneNormals; 2],
    approach: &Approach,
    axes: &mut Vec<Vec3>,
) -> ArrayVec<Vec3, MAX_VIEWS> {
    axes.clear();
    let mut spare = ArrayVec::new();
    let single = match policy {
        CameraPolicy::ContactZone | CameraPolicy::AllDirections => None,
        CameraPolicy::Motion => Some(-approach.toward_b()),
        CameraPolicy::Covariance => top_eigenvector(&zone_covariance(&sides, Some)),
        CameraPolicy::SmallestExtent => {
            let axis = [Vec3::X, Vec3::Y, Vec3::Z][approach.half_extents.min_position()];
            Some(approach.larger_from_a.inverse() * axis)
        }
        CameraPolicy::LastNormal => approach.last_axis,
    };
    match single {
        Some(axis) => {
            let axis = axis.try_normalize().unwrap_or(Vec3::Z);
            axes.push(oriented(axis, &sides, approach).0);
        }
        None => spare = aim_at_zone(&sides, approach, policy, axes),
    }
    if axes.is_empty() {
        let fallback = approach.last_axis.unwrap_or(-approach.toward_b());
        axes.push(fallback.try_normalize().unwrap_or(Vec3::Z));
    }
    spare
}

fn aim_at_zone(
    sides: &[ZoneNormals; 2],
    approach: &Approach,
    policy: CameraPolicy,
    axes: &mut Vec<Vec3>,
) -> ArrayVec<Vec3, MAX_VIEWS> {
    let mut spare = ArrayVec::new();
    // Between faces an axis sees no contact well, but more of where surfaces cross.
    let turns = policy != CameraPolicy::AllDirections;
    let mut seen: [Vec3; MAX_VIEWS] = [Vec3::ZERO; MAX_VIEWS];
    let mut views = 0;
    let mut is_spare = false;
    while views < MAX_VIEWS {
        let unseen = |n: &Vec3| seen[..views].iter().all(|v| v.dot(*n).abs() < WELL_SEEN);
        // What the earlier views see of a normal is not counted again.
        let rest = |n: Vec3| seen[..views].iter().fold(n, |n, v| n - n.dot(*v) * *v);
        let left = |n: Vec3| unseen(&n).then(|| rest(n));
        let of_normals = zone_covariance(sides, left);
        let mut covariance = of_normals;
        if views == 0 {
            covariance += HINT_WEIGHT * approach.plainness() * outer(approach.direction());
            covariance += MEMORY_WEIGHT * outer(approach.last_axis.unwrap_or(Vec3::ZERO));
        }
        let Some(mut axis) = top_eigenvector(&covariance) else {
            break;
        };
        if turns {
            axis = turned_to_face(sides, axis, &of_normals, left);
        }
        if views > 0 {
            let supports = |n: &Vec3| axis.dot(*n).abs() >= SUPPORTED;
            if sides.iter().all(|side| side.share(unseen) < LEAST_SHARE) {
                break;
            }
            is_spare |= sides.iter().any(|side| side.share(supports) < LEAST_SHARE);
        } else if let Some(last) = approach.last_axis
            && axis.dot(last).abs() >= AXIS_HYSTERESIS.cos()
        {
            axis = last;
        }
        let (mut axis, conclusive) = oriented(axis, sides, approach);
        if let Some(last) = approach.last_axis.filter(|_| views == 0 && !conclusive) {
            // A body half way through a rough sheet seems to be beside its rim.
            axis = oriented(last, sides, approach).0;
        }
        if views > 0 && !conclusive {
            // A guess at the side would turn a gap into a penetration.
            break;
        }
        seen[views] = axis;
        match is_spare {
            true => spare.push(axis),
            false => axes.push(axis),
        }
        views += 1;
    }
    spare
}

/// The axis or its opposite, such that it points from `b` towards `a`; and whether anything told.
///
/// A body keeps its side of what the last axis saw well, unless the near points plainly tell another. This holds it on a sheet
/// without an inside. Of a floor, an axis that looked at the wall beside it remembers nothing. Next, the near points decide;
/// then the place where the body plainly lies. The outside of one surface alone only decides about deep bodies: it may be
/// thin and passed already. If nothing tells, `b` comes from where it moves away from.
fn oriented(axis: Vec3, sides: &[ZoneNormals; 2], approach: &Approach) -> (Vec3, bool) {
    let conclusive = |sign: f32| (sign.abs() >= CONCLUSIVE).then_some(sign > 0.0);
    let by_places = side_by_places(sides, axis);
    let remembered = approach.last_axis.map_or(0.0, |last| axis.dot(last));
    let by_memory = (remembered.abs() >= WELL_SEEN)
        .then_some(remembered > 0.0)
        .filter(|&remembered| by_places != Some(!remembered));
    let [of_a, of_b] = sides.each_ref().map(|side| side.mean_along(axis));
    let larger = sides[usize::from(!approach.body.is_b)];
    let sheet = (!larger.oriented).then(|| larger.faces_at(axis));
    let by_position = -approach.leaning(axis, sheet);
    let agrees = by_memory
        .or(by_places)
        .or_else(|| approach.side_by_position(axis, sheet))
        .or_else(|| conclusive(of_b - of_a))
        .or_else(|| conclusive(by_position));
    let moves = approach.motion.dot(axis);
    let guess = if moves != 0.0 { moves } else { by_position };
    if agrees.unwrap_or(guess >= 0.0) {
        (axis, agrees.is_some())
    } else {
        (-axis, agrees.is_some())
    }
}

/// Whether `axis` looks at `a`, and at `b`, from behind: their outward normals say so.
pub(crate) fn seen_from_behind(axis: Vec3, [a, b]: &[ZoneNormals; 2]) -> [bool; 2] {
    [
        a.mean_along(axis) >= CONCLUSIVE,
        b.mean_along(axis) <= -CONCLUSIVE,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::view::approach::Body;
    use glamx::{Pose3, Quat};

    /// `b` lies towards `toward_b`, near or far.
    fn lying(toward_b: Vec3) -> Approach {
        Approach {
            larger_from_a: Quat::IDENTITY,
            half_extents: Vec3::ONE,
            lies: toward_b,
            motion: Vec3::ZERO,
            body: Body {
                middle: toward_b,
                half_extents: Vec3::splat(0.5),
                from_a: Quat::IDENTITY,
                is_b: true,
            },
            last_axis: None,
        }
    }

    /// Near points with these normals, all of them at the origin.
    fn zone(normals: &[Vec3], oriented: bool) -> ZoneNormals<'_> {
        ZoneNormals {
            normals,
            points: &[Vec3::ZERO; 100],
            oriented,
        }
    }

    fn axes_of(policy: CameraPolicy, sides: [ZoneNormals; 2], approach: &Approach) -> Vec<Vec3> {
        let mut axes = vec![];
        aim(policy, sides, approach, &mut axes);
        axes
    }

    fn zone_axes(sides: [ZoneNormals; 2], approach: &Approach) -> Vec<Vec3> {
        axes_of(CameraPolicy::ContactZone, sides, approach)
    }

    #[test]
    fn facing_planes_give_one_axis_from_b_to_a() {
        let (up, down) = (vec![Vec3::Y; 50], vec![-Vec3::Y; 30]);
        let oriented = [zone(&up, true), zone(&down, true)];
        // Two outsides that face each other decide; one alone only where `b` is deep in it.
        assert_eq!(zone_axes(oriented, &lying(-2.0 * Vec3::Y)), [-Vec3::Y]);
        let half = [zone(&up, true), zone(&down, false)];
        assert_eq!(zone_axes(half, &lying(-0.5 * Vec3::Y)), [-Vec3::Y]);
        assert_eq!(zone_axes(half, &lying(-2.0 * Vec3::Y)), [Vec3::Y]);
        let bare = [zone(&up, false), zone(&down, false)];
        assert_eq!(zone_axes(bare, &lying(-0.5 * Vec3::Y)), [Vec3::Y]);
    }

    #[test]
    fn a_corner_gives_two_axes_and_a_box_on_a_floor_one() {
        let corner = [vec![Vec3::Y; 50], vec![Vec3::X; 30]].concat();
        let edges = [vec![-Vec3::Y; 20], vec![-Vec3::X; 20]].concat();
        let edges = zone(&edges, true);
        let above = lying(0.5 * Vec3::Y);
        assert_eq!(
            zone_axes([zone(&corner, true), edges], &above),
            [-Vec3::Y, -Vec3::X]
        );
        let floor = vec![Vec3::Y; 50];
        let mut axes = vec![];
        let policy = CameraPolicy::ContactZone;
        let spare = aim(policy, [zone(&floor, true), edges], &above, &mut axes);
        assert_eq!(axes, [-Vec3::Y]);
        // Only the box has sides.
        assert!(spare.len() == 1 && spare[0].x.abs() > 0.99, "{spare:?}");
    }

    /// A ball's normals around a flat contact are no second face.
    #[test]
    fn a_ball_on_a_floor_is_seen_once() {
        let around = |k: u32| Vec3::new((k as f32).cos(), -0.75, (k as f32).sin()).normalize();
        let (up, ball) = (vec![Vec3::Y; 50], (0..50).map(around).collect::<Vec<_>>());
        let sides = [zone(&up, false), zone(&ball, true)];
        assert_eq!(zone_axes(sides, &lying(2.0 * Vec3::Y)).len(), 1);
    }

    /// The axis stays the same within the hysteresis, and its side beyond it, even if `b` seems to
    /// lie on the other one.
    #[test]
    fn the_last_axis_and_side_are_kept() {
        let tilted = |angle: f32| vec![Vec3::new(angle.sin(), angle.cos(), 0.0); 10];
        for toward_b in [Vec3::Y, -2.0 * Vec3::Y] {
            let approach = Approach {
                last_axis: Some(-Vec3::Y),
                ..lying(toward_b)
            };
            for (angle, kept) in [(0.1, true), (0.3, false)] {
                let normals = tilted(angle);
                let side = zone(&normals, false);
                let axes = zone_axes([side, side], &approach);
                assert_eq!(axes[0] == -Vec3::Y, kept, "{angle}");
                assert!(axes[0].y < 0.0);
            }
        }
    }

    /// What each policy looks along: flat surfaces tilted by 0.1, a motion along x, a last axis.
    #[test]
    fn policies() {
        let tilt = Vec3::new(0.1f32.sin(), 0.1f32.cos(), 0.0);
        let (up, down) = (vec![tilt; 10], vec![-tilt; 10]);
        let sides = [zone(&up, true), zone(&down, true)];
        let unit = Aabb {
            min: -Vec3::ONE,
            max: Vec3::ONE,
        };
        let above = Pose3::translation(0.3, 1.9, 0.0);
        let last = Vec3::new(0.0, -0.6, 0.8);
        let approach = |motion| Approach::new(&unit, &unit, &above, motion, Some(last));
        let axis = |policy| axes_of(policy, sides, &approach(9.0 * Vec3::X))[0];
        assert_eq!(axis(CameraPolicy::SmallestExtent), -Vec3::Y);
        assert!(axis(CameraPolicy::Covariance).distance(-tilt) < 1e-5);
        assert_eq!(axis(CameraPolicy::LastNormal), last);
        let against = axis(CameraPolicy::Motion);
        assert!(against.x.abs() > 0.98, "{against}");
        let still = axes_of(CameraPolicy::Motion, sides, &approach(Vec3::ZERO))[0];
        assert!(still.y < -0.95, "{still}");
    }

    /// A last axis counts by its direction; without one it counts for nothing.
    #[test]
    fn a_last_axis_of_any_length_gives_a_unit_axis() {
        let normals = vec![Vec3::Y; 10];
        let sides = [zone(&normals, false), zone(&normals, false)];
        let unit = Aabb {
            min: -Vec3::ONE,
            max: Vec3::ONE,
        };
        let last = Vec3::new(0.0, -0.99, 0.14).normalize();
        for (length, kept) in [(0.0, false), (0.5, true), (1.0, true), (100.0, true)] {
            let above = Pose3::translation(0.0, 1.9, 0.0);
            let approach = Approach::new(&unit, &unit, &above, Vec3::ZERO, Some(length * last));
            let axis = zone_axes(sides, &approach)[0];
            assert!(axis.is_normalized(), "{length}: {axis}");
            assert_eq!(axis.distance(last) < 1e-6, kept, "{length}: {axis}");
        }
    }

    /// A motion towards `a` puts `b` on the side that it came from, however deep it is.
    #[test]
    fn motion_tells_where_b_came_from() {
        let normals = vec![Vec3::Y; 10];
        let sides = [zone(&normals, false), zone(&normals, false)];
        let sheet = Aabb {
            min: Vec3::new(-9.0, 0.0, -9.0),
            max: Vec3::new(9.0, 0.0, 9.0),
        };
        let body = Aabb {
            min: -Vec3::ONE,
            max: Vec3::ONE,
        };
        let half_through = Pose3::translation(0.0, -0.2, 0.0);
        for (motion, axis) in [
            (-Vec3::Y, -Vec3::Y),
            (Vec3::Y, Vec3::Y),
            (Vec3::ZERO, Vec3::Y),
        ] {
            let approach = Approach::new(&sheet, &body, &half_through, motion, None);
            assert_eq!(zone_axes(sides, &approach), [axis], "{motion}");
        }
    }

    /// A body of half a metre at a bare sheet through the origin.
    fn at_sheet(toward_b: Vec3, motion: Vec3, last_axis: Option<Vec3>) -> Approach {
        Approach {
            motion,
            last_axis,
            ..lying(toward_b)
        }
    }

    /// What was remembered gives way where the near points are plainly apart in the other order, and not where they
    /// are among each other.
    #[test]
    fn a_memory_that_cannot_be_is_corrected() {
        let normals = [Vec3::Y; 10];
        let axis = |least: f32| {
            let points: Vec<Vec3> = (0..10)
                .map(|k| (least + 0.1 * k as f32) * Vec3::Y)
                .collect();
            let above = ZoneNormals {
                points: &points,
                ..zone(&normals, false)
            };
            let approach = at_sheet(Vec3::ZERO, Vec3::ZERO, Some(Vec3::Y));
            zone_axes([zone(&normals, false), above], &approach)[0]
        };
        assert_eq!(axis(0.0), -Vec3::Y);
        assert_eq!(axis(-0.3), Vec3::Y);
    }

    /// An axis that looked along a floor, at a wall beside it, does not tell on which side of the floor a body is.
    #[test]
    fn a_wall_that_was_looked_at_tells_nothing_of_the_floor() {
        let floor = [Vec3::Y; 10];
        let sides = [zone(&floor, false), zone(&floor, false)];
        for tilt in [-0.4f32, -0.2, 0.2, 0.4] {
            let last = Vec3::new((1.0 - tilt * tilt).sqrt(), tilt, 0.0);
            let approach = at_sheet(0.2 * Vec3::Y, Vec3::ZERO, Some(last));
            // The last axis draws the new one a little towards itself.
            assert!(zone_axes(sides, &approach)[0].y < -0.9, "{tilt}");
        }
    }

    /// Where a body's middle tells nothing, as of a large one that touches uneven ground beside it, the motion does.
    #[test]
    fn what_falls_comes_from_above() {
        let floor = [Vec3::Y; 10];
        let sides = [zone(&floor, false), zone(&floor, false)];
        for height in [-0.15, -0.1, 0.0, 0.1] {
            let approach = at_sheet(height * Vec3::Y, -0.05 * Vec3::Y, None);
            assert_eq!(zone_axes(sides, &approach), [-Vec3::Y], "{height}");
        }
    }

    /// A motion along a slope does not tell from which side of it a body came.
    #[test]
    fn a_fast_body_is_on_the_side_of_a_slope_where_it_lies() {
        let normals = vec![Vec3::Y; 10];
        let sides = [zone(&normals, false), zone(&normals, false)];
        // 3 m along the slope, and away from it by more than the body is wide.
        let along = Vec3::new(3.0, 1.2, 0.0);
        let approach = at_sheet(0.4 * Vec3::Y, along, None);
        assert!(zone_axes(sides, &approach)[0].y < -0.9);
        let across = Vec3::new(1.2, 3.0, 0.0);
        let approach = at_sheet(0.4 * Vec3::Y, across, None);
        assert!(zone_axes(sides, &approach)[0].y > 0.9);
    }

    /// A body less than half through lies on the side of its middle, whatever the bounds seem to tell.
    #[test]
    fn a_body_deep_in_a_sheet_lies_on_the_side_of_its_middle() {
        let normals = vec![Vec3::Y; 10];
        let sides = [zone(&normals, false), zone(&normals, false)];
        for (y, axis) in [(0.1_f32, -Vec3::Y), (-0.1, Vec3::Y)] {
            let approach = Approach {
                lies: Vec3::new(0.1, -0.3 * y.signum(), 0.0),
                ..at_sheet(y * Vec3::Y, Vec3::ZERO, None)
            };
            assert!(zone_axes(sides, &approach)[0].dot(axis) > 0.9, "{y}");
        }
    }

    /// Half way through a rough sheet the normals of a ball's rim make an axis along the sheet, to
    /// which nothing gives a sign: the last one is better.
    #[test]
    fn an_axis_without_a_sign_gives_way_to_the_last_one() {
        let normals = [vec![Vec3::X; 10], vec![Vec3::Y; 2]].concat();
        let sides = [zone(&normals, false), zone(&normals, false)];
        let last = -Vec3::Y;
        let approach = at_sheet(Vec3::ZERO, Vec3::ZERO, Some(last));
        assert_eq!(zone_axes(sides, &approach)[0], last);
    }

    #[test]
    fn behind_is_where_outward_normals_point_away() {
        let up = vec![Vec3::Y; 10];
        let behind = |axis| seen_from_behind(axis, &[zone(&up, true), zone(&up, true)]);
        assert_eq!(behind(-Vec3::Y), [false, true]);
        assert_eq!(behind(Vec3::Y), [true, false]);
        let bare = [zone(&up, false), zone(&up, false)];
        assert_eq!(seen_from_behind(Vec3::Y, &bare), [false, false]);
    }
}
