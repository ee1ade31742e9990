//! Properties of whole pairs on random clouds and poses, each with a replayable seed.

use tldi::glamx::{Pose3, Vec3};
use tldi::{ContactPixel, PairResult, Params, PatchScratch, PointCloud};
use tldi_tests::{
    Samples, compare_clouds, deepest_point, random_pose, random_unit, sampled_box, sampled_sphere,
};

const R: f32 = 0.012;

fn random_body(rng: &mut fastrand::Rng) -> Samples {
    let body = match rng.u8(0..2) {
        0 => sampled_sphere(0.06 + 0.06 * rng.f32(), R),
        _ => {
            let half = Vec3::from_array(std::array::from_fn(|_| 0.04 + 0.08 * rng.f32()));
            sampled_box(half, R, rng)
        }
    };
    body.moved(&random_pose(rng, 0.05))
}

/// Two bodies at a pose where they are somewhere between apart and halfway into each other.
fn random_pair(seed: u64) -> (PointCloud<'static>, PointCloud<'static>, Pose3) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let (a, b) = (
        random_body(&mut rng).cloud(R),
        random_body(&mut rng).cloud(R),
    );
    let mut a_from_b = random_pose(&mut rng, 0.0);
    a_from_b.translation = random_unit(&mut rng) * (0.05 + 0.2 * rng.f32());
    (a, b, a_from_b)
}

/// Exchanging the bodies may move the pixel grid but not the answer.
#[test]
fn symmetric_in_a_and_b() {
    let (mut clear, mut collisions) = (0, 0);
    for seed in 0..200 {
        let (a, b, a_from_b) = random_pair(seed);
        let (ab, ba) = (
            compare_clouds(&a, &b, a_from_b, R),
            compare_clouds(&b, &a, a_from_b.inverse(), R),
        );
        let (Some(gap_ab), Some(gap_ba)) = (ab.gap, ba.gap) else {
            assert!(!ab.collides && !ba.collides, "seed {seed}");
            continue;
        };
        // Within r̄ of touching the pixel grid decides.
        if gap_ab.min(gap_ba) > R || gap_ab.max(gap_ba) < -R {
            clear += 1;
            collisions += usize::from(ab.collides);
            assert_eq!(
                ab.collides, ba.collides,
                "seed {seed}: gaps {gap_ab} {gap_ba}"
            );
        }
    }
    assert!(clear > 80 && collisions > 30, "{clear} {collisions}");
}

/// A pose of which the last bits are others, as of bodies that are 10 m from the origin, changes little.
#[test]
fn insensitive_to_the_rounding_of_poses() {
    for seed in 0..100 {
        let (a, b, a_from_b) = random_pair(seed);
        let mut rng = fastrand::Rng::with_seed(seed);
        let world_from_a = random_pose(&mut rng, 10.0);
        let world_from_b = world_from_a * a_from_b;
        let moved = compare_clouds(&a, &b, world_from_a.inv_mul(&world_from_b), R);
        let still = compare_clouds(&a, &b, a_from_b, R);
        match (still.gap, moved.gap) {
            // 10 m away f32 poses are good to 2 µm and 2⁻²² rad: a point may still fall into the
            // next pixel, which moves a layer by a fraction of r̄.
            (Some(g), Some(h)) => assert!((g - h).abs() < 0.3 * R, "seed {seed}: {g} {h}"),
            (g, h) => assert_eq!(g.is_some(), h.is_some(), "seed {seed}"),
        }
    }
}

/// The frame in which a body's points are given does not matter: results turn with that of the
/// first, and do not change with that of the second.
#[test]
fn independent_of_the_frames_of_the_bodies() {
    for seed in 0..100 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let (ra, rb) = (0.06 + 0.06 * rng.f32(), 0.06 + 0.06 * rng.f32());
        let (a, b) = (sampled_sphere(ra, R), sampled_sphere(rb, R));
        let gap = (1.0 - 3.0 * rng.f32()) * R;
        let mut a_from_b = random_pose(&mut rng, 0.0);
        let direction = random_unit(&mut rng);
        a_from_b.translation = direction * (ra + rb + gap);
        let (frame_from_a, frame_from_b) = (random_pose(&mut rng, 0.3), random_pose(&mut rng, 0.3));
        let moved = compare_clouds(
            &a.moved(&frame_from_a).cloud(R),
            &b.moved(&frame_from_b).cloud(R),
            frame_from_a * a_from_b * frame_from_b.inverse(),
            R,
        );
        let (found, place) = deepest_point(&moved).expect("the spheres touch");
        let true_place = frame_from_a * (direction * (ra + 0.5 * gap));
        let true_normal = frame_from_a.rotation * direction;
        let angle = true_normal.angle_between(moved.patches[0].normal);
        // On spheres of 5 r̄ the pixel grid, which turns with the frame, leaves this much.
        assert!((found - gap).abs() < 0.5 * R, "seed {seed}: {found} {gap}");
        assert!(place.distance(true_place) < 2.0 * R, "seed {seed}");
        assert!(angle < 0.2, "seed {seed}: {angle} rad off");
    }
}

/// Moving the second body out along the contact normal opens the gap by as much.
#[test]
fn gaps_follow_the_distance() {
    for seed in 0..200 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let (ra, rb) = (0.05 + 0.1 * rng.f32(), 0.05 + 0.1 * rng.f32());
        let (a, b) = (
            sampled_sphere(ra, R).cloud(R),
            sampled_sphere(rb, R).cloud(R),
        );
        let direction = random_unit(&mut rng);
        let gap_at = |gap: f32| {
            let pose = Pose3::from_translation(direction * (ra + rb + gap));
            let result = compare_clouds(&a, &b, pose, R);
            result.gap.expect("the spheres share pixels")
        };
        let (near, far) = (gap_at(-0.5 * R), gap_at(0.5 * R));
        // Each within 0.3 r̄ of the truth on these curvatures.
        assert!(
            (far - near - R).abs() < 0.6 * R,
            "seed {seed}: {near} {far}"
        );
    }
}

/// A hundred thousand contact pixels are reduced to the same patches whatever their order.
#[test]
fn reduced_alike_in_any_order() {
    let mut rng = fastrand::Rng::with_seed(5);
    let pixel = 0.01;
    let mut gap = 0.0;
    let contacts: Vec<ContactPixel> = (0..100_000)
        .map(|k| {
            // Two layers in each pixel, in every second one with equal gaps.
            let [i, j] = [k % 400 / 2, k / 400];
            if k % 4 != 1 {
                gap = 0.2 * pixel * (rng.f32() - 0.8);
            }
            let point = pixel * Vec3::new(i as f32, 3.0 * (k % 2) as f32, j as f32);
            ContactPixel {
                pixel: [i, j],
                view: u32::from(j > 120),
                point_a: point,
                point_b: point + gap * Vec3::Y,
                normal_a: Vec3::new(0.1 * rng.f32(), 1.0, 0.0).normalize(),
                normal_b: -Vec3::Y,
                gap,
            }
        })
        .collect();
    let reduced = |contacts: Vec<ContactPixel>| {
        let mut result = PairResult {
            contacts,
            ..PairResult::default()
        };
        PatchScratch::default().reduce(&mut result, &Params::for_radius(pixel));
        result
    };
    let ordered = reduced(contacts.clone());
    assert!(!ordered.patches.is_empty());
    for _ in 0..3 {
        let mut shuffled = contacts.clone();
        rng.shuffle(&mut shuffled);
        assert!(
            reduced(shuffled) == ordered,
            "another order, another result"
        );
    }
}
