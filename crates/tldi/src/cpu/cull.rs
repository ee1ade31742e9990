//! Stage `cull`: the points of one cloud inside the overlap of both bounds, in the frame of the
//! query.
//!
//! One pass over the cloud, skipping blocks of [`BLOCK`] points whose bounds miss the overlap: the
//! floor of the whole pipeline is this stage's reading of the coordinates. Of a cloud much finer
//! than the pixels only every n-th point is taken ([`stride`]): more would not be seen.

use crate::{Aabb, BLOCK, PointCloud, Radii};
use glamx::{Mat3, Pose3, Vec3};
use multiversion::multiversion;
use rayon::prelude::*;

/// Points that passed the cull, as structure of arrays, in the frame of the query.
#[derive(Default)]
pub(crate) struct Survivors {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) z: Vec<f32>,
    /// Radii in metres.
    pub(crate) radius: Vec<f32>,
    /// Indices into the cloud.
    pub(crate) index: Vec<u32>,
    /// Unit normals in the frame of the query; empty until the stage `normals` has run.
    pub(crate) normal: Vec<Vec3>,
}

impl Survivors {
    pub(crate) fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.radius.clear();
        self.index.clear();
        self.normal.clear();
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
        self.radius.extend_from_slice(&other.radius);
        self.index.extend_from_slice(&other.index);
    }
}

/// Points that are kept per pixel of a surface seen face on: enough for the mean of a layer.
const POINTS_PER_PIXEL: f32 = 8.0;

/// Every how many points of a cloud are enough for pixels of this size, metres.
///
/// With radii of 0.65 × the distance of the 7th neighbour there are 0.94 (pixel / r̄)² points to a
/// pixel.
pub(crate) fn stride(cloud: &PointCloud, pixel_size: f32) -> usize {
    let per_pixel = 0.94 * (pixel_size / cloud.mean_radius()).powi(2);
    ((per_pixel / POINTS_PER_PIXEL) as usize).clamp(1, BLOCK)
}

/// Points whose culling is one parallel task.
const TASK_BLOCKS: usize = 128;

/// Memory of [`cull`], kept from call to call.
#[derive(Default)]
pub(crate) struct CullScratch {
    tasks: Vec<Survivors>,
}

/// What is kept: a box in the frame of the query and one in the frame of the other surface.
pub(crate) struct Region {
    /// Overlap of both bounds in the frame of the query.
    pub(crate) overlap: Aabb,
    /// From the frame of the query into the frame of the other surface.
    pub(crate) other_from_frame: Pose3,
    /// The other surface's bounds in its own frame, loosened: as good as an oriented box.
    pub(crate) other_bounds: Aabb,
}

/// Fills `out` with every `stride`-th point of `cloud` inside `region`, in the order of the cloud;
/// their radii are scaled so that they still cover the surface.
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
    if region.overlap.is_empty() {
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
    let kernel = Kernel::new(frame_from_cloud, region);
    let [x, y, z] = cloud.coordinates();
    let mut moved = Moved::default();
    let mut thinned = [[0.0; BLOCK]; 3];
    for block in blocks {
        if !cloud.blocks()[block]
            .transformed(frame_from_cloud)
            .intersects(&region.overlap)
        {
            continue;
        }
        let range = block * BLOCK..((block + 1) * BLOCK).min(x.len());
        if stride == 1 {
            let [x, y, z] = [x, y, z].map(|c| &c[range.clone()]);
            classify(&kernel, x, y, z, &mut moved);
        } else {
            let thin = |c: &[f32], to: &mut [f32; BLOCK]| {
                let taken = c[range.clone()].iter().step_by(stride);
                to.iter_mut().zip(taken).for_each(|(to, from)| *to = *from);
            };
            thin(x, &mut thinned[0]);
            thin(y, &mut thinned[1]);
            thin(z, &mut thinned[2]);
            let n = range.len().div_ceil(stride);
            let [x, y, z] = &thinned;
            classify(&kernel, &x[..n], &y[..n], &z[..n], &mut moved);
        }
        for i in 0..range.len().div_ceil(stride) {
            if moved.inside[i] != 0 {
                out.x.push(moved.x[i]);
                out.y.push(moved.y[i]);
                out.z.push(moved.z[i]);
                out.index.push((range.start + i * stride) as u32);
            }
        }
    }
    let grown = (stride as f32).sqrt();
    match cloud.radii() {
        Radii::Global(r) => out.radius.resize(out.x.len(), grown * r),
        Radii::PerPoint(r) => {
            let radii = out.index.iter().map(|&i| grown * r[i as usize]);
            out.radius.extend(radii);
        }
    }
}

/// One block's points in the frame of the query, and whether they are inside the region.
struct Moved {
    x: [f32; BLOCK],
    y: [f32; BLOCK],
    z: [f32; BLOCK],
    inside: [u32; BLOCK],
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

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2+fma",
    "aarch64+neon"
))]
fn classify(k: &Kernel, x: &[f32], y: &[f32], z: &[f32], moved: &mut Moved) {
    let n = x.len().min(y.len()).min(z.len()).min(BLOCK);
    let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
    let (mx, my, mz) = (&mut moved.x[..n], &mut moved.y[..n], &mut moved.z[..n]);
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
        inside[i] = u32::from(within);
    }
}
