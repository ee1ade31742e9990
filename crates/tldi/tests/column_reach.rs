//! Columns that are not drawn hold no contact: surfaces at the prediction distance have one in all of them.

use fastrand::Rng;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{
    Backend, CpuBackend, PairQuery, PairResult, Params, PointCloud, Surface, View, VirtualCamera,
};

/// Metres.
const RADIUS: f32 = 0.01;

/// Half the edge of the sheets, metres.
const HALF: f32 = 0.3;

/// Random points of a square with outward normals, as dense as splats of [`RADIUS`] ask for.
fn sheet(turn: Quat, height: f32, rng: &mut Rng) -> PointCloud<'static> {
    let count = (0.94 * (2.0 * HALF / RADIUS).powi(2)) as usize;
    let side = |rng: &mut Rng| HALF * (2.0 * rng.f32() - 1.0);
    let points: Vec<Vec3> = (0..count)
        .map(|_| turn * Vec3::new(side(rng), side(rng), height))
        .collect();
    let normals = vec![turn * (height.signum() * Vec3::NEG_Z); count];
    let builder = PointCloud::builder(points).radius(RADIUS);
    builder.normals(normals).build().expect("valid")
}

/// By geometry: two parallel sheets, inclined to the view, have a contact in each pixel that they cover. Their
/// splats leave out one pixel in a hundred.
#[test]
fn parallel_sheets_touch_everywhere() {
    let mut rng = Rng::with_seed(1);
    for (prediction, pixel) in [(2.0, 1.0), (2.0, 0.4), (20.0, 0.4), (1.0, 3.0)] {
        for degrees in [0.0f32, 20.0, 40.0, 55.0] {
            let about = Quat::from_rotation_z(6.0 * rng.f32());
            let turn = about * Quat::from_rotation_x(degrees.to_radians());
            let distance = 0.9 * prediction * RADIUS;
            let [a, b] = [0.5, -0.5].map(|side| sheet(turn, side * distance, &mut rng));
            let pixel = pixel * RADIUS;
            let params = Params::for_radius(RADIUS)
                .with_prediction(prediction * RADIUS)
                .with_pixel_size(pixel);
            let mut results: Vec<PairResult> = Vec::new();
            let query = PairQuery {
                a: Surface::Cloud(&a),
                b: Surface::Cloud(&b),
                a_from_b: Pose3::IDENTITY,
                view: View::Fixed(VirtualCamera::along(Vec3::Z, pixel)),
                params,
            };
            let mut backend = CpuBackend::new();
            backend.compare(&[query], &mut results).expect("supported");
            // In the view the sheets are moved against each other, and their rims cover each other in part.
            let moved = distance * degrees.to_radians().sin() + 4.0 * RADIUS;
            let covered = (2.0 * HALF - moved) * (2.0 * HALF * degrees.to_radians().cos() - moved);
            let share = results[0].contacts.len() as f32 / (covered / pixel.powi(2));
            let what = format!("{prediction} r, pixels of {pixel} m, {degrees}°");
            assert!(share > 0.95, "{share} of the pixels have a contact: {what}");
        }
    }
}
