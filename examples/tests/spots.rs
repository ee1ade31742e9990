//! Where bodies are dropped.

use tldi::PointCloud;
use tldi::glamx::Vec3;
use tldi_examples::spots::{Demand, find_spots};

const BODY_RADIUS: f32 = 0.15;

/// A surface over a square of `edge` metres about (`x`, `y`), z up.
fn surface(edge: f32, [x, y]: [f32; 2], height: impl Fn(f32, f32) -> f32) -> Vec<Vec3> {
    let n = (edge / 0.02) as usize;
    (0..n * n)
        .map(|k| {
            let along = |i: usize| i as f32 * 0.02 - 0.5 * edge;
            let (x, y) = (x + along(k % n), y + along(k / n));
            Vec3::new(x, y, height(x, y))
        })
        .collect()
}

fn spots(points: Vec<Vec3>, count: usize, seed: u64) -> Vec<Vec3> {
    let scan = PointCloud::builder(points).radius(0.015).build().unwrap();
    let demand = Demand {
        count,
        body_radius: BODY_RADIUS,
        seed,
    };
    find_spots(&scan, Vec3::Z, &demand)
        .unwrap()
        .iter()
        .map(|spot| spot.surface)
        .collect()
}

#[test]
fn every_level_gets_a_body() {
    for seed in 0..8 {
        let mut points = surface(4.0, [0.0, 0.0], |_, _| 0.0);
        points.extend(surface(1.0, [0.55, 0.0], |_, _| 0.7));
        points.extend(surface(1.0, [-0.55, 0.0], |_, _| 1.2));
        let mut heights: Vec<f32> = spots(points, 3, seed).iter().map(|p| p.z).collect();
        heights.sort_unstable_by(f32::total_cmp);
        for (height, level) in heights.iter().zip([0.0, 0.7, 1.2]) {
            assert!((height - level).abs() < 0.01, "seed {seed}: {heights:?}");
        }
    }
}

/// On a slope it is the upper rim of the disc, 2.5 body radii wide, that a body meets first.
#[test]
fn a_spot_is_as_high_as_the_highest_point_of_its_disc() {
    const SLOPE: f32 = 0.05;
    for place in spots(surface(3.0, [0.0, 0.0], |x, _| SLOPE * x), 4, 1) {
        let above_middle = place.z - SLOPE * place.x;
        let rim = SLOPE * 2.5 * BODY_RADIUS;
        // Two pixels of 3 cm on the slope.
        assert!(
            (above_middle - rim).abs() < 0.003,
            "{place}: {above_middle}"
        );
    }
}
