//! The points that a cull leaves, and their radii.

use crate::cpu::cull::region::{Kernel, Moved, Region, classify};
use crate::cpu::fold::SpaceFold;
use crate::{BLOCK, PointCloud, Radii};
use glamx::{Pose3, Vec3};

/// Points that passed the cull, as structure of arrays, in the frame of the query.
#[derive(Debug, Default)]
pub(crate) struct Survivors {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) z: Vec<f32>,
    /// Indices into the cloud.
    pub(crate) index: Vec<u32>,
    /// By how much each reaches farther than the cloud's mean radius, metres; empty where none does.
    pub(crate) further: Vec<f32>,
    /// Every how many points of the cloud were taken.
    pub(super) stride: usize,
}

impl Survivors {
    /// By how much the i-th reaches farther than the cloud's mean radius, metres.
    pub(crate) fn further(&self, i: usize) -> f32 {
        self.further.get(i).copied().unwrap_or(0.0)
    }

    pub(crate) fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.index.clear();
        self.further.clear();
    }

    pub(crate) fn len(&self) -> usize {
        self.x.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Whether no point of the cloud that is in the region was left out.
    pub(crate) fn are_all(&self) -> bool {
        self.stride == 1
    }

    pub(crate) fn point(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    pub(crate) fn points(&self) -> impl Iterator<Item = Vec3> + Clone {
        (0..self.len()).map(|i| self.point(i))
    }

    /// Takes the coordinates of `other` as they are on folded axes.
    pub(crate) fn fold(&mut self, other: &Self, fold: &SpaceFold) {
        self.clear();
        for point in other.points() {
            let folded = fold.folded(point);
            self.x.push(folded.x);
            self.y.push(folded.y);
            self.z.push(folded.z);
        }
        self.further.extend_from_slice(&other.further);
    }

    /// Takes the points of `all` that are in `region`. The cloud is even.
    pub(crate) fn select(&mut self, all: &Self, region: &Region) {
        self.clear();
        self.stride = all.stride;
        let kernel = Kernel::new(&Pose3::IDENTITY, region);
        let mut moved = Moved::default();
        for first in (0..all.len()).step_by(BLOCK) {
            let range = first..all.len().min(first + BLOCK);
            let [x, y, z] = [&all.x, &all.y, &all.z].map(|c| &c[range.clone()]);
            if classify(&kernel, x, y, z, &[1; BLOCK], &mut moved) {
                self.extend(&mut moved, |i| all.index[first + i]);
            }
        }
    }

    pub(super) fn append(&mut self, other: &Self) {
        self.x.extend_from_slice(&other.x);
        self.y.extend_from_slice(&other.y);
        self.z.extend_from_slice(&other.z);
        self.index.extend_from_slice(&other.index);
        self.further.extend_from_slice(&other.further);
    }

    /// Appends the points of a block that are inside the region, after moving them to its front.
    pub(super) fn extend(&mut self, moved: &mut Moved, index_of: impl Fn(usize) -> u32) {
        let Moved { x, y, z, inside } = moved;
        let mut index = [0; BLOCK];
        let mut kept = 0;
        let (words, _) = inside.as_chunks::<64>();
        for (word, flags) in words.iter().enumerate() {
            let mut mask = bits(flags);
            while mask != 0 {
                let i = 64 * word + mask.trailing_zeros() as usize;
                mask &= mask - 1;
                (x[kept], y[kept], z[kept]) = (x[i], y[i], z[i]);
                index[kept] = index_of(i);
                kept += 1;
            }
        }
        self.x.extend_from_slice(&x[..kept]);
        self.y.extend_from_slice(&y[..kept]);
        self.z.extend_from_slice(&z[..kept]);
        self.index.extend_from_slice(&index[..kept]);
    }

    pub(super) fn reserve(&mut self, additional: usize, with_further: bool) {
        self.x.reserve(additional);
        self.y.reserve(additional);
        self.z.reserve(additional);
        self.index.reserve(additional);
        if with_further {
            self.further.reserve(additional);
        }
    }
}

/// One bit for each of 64 flags that are 0 or 1.
fn bits(flags: &[u8; 64]) -> u64 {
    let (bytes, _) = flags.as_chunks::<8>();
    bytes.iter().enumerate().fold(0, |mask, (k, flags)| {
        // The product's highest byte collects the flags, the first as its lowest bit.
        let byte = u64::from_le_bytes(*flags).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        mask | byte << (8 * k)
    })
}

/// Radii in metres of the culled points, scaled so that they cover the surface even where only
/// every n-th point is left.
#[derive(Clone, Copy)]
pub(crate) struct PointRadii<'a> {
    radii: &'a Radii<'a>,
    index: &'a [u32],
    scale: f32,
}

impl<'a> PointRadii<'a> {
    pub(crate) fn new(cloud: &'a PointCloud, points: &'a Survivors) -> Self {
        Self {
            radii: cloud.radii(),
            index: &points.index,
            scale: (points.stride as f32).sqrt(),
        }
    }

    /// As the cloud has them.
    pub(crate) fn unscaled(cloud: &'a PointCloud, points: &'a Survivors) -> Self {
        Self {
            scale: 1.0,
            ..Self::new(cloud, points)
        }
    }

    /// Mean over the culled points.
    pub(crate) fn mean(&self) -> f32 {
        match self.radii {
            Radii::Global(r) => self.scale * r,
            Radii::PerPoint(r) => {
                let sum: f32 = self.index.iter().map(|&i| r[i as usize]).sum();
                self.scale * sum / self.index.len().max(1) as f32
            }
        }
    }

    /// Mean over some of the culled points.
    pub(crate) fn mean_of(&self, some: &[u32]) -> f32 {
        let sum: f32 = some.iter().map(|&i| self.of(i as usize)).sum();
        sum / some.len().max(1) as f32
    }

    /// A bound of the radii of the culled points. It is theirs if the cloud is coarser elsewhere, else the cloud's.
    pub(crate) fn limit(&self, cloud: &PointCloud) -> f32 {
        let largest = match self.radii {
            Radii::PerPoint(r) if cloud.is_uneven() => {
                let culled = self.index.iter().map(|&i| r[i as usize]);
                culled.fold(0.0, f32::max)
            }
            _ => cloud.max_radius(),
        };
        self.scale * largest
    }

    /// Of the i-th culled point.
    #[inline(always)]
    pub(crate) fn of(&self, i: usize) -> f32 {
        match self.radii {
            Radii::Global(r) => self.scale * r,
            Radii::PerPoint(r) => self.scale * r[self.index[i] as usize],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_in_the_order_of_the_flags() {
        let mut rng = fastrand::Rng::with_seed(1);
        for _ in 0..1000 {
            let mask = rng.u64(..);
            let flags = std::array::from_fn(|i| (mask >> i & 1) as u8);
            assert_eq!(bits(&flags), mask);
        }
    }
}
