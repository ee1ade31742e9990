//! How a drop starts, and what its report says.

use tldi::PointCloud;
use tldi::glamx::Vec3;
use tldi_examples::cli::BackendChoice;
use tldi_examples::load;
use tldi_examples::simulation::{DropSimulation, NamedCloud};
use tldi_examples::spots::Spot;
use tldi_examples::surface_sampling::sample_surface;

/// Edge of the bodies, metres.
const EDGE: f32 = 0.2;

fn cube() -> NamedCloud {
    let bounds = tldi::Aabb {
        min: Vec3::splat(-EDGE),
        max: Vec3::splat(EDGE),
    };
    let distance = |p: Vec3| {
        let outside = p.abs() - 0.5 * EDGE;
        outside.max(Vec3::ZERO).length() + outside.max_element().min(0.0)
    };
    let surface = sample_surface(distance, |_| [255; 4], bounds, 0.02, 1);
    NamedCloud {
        name: "cube".to_owned(),
        cloud: load::body_from_surface(surface).unwrap(),
    }
}

/// A level floor of 2 × 2 m about the origin, z up.
fn floor() -> PointCloud<'static> {
    let points: Vec<Vec3> = (0..10_000)
        .map(|k| {
            Vec3::new((k % 100) as f32, (k / 100) as f32, 0.0) * 0.02 - Vec3::new(1.0, 1.0, 0.0)
        })
        .collect();
    PointCloud::builder(points).radius(0.02).build().unwrap()
}

fn simulation(places: &[(Vec3, usize)]) -> DropSimulation {
    let spots: Vec<Spot> = places
        .iter()
        .map(|&(surface, level)| Spot { surface, level })
        .collect();
    let bodies = vec![cube(); spots.len()];
    let chosen = BackendChoice::Cpu.open().unwrap();
    DropSimulation::new(floor(), Vec3::Z, bodies, &spots, 3, chosen).unwrap()
}

/// Heights of the lowest and the highest point of each body.
fn height_ranges(simulation: &DropSimulation) -> Vec<[f32; 2]> {
    let poses = simulation.snapshot().scan_from_body;
    (simulation.clouds().iter().zip(poses))
        .map(|(cloud, pose)| {
            let heights = cloud.points().map(|p| (pose * p).z);
            heights.fold([f32::MAX, f32::MIN], |[min, max], h| {
                [min.min(h), max.max(h)]
            })
        })
        .collect()
}

#[test]
fn bodies_start_above_their_spots_and_above_each_other() {
    let spot = Vec3::new(0.3, -0.2, 0.0);
    let simulation = simulation(&[(spot, 0), (spot, 1), (spot, 2)]);
    let ranges = height_ranges(&simulation);
    assert!((0.15..=0.3).contains(&ranges[0][0]), "{ranges:?}");
    for pair in ranges.windows(2) {
        assert!(pair[0][1] < pair[1][0], "{ranges:?}");
    }
    for pose in simulation.snapshot().scan_from_body {
        assert!((pose.translation - spot).truncate().length() < 1e-3);
        // Up to 5° of tilt about the body's own y axis.
        assert!((pose.rotation * Vec3::Y).z > 0.996);
    }
}

#[test]
fn the_report_says_who_is_beside_or_below_the_scan() {
    let simulation = simulation(&[
        (Vec3::ZERO, 0),
        (Vec3::X * 2.0, 0),
        (Vec3::Y * -2.0, 0),
        (Vec3::Z * -2.0, 0),
        (Vec3::Z * 2.0, 0),
    ]);
    let inside: Vec<bool> = (simulation.report().bodies.iter())
        .map(|body| body.inside_bounds)
        .collect();
    assert_eq!(inside, [true, false, false, false, true]);
}

#[test]
fn the_report_says_when_a_body_fell_asleep() {
    let mut simulation = simulation(&[(Vec3::ZERO, 0)]);
    let mut first = None;
    for step in 1..=300 {
        simulation.step().unwrap();
        if simulation.report().bodies[0].sleeping {
            first = first.or(Some(step));
        }
        if first.is_some_and(|first| step >= first + 5) {
            break;
        }
    }
    let first = first.expect("a cube on a floor falls asleep within 5 s");
    let report = simulation.report();
    let body = &report.bodies[0];
    let slept_at = body.slept_at_seconds.expect("it sleeps");
    assert!((slept_at - first as f32 / 60.0).abs() < 1e-4, "{slept_at}");
    assert!((body.translation[2] - 0.5 * EDGE).abs() < 0.005, "{body:?}");
    assert_eq!(report.steps, first + 5);
    // The scan has the larger radii.
    assert_eq!(report.mean_radius, 0.02);
}
