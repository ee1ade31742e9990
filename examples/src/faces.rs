//! Meshes as scans and bodies: points on their faces, where the corners alone would be too few.

use rapier3d::parry::shape::TriMesh;
use rapier3d_tldi::sample_shape;
use tldi::glamx::Vec3;
use tldi::{KdTree, PointCloud};
use tldi_sources::RawCloud;

/// Edge of a face, in spacings of the points that are wanted, from which on the face counts as large. Corners twice or three
/// times as far apart as wanted still show what the surface is; those of a cube do not. Half or twice: no test changes.
const LONG_EDGE: f32 = 4.0;
/// Share of the surface that must be in large faces: less of it closes the holes of a scan, where nothing was seen. Half
/// or twice: no test changes.
const LARGE_SHARE: f64 = 0.1;

/// Whether the points are the corners of faces, of which many have edges that are long compared with `spacing`. A cloud
/// most of whose points are in no face is a cloud.
pub(crate) fn are_large(raw: &RawCloud, spacing: f32) -> bool {
    let mut is_corner = vec![false; raw.points.len()];
    let (mut large, mut all) = (0.0, 0.0);
    for face in finite(raw) {
        let [a, b, c] = face.map(|i| raw.points[i as usize]);
        let area = f64::from((b - a).cross(c - a).length());
        let longest = (a.distance(b)).max(b.distance(c)).max(c.distance(a));
        all += area;
        for i in face {
            is_corner[i as usize] = true;
        }
        if longest > LONG_EDGE * spacing {
            large += area;
        }
    }
    let corners = is_corner.iter().filter(|is_corner| **is_corner).count();
    2 * corners > raw.points.len() && large > LARGE_SHARE * all
}

/// Even points on the faces, `spacing` apart, with outward normals and the colour of the nearest corner.
///
/// # Errors
/// Those of the sampling.
pub(crate) fn sampled(raw: RawCloud, spacing: f32) -> anyhow::Result<RawCloud> {
    let mesh = TriMesh::new(raw.points.clone(), finite(&raw).collect())?;
    let cloud = sample_shape(&mesh, spacing)?;
    let colors = match raw.colors {
        Some(colors) => {
            let corners = PointCloud::builder(raw.points)
                .colors(colors)
                .radius(spacing)
                .build()?;
            let tree = KdTree::new(&corners);
            let color_at = |p: &Vec3| {
                let nearest = tree.nearest(*p, f32::INFINITY)?.index;
                Some(corners.colors()?[nearest])
            };
            cloud.points().iter().map(color_at).collect()
        }
        None => None,
    };
    Ok(RawCloud {
        points: cloud.points().to_vec(),
        normals: cloud.normals().map(<[Vec3]>::to_vec),
        colors,
        radii: Some(vec![spacing; cloud.len()]),
        faces: Vec::new(),
        origin: raw.origin,
        ..RawCloud::default()
    })
}

/// The faces whose corners are all finite.
pub(crate) fn finite(raw: &RawCloud) -> impl Iterator<Item = [u32; 3]> {
    let is_finite = |face: &[u32; 3]| face.iter().all(|i| raw.points[*i as usize].is_finite());
    raw.faces.iter().copied().filter(is_finite)
}
