//! Points that are none of a surface: flying pixels of a depth camera, dust. No body touches them, and none is hidden by them.

use rapier3d::parry::shape::Ball;
use rapier3d_tldi::ExactShape;
use tldi::glamx::{Pose3, Vec3};
use tldi::{CpuBackend, PairQuery, PairResult, Params, PointCloud, Surface};
use tldi_tests::{
    Difference, aimed_clouds, cloud_of, compare, compare_clouds, compare_on, gpu_backend,
    sampled_plane, sampled_sphere,
};

/// Spacing of all samples here, and with radius = spacing a mean radius, in metres.
const R: f32 = 0.01;

fn clouds(a: &PointCloud<'_>, b: &PointCloud<'_>, a_from_b: Pose3) -> PairResult {
    compare_clouds(a, b, a_from_b, R)
}

/// As a GPU does it: with small pixels only.
fn on_cpu(batch: &[PairQuery<'_>]) -> Vec<PairResult> {
    compare_on(&mut CpuBackend::without_first_look(), batch)
}

/// A ball of 5 cm whose lowest point is 6 cm above a sheet, 1.5 r̄ deep in what is there beside.
fn over_sheet(beside: &[Vec3]) -> PairResult {
    let mut rng = fastrand::Rng::with_seed(8);
    let mut sheet = sampled_plane(0.4, R, &mut rng);
    sheet.points.extend(beside);
    let ball = sampled_sphere(0.05, R).cloud(R);
    let pose = Pose3::translation(0.0, 0.11 - 1.5 * R, 0.0);
    clouds(&sheet.bare_cloud(R), &ball, pose)
}

/// A flying pixel within a ball does not hide the sheet in which the ball is one radius deep. The point's splat is as wide
/// as the ball, as it is if radii come from neighbours.
#[test]
fn what_lone_points_hide_is_touched() {
    let mut rng = fastrand::Rng::with_seed(8);
    let sheet = sampled_plane(0.4, R, &mut rng).points;
    let ball = sampled_sphere(0.05, R).cloud(R);
    let mut radii = vec![R; sheet.len()];
    radii.extend([5.0 * R; 2]);
    // The second one is hidden by the first.
    for lone in [&[0.07][..], &[0.07, 0.045]] {
        let above = lone.iter().map(|y| Vec3::new(0.0, *y, 0.0));
        let points: Vec<Vec3> = sheet.iter().copied().chain(above).collect();
        let radii = radii[..points.len()].to_vec();
        let cloud = PointCloud::builder(points).radii(radii).build();
        let pose = Pose3::translation(0.0, 0.05 - R, 0.0);
        let result = clouds(&cloud.expect("a valid cloud"), &ball, pose);
        let gap = result.gap.expect("they touch");
        assert!((gap + R).abs() < 0.1 * R, "{} r deep", -gap / R);
        assert!(result.patches[0].normal.y > 0.999);
    }
}

/// Nothing is left where a flying pixel is all that a body can reach of a cloud.
#[test]
fn nothing_but_a_lone_point_is_not_touched() {
    let mut rng = fastrand::Rng::with_seed(8);
    let mut points = sampled_plane(0.4, R, &mut rng).points;
    points.push(Vec3::new(0.0, 0.3, 0.0));
    let cloud = cloud_of(points, R);
    let pose = Pose3::translation(0.0, 0.3 + 0.05 - 0.5 * R, 0.0);
    let ball = sampled_sphere(0.05, R).cloud(R);
    assert!(clouds(&cloud, &ball, pose).patches.is_empty());
    let ball = Ball::new(0.05);
    let ball = ExactShape(&ball);
    let (a, b) = (Surface::Cloud(&cloud), Surface::Exact(&ball));
    let result = compare(a, b, pose, Params::for_radius(R));
    assert!(result.patches.is_empty());
}

/// A flying pixel is not touched; a wire of points in its place is, and so are five points that are
/// all there is.
#[test]
fn lone_points_are_not_touched() {
    assert!(over_sheet(&[]).patches.is_empty());
    let lone = Vec3::new(0.0, 0.06, 0.0);
    assert!(over_sheet(&[lone]).patches.is_empty());
    let wire: Vec<Vec3> = (-10..=10).map(|k| lone + k as f32 * R * Vec3::X).collect();
    assert!(!over_sheet(&wire).patches.is_empty());
    let few = [Vec3::ZERO, Vec3::X, -Vec3::X, Vec3::Z, -Vec3::Z].map(|p| lone + R * p);
    let few = cloud_of(few.to_vec(), R);
    let ball = sampled_sphere(0.05, R).cloud(R);
    let pose = Pose3::translation(0.0, 0.11 - 1.5 * R, 0.0);
    let result = clouds(&few, &ball, pose);
    assert!(!result.patches.is_empty());
}

/// A ball on a sheet with a flying pixel. One close to a bare sheet is not drawn; for one inside the ball, whose normal
/// says that it is touched, the CPU compares the pair again.
#[test]
fn flying_pixels_do_not_count() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let mut rng = fastrand::Rng::with_seed(4);
    let sheet = sampled_plane(0.5, R, &mut rng).points;
    let ball = sampled_sphere(20.0 * R, R).cloud(R);
    let cloud = |is_bare: bool, flying: Option<f32>| {
        let flying = flying.map(|height| Vec3::new(0.01, height, 0.01));
        let points: Vec<Vec3> = sheet.iter().copied().chain(flying).collect();
        let normals = vec![Vec3::Y; points.len()];
        let builder = PointCloud::builder(points).radius(R);
        let builder = match is_bare {
            true => builder,
            false => builder.normals(normals),
        };
        builder.build().expect("the points are valid")
    };
    for (is_bare, height, pairs_on_cpu) in [(true, 1.5 * R, 0), (false, 10.0 * R, 1)] {
        let [with, without] = [Some(height), None].map(|flying| cloud(is_bare, flying));
        let [with, without] = [&with, &without].map(|cloud| {
            let pose = Pose3::translation(0.0, 19.0 * R, 0.0);
            [aimed_clouds(cloud, &ball, pose, R)]
        });
        let gpu = compare_on(&mut backend, &with);
        assert_eq!(backend.pairs_on_cpu(), pairs_on_cpu, "{height}");
        for cpu in [on_cpu(&with), on_cpu(&without)] {
            let found = Difference::between(&cpu, &gpu);
            assert!(
                found.answers == 0 && found.gap < 0.05,
                "{height}: {found:?}"
            );
        }
    }
}
