//! Stage `cull`: the points of one cloud inside the overlap of both bounds, in the frame of the
//! query.
//!
//! One pass over the cloud, skipping blocks of [`BLOCK`] points whose bounds miss the overlap: the
//! floor of the whole pipeline is this stage's reading of the coordinates. Of a cloud much finer
//! than the pixels only some points are taken ([`Thinning`]).

use super::lanes::multiversioned;
use crate::thinning::Thinning;
use crate::{Aabb, BLOCK, PointCloud, Radii};
use glamx::{Mat3, Pose3, Vec3};
use rayon::prelude::*;

/// Points that passed the cull, as structure of arrays, in the frame of the query.
#[derive(Debug, Default)]
pub(crate) struct Survivors {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) z: Vec<f32>,
    /// Indices into the cloud.
    pub(crate) index: Vec<u32>,
    /// Which points of the cloud were taken.
    thinning: Thinning,
}

impl Survivors {
    pub(crate) fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.index.clear();
    }

    pub(crate) fn len(&self) -> usize {
        self.x.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    pub(crate) fn point(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    fn append(&mut self, other: &Self) {
        self.x.extend_from_slice(&other.x);
        self.y.extend_from_slice(&other.y);
        self.z.extend_from_slice(&other.z);
        self.index.extend_from_slice(&other.index);
    }

    /// Appends the points of a block that are inside the region, after moving them to its front.
    fn extend(&mut self, moved: &mut Moved, first: usize, stride: usize) {
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
                index[kept] = (first + i * stride) as u32;
                kept += 1;
            }
        }
        self.x.extend_from_slice(&x[..kept]);
        self.y.extend_from_slice(&y[..kept]);
        self.z.extend_from_slice(&z[..kept]);
        self.index.extend_from_slice(&index[..kept]);
    }

    fn reserve(&mut self, additional: usize) {
        self.x.reserve(additional);
        self.y.reserve(additional);
        self.z.reserve(additional);
        self.index.reserve(additional);
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

/// Radii in metres of the culled points, which cover the surface even where some are left out.
#[derive(Clone, Copy)]
pub(crate) struct PointRadii<'a> {
    radii: &'a Radii<'a>,
    index: &'a [u32],
    thinning: Thinning,
}

impl<'a> PointRadii<'a> {
    pub(crate) fn new(cloud: &'a PointCloud, points: &'a Survivors) -> Self {
        Self {
            radii: cloud.radii(),
            index: &points.index,
            thinning: points.thinning,
        }
    }

    /// Mean over the culled points.
    pub(crate) fn mean(&self) -> f32 {
        match self.radii {
            Radii::Global(r) => self.thinning.radius(*r),
            Radii::PerPoint(_) => {
                let sum: f32 = (0..self.index.len()).map(|i| self.of(i)).sum();
                sum / self.index.len().max(1) as f32
            }
        }
    }

    /// At least the largest.
    pub(crate) fn limit(&self, cloud: &PointCloud) -> f32 {
        self.thinning.max_radius(cloud.max_radius())
    }

    /// Of the i-th culled point.
    #[inline(always)]
    pub(crate) fn of(&self, i: usize) -> f32 {
        self.thinning.radius(match self.radii {
            Radii::Global(r) => *r,
            Radii::PerPoint(r) => r[self.index[i] as usize],
        })
    }
}

/// Points whose culling is one parallel task.
const TASK_BLOCKS: usize = 128;

/// Memory of [`cull`], kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct CullScratch {
    tasks: Vec<Survivors>,
}

/// Which points of a cloud are kept: a box in the frame of the query and one in the frame of the
/// other surface.
#[derive(Clone, Debug)]
pub struct Region {
    /// Overlap of both bounds in the frame of the query, metres.
    pub overlap: Aabb,
    /// From the frame of the query into the frame of the other surface.
    pub other_from_frame: Pose3,
    /// The other surface's bounds in its own frame, loosened: as good as an oriented box.
    pub other_bounds: Aabb,
}

/// Fills `out` with the points of `cloud` inside `region` that `thinning` leaves, in the order of the
/// cloud.
///
/// Cost: linear in the points of the blocks that meet the region; parallel over blocks where there
/// are many. The result does not depend on the number of threads.
pub(crate) fn cull(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    region: &Region,
    thinning: Thinning,
    scratch: &mut CullScratch,
    out: &mut Survivors,
) {
    out.clear();
    out.thinning = thinning;
    if region.overlap.is_empty() {
        return;
    }
    let blocks = cloud.blocks().len();
    let tasks = blocks.div_ceil(TASK_BLOCKS);
    if tasks <= 1 {
        cull_blocks(cloud, frame_from_cloud, region, thinning, 0..blocks, out);
        return;
    }
    if scratch.tasks.len() < tasks {
        scratch.tasks.resize_with(tasks, Survivors::default);
    }
    scratch.tasks[..tasks]
        .par_iter_mut()
        .enumerate()
        .for_each(|(task, part)| {
            part.clear();
            // At once for all that may come: which task has how many changes from pose to pose.
            part.reserve(TASK_BLOCKS * BLOCK.div_ceil(thinning.stride));
            let first = task * TASK_BLOCKS;
            let range = first..(first + TASK_BLOCKS).min(blocks);
            cull_blocks(cloud, frame_from_cloud, region, thinning, range, part);
        });
    for part in &scratch.tasks[..tasks] {
        out.append(part);
    }
}

fn cull_blocks(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    region: &Region,
    thinning: Thinning,
    blocks: std::ops::Range<usize>,
    out: &mut Survivors,
) {
    let kernel = Kernel::new(frame_from_cloud, region);
    let [x, y, z] = cloud.coordinates();
    let mut moved = Moved::default();
    let mut strided = [[0.0; BLOCK]; 3];
    for block in blocks {
        if !cloud.blocks()[block]
            .transformed(frame_from_cloud)
            .intersects(&region.overlap)
        {
            continue;
        }
        let end = ((block + 1) * BLOCK).min(x.len());
        let (first, stride) = match cloud.radii() {
            Radii::Global(_) => (thinning.first(block), thinning.stride),
            Radii::PerPoint(_) => (0, 1),
        };
        let range = (block * BLOCK + first).min(end)..end;
        if stride == 1 {
            let [x, y, z] = [x, y, z].map(|c| &c[range.clone()]);
            classify(&kernel, x, y, z, &mut moved);
        } else {
            for (to, from) in strided.iter_mut().zip([x, y, z]) {
                let taken = from[range.clone()].iter().step_by(stride);
                to.iter_mut().zip(taken).for_each(|(to, from)| *to = *from);
            }
            let n = range.len().div_ceil(stride);
            let [x, y, z] = strided.each_ref().map(|c| &c[..n]);
            classify(&kernel, x, y, z, &mut moved);
        }
        if let Radii::PerPoint(radii) = cloud.radii()
            && thinning.stride > 1
        {
            thin(
                thinning,
                range.start,
                &radii[range.clone()],
                &mut moved.inside,
            );
        }
        out.extend(&mut moved, range.start, stride);
    }
}

/// One block's points in the frame of the query, and whether they are inside the region.
struct Moved {
    x: [f32; BLOCK],
    y: [f32; BLOCK],
    z: [f32; BLOCK],
    /// 1 or 0; 0 beyond the points of the block.
    inside: [u8; BLOCK],
}

impl Default for Moved {
    fn default() -> Self {
        Self {
            x: [0.0; BLOCK],
            y: [0.0; BLOCK],
            z: [0.0; BLOCK],
            inside: [0; BLOCK],
        }
    }
}

/// Two rigid motions and two boxes, unpacked for the inner loop.
struct Kernel {
    r: Mat3,
    t: Vec3,
    lo: Vec3,
    hi: Vec3,
    other_r: Mat3,
    other_t: Vec3,
    other_lo: Vec3,
    other_hi: Vec3,
}

impl Kernel {
    fn new(frame_from_cloud: &Pose3, region: &Region) -> Self {
        Self {
            r: Mat3::from_quat(frame_from_cloud.rotation),
            t: frame_from_cloud.translation,
            lo: region.overlap.min,
            hi: region.overlap.max,
            other_r: Mat3::from_quat(region.other_from_frame.rotation),
            other_t: region.other_from_frame.translation,
            other_lo: region.other_bounds.min,
            other_hi: region.other_bounds.max,
        }
    }
}

multiversioned! {
fn classify(k: &Kernel, x: &[f32], y: &[f32], z: &[f32], moved: &mut Moved) {
    let n = x.len().min(y.len()).min(z.len()).min(BLOCK);
    let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
    let (mx, my, mz) = (&mut moved.x[..n], &mut moved.y[..n], &mut moved.z[..n]);
    moved.inside[n..].fill(0);
    let inside = &mut moved.inside[..n];
    let (r, t, o, ot) = (&k.r, k.t, &k.other_r, k.other_t);
    for i in 0..n {
        let px = r.x_axis.x * x[i] + r.y_axis.x * y[i] + r.z_axis.x * z[i] + t.x;
        let py = r.x_axis.y * x[i] + r.y_axis.y * y[i] + r.z_axis.y * z[i] + t.y;
        let pz = r.x_axis.z * x[i] + r.y_axis.z * y[i] + r.z_axis.z * z[i] + t.z;
        let qx = o.x_axis.x * px + o.y_axis.x * py + o.z_axis.x * pz + ot.x;
        let qy = o.x_axis.y * px + o.y_axis.y * py + o.z_axis.y * pz + ot.y;
        let qz = o.x_axis.z * px + o.y_axis.z * py + o.z_axis.z * pz + ot.z;
        let within = (px >= k.lo.x)
            & (px <= k.hi.x)
            & (py >= k.lo.y)
            & (py <= k.hi.y)
            & (pz >= k.lo.z)
            & (pz <= k.hi.z)
            & (qx >= k.other_lo.x)
            & (qx <= k.other_hi.x)
            & (qy >= k.other_lo.y)
            & (qy <= k.other_hi.y)
            & (qz >= k.other_lo.z)
            & (qz <= k.other_hi.z);
        mx[i] = px;
        my[i] = py;
        mz[i] = pz;
        inside[i] = u8::from(within);
    }
}
}

multiversioned! {
/// Leaves out those of a block's points, from the one of index `first` on, that thinning does not leave.
fn thin(thinning: Thinning, first: usize, radii: &[f32], inside: &mut [u8; BLOCK]) {
    for ((radius, inside), index) in radii.iter().zip(inside).zip(first as u32..) {
        *inside &= u8::from(thinning.is_left(index, *radius));
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Params;

    /// Pixels of this edge in metres, each with one point.
    fn pixels(edge: f32) -> Params {
        Params {
            points_per_pixel: 1.0,
            ..Params::for_radius(edge)
        }
    }

    /// What thinning leaves of a whole cloud.
    fn left_of(cloud: &PointCloud, thinning: Thinning) -> Survivors {
        let everything = cloud.bounds().loosened(1.0);
        let region = Region {
            overlap: everything,
            other_from_frame: Pose3::IDENTITY,
            other_bounds: everything,
        };
        let (mut left, mut scratch) = (Survivors::default(), CullScratch::default());
        let frame = Pose3::IDENTITY;
        cull(cloud, &frame, &region, thinning, &mut scratch, &mut left);
        left
    }

    /// Of an image whose rows are two blocks long, every 16th point leaves points in all columns.
    #[test]
    fn thinned_rows_are_left_everywhere() {
        let (width, rows, stride) = (2 * BLOCK, 64, 16);
        let thinning = Thinning::new(1.0, &pixels(4.2));
        assert_eq!(thinning.stride, stride);
        let point = |k: usize| Vec3::new((k % width) as f32, (k / width) as f32, 0.0);
        let points: Vec<Vec3> = (0..width * rows).map(point).collect();
        let cloud = PointCloud::builder(points).radius(1.0).build().unwrap();
        let left = left_of(&cloud, thinning);
        assert_eq!(left.len() * stride, cloud.len());
        let mut in_strip = vec![0; width / 8];
        for (k, &index) in left.index.iter().enumerate() {
            assert_eq!(left.point(k), cloud.point(index as usize));
            in_strip[left.x[k] as usize / 8] += 1;
        }
        // 64 rows × 8 columns / 16, five standard deviations of a binomial.
        assert!(in_strip.iter().all(|n| (5..60).contains(n)), "{in_strip:?}");
    }

    /// A fine part of a cloud among points that are far apart, in random order.
    #[test]
    fn what_is_far_apart_is_not_thinned() {
        let mut rng = fastrand::Rng::with_seed(1);
        let points: Vec<Vec3> = (0..3000).map(|_| Vec3::splat(rng.f32())).collect();
        let radii: Vec<f32> = (0..3000)
            .map(|_| if rng.u8(..50) == 0 { 0.5 } else { 0.05 })
            .collect();
        let far_apart = radii.iter().filter(|&&r| r == 0.5).count();
        let cloud = PointCloud::builder(points).radii(radii).build().unwrap();
        let thinning = Thinning::new(cloud.mean_radius(), &pixels(4.2 * cloud.mean_radius()));
        let left = left_of(&cloud, thinning);
        let radii = PointRadii::new(&cloud, &left);
        let radii: Vec<f32> = (0..left.len()).map(|i| radii.of(i)).collect();
        assert_eq!(radii.iter().filter(|&&r| r == 0.5).count(), far_apart);
        // The others stand for as many as their new discs are larger.
        let others: Vec<f32> = radii.into_iter().filter(|&r| r != 0.5).collect();
        assert!(
            others.iter().all(|r| *r == others[0] && *r > 0.1),
            "{}",
            others[0]
        );
        let stand_for = others.len() as f32 * (others[0] / 0.05).powi(2);
        assert!((2000.0..4000.0).contains(&stand_for), "{stand_for}");
    }

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
