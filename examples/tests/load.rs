//! Clouds made from other clouds.

use tldi::PointCloud;
use tldi::glamx::Vec3;
use tldi_examples::load::{on_surfaces, resized, subset};

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

/// Estimated normals do not know their side: no cloud that is made of theirs may claim to.
#[test]
fn only_normals_with_a_side_count_as_such() {
    let points: Vec<Vec3> = (0..100)
        .map(|k| Vec3::new((k % 10) as f32, (k / 10) as f32, 0.0))
        .collect();
    let bare = || PointCloud::builder(points.clone()).radius(1.0);
    for (builder, is_oriented) in [
        (bare().pca_normals(8), false),
        (bare().normals(vec![Vec3::Z; 100]), true),
    ] {
        let cloud = builder.build().unwrap();
        let half = resized(&cloud, 2.0).unwrap();
        let indices: Vec<usize> = (0..50).collect();
        let part = subset(&cloud, &indices, |p| p, |r| r).unwrap();
        for made in [&cloud, &half, &part] {
            assert_eq!(made.normals_oriented(), is_oriented);
            let normals = made.normals().expect("they are kept or estimated");
            assert!(normals.iter().all(|n| n.z.abs() > 0.999));
        }
    }
}

/// A level grid, a hundred specks over it, and dust far away, whose nearest points are other dust: what lies on the surface
/// is known. The specks are at least three spacings over the grid, and five apart.
#[test]
fn dust_and_specks_are_on_no_surface_and_the_surface_is() {
    let grid = (0..3600).map(|k| Vec3::new((k % 60) as f32, (k / 60) as f32, 0.0));
    let specks = (0..100).map(|k| {
        let place = Vec3::new((k % 10) as f32, (k / 10) as f32, 0.0);
        6.0 * place + Vec3::new(2.3, 2.4, 3.0 + 0.2 * (k % 7) as f32)
    });
    let dust = (0..9).map(|k| Vec3::new((20 * (k % 3)) as f32, (20 * (k / 3)) as f32, 500.0));
    let points: Vec<Vec3> = grid.chain(specks).chain(dust).collect();
    let cloud = PointCloud::builder(points)
        .knn_radii(7, 0.65)
        .build()
        .unwrap();
    let on = on_surfaces(&cloud);
    assert!(on[..3600].iter().all(|is_on| *is_on));
    assert!(on[3600..].iter().all(|is_on| !is_on));
}
