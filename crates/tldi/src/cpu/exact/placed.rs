//! An exact surface where a pair has it, and how far it is from cells and columns.

use crate::cpu::columns::rect_of;
use crate::cpu::fold::SpaceFold;
use crate::cpu::rect::Rect;
use crate::{RaySurface, VirtualCamera};
use glamx::{Pose3, Vec3};

/// A march ends where the surface is beyond its reach by less than this share of it. Without this, it would take ever
/// smaller steps. Half or twice: no test of queries fails.
const LEAST_FREE: f32 = 0.05;

/// Steps of a march along a column, after which a surface counts as near. Spheres that grow past a surface leave it in
/// about ten; a march along a plane that is hardly farther than the reach would take as many as the column is long.
/// Half as many draw a few columns more in which nothing meets; twice as many cost as much again.
pub(crate) const MOST_STEPS: usize = 64;

/// How far the cells of a grid are from the surface; kept from call to call.
#[derive(Default)]
pub(crate) struct CellDistances {
    /// The least distance that a point in each cell can have, metres. It is not a number until it is asked for.
    pub(crate) least: Vec<f32>,
    pub(crate) fold: SpaceFold,
    /// Middles of the cells that were asked for, before gaps were folded. None where nothing is folded.
    pub(crate) middles: Vec<Vec3>,
}

/// An exact surface where a pair has it.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'a> {
    pub(crate) surface: &'a dyn RaySurface,
    pub(crate) frame_from_surface: &'a Pose3,
}

impl Placed<'_> {
    /// Signed distance, and the normal at the nearest point, in the frame of the pair.
    pub(crate) fn project(&self, point: Vec3) -> (f32, Vec3) {
        let own = self.frame_from_surface.inverse_transform_point(point);
        let (distance, normal) = self.surface.project(own);
        (distance, self.frame_from_surface.rotation * normal)
    }

    /// The pixels that it covers and `border` more on all sides; `None` where its bounds are infinite.
    pub(crate) fn covers(&self, camera: &VirtualCamera, border: i32) -> Option<Rect> {
        let view_from_surface = camera.view_from_frame * *self.frame_from_surface;
        let bounds = self.surface.bounds().transformed(&view_from_surface);
        let corners = [bounds.min, bounds.max];
        if !corners.iter().all(|corner| corner.is_finite()) {
            return None;
        }
        let [first, last] = corners.map(|corner| camera.pixel_from_view(corner));
        Some(rect_of(first, last)?.grown(border))
    }

    /// Whether it comes within `reach` metres of a column of pixels: of one through `[u, v]`, between two depths.
    /// Marches along it, each time as far as nothing can be near; where that does not end, it may come so near.
    pub(crate) fn meets(
        &self,
        camera: &VirtualCamera,
        [u, v]: [f32; 2],
        [mut depth, end]: [f32; 2],
        reach: f32,
    ) -> bool {
        for _ in 0..MOST_STEPS {
            if depth > end {
                return false;
            }
            let (distance, _) = self.project(camera.point_at(u, v, depth));
            let free = distance - reach;
            // A depth so great that it does not grow is no reason to march for ever.
            if free.is_nan() || free <= LEAST_FREE * reach || depth + free == depth {
                return true;
            }
            depth += free;
        }
        true
    }
}
