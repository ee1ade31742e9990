//! What the benches share: clouds that a sensor could have handed over this very frame.

pub mod accuracy;
pub mod args;
pub mod charts;
pub mod contact_quality;
mod distinct;
pub mod floor;
pub mod gpu_day;
pub mod mesh_truth;
pub mod model;
pub mod peers;
pub mod placements;
pub mod protocol;
pub mod stages;
pub mod stopwatch;
pub mod stored;
pub mod threads;
pub mod times;

use std::collections::HashMap;
use tldi::PointCloud;
use tldi::glamx::Vec3;

/// Edge of the square that [`bumpy_sheet`] covers, metres.
pub const SHEET_EDGE: f32 = 2.0;

/// Height of its bumps, metres.
pub const BUMP: f32 = 0.02;

/// A gently bumpy sheet in the x-z plane of `points` random points in random order, without normals
/// unless asked for. Its radii are those of 7 neighbours on a surface of that density.
pub fn bumpy_sheet(points: usize, with_normals: bool, seed: u64) -> PointCloud<'static> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let wave = 3.0 * std::f32::consts::TAU / SHEET_EDGE;
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for _ in 0..points {
        let (x, z) = (rng.f32() - 0.5, rng.f32() - 0.5);
        let (x, z) = (SHEET_EDGE * x, SHEET_EDGE * z);
        let (height, slope_x, slope_z) = (
            BUMP * (wave * x).sin() * (wave * z).cos(),
            BUMP * wave * (wave * x).cos() * (wave * z).cos(),
            -BUMP * wave * (wave * x).sin() * (wave * z).sin(),
        );
        positions.push(Vec3::new(x, height, z));
        normals.push(Vec3::new(-slope_x, 1.0, -slope_z).normalize());
    }
    let radius = covering_radius(points, SHEET_EDGE * SHEET_EDGE);
    let builder = PointCloud::builder(positions).radius(radius);
    let builder = match with_normals {
        true => builder.normals(normals),
        false => builder,
    };
    builder.build().expect("the points are finite")
}

/// Radius of balls that cover a surface of `area` square metres on which so many points lie: 0.65 of the
/// distance to the 7th neighbour.
pub fn covering_radius(points: usize, area: f32) -> f32 {
    // 8 points, with itself, lie within π d² × density.
    0.65 * (8.0 * area / (std::f32::consts::PI * points as f32)).sqrt()
}

/// Random points in random order on a ball of about 1 m with bumps.
pub fn random_body(points: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let direction = |rng: &mut fastrand::Rng| {
        let (height, turn) = (2.0 * rng.f32() - 1.0, std::f32::consts::TAU * rng.f32());
        let across = (1.0 - height * height).sqrt();
        Vec3::new(across * turn.cos(), height, across * turn.sin())
    };
    (0..points).map(|_| bumpy(direction(&mut rng))).collect()
}

/// A point of the unit sphere on the bumpy ball.
fn bumpy(p: Vec3) -> Vec3 {
    let wave = (6.0 * p.x).sin() + (7.0 * p.y).sin() + (5.0 * p.z).cos();
    p * (1.0 + 0.1 * wave / 3.0)
}

/// Points and faces of a ball with bumps of a tenth of its radius: a closed, smooth mesh of about
/// `points` points.
pub fn bumpy_ball(points: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (sphere, faces) = icosphere(points);
    (sphere.into_iter().map(bumpy).collect(), faces)
}

/// Vertices and faces of the unit sphere: an icosahedron, subdivided until it has at least `points`
/// vertices.
fn icosphere(points: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5.0f32.sqrt());
    let mut corners = Vec::new();
    for [x, y] in [
        [-1.0, golden],
        [1.0, golden],
        [-1.0, -golden],
        [1.0, -golden],
    ] {
        corners.push(Vec3::new(x, y, 0.0));
        corners.push(Vec3::new(0.0, x, y));
        corners.push(Vec3::new(y, 0.0, x));
    }
    // Faces of the icosahedron: three corners that are two apart.
    let is_edge = |i: usize, j: usize| (corners[i].distance(corners[j]) - 2.0).abs() < 1e-3;
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if is_edge(i, j) && is_edge(j, k) && is_edge(i, k) {
                    faces.push([i as u32, j as u32, k as u32]);
                }
            }
        }
    }
    let mut sphere: Vec<Vec3> = corners.iter().map(|c| c.normalize()).collect();
    while sphere.len() < points {
        let known = sphere.len();
        faces = subdivided(&mut sphere, &faces);
        sphere[known..].iter_mut().for_each(|p| *p = p.normalize());
    }
    (sphere, faces)
}

/// Four faces in place of each; the middles of the edges are added to the vertices.
fn subdivided(vertices: &mut Vec<Vec3>, faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            vertices.push(0.5 * (vertices[a as usize] + vertices[b as usize]));
            vertices.len() as u32 - 1
        })
    };
    faces
        .iter()
        .flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        })
        .collect()
}
