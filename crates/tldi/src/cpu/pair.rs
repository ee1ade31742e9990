//! The stages of one pair, in order.

use super::columns::{Tiles, Touching};
use super::compare::{self, Crossings, Middles, Seen};
use super::cull;
use super::impact::{CoreScratch, Meeting};
use super::near_exact::Placed;
use super::side::{CloudView, ExactView, Scope, Side};
use super::splat::{DepthScale, Imaging};
use super::zone::{self, ZoneScratch, ZoneSide};
use crate::camera_policy::{MAX_VIEWS, ZoneNormals, aim, further_axes, seen_from_behind};
use crate::patches::PatchScratch;
use crate::plan::{PairPlan, SidePlan, column_reach, stride};
use crate::reach::Place;
use crate::{
    CameraPolicy, PairQuery, PairResult, RayHit, Surface, Variant, View, VirtualCamera, paper,
};
use arrayvec::ArrayVec;
use glamx::{Pose3, Vec3};

/// Everything one pair needs while it is compared.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) a: Side,
    pub(super) b: Side,
    pub(super) hits: Vec<RayHit>,
    pub(super) core: CoreScratch,
    pub(super) meetings: Vec<Meeting>,
    zone: ZoneScratch,
    /// Of both sides, metres.
    merge_gaps: [f32; 2],
    pub(super) touching: Touching,
    crossings: Crossings,
    paper: [paper::Scratch; 2],
    patches: PatchScratch,
}

impl Scratch {
    pub(super) fn compare(&mut self, query: &PairQuery, result: &mut PairResult) {
        if query.params.variant() == Variant::Paper
            && let View::Fixed(camera) = query.view
        {
            self.compare_paper(query, &camera, result);
            return;
        }
        let Some(mut plan) = PairPlan::new(query) else {
            return;
        };
        if !self.cull(query, &plan) || !self.zone(query, &plan) {
            return;
        }
        let place = self.place(query);
        self.merge_gaps = place.merging.map(|factor| factor * query.params.merge_gap);
        let query = &PairQuery {
            params: place.params(&query.params),
            ..*query
        };
        plan.column_reach = column_reach(&query.params);
        self.crossings = Crossings::default();
        match query.view {
            View::Fixed(camera) => {
                result.axes.push(camera.axis());
                self.look(query, &plan, &camera, &[camera.axis()], 0, result);
            }
            View::Aim { policy, .. } => {
                let near = [(&self.a, query.a), (&self.b, query.b)].map(|(side, surface)| {
                    let is_cloud = matches!(surface, Surface::Cloud(_));
                    (is_cloud && !surface.is_oriented()).then(|| side.mean_of_near())
                });
                let approach = plan.approach.at_sheet(near);
                let normals = self.zone_normals(query);
                aim(policy, normals, &approach, &mut result.axes);
                if query.params.variant() == Variant::Paper {
                    let camera = VirtualCamera::along(result.axes[0], query.params.pixel_size);
                    self.compare_paper(query, &camera, result);
                    return;
                }
                let mut axes: ArrayVec<Vec3, MAX_VIEWS> = result.axes.iter().copied().collect();
                for view in 0..axes.len() {
                    self.look_along(query, &plan, &axes, view, result);
                }
                if policy == CameraPolicy::AllDirections && !self.crossings.are_enough() {
                    axes.extend(further_axes(&result.axes));
                    for view in result.axes.len()..axes.len() {
                        self.look_along(query, &plan, &axes, view, result);
                    }
                }
            }
        }
        result.collides = self.crossings.are_enough();
        self.patches.reduce_pair(result, query);
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
        rayon::join(
            || {
                paper::build(
                    a,
                    &Pose3::IDENTITY,
                    camera,
                    &query.params,
                    scratch_a,
                    image_a,
                )
            },
            || {
                paper::build(
                    b,
                    &query.a_from_b,
                    camera,
                    &query.params,
                    scratch_b,
                    image_b,
                )
            },
        );
        let found = paper::compare(image_a, image_b, &query.params);
        result.collides = found.collides;
        result.gap = found.gap;
    }

    /// Fills both sides' culled points; `false` where a cloud has no point in reach.
    fn cull(&mut self, query: &PairQuery, plan: &PairPlan) -> bool {
        let cull = |side: &mut Side, surface: Surface, plan: &SidePlan| {
            side.near.clear();
            if let Surface::Cloud(cloud) = surface {
                let stride = stride(cloud.mean_radius(), query.params.pixel_size);
                let frame = &plan.frame_from_surface;
                let Side { cull, points, .. } = side;
                cull::cull(cloud, frame, &plan.region, stride, cull, points);
                !points.is_empty()
            } else {
                side.points.clear();
                true
            }
        };
        let (a, b) = (&mut self.a, &mut self.b);
        let [plan_a, plan_b] = &plan.sides;
        let (is_near_a, is_near_b) =
            rayon::join(|| cull(a, query.a, plan_a), || cull(b, query.b, plan_b));
        is_near_a && is_near_b
    }

    /// Finds the near points of both sides and their normals; `false` where nothing is near.
    fn zone(&mut self, query: &PairQuery, plan: &PairPlan) -> bool {
        let reach = plan.zone_reach;
        match (query.a, query.b) {
            (Surface::Cloud(a), Surface::Cloud(b)) => {
                let zone_side = |points, mean_radius| ZoneSide {
                    points,
                    mean_radius,
                };
                zone::zone(
                    [
                        zone_side(&self.a.points, a.mean_radius()),
                        zone_side(&self.b.points, b.mean_radius()),
                    ],
                    &plan.overlap,
                    reach,
                    &mut self.zone,
                    &mut self.a.near,
                    &mut self.b.near,
                );
                if self.a.near.is_empty() || self.b.near.is_empty() {
                    return false;
                }
                let (side_a, side_b) = (&mut self.a, &mut self.b);
                rayon::join(
                    || side_a.sample_normals(a, &Pose3::IDENTITY),
                    || side_b.sample_normals(b, &query.a_from_b),
                );
                true
            }
            (Surface::Cloud(cloud), Surface::Exact(surface)) => {
                let near = &mut self.b.near_normals;
                let exact = Placed {
                    surface,
                    frame_from_surface: &query.a_from_b,
                };
                self.a
                    .near_exact(cloud, &Pose3::IDENTITY, &exact, reach, near)
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                let near = &mut self.a.near_normals;
                let exact = Placed {
                    surface,
                    frame_from_surface: &Pose3::IDENTITY,
                };
                self.b
                    .near_exact(cloud, &query.a_from_b, &exact, reach, near)
            }
            _ => false, // refused
        }
    }

    /// What the surfaces look like where they are near each other; as the parameters say, where the camera is given.
    fn place(&self, query: &PairQuery) -> Place {
        let near = [(&self.a, query.a), (&self.b, query.b)].map(|(side, surface)| match surface {
            Surface::Cloud(cloud) => side.near_radius(cloud),
            Surface::Exact(_) | Surface::Device(_) => 0.0,
        });
        match query.view {
            View::Fixed(_) => Place::AS_TOLD,
            View::Aim { .. } => Place::new(&query.params, [&query.a, &query.b], near),
        }
    }

    fn zone_normals(&self, query: &PairQuery) -> [ZoneNormals<'_>; 2] {
        [(&self.a, query.a), (&self.b, query.b)].map(|(side, surface)| ZoneNormals {
            normals: &side.near_normals,
            oriented: surface.is_oriented(),
        })
    }

    fn look_along(
        &mut self,
        query: &PairQuery,
        plan: &PairPlan,
        axes: &[Vec3],
        view: usize,
        result: &mut PairResult,
    ) {
        let camera = VirtualCamera::along(axes[view], query.params.pixel_size);
        self.look(query, plan, &camera, axes, view, result);
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
        let params = &query.params;
        let [merge_a, merge_b] = self.merge_gaps;
        let view_of = |cloud, frame_from_cloud, merge_gap| CloudView {
            cloud,
            frame_from_cloud,
            camera,
            params,
            merge_gap,
            sharpens: true,
        };
        // An unbounded surface as far as the cloud is deep in it, twice for what was not sampled.
        let exact_view = |surface, frame_from_surface, deepest: f32| ExactView {
            exact: Placed {
                surface,
                frame_from_surface,
            },
            reach: 2.0 * deepest,
            scope: Scope::Near(plan.column_reach),
        };
        let (a_from_a, a_from_b) = (&Pose3::IDENTITY, &query.a_from_b);
        let (hits, touching) = (&mut self.hits, &mut self.touching);
        let looked = match (query.a, query.b) {
            (Surface::Cloud(a), Surface::Cloud(b)) => {
                let (a, b) = (view_of(a, a_from_a, merge_a), view_of(b, a_from_b, merge_b));
                self.look_at_clouds(&a, &b, plan.column_reach)
            }
            (Surface::Cloud(cloud), Surface::Exact(surface)) => {
                let exact = exact_view(surface, a_from_b, self.a.deepest);
                let (cloud, image) = (view_of(cloud, a_from_a, merge_a), &mut self.b.image);
                self.a.look_with(&cloud, &exact, touching, hits, image)
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                let exact = exact_view(surface, a_from_a, self.b.deepest);
                let (cloud, image) = (view_of(cloud, a_from_b, merge_b), &mut self.a.image);
                self.b.look_with(&cloud, &exact, touching, hits, image)
            }
            _ => None, // refused
        };
        if looked.is_none() {
            return;
        }
        let depth = |side: &SidePlan| side.middle.map(|middle| camera.view_from_point(middle).z);
        let from_behind = seen_from_behind(camera.axis(), &self.zone_normals(query));
        compare::compare(
            &self.a.image,
            &self.b.image,
            &Seen {
                axes,
                view,
                middles: Middles {
                    a: depth(&plan.sides[0]),
                    b: depth(&plan.sides[1]),
                },
                from_behind,
            },
            &query.params,
            &mut self.crossings,
            result,
        );
    }

    /// Builds the images of two clouds where `a` is less than `reach` metres behind `b`; `None` if
    /// that is nowhere.
    pub(super) fn look_at_clouds(
        &mut self,
        a: &CloudView,
        b: &CloudView,
        reach: f32,
    ) -> Option<()> {
        let (camera, params) = (a.camera, a.params);
        let (side_a, side_b) = (&mut self.a, &mut self.b);
        let (seen_a, seen_b) = rayon::join(|| side_a.project(a), || side_b.project(b));
        let (seen_a, seen_b) = (seen_a?, seen_b?);
        let rect = seen_a.rect.intersection(&seen_b.rect)?;
        let tiles = Tiles::new(&rect, seen_a.reach.max(seen_b.reach));
        let sort = |side: &mut Side, sign: f32, radius: f32| {
            side.columns.sort(&tiles, camera);
            let margin = params.slope_damping * radius;
            side.columns.reduce(&tiles, sign, margin);
        };
        rayon::join(
            || sort(side_a, 1.0, seen_a.radius),
            || sort(side_b, -1.0, seen_b.radius),
        );
        let support = side_a
            .support_radius(a.cloud)
            .max(side_b.support_radius(b.cloud));
        let support_px = support / seen_a.pixel_size.min(seen_b.pixel_size);
        let touching = &mut self.touching;
        let (columns_a, columns_b) = (&side_a.columns, &side_b.columns);
        let meet = |tile: usize| columns_a.meet(columns_b, tile, reach);
        let rect = touching.mark(&tiles, &rect, support_px, meet)?;
        let imaging = Imaging {
            camera,
            params,
            rect,
            tiles,
            scale: DepthScale::new(seen_a.near.min(seen_b.near), params),
        };
        rayon::join(
            || side_a.image(a, &imaging, Some(touching)),
            || side_b.image(b, &imaging, Some(touching)),
        );
        Some(())
    }
}
