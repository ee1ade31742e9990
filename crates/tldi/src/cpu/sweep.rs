//! Stage `sweep`: the fragments of each pixel become layers.
//!
//! Within a pixel the fragments are sorted by class (entry, exit, edge-on) and depth; a run whose
//! depths follow each other within the merge gap (of what is steep, within a thickness) is one
//! layer. Its depth is the mean of its fragments; at an edge of a surface with given normals, of those
//! on one face, as tangent planes do not hold beyond it (estimated normals are means of both faces
//! there). Sums are integers: a layer does not depend on the order of the points.

use super::splat::{
    DEPTH_STEPS, DepthScale, EDGE_ON, Fragment, Fragments, Imaging, NORMAL_STEPS, Splat,
};
use crate::{Facing, Layer, Tldi};
use glamx::Vec3;

/// Mean length of a layer's unit normals below which it has an edge: two faces that meet at 30°.
const CREASED: f32 = 0.97;

/// Cosine of the largest angle (35°) between normals of one face, or of two that face each other.
pub(crate) const SAME_FACE: f32 = 0.82;

/// For [`stage_constants`](crate::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 2] =
    [("CREASED", CREASED as f64), ("SAME_FACE", SAME_FACE as f64)];

/// Appends the layers of the band that was splatted last. `color` tells the colour of a kept
/// point, where the cloud has colours.
pub(crate) fn sweep(
    fragments: &mut Fragments,
    oriented: bool,
    merge_steps: u32,
    color: Option<&dyn Fn(u32) -> [u8; 4]>,
    imaging: &Imaging,
    out: &mut Tldi,
) {
    let scale = &imaging.scale;
    let steep_steps = merge_steps.max(DEPTH_STEPS);
    let same_layer = |f: &Fragment, g: &Fragment| {
        let is_steep = f.is_steep() || g.is_steep();
        let apart = if is_steep { steep_steps } else { merge_steps };
        f.class() == g.class() && g.depth() - f.depth() <= apart
    };
    for pixel in 0..fragments.pixels() {
        let (in_pixel, splats) = fragments.of_pixel(pixel);
        in_pixel.sort_unstable_by_key(|f| f.key);
        let first_layer = out.layers.len();
        for run in in_pixel.chunk_by(same_layer) {
            let mut sum = Sum::default();
            for f in run {
                sum.add(f, &splats[f.splat as usize]);
                if let Some(color) = color {
                    sum.add_color(f, color(splats[f.splat as usize].kept));
                }
            }
            let normal = |f: &Fragment| splats[f.splat as usize].normal;
            let depth = match oriented && sum.is_creased() {
                true => depth_of_face(run, normal),
                false => sum.depth as f64 / sum.weight as f64,
            };
            out.layers
                .push(sum.layer(run, depth, oriented, color.is_some(), scale));
        }
        out.layers[first_layer..]
            .sort_unstable_by(|a, b| (a.depth.total_cmp(&b.depth)).then(a.facing.cmp(&b.facing)));
        out.offsets.push(out.layers.len() as u32);
    }
}

/// Mean depth, in steps, of the fragments of a run that are on the face of its heaviest one.
fn depth_of_face(run: &[Fragment], normal: impl Fn(&Fragment) -> [i16; 3]) -> f64 {
    let heaviest = run.iter().max_by_key(|f| (f.weight, f.key, normal(f)));
    let Some(face) = heaviest.map(&normal) else {
        return 0.0;
    };
    let (mut weight, mut depth) = (0, 0);
    for f in run {
        let cosine = (0..3).map(|k| i32::from(face[k]) * i32::from(normal(f)[k]));
        if cosine.sum::<i32>() as f32 >= SAME_FACE * (NORMAL_STEPS * NORMAL_STEPS) {
            weight += i64::from(f.weight);
            depth += i64::from(f.weight) * i64::from(f.depth());
        }
    }
    depth as f64 / weight as f64
}

#[derive(Default)]
struct Sum {
    weight: i64,
    depth: i64,
    normal: [i64; 3],
    color: [i64; 4],
}

impl Sum {
    fn add(&mut self, f: &Fragment, splat: &Splat) {
        let w = i64::from(f.weight);
        self.weight += w;
        self.depth += w * i64::from(f.depth());
        for (sum, c) in self.normal.iter_mut().zip(splat.normal) {
            *sum += w * i64::from(c);
        }
    }

    fn add_color(&mut self, f: &Fragment, color: [u8; 4]) {
        for (sum, c) in self.color.iter_mut().zip(color) {
            *sum += i64::from(f.weight) * i64::from(c);
        }
    }

    /// Whether the normals differ as those of two faces do.
    fn is_creased(&self) -> bool {
        let length = Vec3::from_array(self.normal.map(|n| n as f32)).length();
        length < CREASED * NORMAL_STEPS * self.weight as f32
    }

    /// The layer whose depth is `depth` steps.
    fn layer(
        &self,
        run: &[Fragment],
        depth: f64,
        oriented: bool,
        colored: bool,
        scale: &DepthScale,
    ) -> Layer {
        let normal = Vec3::from_array(self.normal.map(|n| n as f32)).normalize_or(-Vec3::Z);
        let facing = match run[0].class() {
            0 => Facing::Entry,
            1 if oriented => Facing::Exit,
            _ => Facing::Unknown,
        };
        let color = if colored {
            self.color
                .map(|c| ((c + self.weight / 2) / self.weight) as u8)
        } else {
            [0; 4]
        };
        Layer {
            near: scale.metres(run[0].depth() as f32),
            far: scale.metres(run[run.len() - 1].depth() as f32),
            depth: scale.metres(depth as f32),
            normal,
            facing,
            color,
        }
    }
}

/// Whether a layer is seen too steeply for its depth to be that of a surface crossing the ray.
pub(crate) fn is_edge_on(layer: &Layer) -> bool {
    layer.normal.z.abs() < EDGE_ON
}
