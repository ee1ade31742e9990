//! The stages of one pair, in order.

use super::aim::{self, Hint, ZoneNormals};
use super::compare::{self, Middles};
use super::cull::{self, CullScratch, Region, Survivors};
use super::normals::{self, NormalScratch};
use super::splat::{DepthScale, Fragments, Rect};
use super::zone::{self, ZoneScratch};
use super::{cast, sweep};
use crate::patches::PatchScratch;
use crate::{
    Aabb, PairQuery, PairResult, Params, PointCloud, RayHit, RaySurface, Surface, Tldi, Variant,
    View, VirtualCamera, paper,
};
use glamx::{Pose3, Vec3};

/// Most near points of a cloud that are projected onto an exact surface to aim the camera; more do
/// not sharpen the mean of their normals.
const AIM_SAMPLES: usize = 512;

/// One side of a pair: its culled points and its image.
#[derive(Default)]
pub(super) struct Side {
    pub(super) points: Survivors,
    pub(super) cull: CullScratch,
    pub(super) normals: NormalScratch,
    pub(super) fragments: Fragments,
    /// Indices of the near points, and their normals.
    near: Vec<u32>,
    near_normals: Vec<Vec3>,
    /// Greatest depth of a sampled point inside an exact surface, metres.
    deepest: f32,
    pub(super) image: Tldi,
}

impl Side {
    /// `mark` to `sweep` for points that were projected.
    pub(super) fn image(
        &mut self,
        cloud: &PointCloud,
        camera: &VirtualCamera,
        params: &Params,
        rect: &Rect,
        scale: &DepthScale,
    ) {
        let oriented = cloud.normals().is_some() && cloud.normals_oriented();
        self.fragments
            .splat(&self.points, oriented, camera, params, rect, scale);
        sweep::sweep(
            &mut self.fragments,
            &self.points.index,
            cloud.colors(),
            oriented,
            camera,
            params,
            rect,
            scale,
            &mut self.image,
        );
    }
}

/// Everything one pair needs while it is compared.
#[derive(Default)]
pub(super) struct Scratch {
    a: Side,
    b: Side,
    zone: ZoneScratch,
    hits: Vec<RayHit>,
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
                toward_b,
                last_axis,
            } => {
                self.aim(
                    query,
                    &Hint {
                        toward_b,
                        last_axis,
                    },
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
        self.patches.reduce(result, &query.params);
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
        let (bounds_a, bounds_b) = (query.a.bounds(), query.b.bounds());
        // Splats reach a radius beyond their points, on both sides; normals that are estimated
        // here need their neighbours, or they would err at the rim.
        let ring = |surface: &Surface| match surface {
            Surface::Cloud(cloud) if cloud.normals().is_none() => {
                let stride = cull::stride(cloud, query.params.pixel_size) as f32;
                (2.0 + normals::SUPPORT * stride.sqrt()) * cloud.mean_radius()
            }
            surface => 2.0 * surface.mean_radius(),
        };
        let margin = query.params.prediction + ring(&query.a).max(ring(&query.b));
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
                self.a.estimate_normals(a, &Pose3::IDENTITY);
                self.b.estimate_normals(b, &query.a_from_b);
                true
            }
            (Surface::Cloud(cloud), Surface::Exact(surface)) => {
                self.a.estimate_normals_of_all(cloud, &Pose3::IDENTITY);
                self.a
                    .near_exact(surface, &query.a_from_b, reach, &mut self.b)
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                self.b.estimate_normals_of_all(cloud, &query.a_from_b);
                self.b
                    .near_exact(surface, &Pose3::IDENTITY, reach, &mut self.a)
            }
            (Surface::Exact(_), Surface::Exact(_)) => false,
        }
    }

    fn aim(&mut self, query: &PairQuery, hint: &Hint, axes: &mut Vec<Vec3>) {
        let oriented = |surface: &Surface| match surface {
            Surface::Cloud(cloud) => cloud.normals().is_some() && cloud.normals_oriented(),
            Surface::Exact(surface) => surface.is_closed(),
        };
        aim::aim(
            &ZoneNormals {
                normals: &self.a.near_normals,
                oriented: oriented(&query.a),
            },
            &ZoneNormals {
                normals: &self.b.near_normals,
                oriented: oriented(&query.b),
            },
            hint,
            axes,
        );
    }

    /// Builds both images for one camera and compares them.
    fn look(
        &mut self,
        query: &PairQuery,
        camera: &VirtualCamera,
        view: usize,
        result: &mut PairResult,
    ) {
        let (a, b) = (&mut self.a, &mut self.b);
        match (query.a, query.b) {
            (Surface::Cloud(cloud_a), Surface::Cloud(cloud_b)) => {
                let (seen_a, seen_b) = rayon::join(
                    || a.fragments.project(&a.points, camera),
                    || b.fragments.project(&b.points, camera),
                );
                let (Some(seen_a), Some(seen_b)) = (seen_a, seen_b) else {
                    return;
                };
                let Some(rect) = seen_a.rect.intersection(&seen_b.rect) else {
                    return;
                };
                let scale = DepthScale::new(seen_a.near.min(seen_b.near), &query.params);
                rayon::join(
                    || a.image(cloud_a, camera, &query.params, &rect, &scale),
                    || b.image(cloud_b, camera, &query.params, &rect, &scale),
                );
            }
            (Surface::Cloud(cloud), Surface::Exact(surface)) => {
                let hits = &mut self.hits;
                a.look_with(
                    cloud,
                    surface,
                    &query.a_from_b,
                    camera,
                    query,
                    hits,
                    &mut b.image,
                );
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                let hits = &mut self.hits;
                b.look_with(
                    cloud,
                    surface,
                    &Pose3::IDENTITY,
                    camera,
                    query,
                    hits,
                    &mut a.image,
                );
            }
            (Surface::Exact(_), Surface::Exact(_)) => return,
        }
        compare::compare(
            &self.a.image,
            &self.b.image,
            &result.axes.clone(),
            view,
            &middles(query, camera),
            &query.params,
            result,
        );
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

impl Side {
    fn estimate_normals(&mut self, cloud: &PointCloud, frame_from_cloud: &Pose3) {
        normals::normals(cloud, frame_from_cloud, &mut self.normals, &mut self.points);
        self.near_normals.clear();
        self.near_normals
            .extend(self.near.iter().map(|&i| self.points.normal[i as usize]));
    }

    fn estimate_normals_of_all(&mut self, cloud: &PointCloud, frame_from_cloud: &Pose3) {
        normals::normals(cloud, frame_from_cloud, &mut self.normals, &mut self.points);
    }

    /// Near points of this cloud by their distance to an exact surface, whose normals at the
    /// nearest points go to `other`; `false` where none is near.
    fn near_exact(
        &mut self,
        surface: &dyn RaySurface,
        frame_from_surface: &Pose3,
        reach: f32,
        other: &mut Side,
    ) -> bool {
        self.near_normals.clear();
        other.near_normals.clear();
        self.deepest = 0.0;
        let stride = self.points.len().div_ceil(AIM_SAMPLES).max(1);
        for i in (0..self.points.len()).step_by(stride) {
            let point = frame_from_surface.inverse_transform_point(self.points.point(i));
            let (distance, normal) = surface.project(point);
            self.deepest = self.deepest.max(-distance);
            if distance <= reach {
                self.near_normals.push(self.points.normal[i]);
                other
                    .near_normals
                    .push(frame_from_surface.rotation * normal);
            }
        }
        !self.near_normals.is_empty()
    }

    /// Image of this cloud, and of an exact surface into `image` over the same pixels.
    #[allow(
        clippy::too_many_arguments,
        reason = "one side of each kind, and where both are"
    )]
    fn look_with(
        &mut self,
        cloud: &PointCloud,
        surface: &dyn RaySurface,
        frame_from_surface: &Pose3,
        camera: &VirtualCamera,
        query: &PairQuery,
        hits: &mut Vec<RayHit>,
        image: &mut Tldi,
    ) {
        let Some(seen) = self.fragments.project(&self.points, camera) else {
            self.image = Tldi::default();
            *image = Tldi::default();
            return;
        };
        let scale = DepthScale::new(seen.near, &query.params);
        self.image(cloud, camera, &query.params, &seen.rect, &scale);
        // Rays must pass through all of the surface, or what is deepest would be missed; through
        // as much of an unbounded one as the cloud is deep in it.
        let extent = surface.bounds().extents().length();
        let beyond = if extent.is_finite() {
            extent
        } else {
            2.0 * self.deepest
        };
        let margin = query.params.prediction + (seen.far - seen.near) + beyond;
        let range = (seen.near - margin, seen.far + margin);
        cast::cast(
            surface,
            frame_from_surface,
            camera,
            &self.image,
            range,
            hits,
            image,
        );
    }
}
