//! Scans and models as they come, against what is known of them. Skipped where they are not.

#[allow(
    dead_code,
    unreachable_pub,
    reason = "a part of another package, of which this one uses a part"
)]
#[path = "../../../tests/testkit/skip.rs"]
mod skip;

use tldi::glamx::{DVec3, Vec3};
use tldi_sources::{RawCloud, ReadOptions, read};

/// The file in the folder of test data, unless it is not there.
fn data(name: &str) -> Option<RawCloud> {
    let path = skip::test_data(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), name)?;
    Some(read(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn counts_are_as_published() {
    for (name, points, faces) in [
        ("stanford/bunny.ply.gz", 35_947, 69_451),
        ("stanford/bunny_watertight.ply.gz", 29_834, 59_664),
        ("stanford/bunny_scan.ply.gz", 362_272, 0),
        ("stanford/armadillo_86k.ply.gz", 86_488, 172_972),
        ("horse_gallop/frame01.ply.gz", 8_431, 16_843),
        ("kitchen_scan_300k.ply.gz", 300_000, 0),
        ("outdoor_rock_scan_259k.ply.gz", 259_431, 0),
    ] {
        if let Some(cloud) = data(name) {
            assert_eq!(cloud.points.len(), points, "{name}");
            assert_eq!(cloud.faces.len(), faces, "{name}");
            assert_eq!(cloud.origin, DVec3::ZERO, "{name}");
            assert!(cloud.points.iter().all(|p| p.is_finite()), "{name}");
            assert_eq!(cloud.vertex_normals().is_some(), faces > 0, "{name}");
        }
    }
}

#[test]
fn unreferenced_vertices_of_the_bunny_have_no_normal() {
    let Some(cloud) = data("stanford/bunny.ply.gz") else {
        return;
    };
    let normals = cloud.vertex_normals().expect("a mesh");
    let zero = normals.iter().filter(|n| **n == Vec3::ZERO).count();
    assert_eq!(zero, 1_113);
    let unit = |n: &Vec3| (n.length() - 1.0).abs() < 1e-6;
    assert!(normals.iter().all(|n| *n == Vec3::ZERO || unit(n)));
}

/// On a closed mesh, the winding is outward if the signed volume is positive; then moving each
/// vertex along its normal must make it larger, by about area × distance.
#[test]
fn vertex_normals_of_closed_meshes_point_outward() {
    for name in [
        "stanford/bunny_watertight.ply.gz",
        "stanford/armadillo_86k.ply.gz",
    ] {
        let Some(cloud) = data(name) else {
            continue;
        };
        let corners =
            |points: &[Vec3], face: &[u32; 3]| face.map(|i| points[i as usize].as_dvec3());
        let volume = |points: &[Vec3]| -> f64 {
            let signed = |f| {
                let [a, b, c] = corners(points, f);
                a.dot(b.cross(c)) / 6.0
            };
            cloud.faces.iter().map(signed).sum()
        };
        let area: f64 = cloud
            .faces
            .iter()
            .map(|f| {
                let [a, b, c] = corners(&cloud.points, f);
                (b - a).cross(c - a).length() / 2.0
            })
            .sum();
        let before = volume(&cloud.points);
        assert!(before > 0.0, "{name}: {before}");
        // A tenth of the mean edge: folds cost little of the gain.
        let step = 0.1 * (area / cloud.faces.len() as f64).sqrt();
        let normals = cloud.vertex_normals().expect("a mesh");
        let moved: Vec<Vec3> = cloud
            .points
            .iter()
            .zip(&normals)
            .map(|(p, n)| *p + *n * step as f32)
            .collect();
        let gain = (volume(&moved) - before) / (area * step);
        // Vertex normals lean against the faces' by up to some 20°: cos ≥ 0.9 on average.
        assert!((0.9..1.1).contains(&gain), "{name}: {gain}");
    }
}

#[test]
fn a_mesh_becomes_a_cloud_with_oriented_normals() {
    let Some(raw) = data("stanford/bunny.ply.gz") else {
        return;
    };
    let cloud = raw.into_builder().radius(0.001).build().expect("a cloud");
    assert_eq!(cloud.len(), 35_947);
    assert!(cloud.normals_oriented());
    let normals = cloud.normals().expect("from the faces");
    // The 1,113 vertices without faces took those of their neighbours.
    assert!(normals.iter().all(|n| n.is_normalized()));
}
