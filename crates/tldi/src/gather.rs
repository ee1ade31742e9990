//! The one pass over raw points: finiteness, transposition to structure of arrays, block bounds.

use crate::{Aabb, BLOCK};
use glamx::Vec3;
use multiversion::multiversion;

/// Finite points as structure of arrays, with what was learnt while reading them. All buffers keep
/// their memory from one [`Gathered::refill`] to the next.
#[derive(Debug, Default)]
pub(crate) struct Gathered {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) z: Vec<f32>,
    /// Bounds of each run of [`BLOCK`] points.
    pub(crate) blocks: Vec<Aabb>,
    /// Indices, among the points given, of those left out because they are not finite; ascending.
    pub(crate) dropped: Vec<u32>,
}

impl Gathered {
    /// Replaces the content by `points`, leaving out the non-finite ones.
    pub(crate) fn refill(&mut self, mut points: impl ExactSizeIterator<Item = Vec3>) {
        let count = points.len();
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.clear();
            axis.reserve(count);
        }
        self.blocks.clear();
        self.blocks.reserve(count.div_ceil(BLOCK));
        self.dropped.clear();

        let mut block = [[0.0f32; BLOCK]; 3];
        let mut read = 0;
        while read < count {
            let mut filled = 0;
            while filled < BLOCK && read < count {
                let [x, y, z] = &mut block;
                let slots = x[filled..]
                    .iter_mut()
                    .zip(&mut y[filled..])
                    .zip(&mut z[filled..]);
                let mut fresh = 0;
                // The slots come first: once they are used up, no point is taken.
                for (((x, y), z), point) in slots.zip(points.by_ref()) {
                    (*x, *y, *z) = (point.x, point.y, point.z);
                    fresh += 1;
                }
                let end = filled + fresh;
                if block.iter().all(|axis| all_finite(&axis[filled..end])) {
                    filled = end;
                } else {
                    filled = self.keep_finite(&mut block, filled, end, read);
                }
                read += fresh;
            }
            if filled > 0 {
                let [x, y, z] = [0, 1, 2].map(|axis: usize| &block[axis][..filled]);
                self.x.extend_from_slice(x);
                self.y.extend_from_slice(y);
                self.z.extend_from_slice(z);
                self.blocks.push(bounds_of([x, y, z]));
            }
        }
    }

    /// Closes the gaps of non-finite points in `block[start..end]`, whose first point is the
    /// `read`-th given; returns the new end.
    fn keep_finite(
        &mut self,
        block: &mut [[f32; BLOCK]; 3],
        start: usize,
        end: usize,
        read: usize,
    ) -> usize {
        let mut kept = start;
        for i in start..end {
            let point = Vec3::new(block[0][i], block[1][i], block[2][i]);
            if point.is_finite() {
                [block[0][kept], block[1][kept], block[2][kept]] = point.to_array();
                kept += 1;
            } else {
                self.dropped.push((read + i - start) as u32);
            }
        }
        kept
    }
}

/// Indices of the points with a non-finite coordinate, ascending.
pub(crate) fn non_finite_indices(coordinates: [&[f32]; 3]) -> Vec<u32> {
    let [x, y, z] = coordinates;
    let mut found = Vec::new();
    for start in (0..x.len()).step_by(BLOCK) {
        let end = x.len().min(start + BLOCK);
        if coordinates.iter().all(|axis| all_finite(&axis[start..end])) {
            continue;
        }
        let bad = |&i: &usize| !(x[i].is_finite() && y[i].is_finite() && z[i].is_finite());
        found.extend((start..end).filter(bad).map(|i| i as u32));
    }
    found
}

/// Bounds of each run of [`BLOCK`] points.
pub(crate) fn block_bounds(coordinates: [&[f32]; 3]) -> Vec<Aabb> {
    let [x, y, z] = coordinates.map(|axis| axis.chunks(BLOCK));
    x.zip(y)
        .zip(z)
        .map(|((x, y), z)| bounds_of([x, y, z]))
        .collect()
}

/// Bounds of finite points.
fn bounds_of(coordinates: [&[f32]; 3]) -> Aabb {
    let [x, y, z] = coordinates.map(total_min_max);
    Aabb {
        min: Vec3::new(x.0, y.0, z.0),
        max: Vec3::new(x.1, y.1, z.1),
    }
}

/// Least and greatest value in the total order of `f32`, where −NaN < −∞ and ∞ < NaN. Compared as
/// integers: folds of integers are vectorised, folds of floats, which must not be reordered, not.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn total_min_max(values: &[f32]) -> (f32, f32) {
    // Flips the magnitude of negative values, as `f32::total_cmp` does; its own inverse.
    let key = |bits: i32| bits ^ ((bits >> 31) & i32::MAX);
    let (mut least, mut greatest) = (i32::MAX, i32::MIN);
    for value in values {
        let key = key(value.to_bits() as i32);
        least = least.min(key);
        greatest = greatest.max(key);
    }
    let value = |bits: i32| f32::from_bits(key(bits) as u32);
    (value(least), value(greatest))
}

/// Whether no value is NaN or infinite.
fn all_finite(values: &[f32]) -> bool {
    let (least, greatest) = total_min_max(values);
    values.is_empty() || (least.is_finite() && greatest.is_finite())
}

/// `values` without the entries at the ascending indices `dropped`.
pub(crate) fn without<T: Copy>(values: &[T], dropped: &[u32]) -> Vec<T> {
    let mut kept = Vec::with_capacity(values.len() - dropped.len());
    extend_without(&mut kept, values.iter().copied(), dropped);
    kept
}

/// Appends `values` without the entries at the ascending indices `dropped`.
pub(crate) fn extend_without<T>(
    kept: &mut Vec<T>,
    values: impl Iterator<Item = T>,
    dropped: &[u32],
) {
    if dropped.is_empty() {
        kept.extend(values);
        return;
    }
    let mut dropped = dropped.iter().copied().peekable();
    for (i, value) in values.enumerate() {
        if dropped.next_if_eq(&(i as u32)).is_none() {
            kept.push(value);
        }
    }
}
