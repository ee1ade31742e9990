//! Whether surfaces cross: part of the stage `compare`.
//!
//! They cross where the order in depth of two layers swaps between neighbouring pixels of the same continuous layers (a
//! sign change): sharper than overlapping depth ranges, and it needs no closed surface.

use super::sweep::{SAME_FACE, is_edge_on};
use crate::{Layer, Params, Tldi};
use glamx::{Vec2, Vec3};

/// Two layers that swap their order between two neighbouring pixels, in [`Crossings`]. Half or twice: no change.
const SWAPPED: u32 = 2;

/// A pixel in which a layer pierces a wall, in [`Crossings`]: where a wall is, edge-on, is less sure. Half or twice: no
/// change.
const PIERCED: u32 = 1;

/// How many signs of a crossing all views must see together before surfaces cross. A swap of layers between pixels
/// counts two, a pixel in which a wall is pierced counts one. A single swap may be the overhang of a splat beside an
/// edge. Half or twice: no change.
pub const CROSSED: u32 = 4;

/// How much of a crossing all views of a pair have seen, in the units of [`CROSSED`]. Those that are
/// enough need not all be counted.
#[derive(Clone, Copy, Default)]
pub(crate) struct Crossings(u32);

impl Crossings {
    pub(crate) fn are_enough(self) -> bool {
        self.0 >= CROSSED
    }

    /// Adds what a pixel and the next ones of its row and column show, unless there is enough.
    pub(super) fn count(
        &mut self,
        [a, b]: [&Tldi; 2],
        [i, j]: [u32; 2],
        others: &[Vec3],
        params: &Params,
    ) {
        if self.are_enough() {
            return;
        }
        let [width, height] = a.size;
        let k = (j * width + i) as usize;
        let here = [a.layers_of(k), b.layers_of(k)];
        let swap =
            |k: usize| swap_depth(here, [a.layers_of(k), b.layers_of(k)], others, params).is_some();
        self.0 += PIERCED * u32::from(pierces(a, b, [i, j], params))
            + SWAPPED * u32::from(i + 1 < width && swap(k + 1))
            + SWAPPED * u32::from(j + 1 < height && swap(k + width as usize));
    }
}

/// How far in pixels the middle of a neighbouring pixel is from a wall, at least, that it is beside. Half or twice: no
/// change.
const BESIDE: f32 = 0.5;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 4] = [
    ("BESIDE", BESIDE as f64),
    ("SWAPPED", SWAPPED as f64),
    ("PIERCED", PIERCED as f64),
    ("CROSSED", CROSSED as f64),
];

/// From a pixel to those around it.
const AROUND: [[i32; 2]; 8] = [
    [-1, -1],
    [0, -1],
    [1, -1],
    [-1, 0],
    [1, 0],
    [-1, 1],
    [0, 1],
    [1, 1],
];

/// Whether no other view (axes in the frame of this one) sees a surface of this normal less
/// steeply.
pub(super) fn best_seen(normal: Vec3, others: &[Vec3]) -> bool {
    others
        .iter()
        .all(|axis| axis.dot(normal).abs() <= normal.z.abs())
}

/// Depth, metres, at which a layer of the first surface and one of the second swap their order between two
/// neighbouring pixels, or coincide.
pub(super) fn swap_depth(
    [a, b]: [&[Layer]; 2],
    [a_next, b_next]: [&[Layer]; 2],
    others: &[Vec3],
    params: &Params,
) -> Option<f32> {
    let continuous = |from: &Layer, to: &[Layer]| {
        let next = to
            .iter()
            .filter(|l| l.facing == from.facing && !is_edge_on(l))
            .min_by(|l, m| {
                (l.depth - from.depth)
                    .abs()
                    .total_cmp(&(m.depth - from.depth).abs())
            })?;
        ((next.depth - from.depth).abs() <= params.thickness).then_some(next.depth)
    };
    let swaps = |la: &&Layer| {
        continuous(la, a_next).is_some_and(|na| {
            b.iter().filter(|l| !is_edge_on(l)).any(|lb| {
                (la.depth - lb.depth).abs() <= 2.0 * params.thickness
                    && (best_seen(la.normal, others) || best_seen(lb.normal, others))
                    && continuous(lb, b_next)
                        .is_some_and(|nb| (la.depth - lb.depth) * (na - nb) <= 0.0)
            })
        })
    };
    let mut seen = a.iter().filter(|l| !is_edge_on(l));
    seen.find(swaps).map(|layer| layer.depth)
}

/// Whether a layer of one surface pierces a wall of the other: it lies well within a thick layer,
/// which is a wall seen edge-on, is not parallel to the wall, and continues on both sides of it. A
/// surface that ends beside a wall also has its last splats in the wall's pixels.
pub(super) fn pierces(a: &Tldi, b: &Tldi, pixel: [u32; 2], params: &Params) -> bool {
    let rim = 0.5 * params.thickness;
    let through = |walls: &Tldi, other: &Tldi| {
        let [i, j] = pixel;
        walls.layers_at(i, j).iter().any(|wall| {
            other.layers_at(i, j).iter().any(|layer| {
                wall.normal.dot(layer.normal).abs() < SAME_FACE
                    && wall.near + rim < layer.depth
                    && layer.depth < wall.far - rim
                    && is_on_both_sides(wall.normal.truncate(), layer, other, pixel, params)
            })
        })
    };
    through(a, b) || through(b, a)
}

/// Whether `layer` at `pixel` of `image` goes on in pixels on both sides of a line across `across`.
/// Beyond the image nothing is known, and it is taken to.
fn is_on_both_sides(
    across: Vec2,
    layer: &Layer,
    image: &Tldi,
    pixel: [u32; 2],
    params: &Params,
) -> bool {
    let continues = |next: &Layer| {
        (next.depth - layer.depth).abs() <= params.thickness
            || (next.near..=next.far).contains(&layer.depth)
    };
    [across, -across].into_iter().all(|side| {
        let mut beside = neighbors_toward(image, pixel, side);
        beside.any(|next| next.is_none_or(|layers| layers.iter().any(continues)))
    })
}

/// The layers of the pixels next to one that are on the `side` of it; `None` beyond the image.
pub(crate) fn neighbors_toward(
    image: &Tldi,
    pixel: [u32; 2],
    side: Vec2,
) -> impl Iterator<Item = Option<&[Layer]>> {
    let least = BESIDE * side.length();
    let is_beside = move |step: &[i32; 2]| {
        let [di, dj] = step.map(|k| k as f32);
        side.dot(Vec2::new(di, dj)) >= least
    };
    AROUND.into_iter().filter(is_beside).map(move |step| {
        let at = [0, 1].map(|axis| pixel[axis].checked_add_signed(step[axis]));
        let [Some(i), Some(j)] = at else { return None };
        (i < image.size[0] && j < image.size[1]).then(|| image.layers_at(i, j))
    })
}
