//! Stage `impact`: where a surface in straight motion first meets another.
//!
//! A camera looks along the motion. In each pixel, the moving surface can go from where the ray leaves it to where the
//! ray enters the other one. The least of these distances is the distance to the impact. The images hold all that the
//! motion passes, so no surface is too thin, and none too fast.

use crate::cloud::reach::Ring;
use crate::contact::lone_points::LonePoints;
use crate::cpu::crossings::neighbors_toward;
use crate::cpu::cull::{self, PointRadii, Region};
use crate::cpu::exact::placed::Placed;
use crate::cpu::fold::ViewFold;
use crate::cpu::motion::core::{BORDER, CORE, CoreScratch, OUTSIDE, RIM};
use crate::cpu::motion::meeting::Meeting;
use crate::cpu::scratch::{Look, Scratch};
use crate::cpu::side::Scope;
use crate::cpu::sweep::is_edge_on;
use crate::pair::plan::ring;
use crate::pair::sampling::stride;
use crate::stage::stage;
use crate::{Aabb, Facing, Impact, ImpactQuery, Layer, Penetration, Surface, Tldi, VirtualCamera};
use glamx::{Pose3, Vec2, Vec3};

/// Normals are averaged over the pixels whose distance is within this many pixels of the least. Half or twice: no row
/// changes.
const IMPACT_BAND: f32 = 0.5;

/// Least cosine between the normal of a penetration and the normal of the surface that it leaves from behind. Half or
/// twice the angle: no change.
const FROM_BEHIND: f32 = 0.5;

impl Scratch {
    /// The first meeting.
    pub(crate) fn impact(&mut self, query: &ImpactQuery) -> Option<Impact> {
        let _stage = stage!("impact");
        self.impact_coarser(query, 1.0)
    }

    /// The first meeting, with pixels that are larger than asked for by a factor of `coarser` already.
    fn impact_coarser(&mut self, query: &ImpactQuery, coarser: f32) -> Option<Impact> {
        let length = query.motion.length();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let camera = VirtualCamera::along(query.motion, query.params.pixel_size);
        let rings = [query.a, query.b].map(|surface| ring(&surface, &query.params));
        let widest_ring = rings[0].widest().max(rings[1].widest());
        self.cull_swept(query, &camera, rings, widest_ring)?;
        let reach = length + query.params.prediction + widest_ring;
        if !self.reaches_exact(query, reach) {
            return None;
        }
        let [params_a, params_b] =
            [query.a, query.b].map(|surface| query.params.of_surface(surface.mean_radius()));
        let look = Look {
            surfaces: [query.a, query.b],
            a_from_b: &query.a_from_b,
            camera: &camera,
            params: [&params_a, &params_b],
            sharpens: false,
        };
        // The rim of an exact surface that moves is not that of the cloud.
        let scope = match query.b {
            Surface::Exact(_) => Scope::Everywhere(length),
            _ => Scope::Ahead(reach),
        };
        let seen = self.look_at(&look, length + query.params.thickness, scope);
        if let Some(by) = self.shared.room.take_wanted() {
            let coarser = by * coarser;
            self.shared.room.tell(coarser);
            let pixel_size = by * query.params.pixel_size;
            let larger = ImpactQuery {
                params: query.params.with_pixel_size(pixel_size),
                ..*query
            };
            return self.impact_coarser(&larger, coarser);
        }
        seen?;
        let (a, b) = (&self.a.image, &self.b.image);
        if query.core_only {
            match query.b {
                Surface::Cloud(cloud) => {
                    let radius = PointRadii::new(cloud, &self.b.points).mean();
                    self.core.cover_by_points(b, &self.b.columns, radius);
                }
                _ => self.core.cover_by_image(b),
            }
            self.core.find(b.size[0]);
        }
        let motion = Motion {
            query,
            length,
            camera: &camera,
            images: [a, b],
            core: &self.core,
            fold: &self.shared.fold,
        };
        let pixels = 0..b.pixel_count();
        self.meetings.clear();
        (self.meetings).extend(pixels.filter_map(|pixel| motion.nearest(pixel, f32::NEG_INFINITY)));
        self.meetings.sort_unstable_by(Meeting::order);
        motion.pass_lone_points(&mut self.meetings, &mut self.patches.lone_points);
        let first = self.meetings.first()?;
        // A single pixel's normal may be that of a rim.
        let near = first.distance + IMPACT_BAND * query.params.pixel_size;
        let normals = self.meetings.iter().filter(|m| m.distance <= near);
        let normal: Vec3 = normals.map(|m| m.normal).sum();
        let frame_from_view = camera.view_from_frame.rotation.inverse();
        Some(Impact {
            distance: first.distance,
            point: motion.point(first.pixel, first.depth),
            normal: (frame_from_view * normal).normalize_or(-camera.axis()),
            coarser: (coarser > 1.0).then_some(coarser),
        })
    }

    /// Whether a culled point may be within `reach` metres of an exact surface, if one of both is exact.
    fn reaches_exact(&mut self, query: &ImpactQuery, reach: f32) -> bool {
        let (side, surface, frame_from_surface) = match (query.a, query.b) {
            (Surface::Exact(surface), _) => (&mut self.b, surface, &Pose3::IDENTITY),
            (_, Surface::Exact(surface)) => (&mut self.a, surface, &query.a_from_b),
            _ => return true,
        };
        let exact = Placed {
            surface,
            frame_from_surface,
        };
        side.in_near_cells(&exact, reach, 0.0);
        !side.kept.is_empty()
    }

    /// Fills both sides with the points that the motion can bring together. `None` if there are none.
    fn cull_swept(
        &mut self,
        query: &ImpactQuery,
        camera: &VirtualCamera,
        [ring_a, ring_b]: [Ring; 2],
        widest_ring: f32,
    ) -> Option<()> {
        let widest = query.params.prediction + widest_ring;
        let way = query.motion.length() * Vec3::Z;
        let view_from_a = camera.view_from_frame;
        let seen_a = query.a.bounds().transformed(&view_from_a).loosened(widest);
        let view_from_b = view_from_a * query.a_from_b;
        let seen_b = query.b.bounds().transformed(&view_from_b).loosened(widest);
        let mut met_by_b = Aabb {
            min: seen_b.min,
            max: seen_b.max + way,
        };
        let mut meeting_a = Aabb {
            min: seen_a.min - way,
            max: seen_a.max,
        };
        if !seen_a.intersects(&met_by_b) {
            return None;
        }
        // What lies in front of a layer of `b` tells whether it leads; what lies beside it, whether it is of the rim.
        // Both belong to the region.
        meeting_a.max.z = meeting_a.max.z.max(seen_b.max.z);
        let beside = (BORDER + 1) as f32 * query.params.pixel_size * Vec3::new(1.0, 1.0, 0.0);
        (meeting_a.min, meeting_a.max) = (meeting_a.min - beside, meeting_a.max + beside);
        if query.a.is_oriented() {
            // What lies behind a layer of `a` tells whether `b` is inside.
            met_by_b.min.z = met_by_b.min.z.min(seen_a.min.z);
        }
        let frame_from_view = view_from_a.inverse();
        let sides = [
            (&mut self.a, query.a, Pose3::IDENTITY, met_by_b),
            (&mut self.b, query.b, query.a_from_b, meeting_a),
        ];
        let rings = [[ring_a, ring_b], [ring_b, ring_a]];
        for ((side, surface, frame, region), [own, other]) in sides.into_iter().zip(rings) {
            side.near.clear();
            let Surface::Cloud(cloud) = surface else {
                side.points.clear();
                continue;
            };
            let included = own.beside(&other);
            let margin = query.params.prediction + included;
            let region = region.loosened(included - widest_ring);
            let region = Region {
                overlap: region
                    .transformed(&frame_from_view)
                    .intersection(cloud.bounds().transformed(&frame).loosened(margin)),
                other_from_frame: view_from_a,
                other_bounds: region,
                ring: own,
                included,
            };
            let stride = stride(cloud.mean_radius(), query.params.pixel_size);
            cull::cull(
                cloud,
                &frame,
                &region,
                stride,
                &mut side.cull,
                &mut side.points,
            );
            if side.points.is_empty() {
                return None;
            }
        }
        Some(())
    }
}

/// The images along a motion.
struct Motion<'a> {
    query: &'a ImpactQuery<'a>,
    /// Of the motion, metres.
    length: f32,
    camera: &'a VirtualCamera,
    /// Of the surface at rest, and of the one that moves.
    images: [&'a Tldi; 2],
    core: &'a CoreScratch,
    fold: &'a ViewFold,
}

impl Motion<'_> {
    /// The nearest meeting in a pixel that is farther than `beyond` metres along the motion.
    fn nearest(&self, pixel: usize, beyond: f32) -> Option<Meeting> {
        let (query, length) = (self.query, self.length);
        let [a, b] = self.images;
        let place = match query.core_only {
            true => self.core.place(pixel, b.size[0]),
            false => CORE,
        };
        if place == OUTSIDE {
            return None;
        }
        let (layers, moving) = (a.layers_of(pixel), b.layers_of(pixel));
        let width = b.size[0];
        let at = [pixel as u32 % width, pixel as u32 / width];
        let are_left = || {
            let mut beside = neighbors_toward(b, at, Vec2::ZERO).flatten().flatten();
            beside.any(|layer| layer.facing == Facing::Exit)
        };
        let leading = (0..moving.len()).filter(|&l| is_leading(moving, l, are_left));
        let met = |l: usize| {
            (0..layers.len())
                .filter(|&k| !leaves_solid(&layers[..=k]))
                .map(move |k| Meeting::new(pixel, &layers[k], &moving[l], &query.params))
        };
        let in_way = |meeting: &Meeting| {
            let approach = meeting.facing * (length - meeting.distance);
            !query.leaves_at(meeting, self.camera)
                && (place == CORE || approach > RIM as f32 * query.params.pixel_size)
                && (0.0..=length).contains(&meeting.distance)
                && (meeting.distance >= query.touching || approach > query.params.pixel_size)
        };
        leading
            .flat_map(met)
            .filter(|meeting| meeting.distance > beyond && in_way(meeting) && self.goes_in(meeting))
            .min_by(|m, n| m.distance.total_cmp(&n.distance))
    }

    /// Whether the point of `b` that meets `a` goes in by more than a pixel later, if that is known.
    fn goes_in(&self, meeting: &Meeting) -> bool {
        let query = self.query;
        if query.turned.is_empty() {
            return true;
        }
        let frame_from_view = self.camera.view_from_frame.rotation.inverse();
        let normal = frame_from_view * meeting.met_normal;
        let place = self.point(meeting.pixel, meeting.depth);
        let before = self.point(meeting.pixel, meeting.depth - meeting.distance);
        let of_b = query.a_from_b.inverse() * before;
        let height = |pose: &Pose3| normal.dot(*pose * of_b - place);
        (query.turned.iter()).any(|pose| height(pose) < -query.params.pixel_size)
    }

    /// The place in a pixel at `depth` metres, in the frame of the query.
    fn point(&self, pixel: usize, depth: f32) -> Vec3 {
        let image = self.images[1];
        let width = image.size[0] as usize;
        let at = [pixel % width, pixel / width];
        let at = [0, 1].map(|k| image.origin[k] + at[k] as i32);
        let [u, v] = self.fold.unfolded(at).map(|c| c as f32 + 0.5);
        self.camera.point_at(u, v, depth)
    }

    /// Removes the first of the ordered `meetings` as long as it is with a point that stands alone. Its pixel then meets
    /// what lies behind.
    fn pass_lone_points(&self, meetings: &mut Vec<Meeting>, lone_points: &mut LonePoints) {
        let b_from_a = self.query.a_from_b.inverse();
        lone_points.begin();
        let mut is_lone = |meeting: &Meeting| {
            let before = self.point(meeting.pixel, meeting.depth - meeting.distance);
            let mut of = |side: usize, place: Vec3| match [self.query.a, self.query.b][side] {
                Surface::Cloud(cloud) => lone_points.is_alone(side, cloud, place),
                Surface::Exact(_) | Surface::Device(_) => false,
            };
            of(0, self.point(meeting.pixel, meeting.depth)) || of(1, b_from_a * before)
        };
        let mut lone = 0;
        while let Some(meeting) = meetings.get(lone).filter(|meeting| is_lone(meeting)) {
            let Some(behind) = self.nearest(meeting.pixel, meeting.distance) else {
                lone += 1;
                continue;
            };
            let is_before = |m: &Meeting| m.order(&behind).is_lt();
            let passed = meetings[lone + 1..].partition_point(is_before);
            meetings[lone] = behind;
            meetings[lone..=lone + passed].rotate_left(1);
        }
        meetings.drain(..lone);
    }
}

impl ImpactQuery<'_> {
    /// Whether `b` leaves here the surface that it penetrates: from behind, and from no deeper than it is.
    fn leaves_at(&self, meeting: &Meeting, camera: &VirtualCamera) -> bool {
        self.penetration
            .is_some_and(|Penetration { normal, depth }| {
                let normal = camera.view_from_frame.rotation * normal;
                normal.dot(meeting.normal) <= -FROM_BEHIND
                    && normal.z * meeting.distance <= depth + self.params.pixel_size
            })
    }
}

/// Whether the ray has entered a solid and leaves it at the last of `layers`. What is inside such a solid may leave. A
/// sheet that the ray leaves without having entered is met from behind.
fn leaves_solid(layers: &[Layer]) -> bool {
    let mut known = layers.iter().rev().filter(|layer| !is_edge_on(layer));
    layers
        .last()
        .is_some_and(|layer| !is_edge_on(layer) && layer.facing == Facing::Exit)
        && known
            .nth(1)
            .is_some_and(|layer| layer.facing == Facing::Entry)
}

/// Whether a ray leaves the moving surface at this layer. If its side is unknown, the ray leaves at every second layer and
/// at the last. `are_left` tells whether rays leave it beside this one.
fn is_leading(layers: &[Layer], index: usize, are_left: impl Fn() -> bool) -> bool {
    let is_last = index + 1 == layers.len();
    match layers[index].facing {
        _ if is_edge_on(&layers[index]) => is_last,
        // An open body, which rays enter and do not leave.
        Facing::Entry => is_last && !are_left(),
        Facing::Exit => true,
        Facing::Unknown => {
            let before = layers[..index].iter().filter(|layer| !is_edge_on(layer));
            is_last || before.count() % 2 == 1
        }
    }
}
