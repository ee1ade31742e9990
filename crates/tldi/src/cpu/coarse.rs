//! The first look at two clouds: with large pixels and a part of the points, which settles what is deep.
//!
//! What is deep by several large pixels needs no small ones to tell how deep it is. That surfaces cross
//! large pixels do not prove: the two sides of a limb merge in them. So fine images are taken, too, but only
//! in a few small windows, where the large pixels show a crossing most plainly. What is shallow, or what no window
//! proves, is left to the fine look at all of the contact zone.

use super::cells::CellImaging;
use super::compare::{self, Crossings, Seen};
use super::pair::Scratch;
use super::side::CloudView;
use crate::camera_policy::{MAX_VIEWS, aim};
use crate::plan::{PairPlan, ring, stride};
use crate::{
    Aabb, BLOCK, PairQuery, PairResult, Params, Surface, Tldi, Variant, View, VirtualCamera,
};
use glamx::{Pose3, Vec3};

/// Edges of a large pixel, in pixels: smaller ones cost as much as the fine look; larger ones merge limbs.
const LARGE: [f32; 4] = [16.0, 8.0, 4.0, 2.0];

/// Large pixels that contacts are deep at the least, where a first look settles them: a layer's depth errs by a tenth
/// of a pixel, and this is what a solver is told within 5 %.
const DEEP: f32 = 2.0;

/// Large pixels that the bounds overlap by at least, where a first look is worth while: bodies that are deep by
/// [`DEEP`] have as much again behind it.
const WORTHWHILE: f32 = 4.0;

/// Large pixels through the overlap of the bounds from which on larger ones are taken.
const THROUGH: f32 = 8.0;

/// Points that are taken per large pixel of a surface seen face on.
const POINTS_PER_PIXEL: f32 = 4.0;

/// Fewer points of a side are not worth a first look.
const LEAST_POINTS: usize = 256;

/// Edge of a window, in pixels.
const WINDOW: f32 = 32.0;

/// Windows that are looked at; a crossing that is none shows in all of them.
const MOST_WINDOWS: usize = 3;

/// A cube of a view's frame in which surfaces swap their order.
#[derive(Clone, Copy)]
pub(super) struct Window {
    view: usize,
    /// Place along columns, rows and depth, in edges of a window.
    cube: [i32; 3],
    /// Pairs of neighbouring large pixels between which they do.
    swaps: u32,
}

/// The query of the first look: with large pixels; `None` where it would settle nothing.
fn coarse_query<'a>(query: &PairQuery<'a>) -> Option<PairQuery<'a>> {
    let (Surface::Cloud(a), Surface::Cloud(b)) = (query.a, query.b) else {
        return None;
    };
    let is_aimed = matches!(query.view, View::Aim { .. });
    if !is_aimed || query.params.variant() == Variant::Paper {
        return None;
    }
    let overlap = a
        .bounds()
        .intersection(b.bounds().transformed(&query.a_from_b));
    if overlap.is_empty() {
        return None;
    }
    let through = overlap.extents().min_element();
    let [.., smallest] = LARGE.map(|large| large * query.params.pixel_size);
    if through < WORTHWHILE * smallest {
        return None;
    }
    let pixels = LARGE.map(|large| large * query.params.pixel_size);
    let pixel = pixels.into_iter().find(|pixel| through >= THROUGH * pixel);
    let pixel = pixel.unwrap_or(smallest);
    let params = Params {
        pixel_size: pixel,
        thickness: 2.0 * pixel,
        ..query.params
    };
    Some(PairQuery { params, ..*query })
}

/// Every how many points of a cloud are enough for the first look.
fn coarse_stride(mean_radius: f32, pixel_size: f32) -> usize {
    let per_pixel = 0.94 * (pixel_size / mean_radius).powi(2);
    ((per_pixel / POINTS_PER_PIXEL) as usize).clamp(1, BLOCK)
}

impl Scratch {
    /// Whether a first look settles the pair; `result` is filled then, and else empty.
    pub(super) fn settle(
        &mut self,
        query: &PairQuery,
        plan: &PairPlan,
        result: &mut PairResult,
    ) -> bool {
        let is_settled = coarse_query(query)
            .is_some_and(|coarse| self.settle_with(&coarse, query, plan, result).is_some());
        if !is_settled {
            result.clear();
        }
        is_settled
    }

    fn settle_with(
        &mut self,
        coarse: &PairQuery,
        query: &PairQuery,
        plan: &PairPlan,
        result: &mut PairResult,
    ) -> Option<()> {
        let View::Aim { policy, .. } = query.view else {
            return None;
        };
        let pixel = coarse.params.pixel_size;
        let strides = [query.a, query.b].map(|s| coarse_stride(s.mean_radius(), pixel));
        let coarse_plan = PairPlan {
            zone_reach: plan.zone_reach * (strides[0].max(strides[1]) as f32).sqrt(),
            ..plan.clone()
        };
        let is_enough = |scratch: &Self| {
            [&scratch.a, &scratch.b]
                .iter()
                .all(|side| side.points.len() >= LEAST_POINTS)
        };
        let is_near =
            self.cull(coarse, plan, strides) && is_enough(self) && self.zone(coarse, &coarse_plan);
        if !is_near {
            return None;
        }
        let approach = self.approach(coarse, plan);
        aim(
            policy,
            self.zone_normals(coarse),
            &approach,
            &mut result.axes,
        );
        let axes: arrayvec::ArrayVec<Vec3, MAX_VIEWS> = result.axes.iter().copied().collect();
        let edge = (WINDOW * query.params.pixel_size / pixel) as i32;
        self.windows.clear();
        for view in 0..axes.len() {
            let camera = VirtualCamera::along(axes[view], pixel);
            self.look_at_cells(coarse, &camera)?;
            let seen = self.seen(coarse, plan, &camera, &axes, view);
            let mut counted = Crossings::default();
            let [a, b] = [&self.a.image, &self.b.image];
            compare::compare(a, b, &seen, &coarse.params, &mut counted, result);
            find_windows([a, b], &seen, &coarse.params, edge, &mut self.windows);
        }
        let deep = -DEEP * pixel;
        if !result.contacts.iter().any(|c| c.gap < deep) {
            return None;
        }
        rank(&mut self.windows);
        let mut crossings = Crossings::default();
        for k in 0..self.windows.len().min(MOST_WINDOWS) {
            let window = self.windows[k];
            self.look_through(query, plan, &axes, &window, &mut crossings);
            if crossings.are_enough() {
                break;
            }
        }
        if !crossings.are_enough() {
            return None;
        }
        result.collides = true;
        self.patches.reduce_coarse(result, coarse);
        result.gap.filter(|gap| *gap < deep).map(|_| ())
    }

    /// Builds both images from the sums of what was culled.
    fn look_at_cells(&mut self, query: &PairQuery, camera: &VirtualCamera) -> Option<()> {
        let (Surface::Cloud(a), Surface::Cloud(b)) = (query.a, query.b) else {
            return None;
        };
        let view_of = |cloud, frame_from_cloud| CloudView {
            cloud,
            frame_from_cloud,
            camera,
            params: &query.params,
            sharpens: false,
        };
        let (a, b) = (view_of(a, &Pose3::IDENTITY), view_of(b, &query.a_from_b));
        let (side_a, side_b) = (&mut self.a, &mut self.b);
        let (seen_a, seen_b) = rayon::join(|| side_a.project(&a), || side_b.project(&b));
        let (seen_a, seen_b) = (seen_a?, seen_b?);
        let imaging = CellImaging {
            camera,
            pixel_size: query.params.pixel_size,
            rect: seen_a.rect.intersection(&seen_b.rect)?,
            near: seen_a.near.min(seen_b.near),
        };
        rayon::join(
            || side_a.image_of_cells(&a, &imaging),
            || side_b.image_of_cells(&b, &imaging),
        );
        Some(())
    }

    /// Adds what the fine images show of crossings in a window.
    fn look_through(
        &mut self,
        query: &PairQuery,
        plan: &PairPlan,
        axes: &[Vec3],
        window: &Window,
        crossings: &mut Crossings,
    ) {
        let (Surface::Cloud(a), Surface::Cloud(b)) = (query.a, query.b) else {
            return;
        };
        let pixel = query.params.pixel_size;
        let mut camera = VirtualCamera::along(axes[window.view], pixel);
        let edge = WINDOW * pixel;
        // A whole number of pixels: the grid is that of the look at all of the contact zone.
        let first = edge * Vec3::from_array(window.cube.map(|c| c as f32));
        camera.view_from_frame.translation = -first.with_z(0.0);
        camera.size = Some([WINDOW as u32; 2]);
        let margin = ring(&query.a, &query.params).max(ring(&query.b, &query.params));
        let cube = Aabb {
            min: Vec3::ZERO.with_z(first.z),
            max: Vec3::splat(edge).with_z(first.z + edge),
        };
        let mut plan = plan.clone();
        for side in &mut plan.sides {
            side.region.other_from_frame = camera.view_from_frame;
            side.region.other_bounds = cube.loosened(margin);
        }
        let strides = [query.a, query.b].map(|s| stride(s.mean_radius(), pixel));
        if !self.cull(query, &plan, strides) {
            return;
        }
        let view_of = |cloud, frame_from_cloud| CloudView {
            cloud,
            frame_from_cloud,
            camera: &camera,
            params: &query.params,
            sharpens: true,
        };
        let (a, b) = (view_of(a, &Pose3::IDENTITY), view_of(b, &query.a_from_b));
        if self.look_at_clouds(&a, &b, plan.column_reach).is_none() {
            return;
        }
        let seen = Seen {
            axes,
            view: window.view,
            ..Seen::default()
        };
        let mut nothing = PairResult::default();
        compare::compare(
            &self.a.image,
            &self.b.image,
            &seen,
            &query.params,
            crossings,
            &mut nothing,
        );
    }
}

/// Appends the windows, cubes of `edge` large pixels, in which two images show surfaces that swap their order.
fn find_windows(
    [a, b]: [&Tldi; 2],
    seen: &Seen,
    params: &Params,
    edge: i32,
    windows: &mut Vec<Window>,
) {
    let others = seen.others(&a.camera);
    let [width, height] = a.size;
    let at = |k: u32| [a, b].map(|image| image.layers_of(k as usize));
    for j in 0..height {
        for i in 0..width {
            let k = j * width + i;
            let nexts = [
                (i + 1 < width).then_some(k + 1),
                (j + 1 < height).then_some(k + width),
            ];
            for next in nexts.into_iter().flatten() {
                if let Some(depth) = compare::swap_depth(at(k), at(next), &others, params) {
                    let depth = (depth / params.pixel_size).floor() as i32;
                    let place = [a.origin[0] + i as i32, a.origin[1] + j as i32, depth];
                    windows.push(Window {
                        view: seen.view,
                        cube: place.map(|c| c.div_euclid(edge)),
                        swaps: 1,
                    });
                }
            }
        }
    }
}

/// Adds up the swaps in each window and sorts the windows, the one with most first.
fn rank(windows: &mut Vec<Window>) {
    windows.sort_unstable_by_key(|window| (window.view, window.cube));
    windows.dedup_by(|next, first| {
        let is_same = (next.view, next.cube) == (first.view, first.cube);
        first.swaps += u32::from(is_same);
        is_same
    });
    windows.sort_unstable_by_key(|w| (std::cmp::Reverse(w.swaps), w.view, w.cube));
}
