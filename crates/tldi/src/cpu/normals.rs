//! Stage `normals`: a unit normal for each culled point.
//!
//! Normals of the cloud are rotated; where it has none (all-new points), they are the directions
//! of least covariance of the culled neighbours within [`SUPPORT`] radii. Only what survived the
//! cull is computed.

use super::cull::Survivors;
use crate::PointCloud;
use crate::normals::{covariance, least_variance_axis};
use glamx::{Pose3, Vec3};

/// Radius of the neighbourhood whose covariance gives the normal, in mean radii of
/// the culled points. With 0.65 × the 7th neighbour's distance it holds about 25 neighbours on a surface.
pub(super) const SUPPORT: f32 = 3.0;

/// Memory of the stage, kept from call to call.
#[derive(Default)]
pub(crate) struct NormalScratch {
    /// Grid cell and index of each culled point, sorted.
    cells: Vec<(u64, u32)>,
}

/// Fills `points.normal`.
pub(crate) fn normals(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    scratch: &mut NormalScratch,
    points: &mut Survivors,
) {
    let Some(given) = cloud.normals() else {
        let spacing = points.radius.iter().sum::<f32>() / points.len().max(1) as f32;
        estimate(SUPPORT * spacing, scratch, points);
        return;
    };
    points.normal.clear();
    points.normal.extend(
        points
            .index
            .iter()
            .map(|&i| frame_from_cloud.rotation * given[i as usize]),
    );
}

/// Bits per axis of a cell's key.
const KEY_BITS: u32 = 21;

fn key(c: [u64; 3]) -> u64 {
    c[2] << (2 * KEY_BITS) | c[1] << KEY_BITS | c[0]
}

fn estimate(support: f32, scratch: &mut NormalScratch, points: &mut Survivors) {
    let n = points.len();
    points.normal.clear();
    let min = (0..n).fold(Vec3::INFINITY, |m, i| m.min(points.point(i)));
    let limit = (1u64 << KEY_BITS) - 2;
    let cell_of = |p: Vec3| {
        let c = (p - min) / support;
        // One empty cell below, so that neighbours of the first cell have keys too.
        [c.x, c.y, c.z].map(|c| (c as u64 + 1).min(limit))
    };
    scratch.cells.clear();
    scratch
        .cells
        .extend((0..n).map(|i| (key(cell_of(points.point(i))), i as u32)));
    scratch.cells.sort_unstable();
    let cells = &scratch.cells;
    for i in 0..n {
        let p = points.point(i);
        let [cx, cy, cz] = cell_of(p);
        // Three cells in a row along x have consecutive keys.
        let rows = (cz - 1..=cz + 1).flat_map(|z| (cy - 1..=cy + 1).map(move |y| (y, z)));
        let offsets = rows.flat_map(|(y, z)| {
            let (first, last) = (key([cx - 1, y, z]), key([cx + 1, y, z]));
            let start = cells.partition_point(|c| c.0 < first);
            cells[start..].iter().take_while(move |c| c.0 <= last)
        });
        let offsets = offsets
            .map(|&(_, j)| points.point(j as usize) - p)
            .filter(|d| d.length_squared() <= support * support)
            .map(|d| d.as_dvec3());
        let normal = least_variance_axis(covariance(offsets)).as_vec3();
        points.normal.push(normal);
    }
}
