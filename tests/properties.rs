//! Properties of whole pairs on random clouds and poses, each with a replayable seed.

use tldi::glamx::{Pose3, Vec3};
use tldi::{Backend, CpuBackend, PairQuery, PairResult, Params, PointCloud, Surface, View};
use tldi_tests::{Samples, random_pose, random_unit, sampled_box, sampled_sphere};

const R: f32 = 0.012;

fn random_body(rng: &mut fastrand::Rng) -> Samples {
    let mut body = match rng.u8(0..2) {
        0 => sampled_sphere(0.06 + 0.06 * rng.f32(), R),
        _ => {
            let half = Vec3::from_array(std::array::from_fn(|_| 0.04 + 0.08 * rng.f32()));
            sampled_box(half, R, rng)
        }
    };
    let pose = random_pose(rng, 0.05);
    for (p, n) in body.points.iter_mut().zip(&mut body.normals) {
        *p = pose * *p;
        *n = pose.rotation * *n;
    }
    body
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

fn compare(a: &PointCloud<'static>, b: &PointCloud<'static>, a_from_b: Pose3) -> PairResult {
    let mut results = Vec::new();
    let query = PairQuery {
        a: Surface::Cloud(a),
        b: Surface::Cloud(b),
        a_from_b,
        view: View::Aim {
            toward_b: a_from_b.translation,
            last_axis: None,
        },
        params: Params::for_radius(R),
    };
    CpuBackend::new()
        .compare(&[query], &mut results)
        .expect("the query is supported");
    results.remove(0)
}

fn least_gap(result: &PairResult) -> Option<f32> {
    result.gap
}

/// Exchanging the bodies may move the pixel grid but not the answer.
#[test]
fn symmetric_in_a_and_b() {
    let (mut clear, mut collisions) = (0, 0);
    for seed in 0..200 {
        let (a, b, a_from_b) = random_pair(seed);
        let (ab, ba) = (
            compare(&a, &b, a_from_b),
            compare(&b, &a, a_from_b.inverse()),
        );
        let (Some(gap_ab), Some(gap_ba)) = (least_gap(&ab), least_gap(&ba)) else {
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

/// A common rigid motion of both bodies changes nothing but the rounding: results are in the frame
/// of the first body.
#[test]
fn invariant_under_a_common_motion() {
    for seed in 0..100 {
        let (a, b, a_from_b) = random_pair(seed);
        let mut rng = fastrand::Rng::with_seed(seed);
        let world_from_a = random_pose(&mut rng, 10.0);
        let world_from_b = world_from_a * a_from_b;
        let moved = compare(&a, &b, world_from_a.inv_mul(&world_from_b));
        let still = compare(&a, &b, a_from_b);
        match (least_gap(&still), least_gap(&moved)) {
            // 10 m away f32 poses are good to 2 µm and 2⁻²² rad: a point may still fall into the
            // next pixel, which moves a layer by a fraction of r̄.
            (Some(g), Some(h)) => assert!((g - h).abs() < 0.3 * R, "seed {seed}: {g} {h}"),
            (g, h) => assert_eq!(g.is_some(), h.is_some(), "seed {seed}"),
        }
    }
}

/// Moving the second body out along the contact normal opens the gap by as much.
#[test]
fn gaps_follow_the_distance() {
    let mut checked = 0;
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
            least_gap(&compare(&a, &b, pose)).expect("the spheres share pixels")
        };
        let (near, far) = (gap_at(-0.5 * R), gap_at(0.5 * R));
        // Each within 0.3 r̄ of the truth on these curvatures.
        assert!(
            (far - near - R).abs() < 0.6 * R,
            "seed {seed}: {near} {far}"
        );
        checked += 1;
    }
    assert_eq!(checked, 200);
}
