//! The CPU backend: the reference that every other backend is compared with.
//!
//! One file a stage: `cull`, `zone`, `normals`, `aim`, `splat` (with `mark` and `alloc`), `cast`,
//! `sweep`, `compare`; then the reduction to contact patches, which all backends share.

mod aim;
mod cast;
mod compare;
mod cull;
mod normals;
mod splat;
mod sweep;
mod zone;

use crate::patches::PatchScratch;
use crate::{
    Aabb, Backend, BackendError, PairQuery, PairResult, Params, PointCloud, Projection, RayHit,
    Surface, Tldi, Variant, View, VirtualCamera, paper,
};
use aim::{Hint, ZoneNormals};
use compare::Middles;
use cull::{CullScratch, Region, Survivors};
use glamx::{Pose3, Vec3};
use normals::NormalScratch;
use rayon::prelude::*;
use splat::{DepthScale, Fragments, Rect};
use std::sync::Mutex;
use zone::ZoneScratch;

/// Most near points of a cloud that are projected onto an exact surface to aim the camera; more do
/// not sharpen the mean of their normals.
const AIM_SAMPLES: usize = 512;

/// Compares pairs on the CPU, in parallel over pairs and over the points of large clouds.
///
/// Results are bit-identical at any number of threads. Memory is kept from call to call: a warm
/// backend allocates nothing.
///
/// ```
/// use tldi::{Backend, CpuBackend, PairQuery, Params, PointCloud, Surface, View};
/// use tldi::glamx::{Pose3, Vec3};
///
/// // Two 1 m square sheets, 5 cm spacing, 2 cm apart.
/// let points: Vec<Vec3> = (0..441)
///     .map(|i| Vec3::new((i % 21) as f32 * 0.05, 0.0, (i / 21) as f32 * 0.05))
///     .collect();
/// let sheet = PointCloud::builder(&points).radius(0.05).build()?;
/// let mut results = Vec::new();
/// CpuBackend::default().compare(
///     &[PairQuery {
///         a: Surface::Cloud(&sheet),
///         b: Surface::Cloud(&sheet),
///         a_from_b: Pose3::translation(0.0, 0.02, 0.0),
///         view: View::Aim { toward_b: Vec3::Y, last_axis: None },
///         params: Params::for_radius(0.05),
///     }],
///     &mut results,
/// )?;
/// assert!(!results[0].collides);
/// assert!((results[0].gap.unwrap() - 0.02).abs() < 1e-4);
/// assert!(results[0].patches[0].normal.y > 0.999);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Default)]
pub struct CpuBackend {
    pool: Mutex<Vec<Scratch>>,
}

impl CpuBackend {
    /// A backend with no memory taken yet.
    pub fn new() -> Self {
        Self::default()
    }

    fn with_scratch<R>(&self, run: impl FnOnce(&mut Scratch) -> R) -> R {
        // A panic while the lock is held leaves a list of scratch buffers, which is always valid.
        let pop = || {
            self.pool
                .lock()
                .unwrap_or_else(|poisoned| poisoned.into_inner())
                .pop()
        };
        let mut scratch = pop().unwrap_or_default();
        let result = run(&mut scratch);
        self.pool
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner())
            .push(scratch);
        result
    }
}

impl Backend for CpuBackend {
    fn name(&self) -> &str {
        "cpu"
    }

    fn compare(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<(), BackendError> {
        results.resize_with(batch.len(), PairResult::default);
        for (pair, query) in batch.iter().enumerate() {
            supported(query).map_err(|reason| BackendError::Unsupported { pair, reason })?;
        }
        let this = &*self;
        batch
            .par_iter()
            .zip(results.par_iter_mut())
            .for_each(|(query, result)| {
                result.clear();
                this.with_scratch(|scratch| scratch.compare(query, result));
            });
        Ok(())
    }
}

fn supported(query: &PairQuery) -> Result<(), &'static str> {
    let exact = [query.a, query.b]
        .iter()
        .filter(|s| matches!(s, Surface::Exact(_)))
        .count();
    if exact == 2 {
        return Err("both surfaces are exact: leave this pair to the physics engine");
    }
    if exact == 1 && query.params.variant() == Variant::Paper {
        return Err("the paper's variant compares clouds only: use Variant::Oriented");
    }
    if let View::Fixed(camera) = query.view
        && exact == 1
        && matches!(camera.projection, Projection::Perspective { .. })
    {
        return Err("exact surfaces need an orthographic camera");
    }
    let p = &query.params;
    if !(p.pixel_size > 0.0 && p.merge_gap > 0.0 && p.prediction >= 0.0) {
        return Err("pixel_size and merge_gap must be positive, prediction not negative");
    }
    Ok(())
}

/// The image of one cloud, all layers, with either variant.
///
/// With an orthographic camera of no fixed size the image follows the cloud. Allocates; the
/// backends reuse their memory instead. Cost: linear in points and fragments.
///
/// ```
/// use tldi::{Params, PointCloud, VirtualCamera, build, glamx::{Pose3, Vec3}};
/// let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::Z]).radius(0.1).build()?;
/// let camera = VirtualCamera::along(Vec3::Z, 0.1);
/// let image = build(&cloud, &Pose3::IDENTITY, &camera, &Params::for_radius(0.1));
/// assert_eq!(image.max_layers(), 2);
/// # Ok::<(), tldi::CloudError>(())
/// ```
pub fn build(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    camera: &VirtualCamera,
    params: &Params,
) -> Tldi {
    let mut out = Tldi::default();
    if params.variant() == Variant::Paper {
        paper::build(
            cloud,
            frame_from_cloud,
            camera,
            params,
            &mut paper::Scratch::default(),
            &mut out,
        );
        return out;
    }
    let mut side = Side::default();
    let everything = Region {
        overlap: cloud
            .bounds()
            .transformed(frame_from_cloud)
            .loosened(f32::MAX.sqrt()),
        other_from_frame: Pose3::IDENTITY,
        other_bounds: Aabb {
            min: Vec3::NEG_INFINITY,
            max: Vec3::INFINITY,
        },
    };
    cull::cull(
        cloud,
        frame_from_cloud,
        &everything,
        1,
        &mut side.cull,
        &mut side.points,
    );
    normals::normals(cloud, frame_from_cloud, &mut side.normals, &mut side.points);
    if let Some(seen) = side.fragments.project(&side.points, camera) {
        let scale = DepthScale::new(seen.near, params);
        side.image(cloud, camera, params, &seen.rect, &scale);
    }
    side.image
}

/// One side of a pair: its culled points and its image.
#[derive(Default)]
struct Side {
    points: Survivors,
    cull: CullScratch,
    normals: NormalScratch,
    fragments: Fragments,
    /// Indices of the near points, and their normals.
    near: Vec<u32>,
    near_normals: Vec<Vec3>,
    /// Greatest depth of a sampled point inside an exact surface, metres.
    deepest: f32,
    image: Tldi,
}

impl Side {
    /// `mark` to `sweep` for points that were projected.
    fn image(
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
struct Scratch {
    a: Side,
    b: Side,
    zone: ZoneScratch,
    hits: Vec<RayHit>,
    paper: [paper::Scratch; 2],
    patches: PatchScratch,
}

impl Scratch {
    fn compare(&mut self, query: &PairQuery, result: &mut PairResult) {
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
        self.patches
            .reduce(&result.contacts, &query.params, &mut result.patches);
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
        surface: &dyn crate::RaySurface,
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
        surface: &dyn crate::RaySurface,
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
