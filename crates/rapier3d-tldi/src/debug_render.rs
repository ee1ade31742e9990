//! Pictures of what the pipeline sees, through rapier's debug renderer.

use crate::narrow_phase::manifolds;
use crate::narrow_phase::parts::{PartPair, ShapePair, cloud_of, has_cloud, part, part_count};
use crate::step::candidates::{contact_reach, pose_of};
use crate::step::prepared::Spot;
use crate::step::report::cloud_pairs;
use crate::{PointCloudShape, TldiError, TldiPipeline};
use rapier3d::dynamics::{IntegrationParameters, RigidBodySet};
use rapier3d::geometry::{Collider, ColliderSet, NarrowPhase};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::bounding_volume::{Aabb, BoundingVolume};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject, PhysicsWorld};
use tldi::{Backend, CpuBackend, PairResult, VirtualCamera};

bitflags::bitflags! {
    /// What [`TldiPipeline::debug_render`] draws.
    ///
    /// ```
    /// use rapier3d_tldi::TldiDebugRenderMode;
    /// let mode = TldiDebugRenderMode::default() | TldiDebugRenderMode::CAMERAS;
    /// assert!(mode.contains(TldiDebugRenderMode::MANIFOLDS));
    /// ```
    #[derive(Copy, Clone, PartialEq, Eq, Debug)]
    pub struct TldiDebugRenderMode: u32 {
        /// The points of all clouds: a line of the point's radius along its normal, or a cross of
        /// three lines where the cloud has no normals. At most [`DEBUG_POINT_LIMIT`] a cloud.
        const POINTS = 1 << 0;
        /// For each pair of parts the region in which contacts are sought: where the bounds of the
        /// first, grown by how far contacts are looked for, and those of the second meet. A box along the
        /// axes of the first part.
        const CONTACT_ZONE = 1 << 1;
        /// For each view of a pair its axis, as long as four pixels, and the rectangle of the
        /// pixels in which it sees contacts.
        const CAMERAS = 1 << 2;
        /// For each contact pixel a line between the surfaces and one of a pixel's length from the
        /// middle along the normal. At most [`DEBUG_POINT_LIMIT`] a pair.
        const CONTACT_PIXELS = 1 << 3;
        /// For each contact of a manifold a line between the surfaces, which is its depth, and one
        /// of two pixels' length from the first surface along the normal.
        const MANIFOLDS = 1 << 4;
    }
}

impl Default for TldiDebugRenderMode {
    fn default() -> Self {
        Self::POINTS | Self::MANIFOLDS
    }
}

/// Most points of one cloud, and contact pixels of one pair, that are drawn. If there are more,
/// every n-th is drawn.
///
/// ```
/// # use rapier3d::prelude::*;
/// # use rapier3d_tldi::{DEBUG_POINT_LIMIT, TldiDebugRenderMode, prelude::*};
/// # use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
/// # struct Lines(Vec<[Vector; 2]>);
/// # impl DebugRenderBackend for Lines {
/// #     fn draw_line(&mut self, _: DebugRenderObject, a: Vector, b: Vector, _: DebugColor) {
/// #         self.0.push([a, b]);
/// #     }
/// # }
/// let points: Vec<Vector> = (0..DEBUG_POINT_LIMIT + 2).map(|i| i as f32 * Vector::X).collect();
/// let cloud = PointCloud::builder(points).radius(1.0).build()?;
/// let mut world = PhysicsWorld::default();
/// let tldi = TldiPipeline::new(TldiConfig::default())?;
/// world.insert(RigidBodyBuilder::fixed(), tldi.collider(cloud));
/// let mut lines = Lines(Vec::new());
/// tldi.debug_render(&world, &mut lines, TldiDebugRenderMode::POINTS)?;
/// assert_eq!(lines.0.len(), 3 * (DEBUG_POINT_LIMIT / 2 + 1)); // every second point, as a cross
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub const DEBUG_POINT_LIMIT: usize = 10_000;

/// Colours, as hue in degrees, saturation, lightness and alpha.
const POINT_COLOR: DebugColor = [210.0, 0.6, 0.6, 1.0];
const ZONE_COLOR: DebugColor = [60.0, 0.8, 0.5, 1.0];
const CAMERA_COLOR: DebugColor = [280.0, 0.8, 0.6, 1.0];
const PIXEL_COLOR: DebugColor = [30.0, 1.0, 0.5, 1.0];
const PIXEL_NORMAL_COLOR: DebugColor = [180.0, 0.8, 0.5, 1.0];
const DEPTH_COLOR: DebugColor = [120.0, 1.0, 0.4, 1.0];
const NORMAL_COLOR: DebugColor = [0.0, 1.0, 1.0, 1.0];

/// Length of a view axis and of a contact's normal, in pixels.
const AXIS_PIXELS: f32 = 4.0;
const NORMAL_PIXELS: f32 = 2.0;

impl TldiPipeline {
    /// Draws clouds and contacts at the colliders' present poses.
    ///
    /// The step keeps nothing for this. All pairs of rapier's narrow phase, sleeping ones included,
    /// are compared again on the CPU, one by one. So the picture shows the present state, and it
    /// costs as much as the comparison of a step (nothing for
    /// [`POINTS`](TldiDebugRenderMode::POINTS) alone). Objects that
    /// [`DebugRenderBackend::filter_object`] declines are neither compared nor drawn. Points belong
    /// to a [`DebugRenderObject::Collider`], everything else to a
    /// [`DebugRenderObject::ContactPair`].
    ///
    /// Rapier's own [`DebugRenderPipeline`](rapier3d::pipeline::DebugRenderPipeline) draws the
    /// contacts of the last step, and nothing for a cloud.
    ///
    /// # Errors
    /// [`TldiError::Pair`] where a pair cannot be compared; what was drawn before stays.
    ///
    /// ```
    /// use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
    /// use rapier3d::prelude::*;
    /// use rapier3d_tldi::{TldiDebugRenderMode, prelude::*};
    ///
    /// struct Lines(Vec<[Vector; 2]>);
    /// impl DebugRenderBackend for Lines {
    ///     fn draw_line(&mut self, _: DebugRenderObject, a: Vector, b: Vector, _: DebugColor) {
    ///         self.0.push([a, b]);
    ///     }
    /// }
    ///
    /// let points: Vec<Vector> = (0..400)
    ///     .map(|i| Vector::new((i % 20) as f32, 0.0, (i / 20) as f32) * 0.1)
    ///     .collect();
    /// let mut world = PhysicsWorld::default();
    /// let mut tldi = TldiPipeline::new(TldiConfig::default())?;
    /// tldi.attach(&mut world);
    /// let floor = PointCloud::builder(points).radius(0.1).build()?;
    /// world.insert(RigidBodyBuilder::fixed(), tldi.collider(floor));
    /// let at = Vector::new(1.0, 0.2, 1.0);
    /// world.insert(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::ball(0.2));
    /// tldi.step(&mut world)?;
    ///
    /// let mut lines = Lines(Vec::new());
    /// tldi.debug_render(&world, &mut lines, TldiDebugRenderMode::MANIFOLDS)?;
    /// assert!(!lines.0.is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn debug_render(
        &self,
        world: &PhysicsWorld,
        backend: &mut impl DebugRenderBackend,
        mode: TldiDebugRenderMode,
    ) -> Result<(), TldiError> {
        let (bodies, colliders) = (&world.bodies, &world.colliders);
        let (integration, pairs) = (&world.integration_parameters, &world.narrow_phase);
        self.debug_render_sets(integration, bodies, colliders, pairs, backend, mode)
    }

    /// [`debug_render`](Self::debug_render) for split sets.
    ///
    /// # Errors
    /// Those of [`debug_render`](Self::debug_render).
    ///
    /// ```
    #[doc = example_world!()]
    /// # use rapier3d_tldi::TldiDebugRenderMode;
    /// # use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
    /// # struct Lines(Vec<[Vector; 2]>);
    /// # impl DebugRenderBackend for Lines {
    /// #     fn draw_line(&mut self, _: DebugRenderObject, a: Vector, b: Vector, _: DebugColor) {
    /// #         self.0.push([a, b]);
    /// #     }
    /// # }
    /// let mut lines = Lines(Vec::new());
    /// tldi.debug_render_sets(
    ///     &world.integration_parameters,
    ///     &world.bodies,
    ///     &world.colliders,
    ///     &world.narrow_phase,
    ///     &mut lines,
    ///     TldiDebugRenderMode::POINTS,
    /// )?;
    /// assert_eq!(lines.0.len(), 3 * 400); // crosses: the cloud has no normals
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn debug_render_sets(
        &self,
        integration: &IntegrationParameters,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        narrow_phase: &NarrowPhase,
        backend: &mut impl DebugRenderBackend,
        mode: TldiDebugRenderMode,
    ) -> Result<(), TldiError> {
        if mode.contains(TldiDebugRenderMode::POINTS) {
            for (handle, collider) in colliders.iter() {
                let object = DebugRenderObject::Collider(handle, collider);
                if has_cloud(collider.shape()) && backend.filter_object(object) {
                    draw_clouds(collider, &pose_of(collider, bodies), object, backend);
                }
            }
        }
        if mode == TldiDebugRenderMode::POINTS || mode.is_empty() {
            return Ok(());
        }
        let mut spot = Spot::default();
        for pair in cloud_pairs(narrow_phase, colliders) {
            let ends = colliders
                .get(pair.collider1)
                .zip(colliders.get(pair.collider2));
            let Some((collider1, collider2)) = ends else {
                continue;
            };
            let object = DebugRenderObject::ContactPair(pair, collider1, collider2);
            if !backend.filter_object(object) {
                continue;
            }
            let pose1 = pose_of(collider1, bodies);
            let pos12 = pose1.inv_mul(&pose_of(collider2, bodies));
            let reach = contact_reach(collider1, collider2, bodies, integration);
            let shapes = ShapePair::new(collider1.shape(), collider2.shape(), pos12, reach);
            if !shapes.is_within_reach() {
                continue;
            }
            spot.compare(shapes, &self.config(), CpuBackend::compare)
                .map_err(|source| TldiError::Pair {
                    collider1: pair.collider1,
                    collider2: pair.collider2,
                    source,
                })?;
            let mut drawing = Drawing {
                shapes: &shapes,
                pose1,
                object,
                backend: &mut *backend,
            };
            drawing.draw(mode, &spot);
        }
        Ok(())
    }
}

/// Where the lines of a pair go.
struct Drawing<'a, B> {
    shapes: &'a ShapePair<'a>,
    /// From the frame of shape 1 into the world.
    pose1: Pose,
    object: DebugRenderObject<'a>,
    backend: &'a mut B,
}

impl<B: DebugRenderBackend> Drawing<'_, B> {
    fn draw(&mut self, mode: TldiDebugRenderMode, spot: &Spot) {
        let mut largest_pixel = 0.0;
        for part_pair in &spot.parts {
            let Some(comparison) = &part_pair.comparison else {
                continue;
            };
            largest_pixel = f32::max(largest_pixel, comparison.pixel_size());
            let result = &spot.results[comparison.query];
            let pixel_size = comparison.pixel_size() * result.coarser.unwrap_or(1.0);
            let world_from_part = part_pair.world_from_a(&self.pose1);
            let zone = self.zone(part_pair);
            if mode.contains(TldiDebugRenderMode::CONTACT_ZONE) {
                self.draw_box(&zone, &world_from_part);
            }
            if mode.contains(TldiDebugRenderMode::CAMERAS) {
                for view in 0..result.axes.len() {
                    self.draw_camera(result, view, pixel_size, &zone, &world_from_part);
                }
            }
            if mode.contains(TldiDebugRenderMode::CONTACT_PIXELS) {
                self.draw_pixels(result, pixel_size, &world_from_part);
            }
        }
        if mode.contains(TldiDebugRenderMode::MANIFOLDS) {
            self.draw_manifolds(&spot.parts, &spot.results, NORMAL_PIXELS * largest_pixel);
        }
    }

    fn line(&mut self, pose: &Pose, [a, b]: [Vector; 2], color: DebugColor) {
        self.backend
            .draw_line(self.object, *pose * a, *pose * b, color);
    }

    /// See [`TldiDebugRenderMode::CONTACT_ZONE`]; in the frame of the first part.
    fn zone(&self, part_pair: &PartPair) -> Aabb {
        let [index1, index2] = part_pair.indices;
        let (_, part1) = part(self.shapes.shape1, index1);
        let (_, part2) = part(self.shapes.shape2, index2);
        let bounds1 = part1.compute_local_aabb().loosened(self.shapes.prediction);
        let bounds2 = part2.compute_aabb(&part_pair.a_from_b);
        Aabb::new(
            bounds1.mins.max(bounds2.mins),
            bounds1.maxs.min(bounds2.maxs),
        )
    }

    fn draw_box(&mut self, bounds: &Aabb, pose: &Pose) {
        let corners = bounds.vertices();
        // The bits of a corner's number do not tell its place: edges are those along one axis.
        for (i, a) in corners.iter().enumerate() {
            for b in &corners[i + 1..] {
                if (*a - *b).abs().cmpgt(Vector::ZERO).bitmask().count_ones() == 1 {
                    self.line(pose, [*a, *b], ZONE_COLOR);
                }
            }
        }
    }

    fn draw_camera(
        &mut self,
        result: &PairResult,
        view: usize,
        pixel_size: f32,
        zone: &Aabb,
        pose: &Pose,
    ) {
        let axis = result.axes[view];
        let camera = VirtualCamera::along(axis, pixel_size);
        let pixels = || result.contacts.iter().filter(|c| c.view as usize == view);
        let mut eye = zone.center();
        if pixels().next().is_some() {
            let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
            let mut depth = f32::MAX;
            for contact in pixels() {
                for k in 0..2 {
                    low[k] = low[k].min(contact.pixel[k]);
                    high[k] = high[k].max(contact.pixel[k] + 1);
                }
                let nearest =
                    [contact.point_a, contact.point_b].map(|point| camera.view_from_point(point).z);
                depth = nearest.into_iter().fold(depth, f32::min);
            }
            let corner = |u: i32, v: i32| camera.point_at(u as f32, v as f32, depth);
            let corners = [
                corner(low[0], low[1]),
                corner(high[0], low[1]),
                corner(high[0], high[1]),
                corner(low[0], high[1]),
            ];
            for k in 0..4 {
                self.line(pose, [corners[k], corners[(k + 1) % 4]], CAMERA_COLOR);
            }
            eye = corners[0].midpoint(corners[2]);
        }
        let behind = eye - AXIS_PIXELS * pixel_size * axis;
        self.line(pose, [behind, eye], CAMERA_COLOR);
    }

    fn draw_pixels(&mut self, result: &PairResult, pixel_size: f32, pose: &Pose) {
        let step = result.contacts.len().div_ceil(DEBUG_POINT_LIMIT).max(1);
        for contact in result.contacts.iter().step_by(step) {
            self.line(pose, [contact.point_a, contact.point_b], PIXEL_COLOR);
            let middle = contact.middle();
            let tip = middle + pixel_size * contact.normal();
            self.line(pose, [middle, tip], PIXEL_NORMAL_COLOR);
        }
    }

    fn draw_manifolds(&mut self, parts: &[PartPair], results: &[PairResult], normal_length: f32) {
        let mut filled = Vec::new();
        manifolds::fill(self.shapes, None, parts, results, &mut filled, &mut None);
        let (pose1, pose2) = (self.pose1, self.pose1 * self.shapes.pos12);
        for manifold in &filled {
            let normal = pose1.rotation * manifold.local_n1;
            for point in &manifold.points {
                let (point1, point2) = (pose1 * point.local_p1, pose2 * point.local_p2);
                self.backend
                    .draw_line(self.object, point1, point2, DEPTH_COLOR);
                let tip = point1 + normal_length * normal;
                self.backend
                    .draw_line(self.object, point1, tip, NORMAL_COLOR);
            }
        }
    }
}

/// See [`TldiDebugRenderMode::POINTS`].
fn draw_clouds(
    collider: &Collider,
    pose: &Pose,
    object: DebugRenderObject<'_>,
    backend: &mut impl DebugRenderBackend,
) {
    for index in 0..part_count(collider.shape()) {
        let (part_pose, shape) = part(collider.shape(), index);
        let Some(cloud) = cloud_of(shape).map(PointCloudShape::cloud) else {
            continue;
        };
        let pose = *pose * part_pose.copied().unwrap_or(Pose::IDENTITY);
        let step = cloud.len().div_ceil(DEBUG_POINT_LIMIT).max(1);
        for i in (0..cloud.len()).step_by(step) {
            let (point, radius) = (cloud.point(i), cloud.radius(i));
            let mut line = |a: Vector, b: Vector| {
                backend.draw_line(object, pose * a, pose * b, POINT_COLOR);
            };
            match cloud.normals() {
                Some(normals) => line(point, point + radius * normals[i]),
                None => {
                    for axis in [Vector::X, Vector::Y, Vector::Z] {
                        line(point - 0.5 * radius * axis, point + 0.5 * radius * axis);
                    }
                }
            }
        }
    }
}
