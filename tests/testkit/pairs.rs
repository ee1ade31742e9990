//! One pair at a time.

use crate::compare_batch;
use tldi::glamx::{Pose3, Vec3};
use tldi::{PairQuery, PairResult, Params, PointCloud, Surface, View};

/// A query that aims its own camera, the second surface lying where its pose puts it.
pub fn aimed<'a>(a: Surface<'a>, b: Surface<'a>, a_from_b: Pose3, params: Params) -> PairQuery<'a> {
    PairQuery {
        a,
        b,
        a_from_b,
        view: View::aimed(),
        params,
    }
}

/// An [`aimed`] query about two clouds of mean radius `radius`, metres, with the default parameters.
pub fn aimed_clouds<'a>(
    a: &'a PointCloud<'a>,
    b: &'a PointCloud<'a>,
    a_from_b: Pose3,
    radius: f32,
) -> PairQuery<'a> {
    let [a, b] = [a, b].map(Surface::Cloud);
    aimed(a, b, a_from_b, Params::for_radius(radius))
}

/// Compares two surfaces with [`aimed`] cameras.
pub fn compare(a: Surface, b: Surface, a_from_b: Pose3, params: Params) -> PairResult {
    compare_batch(&[aimed(a, b, a_from_b, params)]).remove(0)
}

/// Compares two clouds of mean radius `radius`, metres, with the default parameters.
pub fn compare_clouds(
    a: &PointCloud<'_>,
    b: &PointCloud<'_>,
    a_from_b: Pose3,
    radius: f32,
) -> PairResult {
    compare_batch(&[aimed_clouds(a, b, a_from_b, radius)]).remove(0)
}

/// Gap and place (midway between the surfaces) of the deepest of all patch points, metres.
pub fn deepest_point(result: &PairResult) -> Option<(f32, Vec3)> {
    result
        .patches
        .iter()
        .flat_map(|patch| &patch.points)
        .min_by(|p, q| p.gap.total_cmp(&q.gap))
        .map(|p| (p.gap, 0.5 * (p.point_a + p.point_b)))
}

/// Normal (unit, from the first surface towards the second, in the frame of the first) of the deepest
/// patch, and the depth of its deepest point, metres, negative where there is a gap.
pub fn deepest_contact(result: &PairResult) -> Option<(Vec3, f32)> {
    // Patches are ordered by depth.
    let patch = result.patches.first()?;
    let depths = patch.points.iter().map(|p| -p.gap);
    Some((patch.normal, depths.fold(f32::NEG_INFINITY, f32::max)))
}
