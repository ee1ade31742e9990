//! Where a surface that moves along the view meets another.

use crate::cpu::sweep::is_edge_on;
use crate::{Layer, Params};
use glamx::Vec3;
use std::cmp::Ordering;

/// Where the ray of a pixel sees the surfaces meet.
pub(crate) struct Meeting {
    pub(crate) pixel: usize,
    /// Distance of the moving surface from there, metres.
    pub(crate) distance: f32,
    pub(crate) depth: f32,
    /// Least cosine between the motion and the normals of both.
    pub(crate) facing: f32,
    /// Unit normal towards the moving surface, in the view frame: between those of both.
    pub(crate) normal: Vec3,
    /// Unit normal of the surface that is met, towards the moving one, in the view frame.
    pub(crate) met_normal: Vec3,
}

impl Meeting {
    pub(crate) fn new(pixel: usize, met: &Layer, leading: &Layer, params: &Params) -> Self {
        let against = |normal: Vec3| if normal.z > 0.0 { -normal } else { normal };
        let facing = met.normal.z.abs().min(leading.normal.z.abs());
        let depth = front(met, params);
        Self {
            pixel,
            distance: depth - back(leading, params),
            facing,
            depth,
            met_normal: against(met.normal),
            normal: (against(met.normal) + against(leading.normal)).normalize_or(-Vec3::Z),
        }
    }

    /// By distance, then by pixel.
    pub(crate) fn order(&self, other: &Self) -> Ordering {
        (self.distance.total_cmp(&other.distance)).then(self.pixel.cmp(&other.pixel))
    }
}

/// Depth at which a ray meets a layer.
fn front(layer: &Layer, params: &Params) -> f32 {
    if is_edge_on(layer) {
        layer.depth.min(layer.near + rise(params))
    } else {
        layer.depth
    }
}

/// Depth at which a ray has left a layer.
fn back(layer: &Layer, params: &Params) -> f32 {
    if is_edge_on(layer) {
        layer.depth.max(layer.far - rise(params))
    } else {
        layer.depth
    }
}

/// How far a splat seen edge-on stands out in depth beyond its point, metres.
fn rise(params: &Params) -> f32 {
    0.5 * params.thickness * params.slope_damping
}
