//! Clouds without normals that keep the estimated ones.

use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{CameraPolicy, PointCloud, View};
use tldi_tests::{
    aimed_clouds, cloud_of, compare_batch, compare_clouds, deepest_contact, sampled_box,
    sampled_plane, sampled_sphere,
};

const R: f32 = 0.02;

/// A sheet of 1 m with a point every [`R`], in the plane y = 0.
fn sheet() -> Vec<Vec3> {
    sampled_plane(1.0, R, &mut fastrand::Rng::with_seed(4)).points
}

/// A box that is pressed into a sheet, by 0.3 to 8 radii, has its depth and normal: with normals that are kept, and with
/// such as the builder estimates. The box must be known as far above the sheet as below: the near points tell the side.
#[test]
fn boxes_in_a_sheet_are_as_deep_as_they_are() {
    let mut rng = fastrand::Rng::with_seed(7);
    let half = R * Vec3::new(15.0, 12.0, 18.0);
    let box_points = sampled_box(half, R, &mut rng).points;
    let kept = [sheet(), box_points.clone()].map(|points| {
        let mut cloud = cloud_of(points, R);
        cloud.keep_normals();
        cloud
    });
    let fitted = [sheet(), box_points].map(|points| {
        let builder = PointCloud::builder(points).radius(R).pca_normals(16);
        builder.build().expect("finite points")
    });
    for case in 0..60 {
        let depth = R * (0.3 + 7.7 * case as f32 / 59.0);
        let spin = Quat::from_rotation_y(rng.f32());
        let pose = Pose3::from_parts((half.y - depth) * Vec3::Y, spin);
        for [sheet, body] in [&kept, &fitted] {
            let mut query = aimed_clouds(sheet, body, pose, R);
            query.view = View::Aim {
                policy: CameraPolicy::ContactZone,
                // As far as that it came from above in this step.
                motion: -2.0 * R * Vec3::Y,
                last_axis: None,
            };
            let result = compare_batch(&[query]).remove(0);
            let (normal, found) = deepest_contact(&result).expect("it touches");
            let told = format!("{} radii deep: {} {normal}", depth / R, found / R);
            assert!((found - depth).abs() < 0.05 * R, "{told}");
            assert!(normal.y > 0.9999, "{told}");
        }
    }
}

/// A sheet turns by 0.5 rad under a ball: its normal turns, too.
#[test]
fn new_points_have_normals_of_their_own() {
    let flat = sheet();
    let turn = Quat::from_rotation_z(0.5);
    let tilted: Vec<Vec3> = flat.iter().map(|p| turn * *p).collect();
    let mut floor = cloud_of(flat, R);
    floor.keep_normals();
    floor.set_points(&tilted, None).expect("finite points");
    let ball = sampled_sphere(0.1, R).bare_cloud(R);
    let upward = turn * Vec3::Y;
    let pose = Pose3::from_translation((0.1 - 0.5 * R) * upward);
    let result = compare_clouds(&floor, &ball, pose, R);
    let normal = result.patches[0].normal;
    let off = normal.dot(upward).abs().min(1.0).acos().to_degrees();
    assert!(off < 1.0, "{off} degrees: {normal}");
}

/// A point two radii above a sheet stands out, kept or not, and what lies between them does not touch it.
#[test]
fn what_stands_out_is_not_seen() {
    let mut points = sheet();
    points.push(Vec3::new(0.1, 2.0 * R, 0.1));
    let mut floor = cloud_of(points, R);
    let plate = cloud_of(sheet(), R);
    let above = Pose3::from_translation(1.5 * R * Vec3::Y);
    let compared = |floor: &PointCloud| compare_clouds(floor, &plate, above, R);
    let bare = compared(&floor);
    floor.keep_normals();
    let kept = compared(&floor);
    assert_eq!(bare.work.fine.points, kept.work.fine.points);
    for result in [bare, kept] {
        assert!(!result.collides, "{:?}", result.gap);
        let gap = result.gap.expect("within the prediction");
        assert!((gap - 1.5 * R).abs() < 0.1 * R, "{gap}");
    }
}
