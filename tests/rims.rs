//! Open bodies, such as scans without a bottom: one layer of points that ends in a rim, with which they stand on floors.

use rapier3d::prelude::{ColliderBuilder, PhysicsWorld, RigidBodyBuilder};
use rapier3d_tldi::prelude::{TldiConfig, TldiPipeline};
use std::f32::consts::{PI, TAU};
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{CpuBackend, ImpactQuery, PairQuery, Params, PointCloud, Surface, View, VirtualCamera};
use tldi_tests::{
    Samples, aimed_clouds, compare_on, deepest_contact, gpu_backend, sampled_box, sampled_plane,
    sampled_sphere,
};

/// Spacing of all samples and radius of their points, metres.
const R: f32 = 0.015;

/// A ring of samples about the y axis, at the height `y`; `up` is the height of their unit normals. Metres.
fn ring(radius: f32, y: f32, up: f32, rng: &mut fastrand::Rng) -> Samples {
    let count = (TAU * radius / R).round();
    let (first, out) = (rng.f32(), (1.0 - up * up).sqrt());
    let mut samples = Samples::default();
    for k in 0..count as u32 {
        let (s, c) = (TAU * (k as f32 + first) / count).sin_cos();
        samples.points.push(Vec3::new(radius * c, y, radius * s));
        samples.normals.push(Vec3::new(out * c, up, out * s));
    }
    samples
}

/// A lampshade 0.3 m high, with its wide end down, whose wall leans inwards by this angle in radians.
fn lampshade(lean: f32, rng: &mut fastrand::Rng) -> Samples {
    let mut shade = Samples::default();
    for k in 0..=20 {
        let up_the_wall = 0.015 * k as f32;
        let radius = 0.3 - up_the_wall * lean.sin();
        shade.extend(&ring(radius, up_the_wall * lean.cos(), lean.sin(), rng));
    }
    shade
}

/// Half of a sphere of 0.25 m, its rim down.
fn dome() -> Samples {
    let mut dome = sampled_sphere(0.25, R);
    dome.retain(|p| p.y >= 0.0);
    dome
}

/// Half of a pipe of 0.2 m radius and 0.4 m length, its rims down.
fn half_pipe() -> Samples {
    let around = (PI * 0.2 / R).round();
    let mut pipe = Samples::default();
    for i in 0..=around as u32 {
        let (s, c) = (PI * i as f32 / around).sin_cos();
        for j in 0..=27 {
            let along = -0.2 + 0.4 * j as f32 / 27.0;
            pipe.points.push(Vec3::new(0.2 * c, 0.2 * s, along));
            pipe.normals.push(Vec3::new(c, s, 0.0));
        }
    }
    pipe
}

/// Names, samples, and how far above and below its lowest point a body may be told to end, in radii. The points of a dome do
/// not lie in rows: its rim is their mean, up to 0.46 above the lowest one. A wall that leans by 10° is seen edge-on in some
/// pixels only. Splats reach over the rim of one that leans further, by 0.7 of their slope.
fn bodies(rng: &mut fastrand::Rng) -> Vec<(&'static str, Samples, [f32; 2])> {
    let shade = |degrees: f32, rng: &mut _| lampshade(degrees.to_radians(), rng);
    vec![
        ("dome", dome(), [0.5, 0.1]),
        ("half pipe", half_pipe(), [0.1, 0.1]),
        ("upright shade", shade(0.0, rng), [0.1, 0.1]),
        ("shade of 10°", shade(10.0, rng), [0.3, 0.1]),
        ("shade of 20°", shade(20.0, rng), [0.0, 0.75]),
        ("shade of 40°", shade(40.0, rng), [0.0, 0.75]),
    ]
}

/// Whether a surface is open, with normals or without, decides nothing: what ends in a rim touches with it, and is as deep as
/// its lowest point.
#[test]
fn rims_touch_floors() {
    let mut rng = fastrand::Rng::with_seed(51);
    let slab = sampled_box(Vec3::new(0.5, 0.2, 0.5), R, &mut rng);
    let slab = slab.moved(&Pose3::translation(0.0, -0.2, 0.0));
    let sheet = sampled_plane(1.0, R, &mut rng);
    let clouds = |samples: &Samples| [samples.bare_cloud(R), samples.cloud(R)];
    let floors = [clouds(&slab), clouds(&sheet)].concat();
    let bodies = bodies(&mut rng);
    let bodies: Vec<_> = (bodies.iter())
        .map(|(name, samples, off)| (name, clouds(samples), off))
        .collect();
    let mut cases = Vec::new();
    for (name, body, off) in &bodies {
        for (body, floor) in body.iter().flat_map(|b| floors.iter().map(move |f| (b, f))) {
            for _ in 0..6 {
                let turn = Quat::from_rotation_y(TAU * rng.f32());
                let lowest = lowest(body, turn);
                let [x, z] = [0, 1].map(|_| 0.1 * (rng.f32() - 0.5));
                let gap = R * (1.0 - 4.0 * rng.f32());
                let pose = Pose3::from_parts(Vec3::new(x, gap - lowest, z), turn);
                cases.push((*name, *off, gap, aimed_clouds(floor, body, pose, R)));
            }
        }
    }
    let batch: Vec<PairQuery> = cases.iter().map(|(.., query)| *query).collect();
    let check = |backend: &mut dyn tldi::Backend| {
        let results = compare_on(backend, &batch);
        for (result, (name, [above, below], gap, _)) in results.iter().zip(&cases) {
            let (normal, depth) = deepest_contact(result).expect("they are near");
            assert!(normal.y > 0.999, "{name}, gap {gap}: {normal}");
            let too_deep = (depth + gap) / R;
            assert!(
                (-above..=*below).contains(&too_deep),
                "{name}, gap {}: {too_deep} too deep",
                gap / R
            );
        }
    };
    check(&mut CpuBackend::new());
    let Some(mut gpu) = gpu_backend() else { return };
    check(&mut gpu);
}

/// Height of the lowest point of a turned cloud, metres.
fn lowest(body: &PointCloud, turn: Quat) -> f32 {
    let heights = body.points().iter().map(|p| (turn * *p).y);
    heights.fold(f32::INFINITY, f32::min)
}

/// They stand for 2 s on a floor of points and on a cuboid of rapier's, where they are put.
#[test]
fn open_bodies_stand() {
    let mut rng = fastrand::Rng::with_seed(52);
    let floor = sampled_plane(1.2, R, &mut rng).bare_cloud(R);
    for (name, samples, [above, below]) in bodies(&mut rng) {
        for body in [samples.bare_cloud(R), samples.cloud(R)] {
            for is_cuboid in [true, false] {
                let mut world = PhysicsWorld::default();
                let mut tldi = TldiPipeline::new(TldiConfig::default()).expect("default settings");
                tldi.attach(&mut world);
                let ground = match is_cuboid {
                    true => ColliderBuilder::cuboid(0.6, 0.1, 0.6)
                        .translation(-0.1 * Vec3::Y)
                        .build(),
                    false => tldi.collider(floor.clone()).build(),
                };
                world.insert(RigidBodyBuilder::fixed(), ground);
                let start = RigidBodyBuilder::dynamic()
                    .translation((0.5 * R - lowest(&body, Quat::IDENTITY)) * Vec3::Y);
                let collider = tldi.collider(body.clone()).density(300.0);
                let (handle, _) = world.insert(start, collider);
                for _ in 0..120 {
                    tldi.step(&mut world).expect("the pair is supported");
                    let pose = *world.bodies[handle].position();
                    let low = (pose.translation.y + lowest(&body, pose.rotation)) / R;
                    // Besides what is told, a contact may scatter by 0.1 r.
                    assert!(
                        (-above - 0.1..=0.6 + below).contains(&low),
                        "{name}, cuboid {is_cuboid}: {low}"
                    );
                }
            }
        }
    }
}

/// Rays enter a shade with outward normals, and do not leave it. It meets a floor all the same where it moves far.
#[test]
fn open_bodies_do_not_fall_through_in_one_step() {
    let mut rng = fastrand::Rng::with_seed(53);
    let floor = sampled_plane(1.2, R, &mut rng).bare_cloud(R);
    for lean in [20.0_f32, 40.0, 60.0] {
        let shade = lampshade(lean.to_radians(), &mut rng);
        for (shade, is_bare) in [(shade.bare_cloud(R), true), (shade.cloud(R), false)] {
            for _ in 0..10 {
                let turn = Quat::from_rotation_y(TAU * rng.f32());
                let height = R * (1.0 + 30.0 * rng.f32());
                let pose = Pose3::from_parts(height * Vec3::Y, turn);
                let impact = CpuBackend::new().impact(&ImpactQuery {
                    a: Surface::Cloud(&floor),
                    b: Surface::Cloud(&shade),
                    a_from_b: pose,
                    motion: -Vec3::Y,
                    touching: 0.0,
                    core_only: false,
                    penetration: None,
                    turned: &[],
                    params: Params::for_radius(R),
                });
                let impact = impact.expect("the query is valid").expect("they meet");
                // As much too early as splats reach over the rim, and later by the rise in a pixel.
                let late = (impact.distance - height) / R;
                assert!(
                    (-0.8..=2.0).contains(&late),
                    "{lean}°, bare {is_bare}: {late}"
                );
            }
        }
    }
}

/// Where two rims meet, neither tells a normal: one upright card on another does not touch it, and no depth is made up.
#[test]
fn rims_that_meet_make_up_no_depth() {
    let mut rng = fastrand::Rng::with_seed(54);
    let card = sampled_plane(0.3, R, &mut rng).moved(&Pose3::rotation(0.5 * PI * Vec3::Z));
    let card = card.bare_cloud(R);
    for _ in 0..20 {
        let gap = R * (0.5 - 2.0 * rng.f32());
        let query = PairQuery {
            view: View::Fixed(VirtualCamera::along(-Vec3::Y, R)),
            ..aimed_clouds(&card, &card, Pose3::translation(0.0, 0.3 + gap, 0.0), R)
        };
        let result = &compare_on(&mut CpuBackend::new(), &[query])[0];
        assert!(result.patches.is_empty(), "{gap}: {:?}", result.patches);
    }
}
