//! Stage `cast`: the image of an exact surface, one ray a pixel.

use crate::cpu::fold::ViewFold;
use crate::cpu::rect::Rect;
use crate::stage::stage;
use crate::{Facing, Layer, RayHit, RaySurface, Tldi, VirtualCamera};
use glamx::Pose3;

/// The rays of an image.
pub(crate) struct Rays<'a> {
    /// Orthographic.
    pub(crate) camera: &'a VirtualCamera,
    pub(crate) rect: Rect,
    /// Of the image's columns and rows.
    pub(crate) fold: &'a ViewFold,
    /// They run from this depth, in metres, ...
    pub(crate) near: f32,
    /// ... to this one.
    pub(crate) far: f32,
    /// An image over the same pixels: those in which it has no layer stay empty.
    pub(crate) cover: Option<&'a Tldi>,
}

/// Builds `out`.
pub(crate) fn cast(
    surface: &dyn RaySurface,
    frame_from_surface: &Pose3,
    rays: &Rays,
    hits: &mut Vec<RayHit>,
    out: &mut Tldi,
) {
    let Rays {
        camera,
        rect,
        fold,
        near,
        far,
        cover,
    } = *rays;
    let _stage = stage!("cast");
    out.begin(camera, rect.origin, rect.size);
    let closed = surface.is_closed();
    let direction = frame_from_surface.rotation.inverse() * camera.axis();
    let view_from_surface = camera.view_from_frame.rotation * frame_from_surface.rotation;
    for pixel in 0..rect.pixels() {
        if cover.is_none_or(|cover| !cover.layers_of(pixel).is_empty()) {
            let i = rect.origin[0] + (pixel % rect.size[0] as usize) as i32;
            let j = rect.origin[1] + (pixel / rect.size[0] as usize) as i32;
            let [u, v] = fold.unfolded([i, j]).map(|c| c as f32 + 0.5);
            let start = camera.point_at(u, v, near);
            let origin = frame_from_surface.inverse_transform_point(start);
            hits.clear();
            surface.crossings(origin, direction, far - near, hits);
            for hit in hits.iter() {
                let depth = near + hit.distance;
                let normal = view_from_surface * hit.normal;
                let facing = match closed {
                    true if normal.z < 0.0 => Facing::Entry,
                    true => Facing::Exit,
                    false => Facing::Unknown,
                };
                out.layers.push(Layer {
                    near: depth,
                    far: depth,
                    depth,
                    normal: if closed || normal.z < 0.0 {
                        normal
                    } else {
                        -normal
                    },
                    agreement: 1.0,
                    facing,
                    color: [0; 4],
                });
            }
        }
        out.offsets.push(out.layers.len() as u32);
    }
}
