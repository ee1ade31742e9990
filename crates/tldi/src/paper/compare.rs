//! Comparison of two images: early rejection, then the layers of each pixel by depth.

use crate::{Layer, Params, Projection, Tldi};
use rayon::prelude::*;
use std::ops::Range;

/// What the comparison of two of the paper's images found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PaperComparison {
    /// Whether layers of both overlap in depth at some pixel.
    pub collides: bool,
    /// Least distance in depth between layers of both at any pixel, in metres: 0 where they
    /// overlap, `None` where no pixel has layers of both. It is unsigned: the ranges do not tell
    /// how deep a penetration is.
    pub gap: Option<f32>,
}

/// Compares two images that were built with the same camera, on the pixels common to both.
///
/// Every layer's range `[near, far]` is first compressed by [`rho`](Params::rho): shortened to
/// 1 − ρ of its length around its middle (paper, section 5: the ranges are thicker than the
/// surface, by about the radius on either side). A ρ below 0 is read as 0, above 1 as 1. Ranges
/// that touch overlap.
///
/// Early rejection comes first: if at every common pixel the front layer of one image lies behind
/// the back layer of the other, they do not collide. (The paper asks for the same image in front
/// at all pixels; each pixel on its own is enough, and rejects more.) Otherwise the layers of each
/// pixel are walked in order of depth; the first overlap ends the search. The result is symmetric
/// in `a` and `b`, and the same at any number of threads. Cost: linear in the common pixels and
/// their layers; allocates nothing.
///
/// # Panics
/// If both images have layers but their cameras look from different places or have different
/// pixels: their pixels have nothing to do with each other.
pub fn compare(a: &Tldi, b: &Tldi, params: &Params) -> PaperComparison {
    let Some(pixels) = CommonPixels::new(a, b) else {
        return PaperComparison::default();
    };
    match pixels.reject_early(params.rho) {
        Ok(gap) => PaperComparison {
            collides: false,
            gap,
        },
        Err(MayCollide) => pixels.compare_layers(params.rho),
    }
}

/// The pixels, in the grid of the camera, where [`compare`] finds overlapping layers, row by row.
/// `pixels` is emptied first.
///
/// # Panics
/// As [`compare`].
pub fn colliding_pixels(a: &Tldi, b: &Tldi, params: &Params, pixels: &mut Vec<[i32; 2]>) {
    pixels.clear();
    let Some(common) = CommonPixels::new(a, b) else {
        return;
    };
    for j in common.rows.clone() {
        for (i, [layers_a, layers_b]) in common.columns.clone().zip(common.row(j)) {
            if walk(layers_a, layers_b, params.rho) == Err(Overlap) {
                pixels.push([i, j]);
            }
        }
    }
}

/// Layers of both images overlap in depth.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Overlap;

/// Neither image lies behind the other as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
struct MayCollide;

/// Front and back depth of a layer after compression, metres.
///
/// Both are monotone in ρ, between the layer's near and far depths, and never swapped: compressed
/// layers keep their order, and overlap for a smaller ρ wherever they do for a larger one.
fn compressed(layer: &Layer, rho: f32) -> [f32; 2] {
    let margin = 0.5 * rho.max(0.0) * (layer.far - layer.near);
    [
        (layer.near + margin).min(layer.depth),
        (layer.far - margin).max(layer.depth),
    ]
}

/// Least distance in depth between the layers of two images at one pixel, `None` where an image
/// has none there. Both lists are in order of depth without overlaps of their own, so that whichever
/// layer ends first has met all that it can.
fn walk(mut a: &[Layer], mut b: &[Layer], rho: f32) -> Result<Option<f32>, Overlap> {
    let mut least = None;
    while let ([layer_a, rest_a @ ..], [layer_b, rest_b @ ..]) = (a, b) {
        let [near_a, far_a] = compressed(layer_a, rho);
        let [near_b, far_b] = compressed(layer_b, rho);
        let gap = if far_a < near_b {
            a = rest_a;
            near_b - far_a
        } else if far_b < near_a {
            b = rest_b;
            near_a - far_b
        } else {
            return Err(Overlap);
        };
        least = lesser(least, Some(gap));
    }
    Ok(least)
}

/// The lesser of two gaps that may be unknown.
fn lesser(a: Option<f32>, b: Option<f32>) -> Option<f32> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        _ => a.or(b),
    }
}

/// Distance in depth between two images at one pixel, where one lies behind the other as a whole;
/// `None` where an image has no layer there.
fn reject(a: &[Layer], b: &[Layer], rho: f32) -> Result<Option<f32>, MayCollide> {
    let ([first_a, ..], [.., last_a], [first_b, ..], [.., last_b]) = (a, a, b, b) else {
        return Ok(None);
    };
    let a_behind_b = compressed(first_a, rho)[0] - compressed(last_b, rho)[1];
    let b_behind_a = compressed(first_b, rho)[0] - compressed(last_a, rho)[1];
    let gap = a_behind_b.max(b_behind_a);
    if gap > 0.0 {
        Ok(Some(gap))
    } else {
        Err(MayCollide)
    }
}

/// The pixels that both images have.
struct CommonPixels<'a> {
    images: [&'a Tldi; 2],
    columns: Range<i32>,
    rows: Range<i32>,
}

impl<'a> CommonPixels<'a> {
    /// `None` where there are none, or an image has no layer at all.
    fn new(a: &'a Tldi, b: &'a Tldi) -> Option<Self> {
        if a.layers.is_empty() || b.layers.is_empty() {
            return None;
        }
        let grid = |image: &Tldi| {
            let camera = image.camera;
            // The principal point of a perspective camera is the middle of its image.
            let size = match camera.projection {
                Projection::Orthographic { .. } => None,
                Projection::Perspective { .. } => camera.size,
            };
            (camera.view_from_frame, camera.projection, size)
        };
        assert!(
            grid(a) == grid(b),
            "the images were built with different cameras: build both with the same one"
        );
        let range = |axis: usize| {
            let end = |image: &Tldi| image.origin[axis].saturating_add_unsigned(image.size[axis]);
            a.origin[axis].max(b.origin[axis])..end(a).min(end(b))
        };
        let [columns, rows] = [range(0), range(1)];
        if columns.is_empty() || rows.is_empty() {
            return None;
        }
        Some(Self {
            images: [a, b],
            columns,
            rows,
        })
    }

    /// Layers of both images at the pixels of a common row, from left to right; nothing where the
    /// row of either image has no layer.
    fn row(&self, j: i32) -> impl Iterator<Item = [&'a [Layer]; 2]> {
        let [a, b] = self.images.map(|image| {
            let column = self.columns.start.abs_diff(image.origin[0]) as usize;
            let row = j.abs_diff(image.origin[1]) as usize;
            let first = row * image.size[0] as usize + column;
            (image, &image.offsets[first..=first + self.columns.len()])
        });
        let bare = |offsets: &[u32]| offsets.first() == offsets.last();
        let count = if bare(a.1) || bare(b.1) {
            0
        } else {
            self.columns.len()
        };
        (0..count).map(move |k| {
            [a, b]
                .map(|(image, offsets)| &image.layers[offsets[k] as usize..offsets[k + 1] as usize])
        })
    }

    /// The least gap where one image lies behind the other at every pixel.
    fn reject_early(&self, rho: f32) -> Result<Option<f32>, MayCollide> {
        self.least(|a, b| reject(a, b, rho))
    }

    /// The full comparison of all layers.
    fn compare_layers(&self, rho: f32) -> PaperComparison {
        match self.least(|a, b| walk(a, b, rho)) {
            Ok(gap) => PaperComparison {
                collides: false,
                gap,
            },
            Err(Overlap) => PaperComparison {
                collides: true,
                gap: Some(0.0),
            },
        }
    }

    /// The least of what `gap` says of the layers of both images at each pixel; ends at an error.
    fn least<E: Send>(
        &self,
        gap: impl Fn(&[Layer], &[Layer]) -> Result<Option<f32>, E> + Sync,
    ) -> Result<Option<f32>, E> {
        self.rows
            .clone()
            .into_par_iter()
            .map(|j| {
                self.row(j)
                    .try_fold(None, |least, [a, b]| Ok(lesser(least, gap(a, b)?)))
            })
            .try_reduce(|| None, |a, b| Ok(lesser(a, b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Facing, VirtualCamera};
    use glamx::Vec3;

    /// A few pixels with ranges in order of depth and random gaps between them.
    fn random_image(rng: &mut fastrand::Rng, start: f32) -> Tldi {
        let mut image = Tldi {
            camera: VirtualCamera::along(Vec3::Z, 1.0),
            origin: [rng.i32(-3..3), rng.i32(-3..3)],
            size: [rng.u32(1..6), rng.u32(1..6)],
            ..Tldi::default()
        };
        for _ in 0..image.pixel_count() {
            let mut depth = start + rng.f32();
            for _ in 0..rng.usize(0..4) {
                let (near, far) = (depth, depth + 0.3 * rng.f32());
                image.layers.push(Layer {
                    near,
                    far,
                    depth: 0.5 * (near + far),
                    normal: Vec3::ZERO,
                    agreement: 1.0,
                    facing: Facing::Unknown,
                    color: [0; 4],
                });
                depth = far + rng.f32();
            }
            image.offsets.push(image.layers.len() as u32);
        }
        image
    }

    #[test]
    fn early_rejection_agrees_with_the_full_comparison() {
        let (mut rejected, mut unsure) = (0, 0);
        for seed in 0..4000 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let a = random_image(&mut rng, 0.0);
            let start = rng.f32() * 8.0 - 4.0;
            let b = random_image(&mut rng, start);
            let Some(pixels) = CommonPixels::new(&a, &b) else {
                continue;
            };
            let rho = rng.f32();
            let full = pixels.compare_layers(rho);
            let rejection = pixels.reject_early(rho);
            let swapped = CommonPixels::new(&b, &a).unwrap();
            assert_eq!(rejection, swapped.reject_early(rho), "seed {seed}");
            match rejection {
                Ok(gap) => {
                    assert_eq!(
                        PaperComparison {
                            collides: false,
                            gap
                        },
                        full,
                        "seed {seed}"
                    );
                    rejected += 1;
                }
                Err(MayCollide) => unsure += 1,
            }
        }
        assert!(
            rejected > 300 && unsure > 300,
            "{rejected} rejected, {unsure} not"
        );
    }
}
