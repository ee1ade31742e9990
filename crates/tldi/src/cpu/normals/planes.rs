//! Planes of neighbourhoods of points: their normals are solved for side by side.

use crate::cloud::point_normals::least_variance_axis;
use crate::cpu::lanes::multiversioned;
use bytemuck::Zeroable;
use glamx::{DMat3, DVec3, FloatExt, Mat4, Vec3, Vec4};

/// Neighbours that are summed side by side: an AVX2 register of `f32`. `Batch::add_up` is written for 8. With 16, slight
/// frames took 3 to 5 % longer.
pub(crate) const LANES: usize = 8;

/// Planes that are solved for side by side.
const BATCH: usize = 64;

/// Share of the squared variance that the two larger axes of a neighbourhood must have for a normal in single
/// precision: below it the points are on a line or coincide. Half or twice: no row changes.
const LEAST_PLANAR: f32 = 1e-4;

/// Radius of the neighbourhood whose covariance gives the normal, in mean radii of the points.
/// With 0.65 × the 7th neighbour's distance it holds about 25 neighbours on a surface. Half: depths of deep edges
/// twice as wrong; twice: depths 29 % worse, and 19 % more points pass a cull.
pub const SUPPORT: f32 = 3.0;

/// Standard deviation of neighbours from their plane, in mean radii, up to which they are on it: a tenth of a pixel,
/// which contacts may err by. Half or twice: no change.
const ON_PLANE: f32 = 0.1;

/// Largest ratio of a measured variance to the noise's own that noise alone explains. Over 20 points, a variance
/// scatters by a third. Half or twice: no row changes.
const OF_NOISE: f32 = 2.0;

/// Share of the squared distances from the plane of its neighbourhood that is a point's own if it is none of the surface:
/// more than that of all others together. Of 20 points with normal noise, one has it at 4.7 standard deviations.
/// Half: the armadillo errs in 0.025 % of the cases instead of 0.022 %; twice, which no point has: 7 of 280 rows
/// with flawed clouds fail instead of 2.
const STANDS_OUT: f32 = 0.5;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 5] = [
    ("SUPPORT", SUPPORT as f64),
    ("LEAST_PLANAR", LEAST_PLANAR as f64),
    ("ON_PLANE", ON_PLANE as f64),
    ("OF_NOISE", OF_NOISE as f64),
    ("STANDS_OUT", STANDS_OUT as f64),
];

/// The points around one that tell the plane there.
#[derive(Clone, Copy)]
pub(crate) struct Neighborhood {
    /// [`SUPPORT`] mean radii, metres.
    pub(crate) radius: f32,
    /// Standard deviation of the points that the user gave, metres.
    pub(crate) noise: f32,
}

impl Neighborhood {
    /// Variance up to which points are on a plane, square metres.
    pub(crate) fn on_plane(&self) -> f32 {
        (ON_PLANE / SUPPORT * self.radius).powi(2) + OF_NOISE * self.noise * self.noise
    }
}

/// Sums over the points around a point, of 1, x, y, z, xx, xy, xz, yy, yz and zz; metres from the point.
type Moments = [f32; 10];

/// The same, each in parts that are still to be added up.
pub(crate) type PartialMoments = [[f32; LANES]; 10];

/// The plane that best fits the points around a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    /// Unit; either way.
    pub(crate) normal: Vec3,
    /// Of the points about it, square metres; infinite where they are no plane's, but three or on a line.
    pub(crate) variance: f32,
    /// Height of the point above it, metres.
    pub(crate) height: f32,
    /// Share of the point in the squared distances of all points around.
    share: f32,
}

impl Plane {
    /// Any other fits better.
    pub(crate) const UNKNOWN: Self = Self {
        normal: Vec3::ZERO,
        variance: f32::INFINITY,
        height: 0.0,
        share: 0.0,
    };

    /// A plane of neighbours.
    pub(crate) fn new(normal: Vec3, variance: f32, height: f32) -> Self {
        Self {
            normal,
            variance,
            height,
            share: 0.0,
        }
    }

    /// Whether the point lies far beside the surface that its neighbours are on.
    pub(crate) fn stands_out(&self, around: &Neighborhood) -> bool {
        self.share > STANDS_OUT && self.height * self.height > around.on_plane()
    }

    /// A plane between this and another of the same point, with a normal on the same side.
    pub(crate) fn towards(&self, other: &Self, share: f32) -> Self {
        if share >= 1.0 {
            return *other;
        }
        Self {
            normal: self
                .normal
                .lerp(other.normal, share)
                .normalize_or(self.normal),
            variance: self.variance.lerp(other.variance, share),
            height: self.height.lerp(other.height, share),
            ..*self
        }
    }
}

/// Neighbourhoods whose planes are solved for together, as structure of arrays.
#[derive(Zeroable)]
pub(crate) struct Batch {
    /// Where the plane goes.
    place: [u32; BATCH],
    partial: [PartialMoments; BATCH],
    moments: [[f32; BATCH]; 10],
    normal: [[f32; BATCH]; 3],
    variance: [f32; BATCH],
    height: [f32; BATCH],
    share: [f32; BATCH],
    /// Whether the neighbourhood is one that `solve_planar` can tell the plane of.
    planar: [bool; BATCH],
    count: usize,
}

impl Default for Batch {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl Batch {
    /// Adds a neighbourhood whose plane is to be the `place`-th. Returns where its moments go.
    pub(crate) fn push(&mut self, place: u32) -> &mut PartialMoments {
        let k = self.count;
        self.count += 1;
        self.place[k] = place;
        &mut self.partial[k]
    }

    /// Adds up the parts of moments, of four neighbourhoods at once.
    fn add_up(&mut self) {
        let (fours, _) = self.partial.as_chunks::<4>();
        let halves = |parts: &[f32; LANES]| {
            let (low, high) = parts.split_at(LANES / 2);
            Vec4::from_slice(low) + Vec4::from_slice(high)
        };
        for (k, four) in fours.iter().enumerate() {
            for (m, sums) in self.moments.iter_mut().enumerate() {
                let [a, b, c, d] = four.each_ref().map(|parts| halves(&parts[m]));
                let parts = Mat4::from_cols(a, b, c, d).transpose();
                let sum = (parts.x_axis + parts.z_axis) + (parts.y_axis + parts.w_axis);
                sums[4 * k..4 * k + 4].copy_from_slice(&sum.to_array());
            }
        }
    }

    pub(crate) fn is_full(&self) -> bool {
        self.count == BATCH
    }

    /// Puts the planes of what was pushed into their places.
    pub(crate) fn solve(&mut self, planes: &mut [Plane]) {
        self.add_up();
        solve_planar(self);
        for k in 0..self.count {
            planes[self.place[k] as usize] = match self.planar[k] {
                true => Plane {
                    normal: Vec3::from_array(self.normal.each_ref().map(|c| c[k])),
                    variance: self.variance[k],
                    height: self.height[k],
                    share: self.share[k],
                },
                false => solve_any(self.moments.each_ref().map(|c| c[k])),
            };
        }
        self.count = 0;
    }
}

/// A plane through points that may be on a line or coincide.
fn solve_any(moments: Moments) -> Plane {
    let [count, x, y, z, xx, xy, xz, yy, yz, zz] = moments.map(f64::from);
    let (mx, my, mz) = (x / count, y / count, z / count);
    let (xy, xz, yz) = (xy - x * my, xz - x * mz, yz - y * mz);
    let normal = least_variance_axis(DMat3::from_cols(
        DVec3::new(xx - x * mx, xy, xz),
        DVec3::new(xy, yy - y * my, yz),
        DVec3::new(xz, yz, zz - z * mz),
    ));
    Plane {
        normal: normal.as_vec3(),
        ..Plane::UNKNOWN
    }
}

multiversioned! {
/// Power iteration by squaring on the adjugate of the covariance: its eigenvectors are the same,
/// and its eigenvalues are the products of the other two, so that the least variance becomes the
/// greatest.
fn solve_planar(batch: &mut Batch) {
    let [count, sx, sy, sz, xx, xy, xz, yy, yz, zz] = &batch.moments;
    for k in 0..BATCH {
        let (mx, my, mz) = (sx[k] / count[k], sy[k] / count[k], sz[k] / count[k]);
        let (cxx, cxy, cxz) = (xx[k] - sx[k] * mx, xy[k] - sx[k] * my, xz[k] - sx[k] * mz);
        let (cyy, cyz, czz) = (yy[k] - sy[k] * my, yz[k] - sy[k] * mz, zz[k] - sz[k] * mz);
        let inv = 1.0 / (cxx + cyy + czz);
        let (xx, xy, xz) = (cxx * inv, cxy * inv, cxz * inv);
        let (yy, yz, zz) = (cyy * inv, cyz * inv, czz * inv);
        let mut a = [
            yy * zz - yz * yz,
            xz * yz - xy * zz,
            xy * yz - xz * yy,
            xx * zz - xz * xz,
            xy * xz - xx * yz,
            xx * yy - xy * xy,
        ];
        batch.planar[k] = a[0] + a[3] + a[5] >= LEAST_PLANAR;
        // The fourth square is the 16th power: eigenvalues that differ by half are 10⁻⁵ apart.
        for _ in 0..4 {
            let inv = 1.0 / (a[0] + a[3] + a[5]);
            let [xx, xy, xz, yy, yz, zz] = a.map(|c| c * inv);
            a = [
                xx * xx + xy * xy + xz * xz,
                xx * xy + xy * yy + xz * yz,
                xx * xz + xy * yz + xz * zz,
                xy * xy + yy * yy + yz * yz,
                xy * xz + yy * yz + yz * zz,
                xz * xz + yz * yz + zz * zz,
            ];
        }
        // The longest column.
        let [axx, axy, axz, ayy, ayz, azz] = a;
        let x_longest = (axx >= ayy) & (axx >= azz);
        let y_longest = ayy >= azz;
        let pick = |x: f32, y: f32, z: f32| {
            let other = if y_longest { y } else { z };
            if x_longest { x } else { other }
        };
        let (x, y, z) = (pick(axx, axy, axz), pick(axy, ayy, ayz), pick(axz, ayz, azz));
        let inv = 1.0 / (x * x + y * y + z * z).sqrt();
        let (x, y, z) = (x * inv, y * inv, z * inv);
        let squares = x * x * cxx + y * y * cyy + z * z * czz
            + 2.0 * (x * y * cxy + x * z * cxz + y * z * cyz);
        (batch.normal[0][k], batch.normal[1][k], batch.normal[2][k]) = (x, y, z);
        let free = count[k] - 3.0;
        batch.variance[k] = if free > 0.0 { squares / free } else { f32::INFINITY };
        let height = -(x * mx + y * my + z * mz);
        batch.height[k] = height;
        batch.share[k] = height * height / squares;
    }
}
}
