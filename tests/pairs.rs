//! Whole pairs against analytic truth: gap, collision, contact normals and support points.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Aabb, Backend, CpuBackend, PairQuery, PairResult, Params, PointCloud, RayHit, RaySurface,
    Surface, View,
};
use tldi_tests::{random_pose, random_unit, sampled_box, sampled_plane, sampled_sphere};

/// Spacing of all samples here, and with radius = spacing a mean radius, in metres.
const R: f32 = 0.01;

fn compare(a: Surface, b: Surface, a_from_b: Pose3, params: Params) -> PairResult {
    let mut results = Vec::new();
    let query = PairQuery {
        a,
        b,
        a_from_b,
        view: View::Aim { toward_b: a_from_b.translation, last_axis: None },
        params,
    };
    CpuBackend::new().compare(&[query], &mut results).expect("the query is supported");
    results.remove(0)
}

fn clouds(a: &PointCloud<'static>, b: &PointCloud<'static>, a_from_b: Pose3) -> PairResult {
    compare(Surface::Cloud(a), Surface::Cloud(b), a_from_b, Params::for_radius(R))
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

/// Two spheres of 0.1 and 0.07 m, from 1.5 r̄ apart to 3 r̄ deep, from random directions.
#[test]
fn spheres() {
    let (ra, rb) = (0.1, 0.07);
    let (big, small) = (sampled_sphere(ra, R), sampled_sphere(rb, R));
    let mut rng = fastrand::Rng::with_seed(1);
    for oriented in [true, false] {
        let cloud = |s: &tldi_tests::Samples| if oriented { s.cloud(R) } else { s.bare_cloud(R) };
        let (a, b) = (cloud(&big), cloud(&small));
        let (mut gaps, mut angles) = (vec![], vec![]);
        for _ in 0..300 {
            let gap = (1.5 - 4.5 * rng.f32()) * R;
            let direction = random_unit(&mut rng);
            let mut pose = random_pose(&mut rng, 0.0);
            pose.translation = direction * (ra + rb + gap);
            let result = clouds(&a, &b, pose);
            gaps.push((least_patch_gap(&result) - gap).abs() / R);
            angles.push(deepest_normal(&result).dot(direction).clamp(-1.0, 1.0).acos().to_degrees());
            if gap.abs() > 0.3 * R {
                assert_eq!(result.collides, gap < 0.0, "gap {} r", gap / R);
            }
        }
        gaps.sort_by(f32::total_cmp);
        angles.sort_by(f32::total_cmp);
        eprintln!("oriented {oriented}: gap error/r median {} max {}; angle median {} max {}",
            gaps[150], gaps[299], angles[150], angles[299]);
    }
}

/// A box dropped flat onto a plane: support points at its corners.
#[test]
fn box_on_plane() {
    let mut rng = fastrand::Rng::with_seed(2);
    let half = Vec3::new(0.1, 0.06, 0.15);
    let plane = sampled_plane(0.8, R, &mut rng);
    let boxed = sampled_box(half, R, &mut rng);
    for oriented in [true, false] {
        let cloud = |s: &tldi_tests::Samples| if oriented { s.cloud(R) } else { s.bare_cloud(R) };
        for gap in [0.01, 0.002, -0.002, -0.01, -0.03] {
            for yaw in [0.0f32, 0.3, 0.8] {
                let pose = Pose3::new(Vec3::new(0.013, half.y + gap, -0.021), Vec3::Y * yaw);
                let result = clouds(&cloud(&plane), &cloud(&boxed), pose);
                eprintln!("oriented {oriented} gap {gap} yaw {yaw}: collides {} views {:?} patches {}", result.collides, result.axes, result.patches.len());
                for p in result.patches.iter().take(4) {
                    eprintln!("   n {:.3} {:?}", p.normal, p.points.iter().map(|p| (((p.point_a+p.point_b)*0.5 - pose.translation).to_array().map(|c| (c*1000.0).round()), (p.gap*1e4).round()/1e4)).collect::<Vec<_>>());
                }
            }
        }
    }
}
