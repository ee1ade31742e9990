//! Stage `impact`: where a surface in straight motion first meets another.
//!
//! A camera along the motion sees in each pixel how far what is there can move: from where its ray
//! leaves the moving surface to where it enters the other one. The least of these distances is the
//! impact's. No surface is too thin for that, and none too fast: the images hold all that the
//! motion passes.

use super::columns::dilate;
use super::cull::{self, Region};
use super::pair::{Scratch, is_oriented, ring};
use super::side::{CloudView, ExactView};
use super::splat::Rect;
use super::sweep::is_edge_on;
use crate::{Aabb, Facing, Impact, ImpactQuery, Layer, Surface, Tldi, VirtualCamera};
use glamx::{Pose3, Vec3};

/// Width in pixels of the rim that [`ImpactQuery::core_only`] spares: what is missed there
/// penetrates by no more, which contacts push out again.
const RIM: i32 = 2;

/// Pixels around an image that tell its rim from its edge: the rim, and one for the closing.
const BORDER: i32 = RIM + 1;

/// Which pixels of a moving surface count, kept from call to call.
#[derive(Default)]
pub(super) struct CoreScratch {
    covered: Vec<u8>,
    inner: Vec<u8>,
    /// Pixels from the rim's edge, counted up to where the rim ends.
    depth: Vec<u8>,
    spare: Vec<u8>,
}

impl Scratch {
    /// The first meeting.
    pub(super) fn impact(&mut self, query: &ImpactQuery) -> Option<Impact> {
        let length = query.motion.length();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let camera = VirtualCamera::along(query.motion, query.params.pixel_size);
        self.cull_swept(query, &camera)?;
        let whole_b = self.images_of_motion(query, &camera, length)?;
        let (a, b) = (&self.a.image, &self.b.image);
        if query.core_only {
            self.core.find(b, &whole_b);
        }
        let mut first: Option<(f32, usize, &Layer, &Layer)> = None;
        for pixel in 0..b.pixel_count() {
            if query.core_only && !self.core.contains(pixel, b.size[0]) {
                continue;
            }
            for (k, met) in a.layers_of(pixel).iter().enumerate() {
                if leaves_solid(&a.layers_of(pixel)[..=k]) {
                    continue;
                }
                for leading in b.layers_of(pixel) {
                    if leading.facing == Facing::Entry && !is_edge_on(leading) {
                        continue;
                    }
                    let distance = front(met) - back(leading);
                    let is_first = first.is_none_or(|(least, ..)| distance < least);
                    if distance >= query.least_distance && distance <= length && is_first {
                        first = Some((distance, pixel, met, leading));
                    }
                }
            }
        }
        let (distance, pixel, met, leading) = first?;
        let [width, _] = b.size;
        let column = b.origin[0] + (pixel % width as usize) as i32;
        let row = b.origin[1] + (pixel / width as usize) as i32;
        let frame_from_view = camera.view_from_frame.rotation.inverse();
        let against = |normal: Vec3| if normal.z > 0.0 { -normal } else { normal };
        let normal = against(met.normal) + against(leading.normal);
        Some(Impact {
            distance,
            point: camera.point_at(column as f32 + 0.5, row as f32 + 0.5, front(met)),
            normal: (frame_from_view * normal).normalize_or(-camera.axis()),
        })
    }

    /// Fills both sides' points that the motion can bring together; `None` where there are none.
    fn cull_swept(&mut self, query: &ImpactQuery, camera: &VirtualCamera) -> Option<()> {
        let margin = query.params.prediction
            + ring(&query.a, &query.params).max(ring(&query.b, &query.params));
        let way = query.motion.length() * Vec3::Z;
        let view_from_a = camera.view_from_frame;
        let seen_a = query.a.bounds().transformed(&view_from_a).loosened(margin);
        let view_from_b = view_from_a * query.a_from_b;
        let seen_b = query.b.bounds().transformed(&view_from_b).loosened(margin);
        let mut met_by_b = Aabb {
            min: seen_b.min,
            max: seen_b.max + way,
        };
        let meeting_a = Aabb {
            min: seen_a.min - way,
            max: seen_a.max,
        };
        if !seen_a.intersects(&met_by_b) {
            return None;
        }
        if is_oriented(&query.a) {
            // Whether `b` is inside is told by what is behind it.
            met_by_b.min.z = met_by_b.min.z.min(seen_a.min.z);
        }
        let frame_from_view = view_from_a.inverse();
        let sides = [
            (&mut self.a, query.a, Pose3::IDENTITY, met_by_b),
            (&mut self.b, query.b, query.a_from_b, meeting_a),
        ];
        for (side, surface, frame, region) in sides {
            let Surface::Cloud(cloud) = surface else {
                side.points.clear();
                continue;
            };
            let region = Region {
                overlap: region
                    .transformed(&frame_from_view)
                    .intersection(cloud.bounds().transformed(&frame).loosened(margin)),
                other_from_frame: view_from_a,
                other_bounds: region,
            };
            let stride = cull::stride(cloud, query.params.pixel_size);
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

    /// Builds both images and returns the rectangle of all of `b`, whose image may hold less.
    fn images_of_motion(
        &mut self,
        query: &ImpactQuery,
        camera: &VirtualCamera,
        length: f32,
    ) -> Option<Rect> {
        let params = &query.params;
        let view_of = |cloud, frame_from_cloud| CloudView {
            cloud,
            frame_from_cloud,
            camera,
            params,
        };
        let (a_from_a, a_from_b) = (&Pose3::IDENTITY, &query.a_from_b);
        let hits = &mut self.hits;
        match (query.a, query.b) {
            (Surface::Cloud(a), Surface::Cloud(b)) => {
                let reach = length + query.params.merge_gap;
                self.look_at_clouds(&view_of(a, a_from_a), &view_of(b, a_from_b), reach)
            }
            (Surface::Exact(surface), Surface::Cloud(cloud)) => {
                let exact = ExactView {
                    surface,
                    frame_from_surface: a_from_a,
                    reach: length,
                    everywhere: false,
                };
                let image = &mut self.a.image;
                self.b
                    .look_with(&view_of(cloud, a_from_b), &exact, hits, image)
            }
            (Surface::Cloud(cloud), Surface::Exact(surface)) => {
                let exact = ExactView {
                    surface,
                    frame_from_surface: a_from_b,
                    reach: length,
                    everywhere: true, // its rim is not that of the cloud
                };
                let image = &mut self.b.image;
                self.a
                    .look_with(&view_of(cloud, a_from_a), &exact, hits, image)
            }
            (Surface::Exact(_), Surface::Exact(_)) => None,
        }
    }
}

impl CoreScratch {
    /// Finds the pixels of `image` that are not of its rim. Beyond the image it is taken to go on
    /// as far as `whole`.
    fn find(&mut self, image: &Tldi, whole: &Rect) {
        let [width, height] = image.size.map(|n| n as i32);
        let row = (width + 2 * BORDER) as usize;
        self.covered.clear();
        for j in -BORDER..height + BORDER {
            for i in -BORDER..width + BORDER {
                let inside = (0..width).contains(&i) && (0..height).contains(&j);
                let covered = match inside {
                    true => !image.layers_of((j * width + i) as usize).is_empty(),
                    false => whole.contains([image.origin[0] + i, image.origin[1] + j]),
                };
                self.covered.push(u8::from(covered));
            }
        }
        // Closed first: a gap of a pixel in the cover is no rim.
        let (covered, inner, depth) = (&mut self.covered, &mut self.inner, &mut self.depth);
        inner.clone_from(covered);
        dilate(inner, &mut self.spare, row, u8::max);
        depth.clone_from(covered);
        for _ in 0..=RIM {
            dilate(inner, &mut self.spare, row, u8::min);
            for (depth, inner) in depth.iter_mut().zip(&*inner) {
                *depth += *inner;
            }
        }
        // What is as far inside as it gets there is no rim, however thin.
        let deepest_around = inner;
        deepest_around.clone_from(depth);
        dilate(deepest_around, &mut self.spare, row, u8::max);
        let rim = 1 + RIM as u8;
        for ((covered, depth), around) in covered.iter_mut().zip(depth).zip(deepest_around) {
            *covered &= u8::from(*depth > rim || depth == around);
        }
    }

    fn contains(&self, pixel: usize, width: u32) -> bool {
        let (i, j) = (pixel % width as usize, pixel / width as usize);
        let row = width as usize + 2 * BORDER as usize;
        self.covered[(j + BORDER as usize) * row + i + BORDER as usize] > 0
    }
}

/// Whether the last of `layers` is where a ray leaves a solid that it has entered: what is inside
/// may leave. A sheet that is only ever left is met from behind.
fn leaves_solid(layers: &[Layer]) -> bool {
    let mut known = layers.iter().rev().filter(|layer| !is_edge_on(layer));
    layers
        .last()
        .is_some_and(|layer| !is_edge_on(layer) && layer.facing == Facing::Exit)
        && known
            .nth(1)
            .is_some_and(|layer| layer.facing == Facing::Entry)
}

/// Depth at which a ray meets a layer; what is seen edge-on begins where it is nearest.
fn front(layer: &Layer) -> f32 {
    if is_edge_on(layer) {
        layer.near
    } else {
        layer.depth
    }
}

/// Depth at which a ray has left a layer.
fn back(layer: &Layer) -> f32 {
    if is_edge_on(layer) {
        layer.far
    } else {
        layer.depth
    }
}
