//! Takes the points that are in a region out of runs of points.
//!
//! Few points of a cloud are in the overlap with another. So all of them meet a box in their own frame, which costs no
//! more than to read them. Only those inside are moved and meet the region itself, many at once.

use crate::cloud::reach::Uneven;
use crate::cpu::cull::region::Region;
use crate::cpu::cull::survivors::Survivors;
use crate::cpu::lanes::multiversioned;
use crate::{Aabb, BLOCK};
use glamx::{Mat3, Pose3, Vec3};

/// Room for the points of one run behind fewer than as many of others.
const CAPACITY: usize = 2 * BLOCK;

/// A region, and the points that may be in it.
pub(super) struct Sieve<'a> {
    region: &'a Region,
    /// Of the cloud, if its points do not reach equally far.
    uneven: Option<Uneven<'a>>,
    kernel: Kernel,
    x: [f32; CAPACITY],
    y: [f32; CAPACITY],
    z: [f32; CAPACITY],
    /// Indices into the cloud.
    index: [u32; CAPACITY],
    /// 1 or 0.
    inside: [u8; CAPACITY],
    count: usize,
}

impl<'a> Sieve<'a> {
    /// For points in a frame of their own. No point reaches farther than those of `largest` radius, metres.
    pub(super) fn new(
        frame_from_points: &Pose3,
        region: &'a Region,
        largest: f32,
        uneven: Option<Uneven<'a>>,
    ) -> Self {
        Self {
            region,
            uneven,
            kernel: Kernel::new(frame_from_points, &region.of_radius(largest)),
            x: [0.0; CAPACITY],
            y: [0.0; CAPACITY],
            z: [0.0; CAPACITY],
            index: [0; CAPACITY],
            inside: [0; CAPACITY],
            count: 0,
        }
    }

    /// Takes a run of up to [`BLOCK`] points, those of them that are `taken` (1, else 0) and within `bounds`. `out` may
    /// get them later than those of the next run.
    pub(super) fn put(
        &mut self,
        points: &[Vec3],
        taken: &[u8; BLOCK],
        bounds: &Aabb,
        index_of: impl Fn(usize) -> u32,
        out: &mut Survivors,
    ) {
        let mut inside = [0; BLOCK];
        find_within(bounds, points, taken, &mut inside);
        let (words, _) = inside.as_chunks::<64>();
        let mut at = self.count;
        for (word, flags) in words.iter().enumerate() {
            let mut mask = bits(flags);
            while mask != 0 {
                let i = 64 * word + mask.trailing_zeros() as usize;
                mask &= mask - 1;
                [self.x[at], self.y[at], self.z[at]] = points[i].to_array();
                self.index[at] = index_of(i);
                at += 1;
            }
        }
        self.count = at;
        if self.count >= BLOCK {
            self.empty(out);
        }
    }

    /// Moves the points into the frame of the query, and gives those that are in the region to `out`.
    pub(super) fn empty(&mut self, out: &mut Survivors) {
        let n = self.count;
        self.count = 0;
        let (x, y, z) = (&mut self.x[..n], &mut self.y[..n], &mut self.z[..n]);
        let (index, inside) = (&mut self.index[..n], &mut self.inside[..n]);
        move_into(&self.kernel, x, y, z, inside);
        if let Some(uneven) = &self.uneven {
            for i in 0..n {
                let own = self.region.of_radius(uneven.radius(index[i] as usize));
                inside[i] &= u8::from(own.contains(Vec3::new(x[i], y[i], z[i])));
            }
        }
        let mut kept = 0;
        // Most are, so nothing moves.
        if inside.contains(&0) {
            for i in 0..n {
                (x[kept], y[kept], z[kept], index[kept]) = (x[i], y[i], z[i], index[i]);
                kept += usize::from(inside[i]);
            }
        } else {
            kept = n;
        }
        out.x.extend_from_slice(&x[..kept]);
        out.y.extend_from_slice(&y[..kept]);
        out.z.extend_from_slice(&z[..kept]);
        out.index.extend_from_slice(&index[..kept]);
        if let Some(uneven) = &self.uneven {
            let further = index[..kept].iter().map(|&i| uneven.further(i as usize));
            out.further.extend(further);
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

#[inline(always)]
fn is_within([x, y, z]: [f32; 3], aabb: &Aabb) -> bool {
    (x >= aabb.min.x)
        & (x <= aabb.max.x)
        & (y >= aabb.min.y)
        & (y <= aabb.max.y)
        & (z >= aabb.min.z)
        & (z <= aabb.max.z)
}

multiversioned! {
/// Tells which of the points that are `taken` are within `bounds`: 1, else 0.
fn find_within(bounds: &Aabb, points: &[Vec3], taken: &[u8; BLOCK], inside: &mut [u8; BLOCK]) {
    let n = points.len().min(BLOCK);
    let (points, inside) = (&points[..n], &mut inside[..n]);
    for i in 0..n {
        inside[i] = u8::from(is_within(points[i].to_array(), bounds)) & taken[i];
    }
}
}

/// Two rigid motions, `None` where nothing moves, and two boxes, unpacked for the inner loop.
struct Kernel {
    frame_from_points: Option<(Mat3, Vec3)>,
    overlap: Aabb,
    other_from_frame: Option<(Mat3, Vec3)>,
    other_bounds: Aabb,
}

impl Kernel {
    fn new(frame_from_points: &Pose3, region: &Region) -> Self {
        let motion = |pose: &Pose3| {
            (*pose != Pose3::IDENTITY).then(|| (Mat3::from_quat(pose.rotation), pose.translation))
        };
        Self {
            frame_from_points: motion(frame_from_points),
            overlap: region.overlap,
            other_from_frame: motion(&region.other_from_frame),
            other_bounds: region.other_bounds,
        }
    }
}

multiversioned! {
/// Moves points, and tells which are in both boxes: 1, else 0.
fn move_into(k: &Kernel, x: &mut [f32], y: &mut [f32], z: &mut [f32], inside: &mut [u8]) {
    let stay = |p: [f32; 3]| p;
    let mover = |(r, t): (Mat3, Vec3)| move |[x, y, z]: [f32; 3]| [
        r.x_axis.x * x + r.y_axis.x * y + r.z_axis.x * z + t.x,
        r.x_axis.y * x + r.y_axis.y * y + r.z_axis.y * z + t.y,
        r.x_axis.z * x + r.y_axis.z * y + r.z_axis.z * z + t.z,
    ];
    let points = [x, y, z];
    match (k.frame_from_points, k.other_from_frame) {
        (None, None) => sort_out(k, points, stay, stay, inside),
        (None, Some(to)) => sort_out(k, points, stay, mover(to), inside),
        (Some(to), None) => sort_out(k, points, mover(to), stay, inside),
        (Some(to), Some(on)) => sort_out(k, points, mover(to), mover(on), inside),
    }
}
}

#[inline(always)]
fn sort_out(
    k: &Kernel,
    [x, y, z]: [&mut [f32]; 3],
    to_frame: impl Fn([f32; 3]) -> [f32; 3],
    to_other: impl Fn([f32; 3]) -> [f32; 3],
    inside: &mut [u8],
) {
    let n = inside.len();
    let (x, y, z) = (&mut x[..n], &mut y[..n], &mut z[..n]);
    for i in 0..n {
        let p = to_frame([x[i], y[i], z[i]]);
        let is_inside = is_within(p, &k.overlap) & is_within(to_other(p), &k.other_bounds);
        [x[i], y[i], z[i]] = p;
        inside[i] = u8::from(is_inside);
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
