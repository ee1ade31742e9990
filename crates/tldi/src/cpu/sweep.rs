//! Stage `sweep`: the fragments of each pixel become layers.
//!
//! Within a pixel the fragments are sorted by class (entry, exit, edge-on) and depth; a run whose
//! depths follow each other within the merge gap is one layer. Sums are integers: a layer does not
//! depend on the order of the points.

use super::splat::{DepthScale, EDGE_ON, Fragment, Fragments, Imaging, Splat};
use crate::{Facing, Layer, Tldi};
use glamx::Vec3;

/// Appends the layers of the band that was splatted last. `color` tells the colour of a kept
/// point, where the cloud has colours.
pub(crate) fn sweep(
    fragments: &mut Fragments,
    oriented: bool,
    color: Option<&dyn Fn(u32) -> [u8; 4]>,
    imaging: &Imaging,
    out: &mut Tldi,
) {
    let scale = &imaging.scale;
    let gap_steps = scale.merge_steps(imaging.params);
    let same_layer =
        |f: &Fragment, g: &Fragment| f.class() == g.class() && g.depth() - f.depth() <= gap_steps;
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
            out.layers
                .push(sum.layer(run, oriented, color.is_some(), scale));
        }
        out.layers[first_layer..]
            .sort_unstable_by(|a, b| (a.depth.total_cmp(&b.depth)).then(a.facing.cmp(&b.facing)));
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

    fn layer(&self, run: &[Fragment], oriented: bool, colored: bool, scale: &DepthScale) -> Layer {
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
