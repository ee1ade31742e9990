//! Clouds made from other clouds.

use tldi::PointCloud;
use tldi::glamx::Vec3;
use tldi_examples::load::resized;

#[test]
fn a_resized_cloud_is_scaled_about_its_middle_and_so_are_its_radii() {
    let points = vec![Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 6.0, 5.0)];
    let cloud = PointCloud::builder(points)
        .radii(vec![0.5, 1.0])
        .normals(vec![Vec3::X, Vec3::Y])
        .colors(vec![[1, 2, 3, 255], [4, 5, 6, 255]])
        .build()
        .unwrap();
    let half = resized(&cloud, 2.0).unwrap();
    assert_eq!(half.point(0), Vec3::new(-0.25, -1.0, -0.5));
    assert_eq!(half.point(1), Vec3::new(0.25, 1.0, 0.5));
    assert_eq!([half.radius(0), half.radius(1)], [0.25, 0.5]);
    assert_eq!(half.normals(), cloud.normals());
    assert_eq!(half.colors(), cloud.colors());
}
