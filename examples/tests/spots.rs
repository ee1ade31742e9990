//! Where bodies are dropped.

use tldi::PointCloud;
use tldi::glamx::{Quat, Vec3};
use tldi_examples::spots::{Demand, NoSpot, Spot, find_spots};

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

/// A square of 3 × 3 m with a hole of 1 m radius in its middle, z up.
fn holed_floor() -> Vec<Vec3> {
    let mut points = surface(3.0, [0.0, 0.0], |_, _| 0.0);
    points.retain(|p| p.length() > 1.0);
    points
}

fn found(points: Vec<Vec3>, up: Vec3, demand: &Demand) -> Result<Vec<Spot>, NoSpot> {
    let scan = PointCloud::builder(points).radius(0.015).build().unwrap();
    find_spots(&scan, up, demand)
}

/// Spots for bodies of [`BODY_RADIUS`].
fn spots(points: Vec<Vec3>, up: Vec3, count: usize, seed: u64) -> Vec<Spot> {
    let demand = Demand {
        count,
        body_radius: BODY_RADIUS,
        seed,
    };
    found(points, up, &demand).unwrap()
}

#[test]
fn every_level_gets_a_body() {
    for seed in 0..8 {
        let mut points = surface(4.0, [0.0, 0.0], |_, _| 0.0);
        points.extend(surface(1.0, [0.55, 0.0], |_, _| 0.7));
        points.extend(surface(1.0, [-0.55, 0.0], |_, _| 1.2));
        let spots = spots(points, Vec3::Z, 3, seed);
        let mut heights: Vec<f32> = spots.iter().map(|spot| spot.surface.z).collect();
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
    let slope = surface(3.0, [0.0, 0.0], |x, _| SLOPE * x);
    for Spot { surface: place, .. } in spots(slope, Vec3::Z, 4, 1) {
        let above_middle = place.z - SLOPE * place.x;
        let rim = SLOPE * 2.5 * BODY_RADIUS;
        // Two pixels of 3 cm on the slope.
        assert!(
            (above_middle - rim).abs() < 0.003,
            "{place}: {above_middle}"
        );
    }
}

#[test]
fn spots_avoid_holes_and_rims_in_any_frame() {
    for (seed, rotation) in [
        (1, Quat::IDENTITY),
        (2, Quat::from_rotation_x(2.0)),
        (3, Quat::from_rotation_y(-0.7)),
    ] {
        let points = holed_floor().iter().map(|p| rotation * *p).collect();
        let spots = spots(points, rotation * Vec3::Z, 4, seed);
        assert_eq!(spots.len(), 4);
        for spot in &spots {
            let p = rotation.inverse() * spot.surface;
            // One pixel is 3 cm: the disc may reach that far over a rim, and 3 % of it again.
            assert!(p.truncate().length() > 1.0 + 0.15 - 0.05, "{p}");
            assert!(p.truncate().abs().max_element() < 1.5 - 0.15 + 0.05, "{p}");
            assert!(p.z.abs() < 0.01, "{p}");
            assert_eq!(spot.level, 0);
        }
        for (k, a) in spots.iter().enumerate() {
            for b in &spots[..k] {
                assert!(a.surface.distance(b.surface) >= 0.45 - 1e-4);
            }
        }
    }
}

#[test]
fn more_bodies_than_places_are_stacked() {
    let table = || surface(0.4, [0.0, 0.0], |_, _| 1.0);
    let spots = spots(table(), Vec3::Z, 3, 1);
    let levels: Vec<usize> = spots.iter().map(|spot| spot.level).collect();
    assert_eq!(levels, [0, 1, 2]);
    let large = Demand {
        count: 3,
        body_radius: 0.5,
        seed: 1,
    };
    let error = found(table(), Vec3::Z, &large).unwrap_err();
    assert_eq!(error, NoSpot { diameter: 1.0 });
}

/// Two points far away make the image so large that its pixels are three times as wide: a strip of 90 cm still has
/// room for a body of 30 cm, which is eleven of the wanted pixels and five of the larger ones.
#[test]
fn a_wide_scan_has_places_as_large_as_asked_for() {
    let mut points: Vec<Vec3> = (0..45 * 150)
        .map(|k| Vec3::new((k % 45) as f32 * 0.02, (k / 45) as f32 * 0.02, 0.0))
        .collect();
    points.extend([-100.0, 100.0].map(|far| Vec3::new(far, far, 0.0)));
    for Spot { surface: p, .. } in spots(points, Vec3::Z, 2, 1) {
        assert!(
            (0.15..0.75).contains(&p.x) && (0.15..2.85).contains(&p.y),
            "{p}"
        );
    }
}

#[test]
fn nothing_is_dropped_on_a_ceiling() {
    let mut points = holed_floor();
    points.extend(holed_floor().iter().map(|p| *p + 2.4 * Vec3::Z));
    for Spot { surface, .. } in spots(points, Vec3::Z, 3, 1) {
        assert!(surface.z < 0.01, "{surface}");
    }
}
