//! A window of the first look: a small part of a view, to be drawn with small pixels.

use crate::pair::plan::{PairPlan, ring};
use crate::{Aabb, PairQuery, VirtualCamera};
use glamx::Vec3;

/// Edge of a window, in pixels. Windows of 32 take twice the time and prove the same.
const WINDOW: f32 = 16.0;

/// A cube of a view's frame in which surfaces swap their order.
#[derive(Clone, Copy)]
pub(crate) struct Window {
    pub(crate) view: usize,
    /// Place along columns, rows and depth, in edges of a window.
    pub(crate) cube: [i32; 3],
    /// Pairs of neighbouring large pixels between which they do.
    pub(crate) swaps: u32,
}

impl Window {
    /// Edge, metres.
    pub(crate) fn edge(query: &PairQuery) -> f32 {
        WINDOW * query.params.pixel_size
    }

    /// The view of it, with the pixel grid of the look at all of the contact zone: it starts at a whole number of pixels.
    pub(crate) fn camera(&self, query: &PairQuery, axes: &[Vec3]) -> VirtualCamera {
        let mut camera = VirtualCamera::along(axes[self.view], query.params.pixel_size);
        let [x, y, _] = self.cube.map(|c| c as f32);
        camera.view_from_frame.translation = -Self::edge(query) * Vec3::new(x, y, 0.0);
        camera.size = Some([WINDOW as u32; 2]);
        camera
    }

    /// The plan of the pair for what `camera` sees of it.
    pub(crate) fn plan(
        &self,
        query: &PairQuery,
        plan: &PairPlan,
        camera: &VirtualCamera,
    ) -> PairPlan {
        let edge = Self::edge(query);
        let near = edge * self.cube[2] as f32;
        let cube = Aabb {
            min: Vec3::new(0.0, 0.0, near),
            max: Vec3::new(edge, edge, near + edge),
        };
        let [a, b] = [&query.a, &query.b].map(|surface| ring(surface, &query.params).widest());
        let mut plan = plan.clone();
        for side in &mut plan.sides {
            side.region.other_from_frame = camera.view_from_frame;
            side.region.other_bounds = cube.loosened(a.max(b));
        }
        plan
    }
}
