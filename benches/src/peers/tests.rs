//! Peers against brute force, so that none of them is beaten for a bug.

use super::*;
use crate::bumpy_ball;
use crate::mesh_truth::ExactMesh;
use ::tldi::CpuBackend;
use ::tldi::glamx::{Pose3, Quat};
use rapier3d::parry::shape::{Compound, SharedShape};

/// Two boxes of random points that overlap by a part or not at all.
fn boxes(seed: u64, count: usize) -> [Vec<Vec3>; 2] {
    let mut rng = fastrand::Rng::with_seed(seed);
    let shift = 0.8 + 0.4 * rng.f32();
    [0.0, shift].map(|x| {
        let at = |_| Vec3::new(x + rng.f32(), rng.f32(), rng.f32());
        (0..count).map(at).collect()
    })
}

/// Every peer that tests balls finds the pairs that brute force finds, also in memory of frames
/// before.
#[test]
fn balls_meet_those_that_brute_force_finds() {
    let mut peers = all_peers();
    let takes_balls = |name: &str| !name.starts_with("voxels") && !name.contains("discs");
    peers.retain(|peer| !peer.needs_faces() && takes_balls(&peer.name()));
    assert_eq!(peers.len(), 13);
    for seed in 0..30 {
        let [a, b] = boxes(seed, 300);
        let frame = Frame::new(&a, &b, 0.03);
        let near = |p: &Vec3| b.iter().filter(|q| p.distance(**q) <= 0.06).count();
        let expected: usize = a.iter().map(near).sum();
        for peer in &mut peers {
            for _ in 0..2 {
                let found = peer.compare(&frame);
                assert_eq!(found.contacts, expected, "seed {seed}: {}", peer.name());
                assert_eq!(found.collides, expected > 0, "seed {seed}: {}", peer.name());
            }
        }
    }
}

/// The grid tells the pair of balls that brute force finds to be deepest, behind a cull as well; which of
/// them is the first body tells where the normal points.
#[test]
fn the_deepest_pair_of_balls_is_told() {
    let plain: [Box<dyn Peer>; 2] = [
        Box::new(Grid::telling_deepest()),
        Box::new(Culled::new(Grid::telling_deepest())),
    ];
    let mut counts = [0; 2];
    for mut peer in plain {
        for seed in 0..40 {
            let [a, b] = boxes(seed, 120);
            let radius = 0.03;
            let pairs = a.iter().flat_map(|p| b.iter().map(move |q| (*p, *q)));
            let (p, q) = pairs
                .min_by(|(p, q), (r, s)| p.distance(*q).total_cmp(&r.distance(*s)))
                .expect("there are points");
            let depth = 2.0 * radius - p.distance(q);
            let found = peer.compare(&Frame::new(&a, &b, radius));
            counts[usize::from(depth > 0.0)] += 1;
            let Some(deepest) = found.deepest else {
                assert!(depth < 0.0, "seed {seed}: {}", peer.name());
                continue;
            };
            assert!((deepest.depth - depth).abs() < 1e-6, "seed {seed}");
            assert!(
                deepest.normal.dot((q - p).normalize()) > 0.9999,
                "seed {seed}"
            );
        }
        // Ball in ball.
        let deepest = peer
            .compare(&Frame::new(&[Vec3::X], &[Vec3::X], 0.5))
            .deepest;
        let expected = Deepest {
            normal: Vec3::Y,
            depth: 1.0,
        };
        assert_eq!(deepest, Some(expected), "{}", peer.name());
    }
    assert!(counts.iter().all(|count| *count > 10), "{counts:?}");
}

/// The deepest point of rapier's manifolds, its normal from the first shape to the second in the frame
/// of both, also where the shapes are turned parts of others.
#[test]
fn manifolds_tell_the_deepest_point() {
    let turn = Pose::rotation(Vector::new(0.0, 0.0, 0.5 * std::f32::consts::PI));
    let part = |x: f32| {
        let pose = Pose::translation(x, 0.0, 0.0) * turn;
        (pose, SharedShape::cuboid(0.5, 1.0, 0.5))
    };
    let body = Compound::new(vec![part(0.0), part(-5.0)]);
    // In the first part by 0.25, in no other.
    for (x, normal) in [(1.75, Vec3::X), (-6.75, -Vec3::X)] {
        let other = Compound::new(vec![part(x)]);
        let found = touching(&body, &other, &Stopwatch::of_thread(), 0.0);
        let deepest = found.deepest.expect("they touch");
        assert!((deepest.depth - 0.25).abs() < 1e-4, "{deepest:?}");
        assert!(deepest.normal.distance(normal) < 1e-4, "{deepest:?}");
    }
}

/// Voxels of one grid meet where they are the same or neighbours, and do not where a whole voxel is
/// between them.
#[test]
fn voxels_meet_where_cells_do() {
    let radius = 0.005;
    let mut answers = [0; 2];
    for seed in 0..60 {
        let [a, b] = boxes(seed, 40);
        let cell = |p: &Vec3| (*p / (2.0 * radius)).floor();
        let apart = |p: &Vec3, q: &Vec3| (cell(p) - cell(q)).abs().max_element();
        let least = a
            .iter()
            .flat_map(|p| b.iter().map(move |q| apart(p, q)))
            .fold(f32::MAX, f32::min);
        let plain: [Box<dyn Peer>; 2] = [
            Box::new(VoxelsRebuild::default()),
            Box::new(Culled::new(VoxelsRebuild::default())),
        ];
        for mut peer in plain {
            let collides = peer.compare(&Frame::new(&a, &b, radius)).collides;
            if least == 0.0 {
                assert!(collides, "seed {seed}: {}", peer.name());
            }
            if least > 1.0 {
                assert!(!collides, "seed {seed}: {}", peer.name());
            }
        }
        answers[usize::from(least > 1.0)] += usize::from(least != 1.0);
    }
    assert!(answers[1] > 5, "{answers:?}");
}

/// Meshes, and ours and discs on the points of meshes, answer as exact tests of all triangles do.
#[test]
fn surfaces_meet_where_triangles_do() {
    let (points, faces) = bumpy_ball(2_000);
    let exact = ExactMesh::new(&points, &faces);
    let radius = crate::covering_radius(points.len(), 4.0 * std::f32::consts::PI);
    let method = Method::Default { pixel_scale: 1.0 };
    let mut peers = all_peers();
    peers.retain(|peer| peer.needs_faces() || peer.name().contains("discs"));
    assert_eq!(peers.len(), 5);
    peers.push(Box::new(
        TldiPeer::new(Box::new(CpuBackend::new()), method, 1).expect("a thread can be started"),
    ));
    let mut answers = [0; 2];
    let mut rng = fastrand::Rng::with_seed(7);
    for _ in 0..20 {
        // Well away from where they barely touch: 1.9 apart they are in each other by bumps or not.
        let apart = if rng.bool() { 1.5 } else { 2.2 };
        let turn = Quat::from_rotation_y(6.0 * rng.f32()) * Quat::from_rotation_z(6.0 * rng.f32());
        let pose = Pose3::from_parts(apart * Vec3::X, turn);
        let moved: Vec<Vec3> = points.iter().map(|p| pose * *p).collect();
        let meets = exact.intersects(&exact, &pose);
        answers[usize::from(meets)] += 1;
        let frame = Frame {
            faces: Some([&faces, &faces]),
            ..Frame::new(&points, &moved, radius)
        };
        for peer in &mut peers {
            assert!(peer.takes(&frame));
            let found = peer.compare(&frame);
            assert_eq!(found.collides, meets, "{apart}: {}", peer.name());
            // Ours also tells of contacts that are not there yet.
            let has_contacts = found.contacts > 0;
            assert!(has_contacts || !meets, "{apart}: {}", peer.name());
            assert!(
                !has_contacts || meets || peer.backend().is_some(),
                "{apart}: {}",
                peer.name()
            );
        }
    }
    assert!(answers[0] > 3 && answers[1] > 3, "{answers:?}");
}

/// Discs lie in the surface, however that is turned: sheets half a radius apart, where balls overlap, do not
/// touch, and those that nearly coincide do.
#[test]
fn discs_lie_in_the_surface() {
    let mut rng = fastrand::Rng::with_seed(3);
    let radius = 0.1;
    for _ in 0..20 {
        let turn = Quat::from_rotation_x(6.0 * rng.f32()) * Quat::from_rotation_z(6.0 * rng.f32());
        let mut sheet = |height: f32| -> Vec<Vec3> {
            let shift = 0.05 * rng.f32();
            let at = |k: i32| radius * Vec3::new((k % 10) as f32 + shift, 0.0, (k / 10) as f32);
            (0..100)
                .map(|k| turn * (at(k) + height * Vec3::Y))
                .collect()
        };
        let (a, apart, near) = (sheet(0.0), sheet(0.5 * radius), sheet(0.05 * radius));
        let touch = |b: &[Vec3]| DiscCompound.compare(&Frame::new(&a, b, radius)).collides;
        assert!(!touch(&apart) && touch(&near), "{turn}");
    }
}

/// Without faces there are no meshes, and of many points no compounds.
#[test]
fn methods_refuse_what_they_cannot_do() {
    let points = vec![Vec3::ZERO; 60_000];
    let frame = Frame::new(&points, &points[..100], 0.01);
    let mut refusing: Vec<String> = all_peers()
        .iter()
        .filter(|peer| !peer.takes(&frame))
        .map(|peer| peer.name())
        .collect();
    refusing.sort();
    assert_eq!(
        refusing,
        [
            "compound of balls",
            "compound of balls, culled",
            "compound of discs",
            "compound of discs, culled",
            "mesh rebuild (TriMesh)",
            "mesh rebuild (TriMesh), culled",
            "mesh set_vertices (TriMesh)",
        ]
    );
}

/// A frame's stages are told by the CPU backend on one thread: those that ran. What is found is the same, to the bit.
#[test]
fn stages_are_told_and_change_nothing() {
    use crate::placements::{Placement, Source};
    let source = Source::Generated(4000);
    let method = Method::Default { pixel_scale: 1.0 };
    let peer = |threads| TldiPeer::new(Box::new(CpuBackend::new()), method, threads);
    let mut ours = peer(1).expect("a thread can be started");
    for (placement, expected) in [
        (Placement::NearMiss, "points rest"),
        (
            Placement::Slight,
            "points cull zone aim columns normals splat sweep compare patches rest",
        ),
        (
            Placement::Coincident,
            "points cull zone aim columns cells compare windows patches normals splat sweep rest",
        ),
    ] {
        let radius = source.radius(placement).expect("points are finite");
        let [a, b] = source.bodies(placement, radius, 1);
        let frame = Frame::new(&a, &b, radius);
        ours.compare(&frame);
        let without = ours.result().cloned();
        let stages = ours.stages(&frame).expect("they are told");
        assert!(without.is_some() && without.as_ref() == ours.result());
        let names: Vec<&str> = stages.iter().map(|(name, _)| *name).collect();
        assert_eq!(names.join(" "), expected, "{}", placement.name());
        // Not those of the frame before.
        assert_eq!(
            ours.stages(&frame).expect("they are told").len(),
            names.len()
        );
        let mut on_two = peer(2).expect("threads can be started");
        assert!(on_two.stages(&frame).is_none());
    }
}
