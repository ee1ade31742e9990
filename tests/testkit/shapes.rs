//! Points on analytic surfaces, with their true outward normals.

use tldi::PointCloud;
use tldi::glamx::{Pose3, Vec2, Vec3};

/// Points and outward normals of a surface.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Positions, metres.
    pub points: Vec<Vec3>,
    /// Outward unit normals.
    pub normals: Vec<Vec3>,
}

impl Samples {
    /// A cloud with these oriented normals and one radius in metres.
    pub fn cloud(&self, radius: f32) -> PointCloud<'static> {
        PointCloud::builder(self.points.clone())
            .radius(radius)
            .normals(self.normals.clone())
            .build()
            .expect("analytic samples are valid")
    }

    /// A cloud without normals.
    pub fn bare_cloud(&self, radius: f32) -> PointCloud<'static> {
        cloud_of(self.points.clone(), radius)
    }

    /// The same surface in another frame.
    pub fn moved(&self, pose: &Pose3) -> Self {
        Self {
            points: self.points.iter().map(|p| *pose * *p).collect(),
            normals: self.normals.iter().map(|n| pose.rotation * *n).collect(),
        }
    }

    /// Keeps only the points of which `is_kept` holds.
    pub fn retain(&mut self, is_kept: impl Fn(&Vec3) -> bool) {
        let mut kept = self.points.iter().map(&is_kept);
        self.normals.retain(|_| kept.next() == Some(true));
        self.points.retain(is_kept);
    }

    /// Adds the points of another surface.
    pub fn extend(&mut self, other: &Self) {
        self.points.extend(&other.points);
        self.normals.extend(&other.normals);
    }

    fn push(&mut self, point: Vec3, normal: Vec3) {
        self.points.push(point);
        self.normals.push(normal);
    }
}

/// A cloud of finite points without normals, with one radius in metres.
pub fn cloud_of(points: Vec<Vec3>, radius: f32) -> PointCloud<'static> {
    let cloud = PointCloud::builder(points).radius(radius).build();
    cloud.expect("the points are finite")
}

/// A sphere about the origin, points about `spacing` metres apart (Fibonacci lattice).
pub fn sampled_sphere(radius: f32, spacing: f32) -> Samples {
    let count =
        (4.0 * std::f32::consts::PI * radius * radius / (spacing * spacing)).ceil() as usize;
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    let mut samples = Samples::default();
    for i in 0..count {
        let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let (s, c) = (golden * i as f64).sin_cos();
        let r = (1.0 - y * y).sqrt();
        let normal = Vec3::new((r * c) as f32, y as f32, (r * s) as f32);
        samples.push(radius * normal, normal);
    }
    samples
}

/// A torus about the y axis through the origin: a tube of radius `minor` around a circle of radius `major`, metres, in
/// rows around the axis.
pub fn sampled_torus(major: f32, minor: f32, spacing: f32) -> Samples {
    use std::f32::consts::TAU;
    let mut samples = Samples::default();
    let rows = (TAU * minor / spacing).ceil();
    for row in 0..rows as u32 {
        let (up, out) = (TAU * row as f32 / rows).sin_cos();
        let count = (TAU * (major + minor * out) / spacing).ceil().max(1.0);
        for k in 0..count as u32 {
            // Neighbouring rows do not stand in line.
            let (s, c) = (TAU * (k as f32 + 0.5 * (row % 2) as f32) / count).sin_cos();
            let normal = Vec3::new(out * c, up, out * s);
            samples.push(major * Vec3::new(c, 0.0, s) + minor * normal, normal);
        }
    }
    samples
}

/// A square in the plane y = 0 about the origin with edges of `size` metres and normal +y, points
/// moved at random by up to 0.3 `spacing` within the plane.
pub fn sampled_plane(size: f32, spacing: f32, rng: &mut fastrand::Rng) -> Samples {
    let mut samples = Samples::default();
    grid(Vec2::splat(size), spacing, rng, |p| {
        samples.push(Vec3::new(p.x, 0.0, p.y), Vec3::Y);
    });
    samples
}

/// The six faces of a box about the origin.
pub fn sampled_box(half: Vec3, spacing: f32, rng: &mut fastrand::Rng) -> Samples {
    let mut samples = Samples::default();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for sign in [-1.0, 1.0] {
            let mut normal = Vec3::ZERO;
            normal[axis] = sign;
            grid(2.0 * Vec2::new(half[u], half[v]), spacing, rng, |p| {
                let mut point = normal * half;
                point[u] = p.x;
                point[v] = p.y;
                samples.push(point, normal);
            });
        }
    }
    samples
}

/// A wedge: `size.x` along its foot, `size.y` high, `size.z` wide, with the slope up along +x; the
/// middle of its bounds is the origin. Also the pose in it of a frame of which the plane y = 0 is
/// the slope, +y its outward normal, and the origin its middle.
pub fn sampled_ramp(size: Vec3, spacing: f32, rng: &mut fastrand::Rng) -> (Samples, Pose3) {
    use std::f32::consts::{FRAC_PI_2, PI};
    let mut samples = Samples::default();
    let mut face =
        |extents: Vec2, pose: Pose3, rng: &mut fastrand::Rng, keep: &dyn Fn(Vec3) -> bool| {
            grid(extents, spacing, rng, |p| {
                let point = pose * Vec3::new(p.x, 0.0, p.y);
                if keep(point) {
                    samples.push(point, pose.rotation * Vec3::Y);
                }
            });
        };
    let all = |_: Vec3| true;
    let slope = Pose3::rotation(Vec3::Z * size.y.atan2(size.x));
    let half = 0.5 * size;
    face(Vec2::new(size.x.hypot(size.y), size.z), slope, rng, &all);
    face(
        Vec2::new(size.x, size.z),
        Pose3::new(Vec3::NEG_Y * half.y, Vec3::X * PI),
        rng,
        &all,
    );
    face(
        Vec2::new(size.y, size.z),
        Pose3::new(Vec3::X * half.x, Vec3::NEG_Z * FRAC_PI_2),
        rng,
        &all,
    );
    for side in [1.0, -1.0] {
        let under_slope = |p: Vec3| p.y * size.x <= p.x * size.y;
        face(
            Vec2::new(size.x, size.y),
            Pose3::new(Vec3::Z * (side * half.z), Vec3::X * (side * FRAC_PI_2)),
            rng,
            &under_slope,
        );
    }
    (samples, slope)
}

/// Calls `visit` for a jittered grid over a rectangle of `size` about the origin, rim included.
fn grid(size: Vec2, spacing: f32, rng: &mut fastrand::Rng, mut visit: impl FnMut(Vec2)) {
    let cells = (size / spacing).ceil().max(Vec2::ONE);
    let step = size / cells;
    for j in 0..=cells.y as usize {
        for i in 0..=cells.x as usize {
            let p = Vec2::new(i as f32, j as f32) * step - 0.5 * size;
            let jitter = 0.6 * step * Vec2::new(rng.f32() - 0.5, rng.f32() - 0.5);
            visit((p + jitter).clamp(-0.5 * size, 0.5 * size));
        }
    }
}
