//! Convex solids and the half-space, against implicit functions.

use super::{ROUNDING, check_projection, crossings, in_box, tolerance, unit};
use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::parry::shape::{
    Ball, Capsule, Cone, ConvexPolyhedron, Cuboid, Cylinder, HalfSpace, RoundCone,
    RoundConvexPolyhedron, RoundCuboid, RoundCylinder, RoundTriangle, SharedShape, Triangle,
};
use rapier3d_tldi::{ExactShape, RayHit, RaySurface};

/// A solid as the set where a function is negative, independent of the code under test.
pub(crate) struct Solid {
    name: &'static str,
    pub(crate) shape: SharedShape,
    implicit: Box<dyn Fn(DVec3) -> f64>,
}

fn profile(p: DVec3) -> (f64, f64) {
    (p.x.hypot(p.z), p.y)
}

pub(crate) fn solids() -> Vec<Solid> {
    let solid = |name, shape, implicit: Box<dyn Fn(DVec3) -> f64>| Solid {
        name,
        shape,
        implicit,
    };
    let box_implicit = |p: DVec3| (p.abs() - DVec3::new(0.5, 0.75, 1.0)).max_element();
    let round_box = |p: DVec3| {
        (p.abs() - DVec3::new(0.5, 0.75, 1.0))
            .max(DVec3::ZERO)
            .length()
            - 0.25
    };
    // Distance to the cone's profile as the largest distance to a supporting line, by angle.
    let round_cone = |p: DVec3| {
        let (rho, y) = profile(p);
        let height_over = |angle: f64| {
            let (s, c) = angle.sin_cos();
            let support = [(0.5, -0.75), (-0.5, -0.75), (0.0, 0.75)]
                .map(|(x, y)| x * c + y * s)
                .into_iter()
                .fold(f64::NEG_INFINITY, f64::max);
            rho * c + y * s - support
        };
        let step = std::f64::consts::TAU / 72.0;
        let best = (0..72)
            .map(|i| f64::from(i) * step)
            .max_by(|&a, &b| height_over(a).total_cmp(&height_over(b)))
            .unwrap();
        let (mut low, mut high) = (best - step, best + step);
        for _ in 0..45 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if height_over(a) < height_over(b) {
                low = a;
            } else {
                high = b;
            }
        }
        height_over(0.5 * (low + high)) - 0.125
    };
    let corners: Vec<Vec3> = (0..8)
        .map(|i| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            Vec3::new(0.5 * sign(0), 0.75 * sign(1), sign(2))
        })
        .collect();
    let hull = ConvexPolyhedron::from_convex_hull(&corners).unwrap();
    vec![
        solid(
            "ball",
            SharedShape::new(Ball::new(0.75)),
            Box::new(|p| p.length() - 0.75),
        ),
        solid(
            "cuboid",
            SharedShape::new(Cuboid::new(Vec3::new(0.5, 0.75, 1.0))),
            Box::new(box_implicit),
        ),
        solid(
            "capsule",
            SharedShape::new(Capsule::new(
                Vec3::new(-0.5, -0.25, 0.5),
                Vec3::new(0.5, 0.5, 0.0),
                0.375,
            )),
            Box::new(|p| {
                let (a, b) = (DVec3::new(-0.5, -0.25, 0.5), DVec3::new(0.5, 0.5, 0.0));
                let s = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                (p - a.lerp(b, s)).length() - 0.375
            }),
        ),
        solid(
            "cylinder",
            SharedShape::new(Cylinder::new(0.75, 0.5)),
            Box::new(|p| {
                let (rho, y) = profile(p);
                (rho - 0.5).max(y.abs() - 0.75)
            }),
        ),
        solid(
            "cone",
            SharedShape::new(Cone::new(0.75, 0.5)),
            Box::new(|p| {
                let (rho, y) = profile(p);
                (rho - 0.5 * (0.75 - y) / 1.5).max(-0.75 - y)
            }),
        ),
        solid(
            "convex polyhedron",
            SharedShape::new(hull.clone()),
            Box::new(box_implicit),
        ),
        solid(
            "round cuboid",
            SharedShape::new(RoundCuboid {
                inner_shape: Cuboid::new(Vec3::new(0.5, 0.75, 1.0)),
                border_radius: 0.25,
            }),
            Box::new(round_box),
        ),
        solid(
            "round cylinder",
            SharedShape::new(RoundCylinder {
                inner_shape: Cylinder::new(0.75, 0.5),
                border_radius: 0.125,
            }),
            Box::new(|p| {
                let (rho, y) = profile(p);
                (rho - 0.5).max(0.0).hypot((y.abs() - 0.75).max(0.0)) - 0.125
            }),
        ),
        solid(
            "round cone",
            SharedShape::new(RoundCone {
                inner_shape: Cone::new(0.75, 0.5),
                border_radius: 0.125,
            }),
            Box::new(round_cone),
        ),
        solid(
            "round convex polyhedron",
            SharedShape::new(RoundConvexPolyhedron {
                inner_shape: hull,
                border_radius: 0.25,
            }),
            Box::new(round_box),
        ),
        solid(
            "round triangle",
            SharedShape::new(RoundTriangle {
                inner_shape: Triangle::new(
                    Vec3::new(0.0, 0.0, 0.0),
                    Vec3::new(1.0, 0.0, 0.0),
                    Vec3::new(0.0, 1.0, 0.0),
                ),
                border_radius: 0.25,
            }),
            // Distance to a right triangle in the plane z = 0: to its face or to its sides.
            Box::new(|p| {
                if p.x >= 0.0 && p.y >= 0.0 && p.x + p.y <= 1.0 {
                    return p.z.abs() - 0.25;
                }
                let to_side = |a: DVec3, b: DVec3| {
                    let s = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                    p.distance(a.lerp(b, s))
                };
                let (o, x, y) = (DVec3::ZERO, DVec3::X, DVec3::Y);
                to_side(o, x).min(to_side(o, y)).min(to_side(x, y)) - 0.25
            }),
        ),
    ]
}

/// Entry and exit of the whole line by sampling and bisection, within `reach` of its origin.
fn chord(solid: &Solid, origin: DVec3, direction: DVec3, reach: f64) -> Option<[f64; 2]> {
    const SAMPLES: i32 = 2000;
    let value = |t: f64| (solid.implicit)(origin + t * direction);
    let at = |i: i32| reach * (2.0 * f64::from(i) / f64::from(SAMPLES) - 1.0);
    let first = (0..=SAMPLES).find(|&i| value(at(i)) < 0.0)?;
    let last = (0..=SAMPLES).rev().find(|&i| value(at(i)) < 0.0)?;
    let root = |mut outside: f64, mut inside: f64| {
        for _ in 0..80 {
            let middle = 0.5 * (outside + inside);
            if value(middle) < 0.0 {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    };
    Some([root(at(first - 1), at(first)), root(at(last + 1), at(last))])
}

/// The gradient, where it is the same on all sides (away from edges).
fn gradient(solid: &Solid, p: DVec3) -> Option<DVec3> {
    let sided = |h: f64| {
        DVec3::from_array(
            DVec3::AXES.map(|axis| ((solid.implicit)(p + h * axis) - (solid.implicit)(p)) / h),
        )
        .normalize()
    };
    let (a, b) = (sided(1e-5), sided(-1e-5));
    (a.distance(b) < 1e-3).then(|| (0.5 * (a + b)).normalize())
}

#[test]
fn solids_are_entered_and_left_where_the_implicit_function_changes_sign() {
    let mut rng = fastrand::Rng::with_seed(1);
    for solid in solids() {
        let (mut compared, mut from_inside, mut normals) = (0, 0, 0);
        for case in 0..400 {
            let origin = in_box(&mut rng, if case % 2 == 0 { 2.0 } else { 0.5 });
            let direction = (in_box(&mut rng, 0.7) - origin).normalize();
            let (o, d) = (origin.as_dvec3(), direction.as_dvec3().normalize());
            let hits = crossings(&*solid.shape, origin, direction, 8.0);
            // Samples are 8 mm apart.
            let Some(expected) = chord(&solid, o, d, 8.0) else {
                let is_short = match hits[..] {
                    [] => true,
                    [entry, exit] => exit.distance - entry.distance < 0.01,
                    _ => false,
                };
                assert!(is_short, "{} {case}: {hits:?}", solid.name);
                continue;
            };
            let ahead: Vec<f64> = expected.into_iter().filter(|&t| t >= 0.0).collect();
            assert_eq!(
                hits.len(),
                ahead.len(),
                "{} {case}: {hits:?} {expected:?}",
                solid.name
            );
            for (hit, t) in hits.iter().zip(&ahead) {
                let normal = hit.normal.as_dvec3();
                let off = (f64::from(hit.distance) - t).abs();
                assert!(
                    off < tolerance(normal, d),
                    "{} {case}: off by {off}",
                    solid.name
                );
                assert!((normal.length() - 1.0).abs() < 1e-6);
                if let Some(expected) = gradient(&solid, o + *t * d) {
                    // Steps of 1e-5 on radii of 0.1 turn the difference quotient by 1e-4.
                    assert!(
                        normal.distance(expected) < 2e-3,
                        "{} {case}: normal {normal} expected {expected}",
                        solid.name
                    );
                    normals += 1;
                }
                compared += 1;
            }
            from_inside += usize::from(ahead.len() == 1);
        }
        assert!(
            compared > 300 && normals > 250 && from_inside > 10,
            "{}: {compared} {normals} {from_inside}",
            solid.name
        );
        assert!(ExactShape(&*solid.shape).is_closed(), "{}", solid.name);
    }
}

#[test]
fn rays_along_a_face_but_outside_cross_nothing() {
    for solid in solids() {
        for (axis, beside) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)] {
            let origin = 1.5 * beside - 3.0 * axis;
            let hits = crossings(&*solid.shape, origin, axis, 10.0);
            assert!(hits.is_empty(), "{}: {hits:?}", solid.name);
        }
    }
}

#[test]
fn crossings_beyond_the_end_are_left_out_and_others_kept() {
    let ball = Ball::new(1.0);
    let mut hits = vec![RayHit {
        distance: 9.0,
        normal: Vec3::X,
    }];
    ExactShape(&ball).crossings(3.0 * Vec3::X, -Vec3::X, 3.0, &mut hits);
    assert_eq!(
        hits.len(),
        2,
        "what was in the vector stays, the exit at 4 is beyond"
    );
    assert_eq!(hits[0].distance, 9.0);
    assert_eq!(hits[1].distance, 2.0);
}

#[test]
fn solids_tell_distance_side_and_normal() {
    let mut rng = fastrand::Rng::with_seed(2);
    for solid in solids() {
        let mut samples = Vec::new();
        while samples.len() < 400 {
            let origin = in_box(&mut rng, 0.4).as_dvec3();
            let direction = unit(&mut rng).as_dvec3().normalize();
            for t in chord(&solid, origin, direction, 4.0).into_iter().flatten() {
                samples.push(origin + t * direction);
            }
        }
        let (mut inside, mut outside) = (0, 0);
        for case in 0..200 {
            let point = in_box(&mut rng, if case % 2 == 0 { 1.2 } else { 0.4 });
            let value = (solid.implicit)(point.as_dvec3());
            let on = |p| (solid.implicit)(p);
            let distance = check_projection(solid.name, &*solid.shape, point, on, &samples);
            if value.abs() > ROUNDING {
                assert_eq!(distance < 0.0, value < 0.0, "{} {point}", solid.name);
            }
            *(if distance < 0.0 {
                &mut inside
            } else {
                &mut outside
            }) += 1;
        }
        assert!(
            inside > 3 && outside > 3,
            "{}: {inside} {outside}",
            solid.name
        );
        // On the surface: no distance, and the normal of the surface.
        for sample in &samples[..100] {
            let (distance, normal) = ExactShape(&*solid.shape).project(sample.as_vec3());
            assert!(f64::from(distance.abs()) < ROUNDING, "{}", solid.name);
            if let Some(expected) = gradient(&solid, *sample) {
                assert!(
                    normal.as_dvec3().distance(expected) < 2e-3,
                    "{} {sample}: {normal} {expected}",
                    solid.name
                );
            }
        }
        // The middle of everything and an axis have no preferred direction; still a unit normal.
        for point in [Vec3::ZERO, 0.25 * Vec3::Y] {
            let (distance, normal) = ExactShape(&*solid.shape).project(point);
            assert!(distance.is_finite() && (normal.length() - 1.0).abs() < 1e-5);
        }
    }
}

#[test]
fn a_half_space_is_crossed_once_and_has_no_bounds() {
    let normal = Vec3::new(0.6, 0.8, 0.0);
    let shape = HalfSpace::new(normal);
    let surface = ExactShape(&shape);
    assert!(surface.is_closed());
    assert_eq!(surface.bounds().max, Vec3::INFINITY);
    assert_eq!(surface.bounds().min, Vec3::NEG_INFINITY);
    let mut rng = fastrand::Rng::with_seed(3);
    for _ in 0..200 {
        let (origin, direction) = (in_box(&mut rng, 2.0), unit(&mut rng));
        let t = -normal.dot(origin) / normal.dot(direction);
        let hits = crossings(&shape, origin, direction, 5.0);
        assert_eq!(hits.len(), usize::from((0.0..=5.0).contains(&t)), "t = {t}");
        for hit in hits {
            assert!((hit.distance - t).abs() < 1e-5 * t.max(1.0) / normal.dot(direction).abs());
            assert_eq!(hit.normal, normal);
        }
        let (distance, n) = surface.project(origin);
        assert!((distance - normal.dot(origin)).abs() < 1e-6);
        assert_eq!(n, normal);
    }
    assert!(
        crossings(&shape, Vec3::new(0.6, 0.8, 0.0), Vec3::Z, 5.0).is_empty(),
        "parallel"
    );
}
