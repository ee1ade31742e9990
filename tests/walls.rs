//! Sheets that end beside a wall seen edge-on, or go on behind it: on the CPU against truth, and on the GPU
//! against the CPU.

use tldi::glamx::{Pose3, Vec3};
use tldi::{CpuBackend, PairQuery, View, VirtualCamera};
use tldi_tests::{aimed_clouds, compare_on, gpu_backend, sampled_plane};

/// Spacing of all samples here, and with radius = spacing a mean radius, in metres.
const R: f32 = 0.02;

/// The last splats of a sheet that ends beside a wall are in the wall's pixels.
#[test]
fn walls_are_pierced_by_what_goes_on_behind_them() {
    let mut rng = fastrand::Rng::with_seed(12);
    let sheet = sampled_plane(0.4, R, &mut rng).bare_cloud(R);
    let upright = 0.5 * std::f32::consts::PI * Vec3::Z;
    let beyond_edge: Vec<f32> = (0..60).map(|_| 4.0 * (rng.f32() - 0.5) * R).collect();
    let query = |beyond: &f32| PairQuery {
        view: View::Fixed(VirtualCamera::along(-Vec3::Y, R)),
        ..aimed_clouds(
            &sheet,
            &sheet,
            Pose3::new(Vec3::new(0.2 + beyond, 0.05, 0.0), upright),
            R,
        )
    };
    let batch: Vec<PairQuery> = beyond_edge.iter().map(query).collect();
    let cpu = compare_on(&mut CpuBackend::new(), &batch);
    for (result, beyond) in cpu.iter().zip(beyond_edge) {
        // In between, it depends on where the outermost samples are.
        if !(-0.5 * R..=0.8 * R).contains(&beyond) {
            assert_eq!(result.collides, beyond < 0.0, "{beyond}");
        }
    }
    let Some(mut gpu) = gpu_backend() else { return };
    let gpu = compare_on(&mut gpu, &batch);
    let both = cpu.iter().zip(&gpu);
    // Where a splat ends within rounding of a pixel's middle.
    let differing = both.filter(|(c, g)| c.collides != g.collides).count();
    assert!(differing <= 5, "{differing}");
}
