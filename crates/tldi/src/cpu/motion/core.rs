//! Which pixels of a moving surface are its core, and which are its rim, where rays miss layers now and then.

use crate::Tldi;
use crate::cpu::columns::{Columns, dilate};
use crate::cpu::splat_radius::splat_radius;

/// Width in pixels of the rim that [`ImpactQuery::core_only`](crate::ImpactQuery::core_only) leaves out. Splats stand out
/// by one pixel on either side, and one more is for roughness. A surface missed in the rim penetrates by at most that pixel, and contacts push it
/// out again. 2: 1 of 900 drops passes through instead of none; 6: no change in any suite.
pub(crate) const RIM: i32 = 3;

/// Width in pixels of the outer rim, which is always left out: a splat of either side stands out by that much. The inner
/// rim stops a motion only if it would go on, past what it meets there, by more than the whole rim. 1: the slide over
/// a noisy plane at 10 m/s fails with every seed; 4: no change in any suite.
const OUTER_RIM: u8 = 2;

/// Pixels added around an image so that a rim shows there: its width, and one for closing gaps.
pub(crate) const BORDER: i32 = RIM + 1;

/// In which part of a moving surface a pixel lies.
pub(crate) const OUTSIDE: u8 = 0;
const INNER_RIM: u8 = 1;
pub(crate) const CORE: u8 = 2;

/// Which pixels of a moving surface count, kept from call to call.
#[derive(Default)]
pub(crate) struct CoreScratch {
    covered: Vec<u8>,
    inner: Vec<u8>,
    /// Two more than the distance from the edge, pixels, up to [`RIM`] + 2; one less in gaps that were closed.
    depth: Vec<u8>,
    spare: Vec<u8>,
}

impl CoreScratch {
    /// Covers the pixels that `image` covers. Beyond the image, its border is continued.
    pub(crate) fn cover_by_image(&mut self, image: &Tldi) {
        let [width, height] = image.size.map(|n| n as i32);
        self.covered.clear();
        for j in -BORDER..height + BORDER {
            for i in -BORDER..width + BORDER {
                let pixel = j.clamp(0, height - 1) * width + i.clamp(0, width - 1);
                let covered = !image.layers_of(pixel as usize).is_empty();
                self.covered.push(u8::from(covered));
            }
        }
    }

    /// Covers the pixels in and around `image` within `radius` metres of a point.
    pub(crate) fn cover_by_points(&mut self, image: &Tldi, points: &Columns, radius: f32) {
        let dims = image.size.map(|n| n as i32 + 2 * BORDER);
        let first = image.origin.map(|o| (o - BORDER) as f32);
        let radius_px =
            splat_radius(radius, image.camera.pixel_size_at(0.0)) / image.camera.pixel_size_at(0.0);
        self.covered.clear();
        self.covered.resize((dims[0] * dims[1]) as usize, 0);
        for k in 0..points.x.len() {
            let [u, v] = image.camera.pixel_from_view(points.view(k));
            let (u, v) = (u - first[0], v - first[1]);
            let range = |c: f32, dim: i32| {
                let from = (c - radius_px - 0.5).ceil().max(0.0) as i32;
                from..dim.min((c + radius_px + 0.5).floor() as i32)
            };
            for j in range(v, dims[1]) {
                for i in range(u, dims[0]) {
                    let (du, dv) = (i as f32 + 0.5 - u, j as f32 + 0.5 - v);
                    if du * du + dv * dv <= radius_px * radius_px {
                        self.covered[(j * dims[0] + i) as usize] = 1;
                    }
                }
            }
        }
    }

    /// Marks what is covered as core, rim or outside; the image is `width` pixels wide.
    pub(crate) fn find(&mut self, width: u32) {
        let row = width as usize + 2 * BORDER as usize;
        // Gaps are closed first: a gap of one pixel has no rim.
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
        // Even a thin part has a core: its innermost pixels.
        let deepest_around = inner;
        deepest_around.clone_from(depth);
        // Twice, since along a round border the core grows by only one in two pixels in places.
        for _ in 0..2 {
            dilate(deepest_around, &mut self.spare, row, u8::max);
        }
        let rim = 1 + RIM as u8;
        for ((covered, depth), around) in covered.iter_mut().zip(depth).zip(deepest_around) {
            *covered *= if *depth > rim || depth == around {
                CORE
            } else if *depth > 1 + OUTER_RIM {
                INNER_RIM
            } else {
                OUTSIDE
            };
        }
    }

    /// [`CORE`], [`INNER_RIM`] or [`OUTSIDE`].
    pub(crate) fn place(&self, pixel: usize, width: u32) -> u8 {
        let (i, j) = (pixel % width as usize, pixel / width as usize);
        let row = width as usize + 2 * BORDER as usize;
        self.covered[(j + BORDER as usize) * row + i + BORDER as usize]
    }
}
