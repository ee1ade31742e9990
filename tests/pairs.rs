//! Whole pairs against analytic truth: gap, collision, contact normals and support points.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Aabb, Backend, BackendError, ContactPoint, CpuBackend, PairQuery, PairResult, Params,
    PointCloud, RayHit, RaySurface, Surface, View,
};
use tldi_tests::{Samples, random_pose, random_unit, sampled_box, sampled_plane, sampled_sphere};

/// Spacing of all samples here, and with radius = spacing a mean radius, in metres.
const R: f32 = 0.01;

fn compare(a: Surface, b: Surface, a_from_b: Pose3, params: Params) -> PairResult {
    let mut results = Vec::new();
    let query = PairQuery {
        a,
        b,
        a_from_b,
        view: View::Aim {
            toward_b: a_from_b.translation,
            last_axis: None,
        },
        params,
    };
    CpuBackend::new()
        .compare(&[query], &mut results)
        .expect("the query is supported");
    results.remove(0)
}

fn clouds(a: &PointCloud<'static>, b: &PointCloud<'static>, a_from_b: Pose3) -> PairResult {
    compare(
        Surface::Cloud(a),
        Surface::Cloud(b),
        a_from_b,
        Params::for_radius(R),
    )
}

fn deepest_normal(result: &PairResult) -> Vec3 {
    result.patches[0].normal
}

/// Least gap over the points of all patches.
fn least_patch_gap(result: &PairResult) -> f32 {
    result
        .patches
        .iter()
        .flat_map(|p| &p.points)
        .fold(f32::INFINITY, |g, p| g.min(p.gap))
}

/// Two spheres of 0.1 and 0.07 m, from 1.5 r̄ apart to 3 r̄ deep, from random directions, with and
/// without given normals.
#[test]
fn spheres() {
    let (ra, rb) = (0.1, 0.07);
    let (big, small) = (sampled_sphere(ra, R), sampled_sphere(rb, R));
    let mut rng = fastrand::Rng::with_seed(1);
    let mut wrong = 0;
    for cloud in [Samples::cloud, Samples::bare_cloud] {
        let (a, b) = (cloud(&big, R), cloud(&small, R));
        for _ in 0..300 {
            let gap = (1.5 - 4.5 * rng.f32()) * R;
            let direction = random_unit(&mut rng);
            let mut pose = random_pose(&mut rng, 0.0);
            pose.translation = direction * (ra + rb + gap);
            let result = clouds(&a, &b, pose);
            // Smoothing over 3 × 3 pixels lifts the middle of a contact of this curvature
            // (1/0.1 + 1/0.07 per metre) by 0.16 r̄; splats of 1 r̄ blur as much again.
            let error = (least_patch_gap(&result) - gap).abs();
            assert!(
                error < 0.45 * R,
                "gap {gap}, direction {direction}: off by {error}"
            );
            let angle = deepest_normal(&result)
                .angle_between(direction)
                .to_degrees();
            assert!(
                angle < 3.0,
                "gap {gap}, direction {direction}: normal off by {angle}°"
            );
            if gap.abs() > 0.3 * R {
                wrong += usize::from(result.collides != (gap < 0.0));
            }
            if gap.abs() > 0.5 * R {
                assert_eq!(
                    result.collides,
                    gap < 0.0,
                    "gap {gap}, direction {direction}"
                );
            }
        }
    }
    // Closer than half a radius the pixel grid may decide otherwise, once in a hundred.
    assert!(wrong <= 6, "{wrong} of 600 wrong between 0.3 and 0.5 r̄");
}

/// A box flat on a plane: exact gap and normal, support points at the corners, whatever the yaw;
/// without normals down to what a sheet allows, and as deep as the box reaches with them.
#[test]
fn box_on_plane() {
    let mut rng = fastrand::Rng::with_seed(2);
    let half = Vec3::new(0.1, 0.06, 0.15);
    let plane = sampled_plane(0.8, R, &mut rng);
    let boxed = sampled_box(half, R, &mut rng);
    for (cloud, gaps, least_cosine) in [
        // Exact normals: what is left is the fixed-point step.
        (
            Samples::cloud as fn(&Samples, f32) -> _,
            [0.01, 0.002, -0.002, -0.03],
            0.999_99,
        ),
        // Estimated normals bend at the box's edges: 1° on the whole face.
        (Samples::bare_cloud, [0.01, 0.002, -0.002, -0.01], 0.999_8),
    ] {
        let (plane, boxed): (PointCloud, PointCloud) = (cloud(&plane, R), cloud(&boxed, R));
        for gap in gaps {
            for yaw in [0.0f32, 0.3, 0.8] {
                let pose = Pose3::new(Vec3::new(0.013, half.y + gap, -0.021), Vec3::Y * yaw);
                let result = clouds(&plane, &boxed, pose);
                let flat = result
                    .patches
                    .iter()
                    .find(|p| p.points.len() == 4)
                    .expect("a face rests on four points");
                assert!(
                    flat.normal.y > least_cosine,
                    "gap {gap}, yaw {yaw}: {flat:?}"
                );
                for corner in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                    let corner = pose * (half * Vec3::new(corner[0], -1.0, corner[1]));
                    let middle = |p: &ContactPoint| 0.5 * (p.point_a + p.point_b);
                    let nearest = flat
                        .points
                        .iter()
                        .min_by(|p, q| {
                            middle(p)
                                .distance(corner)
                                .total_cmp(&middle(q).distance(corner))
                        })
                        .expect("there are four");
                    // The diagonal of one and a half pixels, and half the gap. Without true
                    // normals the splats at the edges mix in the side walls, for 3 pixels.
                    let (reach, tolerance) = match boxed.normals() {
                        Some(_) => (2.2 * R, 0.02 * R),
                        None => (5.2 * R, 0.4 * R),
                    };
                    let limit = reach + 0.5 * gap.abs();
                    assert!(
                        middle(nearest).distance(corner) < limit,
                        "{nearest:?} {corner}"
                    );
                    assert!(
                        (nearest.gap - gap).abs() < tolerance,
                        "gap {gap}: {nearest:?}"
                    );
                }
            }
        }
    }
}

/// A box in a corner touches floor and wall, each with its own normal.
#[test]
fn corner() {
    let mut rng = fastrand::Rng::with_seed(3);
    let half = Vec3::splat(0.1);
    let mut room = sampled_plane(0.8, R, &mut rng);
    for (p, n) in room.points.iter_mut().zip(&mut room.normals) {
        if p.x < 0.0 {
            // Fold one half up into a wall at x = 0.
            *p = Vec3::new(0.0, -p.x, p.z);
            *n = Vec3::X;
        }
    }
    let boxed = sampled_box(half, R, &mut rng).cloud(R);
    let pose = Pose3::from_translation(half - Vec3::new(0.003, 0.005, 0.1));
    let result = clouds(&room.cloud(R), &boxed, pose);
    for (axis, gap) in [(Vec3::X, -0.003), (Vec3::Y, -0.005)] {
        let patch = result
            .patches
            .iter()
            // Pixels in the corner itself mix floor and wall: up to 4° on these few.
            .find(|p| p.normal.dot(axis) > 0.9976)
            .unwrap_or_else(|| panic!("no patch along {axis}: {:?}", result.patches));
        for point in &patch.points {
            assert!((point.gap - gap).abs() < 0.3 * R, "{axis}: {point:?}");
        }
    }
}

/// A body that is wholly behind a sheet has nothing to do with it; one that straddles it is pushed
/// back to the side where its middle is.
#[test]
fn a_sheet_is_no_volume() {
    let mut rng = fastrand::Rng::with_seed(4);
    let sheet = sampled_plane(0.6, R, &mut rng).bare_cloud(R);
    let ball = sampled_sphere(0.06, R);
    for body in [ball.cloud(R), ball.bare_cloud(R)] {
        let behind = clouds(&sheet, &body, Pose3::translation(0.0, -0.06 - 3.0 * R, 0.0));
        assert!(
            !behind.collides && behind.patches.is_empty(),
            "{:?}",
            behind.patches
        );
        for side in [1.0, -1.0] {
            let deep = clouds(&sheet, &body, Pose3::translation(0.0, side * 0.03, 0.0));
            assert!(deep.collides);
            assert!(deepest_normal(&deep).y * side > 0.99, "{:?}", deep.patches);
            assert!(
                (least_patch_gap(&deep) + 0.03).abs() < 0.45 * R,
                "{:?}",
                deep.patches
            );
        }
    }
}

/// A ball known exactly, to check images made by rays.
struct Ball(f32);

impl RaySurface for Ball {
    fn bounds(&self) -> Aabb {
        Aabb {
            min: Vec3::splat(-self.0),
            max: Vec3::splat(self.0),
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>) {
        let along = -origin.dot(direction);
        let squared = self.0 * self.0 - (origin + along * direction).length_squared();
        if squared > 0.0 {
            let half = squared.sqrt();
            for distance in [along - half, along + half] {
                if (0.0..=max_distance).contains(&distance) {
                    let normal = (origin + distance * direction) / self.0;
                    hits.push(RayHit { distance, normal });
                }
            }
        }
    }

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        (point.length() - self.0, point.normalize_or(Vec3::Y))
    }

    fn is_closed(&self) -> bool {
        true
    }
}

/// The half-space y < 0.
struct Ground;

impl RaySurface for Ground {
    fn bounds(&self) -> Aabb {
        Aabb {
            min: Vec3::NEG_INFINITY,
            max: Vec3::new(f32::INFINITY, 0.0, f32::INFINITY),
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>) {
        let distance = -origin.y / direction.y;
        if (0.0..=max_distance).contains(&distance) {
            hits.push(RayHit {
                distance,
                normal: Vec3::Y,
            });
        }
    }

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        (point.y, Vec3::Y)
    }

    fn is_closed(&self) -> bool {
        true
    }
}

/// A cloud against exact surfaces, in both orders: sphere on ball and sphere on half-space.
#[test]
fn clouds_against_exact_surfaces() {
    let mut rng = fastrand::Rng::with_seed(5);
    let radius = 0.08;
    let cloud = sampled_sphere(radius, R).cloud(R);
    for _ in 0..100 {
        let gap = (1.5 - 4.5 * rng.f32()) * R;
        let direction = random_unit(&mut rng);
        let turn = random_pose(&mut rng, 0.0);
        let mut on_ball = turn;
        on_ball.translation = direction * (0.1 + radius + gap);
        let mut on_ground = turn;
        on_ground.translation = Vec3::new(rng.f32(), radius + gap, rng.f32());
        let cases: [(&dyn RaySurface, Pose3, Vec3); 2] = [
            (&Ball(0.1), on_ball, direction),
            (&Ground, on_ground, Vec3::Y),
        ];
        for (surface, exact_from_cloud, normal) in cases {
            let params = Params::for_radius(R);
            let (exact, cloud) = (Surface::Exact(surface), Surface::Cloud(&cloud));
            let first = compare(exact, cloud, exact_from_cloud, params);
            let second = compare(cloud, exact, exact_from_cloud.inverse(), params);
            let turned = exact_from_cloud.rotation.inverse() * -normal;
            for (result, normal) in [(first, normal), (second, turned)] {
                let error = (least_patch_gap(&result) - gap).abs();
                assert!(
                    error < 0.45 * R,
                    "gap {gap}, normal {normal}: off by {error}"
                );
                let angle = deepest_normal(&result).angle_between(normal).to_degrees();
                assert!(angle < 3.0, "gap {gap}: normal off by {angle}°");
            }
        }
    }
}

/// Pairs out of reach are rejected before any image is built, and say so.
#[test]
fn far_pairs_are_rejected_early() {
    let cloud = sampled_sphere(0.1, R).cloud(R);
    for distance in [0.2 + 6.0 * R, 5.0] {
        let result = clouds(&cloud, &cloud, Pose3::translation(distance, 0.0, 0.0));
        assert_eq!(result, PairResult::default());
    }
    // The bounds overlap, the surfaces are far apart: balls diagonally beside each other, farther
    // than two diagonals of the zone's cells (4 R each).
    let diagonal = Vec3::splat((0.2 + 16.0 * R) / 3.0f32.sqrt());
    let result = clouds(&cloud, &cloud, Pose3::from_translation(diagonal));
    assert_eq!(result, PairResult::default());
}

/// What cannot be compared is refused with the place in the batch.
#[test]
fn unsupported_pairs_are_named() {
    let query = PairQuery {
        a: Surface::Exact(&Ground),
        b: Surface::Exact(&Ball(1.0)),
        a_from_b: Pose3::IDENTITY,
        view: View::Aim {
            toward_b: Vec3::Y,
            last_axis: None,
        },
        params: Params::for_radius(R),
    };
    let error = CpuBackend::new()
        .compare(&[query], &mut Vec::new())
        .expect_err("no cloud");
    assert!(
        matches!(error, BackendError::Unsupported { pair: 0, .. }),
        "{error}"
    );
}
