//! Clouds made from other clouds.

mod common;

use common::{CORNERS, SIDES, ball, cube_as_stl, lines, ply};
use std::fs;
use tldi::PointCloud;
use tldi::glamx::Vec3;
use tldi_examples::load::{self, on_surfaces, resized, stem, subset};

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

#[test]
fn names_lose_known_extensions_only() {
    for (path, expected) in [
        ("scans/cat.v2.PLY.gz", "cat.v2"),
        ("1532402927.647951.pcd.bin", "1532402927.647951"),
        ("000007.bin", "000007"),
        ("robot.stl", "robot"),
    ] {
        assert_eq!(stem(path.as_ref()), expected);
    }
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
        assert_eq!(half.normals(), cloud.normals());
    }
}

/// A ball with outward normals, and with normals of any sign, as estimates are before they are oriented.
#[test]
fn normals_of_a_file_have_a_side_only_if_they_agree() {
    let folder = common::folder("load_normals");
    let write = |name: &str, sign: fn(f32) -> f32| {
        let points = ball(2000).into_iter().map(|p| p.map(|c| c as f32));
        let vertices = points.map(|[x, y, z]| {
            let [nx, ny, nz] = [x, y, z].map(|c| c * sign(z));
            [x, y, z, nx, ny, nz]
        });
        let path = folder.join(name);
        fs::write(&path, ply("x y z nx ny nz", &lines(vertices), "")).unwrap();
        path
    };
    let outward = write("outward.ply", |_| 1.0);
    let upward = write("upward.ply", f32::signum);
    for (path, is_oriented) in [(&outward, true), (&upward, false)] {
        for loaded in [load::body_from_file(path), load::scan_from_file(path, 1.0)] {
            let cloud = loaded.unwrap().cloud;
            assert_eq!(cloud.normals_oriented(), is_oriented, "{}", path.display());
            let normals = cloud.normals().unwrap();
            let along = |k: usize| cloud.point(k).dot(normals[k]).abs() > 0.999;
            assert!((0..cloud.len()).all(along));
        }
    }
}

fn cube_as_ply() -> String {
    let green = |z: f32| if z > 0.0 { 255.0 } else { 0.0 };
    let vertices = CORNERS.map(|[x, y, z]| [x, y, z, 0.0, green(z), 0.0]);
    let faces = SIDES.map(|[a, b, c, d]| format!("4 {a} {b} {c} {d}\n"));
    ply("x y z red green blue", &lines(vertices), &faces.concat())
}

fn cube_as_obj() -> String {
    let corners = CORNERS
        .map(|corner| "v ".to_owned() + &lines([corner]))
        .concat();
    let side = |side: &[usize; 4]| format!("f {}\n", side.map(|k| (k + 1).to_string()).join(" "));
    corners + &SIDES.iter().map(side).collect::<String>()
}

/// Every point is on the cube, its normal outward, and there are at least as many as squares of the spacing.
fn assert_cube(cloud: &PointCloud<'_>, spacing: f32) {
    assert!(cloud.normals_oriented());
    let normals = cloud.normals().unwrap();
    for (k, p) in cloud.points().iter().enumerate() {
        assert!((p.abs().max_element() - 1.0).abs() < 1e-5, "{p}");
        assert!(p.dot(normals[k]) > 0.99, "{p} {}", normals[k]);
        assert!(cloud.radius(k) < 1.01 * spacing, "{p}");
    }
    let squares = 24.0 / (spacing * spacing);
    assert!(cloud.len() as f32 > squares, "{}", cloud.len());
}

/// A body has 60 points along its side of 2 m, a scan 240. The upper corners are green, the lower ones black.
#[test]
fn a_mesh_of_large_faces_becomes_points_on_them() {
    let folder = common::folder("load_cube");
    for (name, text) in [
        ("cube.ply", cube_as_ply()),
        ("cube.stl", cube_as_stl()),
        ("cube.obj", cube_as_obj()),
    ] {
        fs::write(folder.join(name), text).unwrap();
        let body = load::body_from_file(&folder.join(name)).unwrap().cloud;
        assert_cube(&body, 2.0 / 60.0);
        assert_eq!(body.colors().is_some(), name == "cube.ply");
        for (p, color) in body.points().iter().zip(body.colors().unwrap_or_default()) {
            assert_eq!(color[1] == 255, p.z > 0.0, "{p}");
        }
    }
    let scan = load::scan_from_file(&folder.join("cube.ply"), 1.0).unwrap();
    assert_cube(&scan.cloud, 2.0 / 240.0);
}

/// A cloud with a single large face, of three of its 1000 points, stays a cloud.
#[test]
fn a_cloud_with_a_face_is_a_cloud() {
    let path = common::folder("load_one_face").join("cloud.ply");
    let vertices = (0..1000).map(|k| [k % 10, k / 10 % 10, k / 100].map(|c| c as f32));
    fs::write(&path, ply("x y z", &lines(vertices), "3 0 9 990\n")).unwrap();
    assert_eq!(load::body_from_file(&path).unwrap().cloud.len(), 1000);
}

/// A sheet of 100 × 100 small squares keeps its corners: they show what it is.
#[test]
fn a_mesh_of_small_faces_keeps_its_corners() {
    let path = common::folder("load_sheet").join("sheet.ply");
    let vertices = (0..101 * 101).map(|k| [(k % 101) as f32, (k / 101) as f32, 0.0]);
    let face = |k: usize| {
        let corner = k / 100 * 101 + k % 100;
        let (right, above) = (corner + 1, corner + 101);
        format!("4 {corner} {right} {} {above}\n", above + 1)
    };
    let faces: String = (0..100 * 100).map(face).collect();
    fs::write(&path, ply("x y z", &lines(vertices), &faces)).unwrap();
    for loaded in [
        load::body_from_file(&path),
        load::scan_from_file(&path, 1.0),
    ] {
        let cloud = loaded.unwrap().cloud;
        assert_eq!(cloud.len(), 101 * 101);
        assert!(cloud.normals().unwrap().iter().all(|n| *n == Vec3::Z));
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
