//! Stage `sweep`: the fragments of each pixel become layers.
//!
//! Within a pixel the fragments are sorted by class (entry, exit, edge-on) and depth; a run whose
//! depths follow each other within the merge gap is one layer. Sums are integers: a layer does not
//! depend on the order of the points.

use super::splat::{DepthScale, EDGE_ON, Fragment, Fragments, Rect};
use crate::{Facing, Layer, Params, Tldi, VirtualCamera};
use glamx::Vec3;

/// Steps of a normal's component in the integer sums.
const NORMAL_STEPS: f32 = 16384.0;

/// Builds `out` from the fragments of a splat stage. `colors` are looked up by `index` (culled
/// point to cloud point).
#[allow(
    clippy::too_many_arguments,
    reason = "a stage: its inputs are separate buffers, as they will be on the GPU"
)]
pub(crate) fn sweep(
    fragments: &mut Fragments,
    index: &[u32],
    colors: Option<&[[u8; 4]]>,
    oriented: bool,
    camera: &VirtualCamera,
    params: &Params,
    rect: &Rect,
    scale: &DepthScale,
    out: &mut Tldi,
) {
    out.begin(camera, rect.origin, rect.size);
    let gap_steps = (params.merge_gap / scale.step) as i32;
    for pixel in 0..rect.pixels() {
        let range = fragments.offsets[pixel] as usize..fragments.offsets[pixel + 1] as usize;
        let in_pixel = &mut fragments.fragments[range];
        in_pixel.sort_unstable_by_key(|f| (f.class, f.depth, f.point));
        let first_layer = out.layers.len();
        let same_layer = |f: &Fragment, g: &Fragment| {
            f.class == g.class && g.depth.saturating_sub(f.depth) <= gap_steps
        };
        for run in in_pixel.chunk_by(same_layer) {
            let mut sum = Sum::default();
            for f in run {
                sum.add(f, fragments.view_normals[f.point as usize], oriented);
                if let Some(colors) = colors {
                    sum.add_color(f, colors[index[f.point as usize] as usize]);
                }
            }
            out.layers
                .push(sum.layer(run, oriented, colors.is_some(), scale));
        }
        out.layers[first_layer..]
            .sort_by(|a, b| (a.depth.total_cmp(&b.depth)).then(a.facing.cmp(&b.facing)));
        out.offsets.push(out.layers.len() as u32);
    }
}

#[derive(Default)]
struct Sum {
    weight: i64,
    depth: i64,
    normal: [i64; 3],
    color: [i64; 4],
}

impl Sum {
    fn add(&mut self, f: &Fragment, normal: Vec3, oriented: bool) {
        let w = i64::from(f.weight);
        self.weight += w;
        self.depth += w * i64::from(f.depth);
        // Unoriented normals are taken as facing the camera.
        let sign = if !oriented && normal.z > 0.0 {
            -1.0
        } else {
            1.0
        };
        for (sum, c) in self.normal.iter_mut().zip(normal.to_array()) {
            *sum += w * (sign * c * NORMAL_STEPS) as i64;
        }
    }

    fn add_color(&mut self, f: &Fragment, color: [u8; 4]) {
        for (sum, c) in self.color.iter_mut().zip(color) {
            *sum += i64::from(f.weight) * i64::from(c);
        }
    }

    fn layer(&self, run: &[Fragment], oriented: bool, colored: bool, scale: &DepthScale) -> Layer {
        let normal = Vec3::from_array(self.normal.map(|n| n as f32)).normalize_or(-Vec3::Z);
        let facing = match run[0].class {
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
            near: scale.metres(run[0].depth as f32),
            far: scale.metres(run[run.len() - 1].depth as f32),
            depth: scale.metres((self.depth as f64 / self.weight as f64) as f32),
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
