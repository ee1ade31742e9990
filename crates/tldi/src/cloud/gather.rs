//! The one pass over raw points: finiteness, transposition to structure of arrays, block bounds.

use crate::Aabb;
use glamx::Vec3;
use multiversion::multiversion;

/// Points per block: [`PointCloud::blocks`](crate::PointCloud::blocks) bounds that many consecutive points each.
pub const BLOCK: usize = 256;

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
    /// Replaces the content by `points`, in the order of their indices `order` where that is given,
    /// leaving out the non-finite ones.
    pub(crate) fn refill(&mut self, points: &[Vec3], order: Option<&[u32]>) {
        let count = order.map_or(points.len(), <[u32]>::len);
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.resize(count, 0.0);
        }
        // Block by block, so that the points are still in the core's cache when its bounds are
        // taken.
        let (x, y, z) = (&mut self.x, &mut self.y, &mut self.z);
        let blocks = x
            .chunks_mut(BLOCK)
            .zip(y.chunks_mut(BLOCK))
            .zip(z.chunks_mut(BLOCK));
        self.blocks.clear();
        self.blocks
            .extend(blocks.enumerate().map(|(k, ((x, y), z))| {
                let range = k * BLOCK..k * BLOCK + x.len();
                match order {
                    Some(order) => {
                        let slots = x.iter_mut().zip(&mut *y).zip(&mut *z);
                        for (((x, y), z), &i) in slots.zip(&order[range]) {
                            (*x, *y, *z) = points[i as usize].into();
                        }
                    }
                    None => transpose(&points[range], [&mut *x, &mut *y, &mut *z]),
                }
                bounds_of([x, y, z])
            }));
        self.dropped.clear();
        let is_finite = |block: &Aabb| block.min.is_finite() && block.max.is_finite();
        if !self.blocks.iter().all(is_finite) {
            extend_non_finite([&self.x, &self.y, &self.z], &mut self.dropped);
            for axis in [&mut self.x, &mut self.y, &mut self.z] {
                remove(axis, &self.dropped);
            }
            self.blocks.clear();
            self.blocks
                .extend(bounds_of_blocks([&self.x, &self.y, &self.z]));
        }
    }
}

#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn transpose(points: &[Vec3], [x, y, z]: [&mut [f32]; 3]) {
    let n = points.len();
    let (x, y, z) = (&mut x[..n], &mut y[..n], &mut z[..n]);
    for (i, point) in points.iter().enumerate() {
        x[i] = point.x;
        y[i] = point.y;
        z[i] = point.z;
    }
}

/// Indices of the points with a non-finite coordinate, ascending.
pub(crate) fn non_finite_indices(coordinates: [&[f32]; 3]) -> Vec<u32> {
    let mut found = Vec::new();
    extend_non_finite(coordinates, &mut found);
    found
}

fn extend_non_finite(coordinates: [&[f32]; 3], found: &mut Vec<u32>) {
    let [x, y, z] = coordinates;
    for start in (0..x.len()).step_by(BLOCK) {
        let end = x.len().min(start + BLOCK);
        if coordinates.iter().all(|axis| all_finite(&axis[start..end])) {
            continue;
        }
        let bad = |&i: &usize| !(x[i].is_finite() && y[i].is_finite() && z[i].is_finite());
        found.extend((start..end).filter(bad).map(|i| i as u32));
    }
}

/// Bounds of each run of [`BLOCK`] points.
pub(crate) fn block_bounds(coordinates: [&[f32]; 3]) -> Vec<Aabb> {
    bounds_of_blocks(coordinates).collect()
}

fn bounds_of_blocks<'a>(coordinates: [&'a [f32]; 3]) -> impl Iterator<Item = Aabb> + 'a {
    let [x, y, z] = coordinates.map(|axis| axis.chunks(BLOCK));
    x.zip(y).zip(z).map(|((x, y), z)| bounds_of([x, y, z]))
}

/// Bounds of points; not finite where one of them is not.
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

/// Removes the entries at the ascending indices `dropped`.
fn remove(values: &mut Vec<f32>, dropped: &[u32]) {
    let mut dropped = dropped.iter().copied().peekable();
    let mut i = 0;
    values.retain(|_| {
        i += 1;
        dropped.next_if_eq(&(i - 1)).is_none()
    });
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

/// The union of all blocks.
pub(crate) fn merged(blocks: &[Aabb]) -> Aabb {
    blocks.iter().copied().fold(Aabb::EMPTY, Aabb::merged)
}
