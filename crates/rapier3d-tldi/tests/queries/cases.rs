//! Pairs of shapes of which the distance is known.

use rapier3d::parry::shape::Shape;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Spacing and radius of all samples here, metres.
pub(crate) const R: f32 = 0.02;

/// Half the edges of the box, metres.
pub(crate) const HALF: Vector = Vector::new(0.2, 0.1, 0.15);

/// Radius of the sampled sphere, metres.
pub(crate) const SPHERE: f32 = 0.3;

/// Radius of rapier's ball, metres.
pub(crate) const BALL: f32 = 0.2;

pub(crate) fn unit(rng: &mut fastrand::Rng) -> Vector {
    loop {
        let v = Vector::from_array([(); 3].map(|()| 2.0 * rng.f32() - 1.0));
        if (1e-3..=1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// Points and outward normals.
pub(crate) type Samples = (Vec<Vector>, Vec<Vector>);

/// The sphere about the origin (Fibonacci lattice).
pub(crate) fn sphere() -> Samples {
    let count = (4.0 * std::f32::consts::PI * SPHERE * SPHERE / (R * R)) as usize;
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    let normal = |i: usize| {
        let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let (s, c) = (golden * i as f64).sin_cos();
        let r = (1.0 - y * y).sqrt();
        Vector::new((r * c) as f32, y as f32, (r * s) as f32)
    };
    (0..count).map(|i| (SPHERE * normal(i), normal(i))).unzip()
}

/// A rectangle across `axis` at `height`, points moved by up to 0.3 of their spacing, but not
/// beyond the rim.
pub(crate) fn face(axis: usize, height: f32, half: Vector, rng: &mut fastrand::Rng) -> Samples {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let cells = [u, v].map(|k| (2.0 * half[k] / R).ceil() as i32);
    let mut normal = Vector::ZERO;
    normal[axis] = if height < 0.0 { -1.0 } else { 1.0 };
    let mut points = Vec::new();
    for i in 0..=cells[0] {
        for j in 0..=cells[1] {
            let mut point = Vector::ZERO;
            point[axis] = height;
            for (k, step, cells) in [(u, i, cells[0]), (v, j, cells[1])] {
                let at = step as f32 + 0.6 * (rng.f32() - 0.5);
                point[k] = half[k] * (2.0 * at / cells as f32 - 1.0).clamp(-1.0, 1.0);
            }
            points.push(point);
        }
    }
    let normals = vec![normal; points.len()];
    (points, normals)
}

/// The box about the origin.
pub(crate) fn cuboid(rng: &mut fastrand::Rng) -> Samples {
    let mut all = Samples::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (points, normals) = face(axis, sign * HALF[axis], HALF, rng);
            all.0.extend(points);
            all.1.extend(normals);
        }
    }
    all
}

/// The plane y = 0 with normal +y and edges of 2 m.
pub(crate) fn plane(rng: &mut fastrand::Rng) -> Samples {
    face(1, 0.0, Vector::ONE, rng)
}

pub(crate) fn shape((points, normals): &Samples, with_normals: bool) -> PointCloudShape {
    let builder = PointCloud::builder(points.clone()).radius(R);
    let builder = if with_normals {
        builder.normals(normals.clone())
    } else {
        builder
    };
    PointCloudShape::new(builder.build().expect("a valid cloud"))
}

/// Signed distance of a point to the box.
pub(crate) fn from_box(point: Vector) -> f32 {
    let beyond = point.abs() - HALF;
    beyond.max(Vector::ZERO).length() + beyond.max_element().min(0.0)
}

/// Height of the lowest corner of a box.
pub(crate) fn lowest_corner(pose: &Pose) -> f32 {
    (0..8)
        .map(|k| {
            let sign = |bit: i32| if k & bit == 0 { 1.0 } else { -1.0 };
            (*pose * (HALF * Vector::new(sign(1), sign(2), sign(4)))).y
        })
        .fold(f32::MAX, f32::min)
}

/// A pair of which the distance is known.
pub(crate) struct Case<'a> {
    pub(crate) name: &'static str,
    pub(crate) shapes: [&'a dyn Shape; 2],
    /// Signed distance of the second shape at a pose to the first.
    pub(crate) distance: &'a dyn Fn(&Pose) -> f32,
    /// Whether the second is above the first one's top; else anywhere around it.
    pub(crate) is_above: bool,
    /// Sum of the curvatures of both surfaces where they are nearest, 1/m: discs are off by half of
    /// it × R².
    pub(crate) curvature: f32,
    /// Whether edges and corners of a sampled box meet something: the outermost sample may be 0.3
    /// spacings off in two directions.
    pub(crate) has_edges: bool,
}

impl Case<'_> {
    /// Second shape at a random pose, `gap` from the first.
    pub(crate) fn pose(&self, gap: f32, rng: &mut fastrand::Rng) -> Pose {
        let rotation = Rotation::from_axis_angle(unit(rng), std::f32::consts::TAU * rng.f32());
        let direction = if self.is_above { Vector::Y } else { unit(rng) };
        // The distance grows along the direction from the middle of a convex shape.
        let at = |t: f32| Pose::from_parts(t * direction, rotation);
        let (mut low, mut high) = (0.0, 10.0);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if (self.distance)(&at(middle)) < gap {
                low = middle;
            } else {
                high = middle;
            }
        }
        at(high)
    }

    /// Least and greatest error of a distance, metres.
    pub(crate) fn tolerance(&self, with_normals: bool) -> [f32; 2] {
        let sagitta = 0.5 * self.curvature * R * R;
        // Planes through 13 samples are tilted where the surface bends, and at the box's faces
        // where samples of the next face are among them.
        let tilt = if with_normals { 0.0 } else { 0.03 * R };
        let rounding = 1e-3 * R;
        let sampling = if self.has_edges { 0.3 * R } else { 0.0 };
        // Where an edge of rapier's cuboid is nearest, between samples, a centre stands for it.
        let between = if self.name == "sphere, cuboid" {
            0.15 * R
        } else {
            0.0
        };
        [
            -(sagitta + tilt + rounding),
            sagitta + tilt + rounding + sampling + between,
        ]
    }
}

/// Calls `visit` for all pairs of shapes, with and without normals.
pub(crate) fn for_all_cases(mut visit: impl FnMut(&Case<'_>, bool)) {
    let mut rng = fastrand::Rng::with_seed(1);
    let samples = [sphere(), cuboid(&mut rng), plane(&mut rng)];
    let (ball, solid) = (Ball::new(BALL), Cuboid::new(HALF));
    let half_space = HalfSpace::new(Vector::Y);
    for with_normals in [true, false] {
        let [sphere, boxed, plane] = samples.each_ref().map(|s| shape(s, with_normals));
        let case = |name, shapes, distance, is_above, curvature, has_edges| Case {
            name,
            shapes,
            distance,
            is_above,
            curvature,
            has_edges,
        };
        let (bent, flat) = (1.0 / SPHERE, 0.0);
        for case in [
            case(
                "sphere, ball",
                [&sphere, &ball],
                &|p: &Pose| p.translation.length() - SPHERE - BALL,
                false,
                bent,
                false,
            ),
            case(
                "sphere, cuboid",
                [&solid, &sphere],
                &|p: &Pose| from_box(p.translation) - SPHERE,
                false,
                bent,
                false,
            ),
            case(
                "sphere, sphere",
                [&sphere, &sphere],
                &|p: &Pose| p.translation.length() - 2.0 * SPHERE,
                false,
                2.0 * bent,
                false,
            ),
            case(
                "sphere, plane",
                [&plane, &sphere],
                &|p: &Pose| p.translation.y - SPHERE,
                true,
                bent,
                false,
            ),
            case(
                "ball, plane",
                [&plane, &ball],
                &|p: &Pose| p.translation.y - BALL,
                true,
                flat,
                false,
            ),
            case(
                "box, half-space",
                [&half_space, &boxed],
                &lowest_corner,
                true,
                flat,
                true,
            ),
            case(
                "box, plane",
                [&plane, &boxed],
                &lowest_corner,
                true,
                flat,
                true,
            ),
            case(
                "box, ball",
                [&boxed, &ball],
                &|p: &Pose| from_box(p.translation) - BALL,
                false,
                flat,
                true,
            ),
        ] {
            visit(&case, with_normals);
        }
    }
}
