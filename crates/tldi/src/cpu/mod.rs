//! The CPU backend: the reference that every other backend is compared with.
//!
//! One file or folder a stage: `cull`, `zone`, `aim` (`camera_policy.rs`), `columns`, `normals`, `splat` (with `mark` and
//! `alloc`), `exact` (rays through exact surfaces), `sweep`, `compare`; then the reduction to contact patches, which all
//! backends share. `pair` runs them, `scratch` holds what a pair needs and the steps that all looks share, `side` those of
//! one cloud. `first_look` settles deep contacts with large pixels, `motion` compares the images of a motion. `lanes` is
//! what makes inner loops SIMD.

pub(crate) mod columns;
pub(crate) mod compare;
pub(crate) mod crossings;
pub(crate) mod cull;
mod exact;
mod first_look;
mod fold;
mod held;
mod lanes;
mod motion;
pub(crate) mod normals;
mod pair;
mod pixel_column;
pub(crate) mod rect;
mod rims;
pub(crate) mod room;
mod scratch;
mod side;
pub(crate) mod splat;
mod splat_radius;
pub(crate) mod sweep;
pub(crate) mod ways_out;
pub(crate) mod zone;

use crate::{
    Backend, BackendError, Impact, ImpactQuery, PairQuery, PairResult, Params, PointCloud, Surface,
    Tldi, Variant, VirtualCamera, Work, paper,
};
use cull::Region;
use glamx::Pose3;
use rayon::prelude::*;
use room::{Cost, Room};
use scratch::Scratch;
use side::{CloudView, Side};
use std::sync::{Mutex, PoisonError};

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
///         view: View::aimed(),
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
    /// Boxed: each has 100 kB. To move these took most of the time of a pair that does not touch.
    pool: Mutex<Vec<Box<Scratch>>>,
    is_without_first_look: bool,
}

impl CpuBackend {
    /// A backend that has allocated nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// A backend without the first look: it draws the whole contact zone with small pixels, even
    /// for deep contacts. It is the reference for backends that have no large pixels, such as the
    /// GPU's. In deep contact it takes 3 to 70 times as long as [`new`](Self::new).
    ///
    /// ```
    /// use tldi::{Backend, CpuBackend};
    /// assert_eq!(CpuBackend::without_first_look().name(), CpuBackend::new().name());
    /// ```
    pub fn without_first_look() -> Self {
        Self {
            is_without_first_look: true,
            ..Self::default()
        }
    }

    /// Where a surface in straight motion first meets another, or `None` where it does not.
    ///
    /// The distance is within a depth error of the images where the surfaces meet face on (0.1 r̄
    /// of the coarser cloud), and within a pixel over the cosine between normal and motion where
    /// they do not. Surfaces are met from behind, too. Solids with oriented normals are not, so
    /// that a body inside may leave. Cost: reading both clouds and the layers in the way of the
    /// motion.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with pair 0: no side is a cloud, or bad parameters.
    ///
    /// ```
    /// use tldi::{CpuBackend, ImpactQuery, Params, PointCloud, Surface};
    /// use tldi::glamx::{Pose3, Vec3};
    ///
    /// let points: Vec<Vec3> = (0..441)
    ///     .map(|i| Vec3::new((i % 21) as f32 * 0.05, 0.0, (i / 21) as f32 * 0.05))
    ///     .collect();
    /// let sheet = PointCloud::builder(&points).radius(0.05).build()?;
    /// let impact = CpuBackend::new().impact(&ImpactQuery {
    ///     a: Surface::Cloud(&sheet),
    ///     b: Surface::Cloud(&sheet),
    ///     a_from_b: Pose3::translation(0.0, 2.0, 0.0),
    ///     motion: Vec3::new(0.0, -5.0, 0.0),
    ///     touching: 0.0,
    ///     core_only: false,
    ///     penetration: None,
    ///     turned: &[],
    ///     params: Params::for_radius(0.05),
    /// })?;
    /// let impact = impact.expect("the sheets meet");
    /// assert!((impact.distance - 2.0).abs() < 1e-3);
    /// assert!(impact.normal.y > 0.999);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn impact(&self, query: &ImpactQuery) -> Result<Option<Impact>, BackendError> {
        self.impact_within(query, &mut Room::default())
    }

    /// The same for a piece of a motion, all pieces of which share a [`Room`]. The example is there.
    ///
    /// # Errors
    /// As [`impact`](Self::impact).
    pub fn impact_within(
        &self,
        query: &ImpactQuery,
        room: &mut Room,
    ) -> Result<Option<Impact>, BackendError> {
        query
            .check()
            .map_err(|reason| BackendError::Unsupported { pair: 0, reason })?;
        Ok(self.with_room(room, |scratch| scratch.impact(query)))
    }

    /// Compares a pair in a piece of a motion, all pieces of which share a [`Room`].
    /// [`compare`](Backend::compare) gives each pair a room of its own.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with pair 0, as [`compare`](Backend::compare).
    ///
    /// ```
    /// use tldi::{CpuBackend, PairQuery, PairResult, Params, PointCloud, Room, Surface, View};
    /// use tldi::glamx::{Pose3, Vec3};
    ///
    /// let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::X]).radius(0.6).build()?;
    /// let (mut result, mut room) = (PairResult::default(), Room::default());
    /// let query = PairQuery {
    ///     a: Surface::Cloud(&cloud),
    ///     b: Surface::Cloud(&cloud),
    ///     a_from_b: Pose3::translation(0.0, 0.3, 0.0),
    ///     view: View::aimed(),
    ///     params: Params::for_radius(0.6),
    /// };
    /// CpuBackend::new().compare_within(&query, &mut room, &mut result)?;
    /// assert_eq!(result.coarser, room.coarser());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn compare_within(
        &self,
        query: &PairQuery<'_>,
        room: &mut Room,
        result: &mut PairResult,
    ) -> Result<(), BackendError> {
        query
            .check()
            .map_err(|reason| BackendError::Unsupported { pair: 0, reason })?;
        self.compare_checked(query, room, result);
        Ok(())
    }

    fn compare_checked(&self, query: &PairQuery, room: &mut Room, result: &mut PairResult) {
        result.clear();
        self.with_room(room, |scratch| {
            scratch.work = Work::default();
            scratch.compare(query, !self.is_without_first_look, result);
            result.work = scratch.work;
        });
    }

    fn with_room<R>(&self, room: &mut Room, run: impl FnOnce(&mut Scratch) -> R) -> R {
        // A panic while the lock is held leaves a list of scratch buffers, which is always valid.
        let pool = || self.pool.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = pool().pop().unwrap_or_default();
        std::mem::swap(&mut scratch.shared.room, room);
        let result = run(&mut scratch);
        std::mem::swap(&mut scratch.shared.room, room);
        pool().push(scratch);
        result
    }
}

impl std::fmt::Debug for CpuBackend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CpuBackend").finish_non_exhaustive()
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
        for (pair, query) in batch.iter().enumerate() {
            query
                .check()
                .map_err(|reason| BackendError::Unsupported { pair, reason })?;
        }
        results.resize_with(batch.len(), PairResult::default);
        let this = &*self;
        batch
            .par_iter()
            .zip(results.par_iter_mut())
            .for_each(|(query, result)| {
                this.compare_checked(query, &mut Room::default(), result);
            });
        Ok(())
    }
}

/// The image of one cloud, all layers, with either variant.
///
/// With an orthographic camera of no fixed size the image follows the cloud, in larger pixels ([`Tldi::camera`] says
/// which) where these would be more than 4 Mi and 16 for each point. Allocates; the
/// backends reuse their memory instead. Cost: linear in points and fragments. An image without pixels where a backend
/// refuses the parameters ([`Params::check`]) or the camera.
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
    let surface = Surface::Cloud(cloud);
    if params.check().is_err() || camera.check(&[surface]).is_err() {
        return out;
    }
    if params.variant() == Variant::Paper {
        let mut scratch = paper::Scratch::default();
        paper::build(
            cloud,
            frame_from_cloud,
            camera,
            params,
            &mut scratch,
            &mut out,
        );
        return out;
    }
    let mut side = Side::default();
    let bounds = cloud.bounds().transformed(frame_from_cloud);
    let everything = Region::of_box(bounds.loosened(f32::MAX.sqrt()));
    let (scratch, points) = (&mut side.cull, &mut side.points);
    cull::cull(cloud, frame_from_cloud, &everything, 1, scratch, points);
    let mut camera = *camera;
    let mut room = Room::default();
    loop {
        let view = CloudView {
            cloud,
            frame_from_cloud,
            camera: &camera,
            params,
            sharpens: true,
        };
        if let Some(seen) = side.project(&view) {
            let points = side.points.len();
            let fragments = side.fragments_in(&view, &seen.rect, seen.near, points);
            if camera.size.is_none()
                && room.refuses(Cost::new(&seen.rect, points, fragments))
                && let Some(coarser) = room.take_wanted()
            {
                camera = camera.coarser(coarser);
                continue;
            }
            side.whole_image(&view, &seen, seen.rect);
        }
        return side.image;
    }
}
