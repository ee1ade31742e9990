//! The stages of one pair, in order.

use super::columns::{Tiles, Touching};
use super::compare::{self, Middles, Seen};
use super::cull::{self, Region};
use super::impact::{CoreScratch, Meeting};
use super::normals;
use super::side::{CloudView, ExactView, Side};
use super::splat::{DepthScale, Imaging};
use super::zone::{self, ZoneScratch};
use crate::camera_policy::{Approach, MAX_VIEWS, ZoneNormals, aim, seen_from_behind};
use crate::patches::PatchScratch;
use crate::{
    Aabb, PairQuery, PairResult, Params, RayHit, Surface, Variant, View, VirtualCamera, paper,
};
use arrayvec::ArrayVec;
use glamx::{Pose3, Vec3};

/// Columns in which the surfaces are farther apart along the view than this many merge gaps, or
/// prediction distances, are not modelled. A contact at the prediction distance is as far along
/// the view where its normal is 60° off (beyond, depths along the view tell no distance); surfaces
/// that cross between neighbouring pixels are at most two merge gaps apart in both.
const REACH: f32 = 2.0;

/// Depth in pixels to which a body that has sunk below all of a surface is looked for. Points that
/// are culled in vain cost little; the deeper ones of two large clouds would be many.
const SUNK: f32 = 16.0;

/// Everything one pair needs while it is compared.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) a: Side,
    pub(super) b: Side,
    pub(super) hits: Vec<RayHit>,
    pub(super) core: CoreScratch,
    pub(super) meetings: Vec<Meeting>,
    zone: ZoneScratch,
    touching: Touching,
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
        let Some(overlap) = self.cull(query) else {
            return;
        };
        if !self.zone(query, &overlap) {
            return;
        }
        match query.view {
            View::Fixed(camera) => {
                result.axes.push(camera.axis());
                self.look(query, &camera, 0, result);
            }
            View::Aim {
                policy,
                motion,
                last_axis,
            } => {
                let (bounds_a, bounds_b) = (query.a.bounds(), query.b.bounds());
                let near = [(&self.a, query.a), (&self.b, query.b)].map(|(side, surface)| {
                    let is_cloud = matches!(surface, Surface::Cloud(_));
                    (is_cloud && !is_oriented(&surface)).then(|| side.mean_of_near())
                });
                let approach = Approach::new(
                    &bounds_a,
                    &bounds_b,
                    &query.a_from_b,
                    motion,
                    near,
                    last_axis,
                );
                aim(
                    policy,
                    self.zone_normals(query),
                    &approach,
                    &mut result.axes,
                );
                if query.params.variant() == Variant::Paper {
                    let camera = VirtualCamera::along(result.axes[0], query.params.pixel_size);
                    self.compare_paper(query, &camera, result);
                    return;
                }
                for view in 0..result.axes.len() {
                    let camera = VirtualCamera::along(result.axes[view], query.params.pixel_size);
                    self.look(query, &camera, view, result);
                }
            }
        }
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

    /// Fills both sides' culled points; returns the overlap of the bounds in the frame of `a`, or
    /// `None` where a cloud has no point in it.
    fn cull(&mut self, query: &PairQuery) -> Option<Aabb> {
        let ring = |surface| ring(surface, &query.params);
        let margin = query.params.prediction + ring(&query.a).max(ring(&query.b));
        let [bounds_a, bounds_b] = bounds_with_inside(query);
        let overlap = bounds_a
            .loosened(margin)
            .intersection(bounds_b.transformed(&query.a_from_b).loosened(margin));
        if overlap.is_empty() {
            return None;
        }
        let b_from_a = query.a_from_b.inverse();
        let (a, b) = (&mut self.a, &mut self.b);
        rayon::join(
            || {
                if let Surface::Cloud(cloud) = query.a {
                    let region = Region {
                        overlap,
                        other_from_frame: b_from_a,
                        other_bounds: bounds_b.loosened(margin),
                    };
                    let stride = cull::stride(cloud, query.params.pixel_size);
                    let frame = Pose3::IDENTITY;
                    cull::cull(cloud, &frame, &region, stride, &mut a.cull, &mut a.points);
                } else {
                    a.points.clear();
                }
            },
            || {
                if let Surface::Cloud(cloud) = query.b {
                    let region = Region {
                        overlap,
                        other_from_frame: Pose3::IDENTITY,
                        other_bounds: bounds_a.loosened(margin),
                    };
                    let stride = cull::stride(cloud, query.params.pixel_size);
                    let frame = query.a_from_b;
                    cull::cull(cloud, &frame, &region, stride, &mut b.cull, &mut b.points);
                } else {
                    b.points.clear();
                }
            },
        );
        let lacks = |side: &Side, surface: &Surface| {
            matches!(surface, Surface::Cloud(_)) && side.points.is_empty()
        };
        if lacks(&self.a, &query.a) || lacks(&self.b, &query.b) {
            return None;
        }
        Some(overlap)
    }

    /// Finds the near points of both sides and their normals; `false` where nothing is near.
    fn zone(&mut self, query: &PairQuery, overlap: &Aabb) -> bool {
        let reach = query.params.prediction + query.a.mean_radius() + query.b.mean_radius();
        match (query.a, query.b) {
            (Surface::Cloud(a), Surface::Cloud(b)) => {
                zone::zone(
                    &self.a.points,
                    &self.b.points,
                    overlap,
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
                let frame = Pose3::IDENTITY;
                let near = &mut self.b.near_normals;
                self.a
                    .near_exact(cloud, &frame, surface, &query.a_from_b, reach, near)
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                let frame = Pose3::IDENTITY;
                let near = &mut self.a.near_normals;
                self.b
                    .near_exact(cloud, &query.a_from_b, surface, &frame, reach, near)
            }
            (Surface::Exact(_), Surface::Exact(_)) => false,
        }
    }

    fn zone_normals(&self, query: &PairQuery) -> [ZoneNormals<'_>; 2] {
        [(&self.a, query.a), (&self.b, query.b)].map(|(side, surface)| ZoneNormals {
            normals: &side.near_normals,
            oriented: is_oriented(&surface),
        })
    }

    /// Builds both images for one camera and compares them.
    fn look(
        &mut self,
        query: &PairQuery,
        camera: &VirtualCamera,
        view: usize,
        result: &mut PairResult,
    ) {
        let params = &query.params;
        let view_of = |cloud, frame_from_cloud| CloudView {
            cloud,
            frame_from_cloud,
            camera,
            params,
        };
        // An unbounded surface as far as the cloud is deep in it, twice for what was not sampled.
        let exact_view = |surface, frame_from_surface, deepest: f32| ExactView {
            surface,
            frame_from_surface,
            reach: 2.0 * deepest,
            everywhere: false,
        };
        let (a_from_a, a_from_b) = (&Pose3::IDENTITY, &query.a_from_b);
        let hits = &mut self.hits;
        let looked = match (query.a, query.b) {
            (Surface::Cloud(a), Surface::Cloud(b)) => {
                let reach = REACH * params.merge_gap.max(params.prediction);
                self.look_at_clouds(&view_of(a, a_from_a), &view_of(b, a_from_b), reach)
            }
            (Surface::Cloud(cloud), Surface::Exact(surface)) => {
                let exact = exact_view(surface, a_from_b, self.a.deepest);
                let (cloud, image) = (view_of(cloud, a_from_a), &mut self.b.image);
                self.a.look_with(&cloud, &exact, hits, image)
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                let exact = exact_view(surface, a_from_a, self.b.deepest);
                let (cloud, image) = (view_of(cloud, a_from_b), &mut self.a.image);
                self.b.look_with(&cloud, &exact, hits, image)
            }
            (Surface::Exact(_), Surface::Exact(_)) => None,
        };
        if looked.is_none() {
            return;
        }
        let axes: ArrayVec<Vec3, MAX_VIEWS> = result.axes.iter().copied().collect();
        compare::compare(
            &self.a.image,
            &self.b.image,
            &axes,
            view,
            &Seen {
                middles: middles(query, camera),
                from_behind: seen_from_behind(camera.axis(), &self.zone_normals(query)),
            },
            &query.params,
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
        let support = side_a.support(a).max(side_b.support(b));
        let support_px = support / seen_a.pixel_size.min(seen_b.pixel_size);
        let touching = &mut self.touching;
        let (columns_a, columns_b) = (&side_a.columns, &side_b.columns);
        let rect = touching.mark(columns_a, columns_b, &tiles, &rect, reach, support_px)?;
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

/// Whether the surface's normals tell its outside.
pub(super) fn is_oriented(surface: &Surface) -> bool {
    match surface {
        Surface::Cloud(cloud) => cloud.normals().is_some() && cloud.normals_oriented(),
        Surface::Exact(surface) => surface.is_closed(),
    }
}

/// By how much more than what can touch is culled, metres: splats reach a radius beyond their
/// points, on both sides; normals that are estimated here need their neighbours, or they would err
/// at the rim.
pub(super) fn ring(surface: &Surface, params: &Params) -> f32 {
    match surface {
        Surface::Cloud(cloud) if cloud.normals().is_none() => {
            let stride = cull::stride(cloud, params.pixel_size) as f32;
            (2.0 + normals::SUPPORT * stride.sqrt()) * cloud.mean_radius()
        }
        surface => 2.0 * surface.mean_radius(),
    }
}

/// Bounds of both surfaces, each in its own frame; those of the larger one with what of a body may
/// be behind it, where the bounds of a floor do not reach: all of a body that passes through them,
/// of others as much as up to their middle, but no more than [`SUNK`] and what they moved.
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
    if a.extents().length() >= b.extents().length() {
        [with_inside(a, b, b.transformed(&query.a_from_b)), b]
    } else {
        let a_in_b = a.transformed(&query.a_from_b.inverse());
        [a, with_inside(b, a, a_in_b)]
    }
}

/// See [`Middles`].
fn middles(query: &PairQuery, camera: &VirtualCamera) -> Middles {
    let (bounds_a, bounds_b) = (query.a.bounds(), query.b.bounds());
    let (size_a, size_b) = (bounds_a.extents().length(), bounds_b.extents().length());
    let depth = |center: Vec3| Some(camera.view_from_point(center).z);
    Middles {
        a: if size_a <= size_b {
            depth(bounds_a.center())
        } else {
            None
        },
        b: if size_b <= size_a {
            depth(query.a_from_b * bounds_b.center())
        } else {
            None
        },
    }
}
