//! Voxels, shapes known by their own ray casts, and rays that are not finite.

use super::meshes::{bumpy_sphere, hills};
use super::solids::solids;
use super::{ROUNDING, check_projection, crossings, in_box};
use rapier3d::glamx::{DVec3, IVec3, Pose3, Vec3};
use rapier3d::parry::shape::{Compound, HalfSpace, Segment, SharedShape, TriMesh, Voxels};
use rapier3d_tldi::{ExactShape, RaySurface};

#[test]
fn sparse_voxels_are_one_solid() {
    let mut rng = fastrand::Rng::with_seed(14);
    let filled: Vec<IVec3> = (0..200)
        .map(|_| IVec3::new(rng.i32(-4..4), rng.i32(-4..4), rng.i32(-4..4)))
        .collect();
    check_voxels(&filled, Vec3::new(0.25, 0.2, 0.3), &mut rng);
}

#[test]
fn dense_voxels_are_one_solid() {
    let mut rng = fastrand::Rng::with_seed(15);
    // One of parry's chunks of 8³, up to its border, with a few holes. In a flat cell the next
    // layer but one is nearer than the diagonal neighbour.
    let filled: Vec<IVec3> = (0..512)
        .map(|k| IVec3::new(k % 8, k / 8 % 8, k / 64))
        .filter(|_| rng.f32() < 0.98)
        .collect();
    check_voxels(&filled, Vec3::new(0.2, 0.05, 0.3), &mut rng);
}

fn check_voxels(filled: &[IVec3], size: Vec3, rng: &mut fastrand::Rng) {
    let voxels = Voxels::new(size, filled);
    let boxes: Vec<(DVec3, DVec3)> = filled
        .iter()
        .map(|key| {
            let low = key.as_dvec3() * size.as_dvec3();
            (low, low + size.as_dvec3())
        })
        .collect();
    let mut compared = 0;
    for case in 0..400 {
        let origin = in_box(rng, if case % 2 == 0 { 3.0 } else { 1.0 });
        let direction = (in_box(rng, 0.8) - origin).normalize();
        let (o, d) = (origin.as_dvec3(), direction.as_dvec3().normalize());
        // Intervals inside the boxes, joined where they touch.
        let mut intervals: Vec<(f64, f64)> = boxes
            .iter()
            .filter_map(|(low, high)| {
                let (a, b) = ((low - o) / d, (high - o) / d);
                let (entry, exit) = (a.min(b).max_element(), a.max(b).min_element());
                (entry < exit).then_some((entry, exit))
            })
            .collect();
        intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut joined: Vec<(f64, f64)> = Vec::new();
        for (entry, exit) in intervals {
            match joined.last_mut() {
                Some(last) if entry <= last.1 + 1e-9 => last.1 = last.1.max(exit),
                _ => joined.push((entry, exit)),
            }
        }
        // Slivers and gaps thinner than rounding may be seen either way.
        let edges: Vec<f64> = joined.iter().flat_map(|&(a, b)| [a, b]).collect();
        if edges.windows(2).any(|w| w[1] - w[0] < 1e-5) {
            continue;
        }
        let expected: Vec<f64> = edges
            .into_iter()
            .filter(|t| (0.0..=10.0).contains(t))
            .collect();
        let hits = crossings(&voxels, origin, direction, 10.0);
        assert_eq!(hits.len(), expected.len(), "{case}: {hits:?} {expected:?}");
        let outside = expected.len().is_multiple_of(2);
        for (k, (hit, t)) in hits.iter().zip(&expected).enumerate() {
            assert!((f64::from(hit.distance) - t).abs() < ROUNDING, "{case}");
            assert_eq!(hit.normal.abs().max_element(), 1.0);
            assert_eq!(
                hit.normal.dot(direction) < 0.0,
                (k % 2 == 0) == outside,
                "{case}"
            );
            compared += 1;
        }
    }
    assert!(compared > 250, "{compared}");
    // Samples of the outer faces.
    let mut samples = Vec::new();
    for key in filled {
        for axis in 0..3 {
            for side in [-1, 1] {
                let mut neighbour = *key;
                neighbour[axis] += side;
                if filled.contains(&neighbour) {
                    continue;
                }
                let mut inner = DVec3::new(rng.f64(), rng.f64(), rng.f64());
                inner[axis] = if side > 0 { 1.0 } else { 0.0 };
                samples.push((key.as_dvec3() + inner) * size.as_dvec3());
            }
        }
    }
    let is_inside = |p: DVec3| {
        boxes
            .iter()
            .any(|(low, high)| p.cmpge(*low).all() && p.cmple(*high).all())
    };
    let on_surface = |p: DVec3| {
        // Within rounding there must be both inside and outside.
        let around = (0..64).map(|k| {
            let direction = |bit: i32| f64::from((k >> (2 * bit)) % 4) - 1.5;
            p + 2e-6 * DVec3::new(direction(0), direction(1), direction(2))
        });
        let inside = around.filter(|&q| is_inside(q)).count();
        if inside > 0 && inside < 64 { 0.0 } else { 1.0 }
    };
    for _ in 0..200 {
        let point = in_box(rng, 1.3);
        let distance = check_projection("voxels", &voxels, point, on_surface, &samples);
        assert_eq!(distance < 0.0, is_inside(point.as_dvec3()), "{point}");
    }
}

#[test]
fn other_shapes_are_cast_upon_again_and_again() {
    let parts = vec![
        (Pose3::translation(-1.0, 0.0, 0.0), SharedShape::ball(0.5)),
        (
            Pose3::translation(1.0, 0.0, 0.0),
            SharedShape::cuboid(0.25, 0.25, 0.25),
        ),
    ];
    let compound = Compound::new(parts);
    let hits = crossings(&compound, Vec3::new(-3.0, 0.1, 0.1), Vec3::X, 10.0);
    let half_chord = (0.25f32 - 0.02).sqrt();
    let expected = [
        (2.0 - half_chord, -1.0),
        (2.0 + half_chord, 1.0),
        (3.75, -1.0),
        (4.25, 1.0),
    ];
    assert_eq!(hits.len(), 4, "{hits:?}");
    for (hit, (t, side)) in hits.iter().zip(expected) {
        // Restarting behind each hit adds an f32 rounding of the size.
        assert!((hit.distance - t).abs() < 1e-5, "{hit:?} {t}");
        assert_eq!(hit.normal.x.signum(), side, "{hit:?}");
    }
    let (distance, normal) = ExactShape(&compound).project(Vec3::new(-1.0, 2.0, 0.0));
    assert!((distance - 1.5).abs() < 1e-6 && normal.distance(Vec3::Y) < 1e-6);
    let (distance, normal) = ExactShape(&compound).project(Vec3::new(-1.0, 0.25, 0.0));
    assert!((distance + 0.25).abs() < 1e-6 && normal.distance(Vec3::Y) < 1e-6);
    let segment = Segment::new(-Vec3::X, Vec3::X);
    assert!(crossings(&segment, Vec3::Y, -Vec3::Y, 2.0).is_empty());
    assert!(!ExactShape(&segment).is_closed());
    let (distance, normal) = ExactShape(&segment).project(Vec3::new(0.5, 0.0, 0.75));
    assert_eq!((distance, normal), (0.75, Vec3::Z));
}

#[test]
fn a_ray_or_point_that_is_not_finite_ends() {
    let (vertices, indices) = bumpy_sphere();
    let mut shapes: Vec<SharedShape> = solids().into_iter().map(|solid| solid.shape).collect();
    shapes.push(SharedShape::new(TriMesh::new(vertices, indices).unwrap()));
    shapes.push(SharedShape::new(hills()));
    shapes.push(SharedShape::new(Voxels::new(Vec3::ONE, &[IVec3::ZERO])));
    shapes.push(SharedShape::new(HalfSpace::new(Vec3::Y)));
    let nan = Vec3::new(f32::NAN, 0.0, 0.0);
    for shape in shapes {
        for (origin, direction, max) in [
            (nan, Vec3::X, 1.0),
            (nan, Vec3::X, f32::INFINITY),
            (Vec3::INFINITY, -Vec3::X, f32::INFINITY),
            (Vec3::ZERO, Vec3::INFINITY, f32::INFINITY),
            (Vec3::ZERO, Vec3::X, f32::NAN),
            (Vec3::ZERO, nan, 1.0),
            (Vec3::ZERO, Vec3::ZERO, 1.0),
            (Vec3::splat(-1e30), Vec3::X, f32::INFINITY),
            (Vec3::new(-9.0, 0.1, 0.2), Vec3::X, f32::INFINITY),
        ] {
            let hits = crossings(&*shape, origin, direction, max);
            assert!(hits.len() < 20);
        }
        ExactShape(&*shape).project(nan);
        ExactShape(&*shape).project(Vec3::splat(1e30));
    }
}
