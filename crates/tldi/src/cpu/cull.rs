//! Stage `cull`: the points of one cloud inside the overlap of both bounds, in the frame of the
//! query.
//!
//! One pass over the cloud, skipping blocks of [`BLOCK`] points whose bounds miss the overlap: the
//! floor of the whole pipeline is this stage's reading of the coordinates. Of a cloud much finer
//! than the pixels only every n-th point is taken ([`stride`](crate::pair::plan::stride)): more would not be seen.
//!
//! Coarser points reach farther ([`reach`](crate::reach)). In such a cloud, the box of a block is
//! as wide as its coarsest point needs. Points inside are then tested again, each by its own
//! radius.

use super::fold::SpaceFold;
use super::lanes::multiversioned;
use crate::cloud::reach::{Ring, Uneven};
use crate::pair::sampling::first_taken;
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
    /// By how much each reaches farther than the cloud's mean radius, metres; empty where none does.
    pub(crate) further: Vec<f32>,
    /// Every how many points of the cloud were taken.
    stride: usize,
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

    fn append(&mut self, other: &Self) {
        self.x.extend_from_slice(&other.x);
        self.y.extend_from_slice(&other.y);
        self.z.extend_from_slice(&other.z);
        self.index.extend_from_slice(&other.index);
        self.further.extend_from_slice(&other.further);
    }

    /// Appends the points of a block that are inside the region, after moving them to its front.
    fn extend(&mut self, moved: &mut Moved, index_of: impl Fn(usize) -> u32) {
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

    fn reserve(&mut self, additional: usize, with_further: bool) {
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

/// Points whose culling is one parallel task.
const TASK_BLOCKS: usize = 128;

/// Memory of [`cull`], kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct CullScratch {
    tasks: Vec<Survivors>,
}

/// Which points of a cloud are kept: a box in the frame of the query and one in the frame of the
/// other surface.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// Overlap of both bounds in the frame of the query, metres.
    pub overlap: Aabb,
    /// From the frame of the query into the frame of the other surface.
    pub other_from_frame: Pose3,
    /// The other surface's bounds in its own frame, loosened: as good as an oriented box.
    pub other_bounds: Aabb,
    /// How far beyond what can touch points are culled.
    pub(crate) ring: Ring,
    /// By how much of it both boxes are loosened, metres.
    pub(crate) included: f32,
}

impl Region {
    /// The region of the points of a radius, metres.
    fn of_radius(&self, radius: f32) -> Self {
        let beyond = self.ring.beyond(self.included, radius);
        Self {
            overlap: self.overlap.loosened(beyond),
            other_bounds: self.other_bounds.loosened(beyond),
            ..*self
        }
    }

    /// Whether a point, in the frame of the query, is in it.
    fn contains(&self, point: Vec3) -> bool {
        self.overlap.contains(point) && self.other_bounds.contains(self.other_from_frame * point)
    }
}

/// Fills `out` with every `stride`-th point of `cloud` inside `region`, in the order of the cloud.
///
/// Cost: linear in the points of the blocks that meet the region; parallel over blocks where there
/// are many. The result does not depend on the number of threads.
pub(crate) fn cull(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    region: &Region,
    stride: usize,
    scratch: &mut CullScratch,
    out: &mut Survivors,
) {
    out.clear();
    out.stride = stride;
    if region.of_radius(cloud.max_radius()).overlap.is_empty() {
        return;
    }
    let blocks = cloud.blocks().len();
    let tasks = blocks.div_ceil(TASK_BLOCKS);
    if tasks <= 1 {
        cull_blocks(cloud, frame_from_cloud, region, stride, 0..blocks, out);
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
            part.reserve(TASK_BLOCKS * BLOCK.div_ceil(stride), cloud.is_uneven());
            let first = task * TASK_BLOCKS;
            let range = first..(first + TASK_BLOCKS).min(blocks);
            cull_blocks(cloud, frame_from_cloud, region, stride, range, part);
        });
    for part in &scratch.tasks[..tasks] {
        out.append(part);
    }
}

fn cull_blocks(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    region: &Region,
    stride: usize,
    blocks: std::ops::Range<usize>,
    out: &mut Survivors,
) {
    let uneven = Uneven::of(cloud);
    let widest = region.of_radius(cloud.max_radius());
    let mut kernel = Kernel::new(frame_from_cloud, &widest);
    let thinning = Thinning::new(stride);
    let [x, y, z] = cloud.coordinates();
    let mut moved = Moved::default();
    for block in blocks {
        let bounds = &cloud.blocks()[block];
        let bounds = match kernel.frame_from_cloud {
            Some(_) => bounds.transformed(frame_from_cloud),
            None => *bounds,
        };
        if !bounds.intersects(&widest.overlap) {
            continue;
        }
        let range = block * BLOCK..((block + 1) * BLOCK).min(x.len());
        if let Some(uneven) = &uneven {
            let region = region.of_radius(uneven.largest(range.clone()));
            if !bounds.intersects(&region.overlap) {
                continue;
            }
            kernel = Kernel::new(frame_from_cloud, &region);
        }
        let [x, y, z] = [x, y, z].map(|c| &c[range.clone()]);
        let taken = thinning.of_block(block);
        if !classify(&kernel, x, y, z, taken, &mut moved) {
            continue;
        }
        let first = range.start;
        if let Some(uneven) = &uneven {
            keep_own(uneven, &mut moved, first, region);
        }
        let before = out.len();
        out.extend(&mut moved, |i| (first + i) as u32);
        if let Some(uneven) = &uneven {
            let kept = out.index[before..].iter();
            (out.further).extend(kept.map(|&i| uneven.further(i as usize)));
        }
    }
}

/// Which points of a block are taken.
struct Thinning {
    stride: usize,
    /// 1 for every `stride`-th, else 0.
    taken: [u8; 2 * BLOCK],
}

impl Thinning {
    fn new(stride: usize) -> Self {
        Self {
            stride,
            taken: std::array::from_fn(|i| u8::from(i.is_multiple_of(stride))),
        }
    }

    /// 1 for the points of a block that are taken, else 0.
    fn of_block(&self, block: usize) -> &[u8; BLOCK] {
        let first = first_taken(block, self.stride);
        let from = (self.stride - first) % self.stride;
        self.taken[from..]
            .first_chunk()
            .expect("a stride is no longer than a block")
    }
}

/// Of the points in the region of the coarsest point, keeps those that are in their own region.
fn keep_own(uneven: &Uneven, moved: &mut Moved, first: usize, region: &Region) {
    for i in 0..BLOCK {
        if moved.inside[i] > 0 {
            let own = region.of_radius(uneven.radius(first + i));
            let point = Vec3::new(moved.x[i], moved.y[i], moved.z[i]);
            moved.inside[i] = u8::from(own.contains(point));
        }
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

/// Two rigid motions, `None` where nothing moves, and two boxes, unpacked for the inner loop.
struct Kernel {
    frame_from_cloud: Option<(Mat3, Vec3)>,
    overlap: Aabb,
    other_from_frame: Option<(Mat3, Vec3)>,
    other_bounds: Aabb,
}

impl Kernel {
    fn new(frame_from_cloud: &Pose3, region: &Region) -> Self {
        let motion = |pose: &Pose3| {
            (*pose != Pose3::IDENTITY).then(|| (Mat3::from_quat(pose.rotation), pose.translation))
        };
        Self {
            frame_from_cloud: motion(frame_from_cloud),
            overlap: region.overlap,
            other_from_frame: motion(&region.other_from_frame),
            other_bounds: region.other_bounds,
        }
    }
}

multiversioned! {
/// Moves points, and tells which are inside of those that are `taken`; whether any is.
fn classify(
    k: &Kernel,
    x: &[f32],
    y: &[f32],
    z: &[f32],
    taken: &[u8; BLOCK],
    moved: &mut Moved,
) -> bool {
    let stay = |p: [f32; 3]| p;
    let mover = |(r, t): (Mat3, Vec3)| move |[x, y, z]: [f32; 3]| [
        r.x_axis.x * x + r.y_axis.x * y + r.z_axis.x * z + t.x,
        r.x_axis.y * x + r.y_axis.y * y + r.z_axis.y * z + t.y,
        r.x_axis.z * x + r.y_axis.z * y + r.z_axis.z * z + t.z,
    ];
    let points = ([x, y, z], taken);
    let other = &k.other_bounds;
    match (k.frame_from_cloud, k.other_from_frame) {
        (None, None) => sort_out(points, stay, &k.overlap, stay, other, moved),
        (None, Some(to)) => sort_out(points, stay, &k.overlap, mover(to), other, moved),
        (Some(to), None) => sort_out(points, mover(to), &k.overlap, stay, other, moved),
        (Some(to), Some(on)) => sort_out(points, mover(to), &k.overlap, mover(on), other, moved),
    }
}
}

/// Moves points to where `overlap` is, then on to where `other` is, and tells which are in both boxes.
#[inline(always)]
fn sort_out(
    ([x, y, z], taken): ([&[f32]; 3], &[u8; BLOCK]),
    to_frame: impl Fn([f32; 3]) -> [f32; 3],
    overlap: &Aabb,
    to_other: impl Fn([f32; 3]) -> [f32; 3],
    other: &Aabb,
    moved: &mut Moved,
) -> bool {
    let n = x.len().min(y.len()).min(z.len()).min(BLOCK);
    let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
    let (mx, my, mz) = (&mut moved.x[..n], &mut moved.y[..n], &mut moved.z[..n]);
    moved.inside[n..].fill(0);
    let inside = &mut moved.inside[..n];
    let within = |[x, y, z]: [f32; 3], aabb: &Aabb| {
        (x >= aabb.min.x)
            & (x <= aabb.max.x)
            & (y >= aabb.min.y)
            & (y <= aabb.max.y)
            & (z >= aabb.min.z)
            & (z <= aabb.max.z)
    };
    for i in 0..n {
        let p = to_frame([x[i], y[i], z[i]]);
        let is_inside = within(p, overlap) & within(to_other(p), other);
        [mx[i], my[i], mz[i]] = p;
        inside[i] = u8::from(is_inside) & taken[i];
    }
    inside.iter().fold(0, |any, flag| any | flag) > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of an image whose rows are two blocks long, every 16th point leaves points in all columns.
    #[test]
    fn thinned_rows_are_left_everywhere() {
        let (width, rows, stride) = (2 * BLOCK, 64, 16);
        let point = |k: usize| Vec3::new((k % width) as f32, (k / width) as f32, 0.0);
        let points: Vec<Vec3> = (0..width * rows).map(point).collect();
        let cloud = PointCloud::builder(points).radius(1.0).build().unwrap();
        let everything = cloud.bounds().loosened(1.0);
        let region = Region {
            overlap: everything,
            other_from_frame: Pose3::IDENTITY,
            other_bounds: everything,
            ring: Ring::default(),
            included: 0.0,
        };
        let (mut left, mut scratch) = (Survivors::default(), CullScratch::default());
        let frame = Pose3::IDENTITY;
        cull(&cloud, &frame, &region, stride, &mut scratch, &mut left);
        assert_eq!(left.len() * stride, cloud.len());
        let mut in_strip = vec![0; width / 8];
        for (k, &index) in left.index.iter().enumerate() {
            assert_eq!(left.point(k), cloud.point(index as usize));
            in_strip[left.x[k] as usize / 8] += 1;
        }
        // 64 rows × 8 columns / 16, five standard deviations of a binomial.
        assert!(in_strip.iter().all(|n| (5..60).contains(n)), "{in_strip:?}");
    }

    /// By brute force, wherever frames are the same and where they are not.
    #[test]
    fn keeps_what_is_in_both_boxes() {
        let turned = Pose3::new(Vec3::new(0.2, -0.1, 0.3), Vec3::new(0.4, 0.9, -0.5));
        let mut rng = fastrand::Rng::with_seed(4);
        let point = |_| 2.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 1.0;
        let points: Vec<Vec3> = (0..3 * BLOCK).map(point).collect();
        let cloud = PointCloud::builder(&points).radius(0.1).build().unwrap();
        let aabb = |half: f32| Aabb {
            min: Vec3::splat(-half),
            max: Vec3::splat(half),
        };
        let mut counts = vec![];
        for frame_from_cloud in [Pose3::IDENTITY, turned] {
            for other_from_frame in [Pose3::IDENTITY, turned] {
                let region = Region {
                    overlap: aabb(0.6),
                    other_from_frame,
                    other_bounds: aabb(0.5),
                    ring: Ring::default(),
                    included: 0.0,
                };
                let is_kept = |&p: &Vec3| {
                    let [p, q] = [p, other_from_frame * p].map(Vec3::abs);
                    p.max_element() <= 0.6 && q.max_element() <= 0.5
                };
                let moved = points.iter().map(|p| frame_from_cloud * *p);
                let expected: Vec<Vec3> = moved.filter(is_kept).collect();
                let (mut kept, mut scratch) = (Survivors::default(), CullScratch::default());
                let frame = &frame_from_cloud;
                let wide = Region {
                    overlap: aabb(9.0),
                    other_bounds: aabb(9.0),
                    ..region
                };
                let (mut all, mut third) = (Survivors::default(), Survivors::default());
                cull(&cloud, frame, &wide, 1, &mut scratch, &mut all);
                cull(&cloud, frame, &region, 3, &mut scratch, &mut third);
                cull(&cloud, frame, &region, 1, &mut scratch, &mut kept);
                let mut selected = Survivors::default();
                selected.select(&all, &region);
                assert_eq!(selected.index, kept.index);
                assert_eq!(selected.x, kept.x);
                let is_taken = |&i: &u32| {
                    let (block, place) = (i as usize / BLOCK, i as usize % BLOCK);
                    let first = first_taken(block, 3);
                    place >= first && (place - first).is_multiple_of(3)
                };
                let thirds = kept.index.iter().copied().filter(is_taken);
                assert!(thirds.eq(third.index.iter().copied()));
                assert_eq!(kept.len(), expected.len());
                for (k, &p) in expected.iter().enumerate() {
                    // Rotations by quaternions and by matrices differ by rounding.
                    assert!(kept.point(k).distance(p) < 1e-6);
                }
                counts.push(expected.len());
            }
        }
        assert!(counts.iter().all(|&n| n > 20 && n < BLOCK), "{counts:?}");
    }

    /// Brute force says: each point is kept by its own radius, even if only some of the blocks hold coarse
    /// points.
    #[test]
    fn coarse_points_are_kept_farther_away() {
        let mut rng = fastrand::Rng::with_seed(6);
        let points: Vec<Vec3> = (0..4 * BLOCK)
            .map(|k| {
                let side = 2.0 * (k / BLOCK % 2) as f32 - 1.0;
                let coordinate = |_| 2.0 * rng.f32() - 1.0;
                Vec3::from_array([0, 1, 2].map(coordinate)).with_x(side * rng.f32())
            })
            .collect();
        // On the right up to 13 times as large as on the left.
        let radius = |p: Vec3| if p.x > 0.0 { 0.02 + 0.11 * p.x } else { 0.01 };
        let radii: Vec<f32> = points.iter().map(|&p| radius(p)).collect();
        let cloud = PointCloud::builder(&points).radii(radii).build().unwrap();
        assert!(cloud.is_uneven());
        let ring = Ring::new(&crate::Surface::Cloud(&cloud), 2.0);
        let aabb = |half: f32| Aabb {
            min: Vec3::splat(-half),
            max: Vec3::splat(half),
        };
        let included = 2.0 * cloud.mean_radius();
        let region = Region {
            overlap: aabb(0.5),
            other_from_frame: Pose3::IDENTITY,
            other_bounds: aabb(0.5),
            ring,
            included,
        };
        for (stride, most) in [(1, 10), (3, 3)] {
            let (mut kept, mut scratch) = (Survivors::default(), CullScratch::default());
            let frame = Pose3::IDENTITY;
            cull(&cloud, &frame, &region, stride, &mut scratch, &mut kept);
            let is_kept = |&i: &usize| {
                let beyond = (2.0 * radius(points[i]) - included).max(0.0);
                let is_taken = (i % BLOCK).checked_sub(first_taken(i / BLOCK, stride));
                points[i].abs().max_element() <= 0.5 + beyond
                    && is_taken.is_some_and(|k| k % stride == 0)
            };
            let expected: Vec<usize> = (0..points.len()).filter(is_kept).collect();
            assert!(kept.index.iter().map(|&i| i as usize).eq(expected));
            let far = |k: &usize| kept.point(*k).abs().max_element() > 0.5;
            assert!((0..kept.len()).filter(far).count() > most);
            for k in 0..kept.len() {
                let further = (radius(kept.point(k)) - cloud.mean_radius()).max(0.0);
                assert!((kept.further(k) - further).abs() < 1e-6);
            }
        }
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
