//! The first look at two clouds: large pixels and a part of the points settle deep contacts.
//!
//! A contact that is several large pixels deep needs no small ones to measure its depth. But large
//! pixels do not prove a crossing, because the two sides of a limb merge in them. So a few small
//! windows are drawn with small pixels, where the large ones show a crossing most plainly. Contacts
//! that are shallow, or that no window proves, go to the full look with small pixels.

use crate::cpu::compare::{self, Seen};
use crate::cpu::crossings::{Crossings, swap_depth};
use crate::cpu::first_look::cells::CellImaging;
use crate::cpu::first_look::window::Window;
use crate::cpu::scratch::{Look, MeetingRegion, Scratch};
use crate::cpu::side::{Scope, Side};
use crate::pair::pixels::largest_pixel;
use crate::pair::plan::PairPlan;
use crate::pair::sampling::{stride, stride_for};
use crate::stage::stage;
use crate::view::camera_policy::MAX_VIEWS;
use crate::{
    CameraPolicy, PairQuery, PairResult, Params, PointCloud, Surface, Tldi, Variant, View,
    VirtualCamera,
};
use arrayvec::ArrayVec;
use glamx::Vec3;

/// Edges of a large pixel, in pixels or in mean radii, whichever is larger. Smaller ones cost as
/// much as the look with small pixels. Larger ones merge limbs.
const LARGE: [f32; 4] = [16.0, 8.0, 4.0, 2.0];

/// Least depth of contacts that a first look settles, in large pixels. With half of it, shallow
/// contacts of spheres were up to 7 r too deep. Twice as much leaves contacts of 4 to 8 r to small
/// pixels.
const DEEP: f32 = 2.0;

/// Least overlap of the bounds, in large pixels. With 8, pixels are smaller and frames take up to twice the time, with
/// the same errors; with less than [`DEEP`] a first look is in vain.
const THROUGH: f32 = 3.0;

/// Points that are taken per large pixel of a surface seen face on: one pixel in fifty is left empty, with half as many
/// points one in seven. Twice as many take twice the time.
const POINTS_PER_LARGE_PIXEL: f32 = 4.0;

/// Most windows that are drawn. In all measured frames, the first window proves a real crossing.
/// The others are for large pixels that only seem to cross, where limbs are close.
const MOST_WINDOWS: usize = 3;

/// What a first look came to.
pub(crate) enum FirstLook {
    /// Both sides hold nothing of use.
    Nothing,
    /// It settled nothing. Both sides hold culled points, one in as many as said here, and which of them are near.
    Culled([usize; 2]),
    /// The result is filled.
    Settled,
}

/// Two clouds at which a first look is possible.
struct CloudPair<'a> {
    query: PairQuery<'a>,
    clouds: [&'a PointCloud<'a>; 2],
    policy: CameraPolicy,
    /// Metres, whatever pixels are looked with.
    window_edge: f32,
}

impl<'a> CloudPair<'a> {
    fn of(query: &PairQuery<'a>) -> Option<Self> {
        let (Surface::Cloud(a), Surface::Cloud(b), View::Aim { policy, .. }) =
            (query.a, query.b, query.view)
        else {
            return None;
        };
        let are_even = !a.is_uneven() && !b.is_uneven();
        (are_even && query.params.variant() != Variant::Paper).then_some(Self {
            query: *query,
            clouds: [a, b],
            policy,
            window_edge: Window::edge(query),
        })
    }

    /// The overlap of the bounds, metres.
    fn overlap(&self) -> Option<f32> {
        let [a, b] = self.clouds.map(PointCloud::bounds);
        let overlap = a.intersection(b.transformed(&self.query.a_from_b));
        (!overlap.is_empty()).then(|| overlap.extents().min_element())
    }

    fn look<'l>(&'l self, camera: &'l VirtualCamera) -> Look<'l> {
        Look {
            surfaces: [self.query.a, self.query.b],
            a_from_b: &self.query.a_from_b,
            camera,
            params: [&self.query.params; 2],
            sharpens: true,
        }
    }
}

/// Edge of the largest large pixel, metres, that resolves the smaller body and fits `deep` times into `depth`. `None` if even
/// the smallest does not.
fn large_pixel(query: &PairQuery, depth: f32, deep: f32) -> Option<f32> {
    let radius = query.a.mean_radius().max(query.b.mean_radius());
    let pixels = LARGE.map(|large| large * query.params.pixel_size.max(radius));
    let extents = [query.a, query.b].map(|surface| surface.bounds().extents());
    let resolving = extents.map(|extents| largest_pixel(extents, pixels[LARGE.len() - 1]));
    let largest = resolving[0].min(resolving[1]).min(depth / deep);
    pixels.into_iter().find(|pixel| *pixel <= largest)
}

impl Scratch {
    /// Looks at the pair with large pixels. Where that settles it, `result` is filled, and else empty.
    pub(crate) fn settle(
        &mut self,
        query: &PairQuery,
        plan: &PairPlan,
        result: &mut PairResult,
    ) -> FirstLook {
        let mut came_to = FirstLook::Nothing;
        let Some(pair) = CloudPair::of(query) else {
            return came_to;
        };
        let Some(through) = pair.overlap() else {
            return came_to;
        };
        let large = large_pixel(query, through, THROUGH);
        let mut next = large.or_else(|| large_pixel(query, through, DEEP));
        while let Some(pixel) = next {
            result.clear();
            let params = Params {
                pixel_size: pixel,
                thickness: 2.0 * pixel,
                ..query.params
            };
            let coarse = CloudPair {
                query: PairQuery { params, ..*query },
                ..pair
            };
            let mut depth = self.look_coarsely(&coarse, plan, result, &mut came_to);
            if depth >= DEEP * pixel {
                self.patches.reduce_coarse(result, &coarse.query);
                depth = result.gap.map_or(0.0, |gap| -gap);
            }
            if depth >= DEEP * pixel {
                if self.is_proven(&pair, plan, &result.axes) {
                    result.coarser = Some(pixel / query.params.pixel_size);
                    return FirstLook::Settled;
                }
                break;
            }
            next = large_pixel(query, depth, DEEP).filter(|next| *next < pixel);
        }
        result.clear();
        came_to
    }

    /// Fills `result` with the contact pixels that large pixels show, and `windows` with where these show crossings.
    /// Returns how deep the surfaces are, metres, or at the most.
    fn look_coarsely(
        &mut self,
        pair: &CloudPair,
        plan: &PairPlan,
        result: &mut PairResult,
        came_to: &mut FirstLook,
    ) -> f32 {
        self.windows.clear();
        let query = &pair.query;
        let pixel = query.params.pixel_size;
        let strides = [query.a, query.b]
            .map(|surface| stride_for(POINTS_PER_LARGE_PIXEL, surface.mean_radius(), pixel));
        let thinned = PairPlan {
            zone_reach: plan.zone_reach * (strides[0].max(strides[1]) as f32).sqrt(),
            ..plan.clone()
        };
        *came_to = FirstLook::Nothing;
        if !self.cull(query, plan, strides, Side::cull_and_hold) || !self.zone(query, &thinned) {
            return 0.0;
        }
        *came_to = FirstLook::Culled(strides);
        self.aim(query, plan, pair.policy, &mut result.axes);
        let axes: ArrayVec<Vec3, MAX_VIEWS> = result.axes.iter().copied().collect();
        let mut deepest = 0.0f32;
        for view in 0..axes.len() {
            let camera = VirtualCamera::along(axes[view], pixel);
            deepest = deepest.max(self.look_at_cells(pair, plan, &camera, &axes, view, result));
        }
        deepest
    }

    /// Whether small pixels show in a few windows that the surfaces cross.
    fn is_proven(&mut self, pair: &CloudPair, plan: &PairPlan, axes: &[Vec3]) -> bool {
        let _stage = stage!("windows");
        let query = &pair.query;
        rank(&mut self.windows);
        let pixel = query.params.pixel_size;
        let strides = [query.a, query.b].map(|s| stride(s.mean_radius(), pixel));
        let mut crossings = Crossings::default();
        self.swap_windows();
        for k in 0..self.windows.len().min(MOST_WINDOWS) {
            let window = self.windows[k];
            let camera = window.camera(query, axes);
            let plan = window.plan(query, plan, &camera);
            let reach = plan.column_reach;
            if self.cull(query, &plan, strides, Side::cull_window)
                && (self.look_at(&pair.look(&camera), reach, Scope::Near(reach))).is_some()
            {
                self.work.windows += self.looked(query);
                let seen = Seen {
                    axes,
                    view: window.view,
                    ..Seen::default()
                };
                let [a, b] = [&self.a.image, &self.b.image];
                let mut nothing = PairResult::default();
                compare::compare(
                    a,
                    b,
                    &seen,
                    &query.params,
                    Some(&mut crossings),
                    &mut nothing,
                );
            }
            if crossings.are_enough() {
                break;
            }
        }
        self.swap_windows();
        crossings.are_enough()
    }

    /// Puts the points of windows aside, and back in their place those of the look before.
    fn swap_windows(&mut self) {
        for side in [&mut self.a, &mut self.b] {
            std::mem::swap(&mut side.points, &mut side.window);
        }
    }

    /// Compares the images of the sums of what was culled. Returns how deep the surfaces are in this view, metres, or at
    /// the most.
    fn look_at_cells(
        &mut self,
        pair: &CloudPair,
        plan: &PairPlan,
        camera: &VirtualCamera,
        axes: &[Vec3],
        view: usize,
        result: &mut PairResult,
    ) -> f32 {
        let (query, look) = (&pair.query, pair.look(camera));
        let [a, b] = [0, 1].map(|side| look.at_cloud(side, pair.clouds[side]));
        let Some(MeetingRegion { rect, near, .. }) = self.meet(&a, &b, plan.column_reach, 0.0)
        else {
            return 0.0;
        };
        let pixel = query.params.pixel_size;
        let at_most = self.a.columns.greatest_overlap(&self.b.columns);
        // One of several views has to be looked at all the same: it may show that others see widths for depths.
        if at_most < DEEP * pixel && axes.len() == 1 {
            return at_most;
        }
        let imaging = CellImaging {
            camera,
            pixel_size: pixel,
            rect,
            near,
        };
        let (side_a, side_b, touching) = (&mut self.a, &mut self.b, &self.shared.touching);
        rayon::join(
            || side_a.image_of_cells(&a, &imaging, touching),
            || side_b.image_of_cells(&b, &imaging, touching),
        );
        self.work.large += self.looked(query);
        let seen = Seen {
            fold: Some(&self.shared.fold),
            // Planes of large pixels at walls that are seen edge-on tell nothing.
            tells_facing: false,
            regions: [None; 2],
            ..self.seen(query, plan, camera, axes, view)
        };
        let [a, b] = [&self.a.image, &self.b.image];
        let first = result.contacts.len();
        // Of crossings, `find_windows` says where they are.
        compare::compare(a, b, &seen, &query.params, None, result);
        find_windows(
            [a, b],
            &seen,
            &query.params,
            pair.window_edge,
            &mut self.windows,
        );
        let depths = result.contacts[first..].iter().map(|contact| -contact.gap);
        depths.fold(0.0, f32::max)
    }
}

/// Appends the windows, cubes with edges of `edge` metres, in which two images show surfaces that swap their order.
fn find_windows(
    [a, b]: [&Tldi; 2],
    seen: &Seen,
    params: &Params,
    edge: f32,
    windows: &mut Vec<Window>,
) {
    let _stage = stage!("windows");
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
                if let Some(depth) = swap_depth(at(k), at(next), &others, params) {
                    let pixel = [a.origin[0] + i as i32, a.origin[1] + j as i32];
                    let [u, v] = seen.fold.map_or(pixel, |fold| fold.unfolded(pixel));
                    let place = a.camera.view_at(u as f32 + 0.5, v as f32 + 0.5, depth);
                    windows.push(Window {
                        view: seen.view,
                        cube: (place / edge).to_array().map(|c| c.floor() as i32),
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
