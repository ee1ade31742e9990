//! The stages of one pair, in order.

use super::compare::{self, Seen};
use super::crossings::Crossings;
use super::first_look::settle::FirstLook;
use super::scratch::{Look, Scratch};
use super::side::{Scope, Side};
use crate::contact::lone_points::SAME_POINT;
use crate::pair::further_views::{asks_for_spare, further_axes, settle_spare};
use crate::pair::plan::{PairPlan, column_reach};
use crate::pair::sampling::stride;
use crate::view::approach::moved_along;
use crate::view::camera_policy::MAX_VIEWS;
use crate::{
    CameraPolicy, Looked, PairQuery, PairResult, Surface, Variant, View, VirtualCamera, paper,
};
use arrayvec::ArrayVec;
use glamx::{Pose3, Vec3};

impl Scratch {
    /// Compares a pair, after a first look at it or at once.
    pub(super) fn compare(
        &mut self,
        query: &PairQuery,
        has_first_look: bool,
        result: &mut PairResult,
    ) {
        self.a.release();
        self.b.release();
        if query.params.variant() == Variant::Paper
            && let View::Fixed(camera) = query.view
        {
            self.compare_paper(query, &camera, result);
            return;
        }
        let Some(mut plan) = PairPlan::new(query) else {
            return;
        };
        let pixel = query.params.pixel_size;
        let strides = [query.a, query.b].map(|surface| stride(surface.mean_radius(), pixel));
        let left = self.shared.room.left();
        let first_look = match has_first_look {
            true => self.settle(query, &plan, result),
            false => FirstLook::Nothing,
        };
        // There may be room for the pixels of the fine look, which thins nothing out.
        self.shared.room.take_wanted();
        let is_found = match first_look {
            FirstLook::Settled => return,
            // Thinned ones may be those of a first look that reached farther.
            FirstLook::Culled(taken) => taken == strides && strides == [1, 1],
            FirstLook::Nothing => false,
        };
        let is_near =
            is_found || self.cull(query, &plan, strides, Side::cull) && self.zone(query, &plan);
        if !is_near {
            return;
        }
        // Each round takes out at least one point.
        while self.compare_closely(query, &mut plan, left, result)
            && self.take_out_lone_points(query)
        {
            result.clear();
            if !self.zone(query, &plan) {
                return;
            }
        }
    }

    /// Compares what was culled with pixels of the size asked for, or with larger ones where these are too many. Returns
    /// whether points that stand alone hide anything.
    fn compare_closely(
        &mut self,
        query: &PairQuery,
        plan: &mut PairPlan,
        left: f32,
        result: &mut PairResult,
    ) -> bool {
        self.shared.room.put_back(left);
        self.scale = self.local_scale(query);
        let scale = self.scale;
        result.coarser = (scale.coarser > 1.0).then_some(scale.coarser);
        let query = &PairQuery {
            params: scale.params(&query.params),
            ..*query
        };
        plan.column_reach = column_reach(&query.params);
        self.crossings = Crossings::default();
        match query.view {
            View::Fixed(camera) => {
                result.axes.push(camera.axis());
                self.look(query, plan, &camera, &[camera.axis()], 0, result);
            }
            View::Aim { policy, .. } => {
                let spare = self.aim(query, plan, policy, &mut result.axes);
                if query.params.variant() == Variant::Paper {
                    let camera = VirtualCamera::along(result.axes[0], query.params.pixel_size);
                    self.compare_paper(query, &camera, result);
                    return false;
                }
                let mut axes: ArrayVec<Vec3, MAX_VIEWS> = result.axes.iter().copied().collect();
                self.look_along(query, plan, &axes, 0, result);
                let first = axes.len();
                let way_out = result.way_out.take();
                let moved = moved_along(plan.approach.motion, axes[0]);
                if asks_for_spare(way_out, moved, &query.params) {
                    axes.extend(spare);
                    result.axes.extend_from_slice(&axes[first..]);
                }
                if policy == CameraPolicy::AllDirections && !self.crossings.are_enough() {
                    axes.extend(further_axes(&axes));
                }
                self.look_along(query, plan, &axes, first, result);
                settle_spare(result, first, way_out, moved, &query.params);
            }
        }
        if let Some(coarser) = self.shared.room.take_wanted() {
            self.shared.room.put_back(left);
            self.compare_coarser(query, coarser, result);
            // Than those of `query`, which are as large as the place asks for.
            result.coarser = result.coarser.map(|coarser| scale.coarser * coarser);
            return false;
        }
        result.collides = self.crossings.are_enough();
        let sides = [(&self.a, &plan.sides[0]), (&self.b, &plan.sides[1])];
        let culled = sides.map(|(side, plan)| side.culled(plan));
        self.patches.reduce_culled(result, query, culled)
    }

    /// Takes the lone points that were found out of what was culled, because they hide what lies behind them; whether
    /// there were any.
    fn take_out_lone_points(&mut self, query: &PairQuery) -> bool {
        let [of_a, of_b] = &self.patches.lone_points.found;
        let take_out = |side: &mut Side, surface: Surface, places: &[Vec3]| {
            !places.is_empty()
                && side
                    .points
                    .leave_out(places, SAME_POINT * surface.mean_radius())
        };
        let from_a = take_out(&mut self.a, query.a, of_a);
        let from_b = take_out(&mut self.b, query.b, of_b);
        from_a || from_b
    }

    /// Compares with pixels that are `coarser` times as large: there would be too many of the size asked for.
    fn compare_coarser(&mut self, query: &PairQuery, coarser: f32, result: &mut PairResult) {
        let pixel_size = coarser * query.params.pixel_size;
        let view = match query.view {
            View::Fixed(camera) => View::Fixed(camera.coarser(coarser)),
            aim @ View::Aim { .. } => aim,
        };
        result.clear();
        let larger = PairQuery {
            params: query.params.with_pixel_size(pixel_size),
            view,
            ..*query
        };
        self.compare(&larger, false, result);
        let coarser = coarser * result.coarser.unwrap_or(1.0);
        self.shared.room.tell(coarser);
        result.coarser = Some(coarser);
    }

    fn compare_paper(
        &mut self,
        query: &PairQuery,
        camera: &VirtualCamera,
        result: &mut PairResult,
    ) {
        let (Surface::Cloud(a), Surface::Cloud(b)) = (query.a, query.b) else {
            return; // refused by `supported`
        };
        let [scratch_a, scratch_b] = &mut self.paper;
        let (image_a, image_b) = (&mut self.a.image, &mut self.b.image);
        let (params, a_from_a) = (&query.params, &Pose3::IDENTITY);
        rayon::join(
            || paper::build(a, a_from_a, camera, params, scratch_a, image_a),
            || paper::build(b, &query.a_from_b, camera, params, scratch_b, image_b),
        );
        self.work.fine += Looked {
            points: a.len() + b.len(),
            ..self.looked(query)
        };
        let found = paper::compare(&self.a.image, &self.b.image, &query.params);
        result.collides = found.collides;
        result.gap = found.gap;
    }

    /// Looks along each of `axes` from the `first` on, until one has no room.
    fn look_along(
        &mut self,
        query: &PairQuery,
        plan: &PairPlan,
        axes: &[Vec3],
        first: usize,
        result: &mut PairResult,
    ) {
        for view in first..axes.len() {
            if self.shared.room.has_refused() {
                return;
            }
            let camera = VirtualCamera::along(axes[view], query.params.pixel_size);
            self.look(query, plan, &camera, axes, view, result);
        }
    }

    /// Builds both images for the camera of `axes[view]` and compares them.
    fn look(
        &mut self,
        query: &PairQuery,
        plan: &PairPlan,
        camera: &VirtualCamera,
        axes: &[Vec3],
        view: usize,
        result: &mut PairResult,
    ) {
        let [params_a, params_b] = self.scale.of_sides(&query.params);
        let look = Look {
            surfaces: [query.a, query.b],
            a_from_b: &query.a_from_b,
            camera,
            params: [&params_a, &params_b],
            sharpens: true,
        };
        let reach = plan.column_reach;
        let looked = self.look_at(&look, reach, Scope::Near(reach));
        if looked.is_none() {
            return;
        }
        self.work.fine += self.looked(query);
        compare::compare(
            &self.a.image,
            &self.b.image,
            &Seen {
                fold: Some(&self.shared.fold),
                ..self.seen(query, plan, camera, axes, view)
            },
            &query.params,
            Some(&mut self.crossings),
            result,
        );
    }
}
