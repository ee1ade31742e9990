//! Models and scans of the test data, or what is generated (and said) where the data is absent.

use super::surface::{Mesh, Surface};
use rapier3d::parry::transformation::convex_hull;
use std::collections::HashMap;
use std::sync::LazyLock;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi_sources::{ReadOptions, read};
use tldi_tests::{Samples, data_file, scale_to};

/// The Stanford Bunny.
const BUNNY: &str = "stanford/bunny_watertight.ply.gz";

/// The mesh of the bunny, largest extent 1, middle of its bounds at the origin; a generated pebble
/// where the data is absent.
static BUNNY_MESH: LazyLock<Mesh> = LazyLock::new(|| {
    let Some(path) = data_file(BUNNY) else {
        return pebble();
    };
    let mut raw = read(&path, &ReadOptions::default()).expect("the test data can be read");
    scale_to(&mut raw.points, 1.0);
    Mesh {
        vertices: raw.points,
        triangles: raw.faces,
        one_sided: true,
    }
});

/// Whether the bunny is at hand.
pub(crate) fn has_bunny() -> bool {
    data_file(BUNNY).is_some()
}

/// A body of the bunny's shape with a largest extent of `size` metres: of the vertices in each cube
/// with edges of `spacing` metres one is kept, for the cloud and for the mesh alike.
pub(crate) fn bunny(size: f32, spacing: f32) -> Surface {
    let mesh = clustered(&BUNNY_MESH, size, spacing);
    let samples = Samples {
        points: mesh.vertices.clone(),
        normals: vertex_normals(&mesh),
    };
    Surface::model(samples, spacing, mesh)
}

/// A mesh scaled by `scale` whose vertices in each cube with edges of `spacing` are merged into
/// the first of them.
fn clustered(mesh: &Mesh, scale: f32, spacing: f32) -> Mesh {
    let mut vertices = Vec::new();
    let mut cells = HashMap::new();
    let kept: Vec<u32> = (mesh.vertices.iter().map(|p| *p * scale))
        .map(|p| {
            let cell = (p / spacing).floor().as_ivec3();
            *cells.entry(cell).or_insert_with(|| {
                vertices.push(p);
                vertices.len() as u32 - 1
            })
        })
        .collect();
    let triangles = (mesh.triangles.iter())
        .map(|triangle| triangle.map(|i| kept[i as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    Mesh {
        vertices,
        triangles,
        one_sided: mesh.one_sided,
    }
}

/// The pose in which a solid mesh lies on y = 0 with its centre of mass lowest, x = z = 0: on the
/// facet of its convex hull that is nearest to the centre of mass.
pub(crate) fn lowest_resting_pose(surface: &Surface) -> Pose3 {
    let (Ok(mesh), Some(mass)) = (&surface.mesh, &surface.mass) else {
        return Pose3::IDENTITY;
    };
    let (corners, triangles) = convex_hull(&mesh.vertices);
    let mut lowest = (f32::INFINITY, Vec3::NEG_Y);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| corners[i as usize]);
        if let Some(normal) = (b - a).cross(c - a).try_normalize() {
            let distance = normal.dot(a - mass.local_com);
            if distance < lowest.0 {
                lowest = (distance, normal);
            }
        }
    }
    let (height, down) = lowest;
    let rotation = Quat::from_rotation_arc(down, Vec3::NEG_Y);
    let middle = rotation * mass.local_com;
    Pose3::from_parts(Vec3::Y * height - middle, rotation)
}

/// Area-weighted normals of the vertices.
fn vertex_normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; mesh.vertices.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize]);
        let area = (b - a).cross(c - a);
        for &i in triangle {
            sums[i as usize] += area;
        }
    }
    sums.iter().map(|sum| sum.normalize_or(Vec3::Y)).collect()
}

/// A sphere with smooth bumps, where there is no bunny.
#[allow(clippy::print_stderr, reason = "a stand-in must not pass unnoticed")]
fn pebble() -> Mesh {
    eprintln!("STAND-IN: a generated pebble takes the place of the bunny");
    let (mut vertices, triangles) = rapier3d::prelude::Ball::new(0.4).to_trimesh(160, 80);
    for p in &mut vertices {
        let d = p.normalize();
        *p *= 1.0 + 0.12 * (5.0 * d.x).sin() * (4.0 * d.y).cos() + 0.08 * (6.0 * d.z + d.x).sin();
    }
    Mesh {
        vertices,
        triangles,
        one_sided: true,
    }
}
