//! The points that a cull leaves, and their radii.

use crate::cpu::cull::region::Region;
use crate::cpu::cull::sieve::Sieve;
use crate::cpu::cull::thinning::Thinning;
use crate::cpu::fold::SpaceFold;
use crate::stage::stage;
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

    pub(crate) fn points(&self) -> impl ExactSizeIterator<Item = Vec3> + Clone {
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

    /// Leaves out the points within `apart` metres of one of `places`, which ascend in x; whether there are any.
    pub(crate) fn leave_out(&mut self, places: &[Vec3], apart: f32) -> bool {
        let is_at = |point: Vec3| {
            let first = places.partition_point(|place| place.x < point.x - apart);
            let mut near = places[first..]
                .iter()
                .take_while(|p| p.x <= point.x + apart);
            near.any(|place| place.distance_squared(point) <= apart * apart)
        };
        let mut kept = 0;
        for i in 0..self.len() {
            if !is_at(self.point(i)) {
                (self.x[kept], self.y[kept], self.z[kept]) = (self.x[i], self.y[i], self.z[i]);
                self.index[kept] = self.index[i];
                if let Some(&further) = self.further.get(i) {
                    self.further[kept] = further;
                }
                kept += 1;
            }
        }
        let are_any = kept < self.len();
        for axis in [&mut self.x, &mut self.y, &mut self.z, &mut self.further] {
            axis.truncate(kept);
        }
        self.index.truncate(kept);
        are_any
    }

    /// Takes every `stride`-th point of the cloud that is in `all`. The cloud is even.
    pub(crate) fn thin_out(&mut self, all: &Self, stride: usize) {
        let _stage = stage!("cull");
        self.clear();
        self.stride = stride;
        let thinning = Thinning::new(stride);
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.resize(all.len(), 0.0);
        }
        self.index.resize(all.len(), 0);
        let block_of = |i: u32| i as usize / BLOCK;
        let runs = (all.index).chunk_by(|&i, &next| block_of(i) == block_of(next));
        let (mut k, mut kept) = (0, 0);
        for run in runs {
            let taken = thinning.of_block(block_of(run[0]));
            for &i in run {
                // All are written, and the next one over those that are not taken: no branch is guessed wrong.
                (self.x[kept], self.y[kept], self.z[kept]) = (all.x[k], all.y[k], all.z[k]);
                self.index[kept] = i;
                kept += usize::from(taken[i as usize % BLOCK]);
                k += 1;
            }
        }
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.truncate(kept);
        }
        self.index.truncate(kept);
    }

    /// Takes those of `all` points that are in `region`. The cloud is even.
    pub(crate) fn select(&mut self, all: &Self, region: &Region) {
        let _stage = stage!("cull");
        self.clear();
        self.stride = all.stride;
        let bounds = region.bounds_in(&Pose3::IDENTITY);
        let mut sieve = Sieve::new(&Pose3::IDENTITY, region, 0.0, None);
        let mut run = [Vec3::ZERO; BLOCK];
        for first in (0..all.len()).step_by(BLOCK) {
            let count = BLOCK.min(all.len() - first);
            for (k, point) in run[..count].iter_mut().enumerate() {
                *point = all.point(first + k);
            }
            let index_of = |i| all.index[first + i];
            sieve.put(&run[..count], &[1; BLOCK], &bounds, index_of, self);
        }
        sieve.empty(self);
    }

    pub(super) fn append(&mut self, other: &Self) {
        self.x.extend_from_slice(&other.x);
        self.y.extend_from_slice(&other.y);
        self.z.extend_from_slice(&other.z);
        self.index.extend_from_slice(&other.index);
        self.further.extend_from_slice(&other.further);
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
                let sum: f64 = self.index.iter().map(|&i| f64::from(r[i as usize])).sum();
                self.scale * (sum / self.index.len().max(1) as f64) as f32
            }
        }
    }

    /// Mean over some of the culled points.
    pub(crate) fn mean_of(&self, some: &[u32]) -> f32 {
        let sum: f64 = some.iter().map(|&i| f64::from(self.of(i as usize))).sum();
        (sum / some.len().max(1) as f64) as f32
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

    /// The sum of radii that are much less than the one before them keeps them.
    #[test]
    fn the_mean_radius_is_that_of_all_points() {
        let radii: Vec<f32> = (0..1001)
            .map(|k| if k == 0 { 16_777_216.0 } else { 1.0 })
            .collect();
        let points = vec![Vec3::ZERO; radii.len()];
        let cloud = PointCloud::builder(points).radii(radii).build().unwrap();
        let survivors = Survivors {
            index: (0..1001).collect(),
            stride: 1,
            ..Survivors::default()
        };
        // In f32, 2^24 + 1 is 2^24.
        let mean = (16_777_216.0 + 1000.0) / 1001.0;
        let all: Vec<u32> = (0..1001).collect();
        let radii = PointRadii::new(&cloud, &survivors);
        assert_eq!([radii.mean(), radii.mean_of(&all)], [mean; 2]);
    }
}
