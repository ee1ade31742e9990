//! What the benches share: clouds that a sensor could have handed over this very frame.

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
    // 7 neighbours lie within π d² × density = 8.
    let density = points as f32 / (SHEET_EDGE * SHEET_EDGE);
    let radius = 0.65 * (8.0 / (std::f32::consts::PI * density)).sqrt();
    let builder = PointCloud::builder(positions).radius(radius);
    let builder = match with_normals {
        true => builder.normals(normals),
        false => builder,
    };
    builder.build().expect("the points are finite")
}
