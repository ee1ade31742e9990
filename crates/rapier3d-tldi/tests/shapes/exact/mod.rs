//! `ExactShape` against analytic implicit functions, brute-force triangles in `f64`, and the
//! definition of distance.

mod meshes;
mod others;
mod solids;

use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::parry::shape::Shape;
use rapier3d_tldi::{ExactShape, RayHit, RaySurface};

/// Hits come back in `f32`, at distances up to 8: half a step is 2⁻²² · 8 / 8 ≈ 5e-7; the shapes'
/// bounds and borders add as much. Grazing divides it by the cosine, see `tolerance`.
pub(crate) const ROUNDING: f64 = 2e-6;

pub(crate) fn tolerance(hit_normal: DVec3, direction: DVec3) -> f64 {
    ROUNDING / hit_normal.dot(direction).abs().max(1e-3)
}

pub(crate) fn unit(rng: &mut fastrand::Rng) -> Vec3 {
    loop {
        let v = Vec3::from_array([(); 3].map(|()| 2.0 * rng.f32() - 1.0));
        if v.length_squared() <= 1.0 && v.length_squared() > 1e-3 {
            return v.normalize();
        }
    }
}

pub(crate) fn in_box(rng: &mut fastrand::Rng, half: f32) -> Vec3 {
    half * Vec3::from_array([(); 3].map(|()| 2.0 * rng.f32() - 1.0))
}

pub(crate) fn crossings(shape: &dyn Shape, origin: Vec3, direction: Vec3, max: f32) -> Vec<RayHit> {
    let mut hits = Vec::new();
    ExactShape(shape).crossings(origin, direction, max, &mut hits);
    hits
}

/// A distance is right if the foot `point - distance * normal` is on the surface and no point of
/// the surface is nearer.
pub(crate) fn check_projection(
    name: &str,
    shape: &dyn Shape,
    point: Vec3,
    on_surface: impl Fn(DVec3) -> f64,
    samples: &[DVec3],
) -> f32 {
    let (distance, normal) = ExactShape(shape).project(point);
    assert!((normal.length() - 1.0).abs() < 1e-5, "{name}: {normal}");
    let p = point.as_dvec3();
    let foot = p - f64::from(distance) * normal.as_dvec3();
    let off = on_surface(foot).abs();
    assert!(
        off < 2.0 * ROUNDING,
        "{name}: the foot of {point} is {off} off the surface"
    );
    for sample in samples {
        let nearer = f64::from(distance.abs()) - p.distance(*sample);
        assert!(
            nearer < ROUNDING,
            "{name}: {point} has a point of the surface {nearer} nearer"
        );
    }
    distance
}
