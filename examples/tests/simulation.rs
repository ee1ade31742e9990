//! How bodies start, and what the report of a drop says.

mod common;

use common::skip;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Backend, CpuBackend, PointCloud};
use tldi_examples::bodies::NamedCloud;
use tldi_examples::depth::{
    DepthScene, DepthSimulation, FrameSource, GeneratedCamera, WantedBodies,
};
use tldi_examples::drop::DropSimulation;
use tldi_examples::gallop::{GallopScene, GallopSimulation, WavyGround, creature};
use tldi_examples::lidar::LidarSimulation;
use tldi_examples::load;
use tldi_examples::spots::Spot;
use tldi_examples::surface_sampling::sample_surface;
use tldi_sources::depth::{DepthCamera, SensorModel};
use tldi_wgpu::{AdapterChoice, Gpu, WgpuBackend};

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
    let surface = sample_surface(distance, bounds, 0.02, 1);
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
    simulation_on(Box::new(CpuBackend::new()), places)
}

fn simulation_on(backend: Box<dyn Backend>, places: &[(Vec3, usize)]) -> DropSimulation {
    let spots: Vec<Spot> = places
        .iter()
        .map(|&(surface, level)| Spot { surface, level })
        .collect();
    let bodies = vec![cube(); spots.len()];
    DropSimulation::new(floor(), Vec3::Z, bodies, &spots, 3, backend).unwrap()
}

/// Heights of the lowest and the highest point of each body.
fn height_ranges(simulation: &DropSimulation) -> Vec<[f32; 2]> {
    let poses = simulation.snapshot().scan_from_body;
    (simulation.clouds().zip(poses))
        .map(|(cloud, pose)| {
            let heights = cloud.points().iter().map(|&p| (pose * p).z);
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

/// Asserts that no two bodies are in each other: they are apart along `up` (an axis), or the balls around them are across it.
fn assert_apart<'a>(
    clouds: impl Iterator<Item = &'a PointCloud<'static>>,
    poses: &[Pose3],
    up: Vec3,
) {
    let bodies: Vec<([f32; 2], Vec3, f32)> = (clouds.zip(poses))
        .map(|(cloud, pose)| {
            let heights = cloud.points().iter().map(|&p| (*pose * p).dot(up));
            let range = heights.fold([f32::MAX, f32::MIN], |[min, max], h| {
                [min.min(h), max.max(h)]
            });
            let place = pose.translation.reject_from(up);
            (range, place, load::ball_radius(cloud))
        })
        .collect();
    assert!(bodies.len() > 1);
    for (k, a) in bodies.iter().enumerate() {
        for b in &bodies[k + 1..] {
            let is_over = a.0[1] < b.0[0] || b.0[1] < a.0[0];
            assert!(is_over || a.1.distance(b.1) > a.2 + b.2, "{a:?} {b:?}");
        }
    }
}

/// A cube and one of four times its height, twice on one spot.
fn unlike_cubes() -> (Vec<NamedCloud>, Vec<Spot>) {
    let tall = NamedCloud {
        cloud: load::resized(&cube().cloud, 4.0 * EDGE).unwrap(),
        ..cube()
    };
    let spots = (0..4).map(|level| Spot {
        surface: Vec3::ZERO,
        level,
    });
    (vec![tall.clone(), cube(), tall, cube()], spots.collect())
}

#[test]
fn bodies_of_a_stack_start_apart_whatever_their_heights() {
    let (bodies, spots) = unlike_cubes();
    let cpu = || Box::new(CpuBackend::new());
    let dropped = DropSimulation::new(floor(), Vec3::Z, bodies.clone(), &spots, 3, cpu()).unwrap();
    let poses = dropped.snapshot().scan_from_body;
    assert_apart(dropped.clouds(), &poses, Vec3::Z);
    let large = bodies.iter().map(|body| NamedCloud {
        name: body.name.clone(),
        cloud: load::resized(&body.cloud, 3.0).unwrap(),
    });
    let lidar = LidarSimulation::new(large.collect(), &spots, Vec3::Z, 12.0, cpu()).unwrap();
    assert_apart(lidar.clouds(), &lidar.world_from_body(), Vec3::Z);
    let source = FrameSource::Generated(GeneratedCamera { frames: 3, seed: 1 });
    let scene = DepthScene {
        camera: DepthCamera::new(source.intrinsics(), SensorModel::default()),
        up: Vec3::Z,
        bodies,
        spots,
        memory: 0,
        seed: 1,
    };
    let depth = DepthSimulation::new(scene, &source.frame(0).unwrap(), cpu()).unwrap();
    let poses = depth.snapshot(1).unwrap().world_from_body;
    assert_apart(depth.clouds(), &poses, Vec3::Z);
}

/// Bodies of the generated depth frames that are too wide for its spots get others.
#[test]
fn wide_bodies_of_the_generated_frames_start_apart() {
    let source = FrameSource::Generated(GeneratedCamera { frames: 3, seed: 1 });
    let mut camera = DepthCamera::new(source.intrinsics(), SensorModel::default());
    let seen = source.first_seen(&mut camera).unwrap();
    let cloud = seen.cloud.into_builder().build().unwrap().into_owned();
    let wanted = WantedBodies {
        count: 3,
        size: Some(0.3),
        seed: 1,
    };
    let (bodies, spots) = (wanted.placed(&source, camera.clone(), &cloud, Vec3::Z)).unwrap();
    let scene = DepthScene {
        camera,
        up: Vec3::Z,
        bodies,
        spots,
        memory: 0,
        seed: 1,
    };
    let depth = DepthSimulation::new(scene, &seen.frame, Box::new(CpuBackend::new())).unwrap();
    let poses = depth.snapshot(1).unwrap().world_from_body;
    assert_apart(depth.clouds(), &poses, Vec3::Z);
}

#[test]
fn many_bodies_of_the_gallop_start_apart() {
    let mut runner = creature(1).unwrap();
    runner.stand(Vec3::Y, 2.0);
    let scene = GallopScene {
        runner,
        size: 2.0,
        speed: 1.0,
        cycle: 0.8,
        ground: WavyGround {
            half_size: [5.2, 1.6],
            spacing: 0.1,
            amplitude: 0.05,
            wavelength: 1.8,
            period: 1.6,
        },
        bodies: 100,
        seed: 1,
    };
    let gallop = GallopSimulation::new(scene, Box::new(CpuBackend::new())).unwrap();
    let poses = gallop.snapshot().world_from_body;
    assert_apart(gallop.body_clouds(), &poses, Vec3::Y);
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
    // Before the first step the backend is known.
    assert_eq!(simulation.report().totals.devices.backend, "cpu");
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
    assert!(
        (body.placed.translation[2] - 0.5 * EDGE).abs() < 0.005,
        "{body:?}"
    );
    assert_eq!(report.totals.steps, first + 5);
    // The scan has the larger radii.
    assert_eq!(report.mean_radius, 0.02);
}

/// The GPU backend, on a software driver where there is no GPU; `None`, said loudly, without either: a
/// failure where the variable `TLDI_REQUIRE_GPU` is set.
fn gpu_backend() -> Option<Box<dyn Backend>> {
    match Gpu::of_process(AdapterChoice::Any).and_then(WgpuBackend::new) {
        Ok(backend) => Some(Box::new(backend)),
        Err(error) => {
            skip::skip(&error.to_string(), skip::REQUIRE_GPU);
            None
        }
    }
}

/// Cubes that fall onto a floor, tilted, end on the GPU where they end on the CPU.
#[test]
fn bodies_end_in_the_same_places_on_the_gpu() {
    let Some(gpu) = gpu_backend() else { return };
    let places = [
        (Vec3::new(-0.4, 0.1, 0.0), 0),
        (Vec3::new(0.4, -0.2, 0.0), 0),
    ];
    let [on_cpu, on_gpu] = [Box::new(CpuBackend::new()) as Box<dyn Backend>, gpu].map(|backend| {
        let mut simulation = simulation_on(backend, &places);
        for _ in 0..120 {
            simulation.step().unwrap();
        }
        (simulation.snapshot().scan_from_body, simulation.report())
    });
    assert_eq!(on_cpu.1.totals.devices.adapter, None);
    assert!(
        on_gpu.1.totals.devices.adapter.is_some(),
        "{:?}",
        on_gpu.1.totals.devices
    );
    assert_eq!(on_gpu.1.totals.devices.fallback, None);
    assert!(on_gpu.1.totals.contact_steps > 60 && on_gpu.1.totals.pairs_missed == 0);
    for (a, b) in on_cpu.0.iter().zip(&on_gpu.0) {
        // Gaps differ by up to 0.006 radii of 2 cm, in each of the few steps of the impact in which an
        // edge turns about its first contact: a tenth of a radius, and as much of turn over 10 cm.
        assert!(a.translation.distance(b.translation) < 0.002, "{a:?} {b:?}");
        assert!(a.rotation.angle_between(b.rotation) < 0.02, "{a:?} {b:?}");
        assert!((b.translation.z - 0.5 * EDGE).abs() < 0.005, "{b:?}");
    }
}
