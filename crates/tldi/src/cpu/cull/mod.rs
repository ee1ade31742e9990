//! Stage `cull`: the points of one cloud inside the overlap of both bounds, in the frame of the
//! query.
//!
//! One pass over the cloud, skipping blocks of [`BLOCK`] points whose bounds miss the overlap: the
//! floor of the whole pipeline is this stage's reading of the coordinates. Of a cloud much finer
//! than the pixels only every n-th point is taken ([`stride`](crate::pair::plan::stride)): more would not be seen.
//!
//! Coarser points reach farther ([`reach`](crate::cloud::reach)). In such a cloud, the box of a block is
//! as wide as its coarsest point needs. Points inside are then tested again, each by its own
//! radius.

mod region;
mod sieve;
mod survivors;
mod thinning;

pub use region::Region;
pub(crate) use survivors::{PointRadii, Survivors};

use crate::cloud::reach::Uneven;
use crate::stage::stage;
use crate::{BLOCK, PointCloud};
use glamx::{Pose3, Vec3};
use rayon::prelude::*;
use sieve::Sieve;
use thinning::Thinning;

/// Blocks of points whose culling is one parallel task.
const TASK_BLOCKS: usize = 128;

/// Memory of [`cull`], kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct CullScratch {
    tasks: Vec<Survivors>,
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
    let _stage = stage!("cull");
    out.clear();
    out.stride = stride;
    if region.of_radius(cloud.max_radius()).overlap.is_empty() {
        return;
    }
    let blocks = cloud.blocks().len();
    let tasks = blocks.div_ceil(TASK_BLOCKS);
    if tasks <= 1 || rayon::current_num_threads() == 1 {
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

/// Largest share of a cloud's bounds in which all points are held for several looks. Beyond it, to read the cloud once
/// more takes less time than to write them down. Half or twice: no frame takes longer or shorter beyond what times scatter by.
const HELD: f32 = 0.2;

/// Whether the region holds so small a share of the cloud's bounds that its points are better held than culled again for
/// each look.
pub(crate) fn are_few(cloud: &PointCloud, frame_from_cloud: &Pose3, region: &Region) -> bool {
    let all = cloud.bounds().extents();
    let inside = region
        .bounds_in(frame_from_cloud)
        .intersection(cloud.bounds());
    let share = inside.extents().max(Vec3::ZERO) / all;
    // Of a flat cloud, the share of its length across is no number.
    Vec3::select(all.cmpgt(Vec3::ZERO), share, Vec3::ONE).element_product() <= HELD
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
    let bounds_of = |radius| region.of_radius(radius).bounds_in(frame_from_cloud);
    let widest = bounds_of(cloud.max_radius());
    let mut sieve = Sieve::new(frame_from_cloud, region, cloud.max_radius(), uneven);
    let thinning = Thinning::new(stride);
    for block in blocks {
        let bounds = &cloud.blocks()[block];
        if !bounds.intersects(&widest) {
            continue;
        }
        let first = block * BLOCK;
        let range = first..(first + BLOCK).min(cloud.len());
        let mut reached = widest;
        if let Some(uneven) = &uneven {
            reached = bounds_of(uneven.largest(range.clone()));
            if !bounds.intersects(&reached) {
                continue;
            }
        }
        let run = &cloud.points()[range];
        let (taken, index_of) = (thinning.of_block(block), |i| (first + i) as u32);
        sieve.put(run, taken, &reached, index_of, out);
    }
    sieve.empty(out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::cloud::reach::Ring;
    use crate::pair::sampling::first_taken;

    fn is_taken(index: usize, stride: usize) -> bool {
        let first = first_taken(index / BLOCK, stride);
        (index % BLOCK)
            .checked_sub(first)
            .is_some_and(|k| k.is_multiple_of(stride))
    }

    /// Of an image whose rows are two blocks long, every 16th point leaves points in all columns.
    #[test]
    fn thinned_rows_are_left_everywhere() {
        let (width, rows, stride) = (2 * BLOCK, 64, 16);
        let point = |k: usize| Vec3::new((k % width) as f32, (k / width) as f32, 0.0);
        let points: Vec<Vec3> = (0..width * rows).map(point).collect();
        let cloud = PointCloud::builder(points).radius(1.0).build().unwrap();
        let region = Region::of_box(cloud.bounds().loosened(1.0));
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
                    other_from_frame,
                    other_bounds: aabb(0.5),
                    ..Region::of_box(aabb(0.6))
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
                let is_taken = |&i: &u32| is_taken(i as usize, 3);
                let thirds = kept.index.iter().copied().filter(is_taken);
                assert!(thirds.eq(third.index.iter().copied()));
                selected.thin_out(&kept, 3);
                assert_eq!(selected.index, third.index);
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
                let is_inside = points[i].abs().max_element() <= 0.5 + beyond;
                is_inside && is_taken(i, stride)
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
}
