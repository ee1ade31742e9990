//! What a batch on the GPU backend costs beside its stages, by bytes and counts: these do not depend on the machine.

use tldi::glamx::{Pose3, Vec3};
use tldi::{CameraPolicy, PairQuery, Params, PointCloud, Surface, View};
use tldi_tests::{Samples, aimed, aimed_clouds, cloud_of, compare_on, gpu_backend, sampled_sphere};
use tldi_wgpu::WgpuBackend;

const R: f32 = 0.02;

/// A ball of a metre: 7,854 points.
fn ball() -> Samples {
    sampled_sphere(0.5, R)
}

/// The same ball twice, apart by this share of its width.
fn apart<'a>(ball: &'a PointCloud<'static>, share: f32) -> PairQuery<'a> {
    let pose = Pose3::translation(share, 0.1 * R, 0.05 * R);
    aimed_clouds(ball, ball, pose, R)
}

/// Shares for slight and for deep contact.
const SLIGHT: f32 = 0.97;
const DEEP: f32 = 0.6;

fn fresh() -> Option<WgpuBackend> {
    let shared = gpu_backend()?;
    Some(WgpuBackend::new(shared.gpu().clone()).expect("there is a device"))
}

/// The contacts that the stages of the last batch wrote.
fn contacts(backend: &WgpuBackend) -> u64 {
    let named = backend.needed_elements();
    let found = named.iter().find(|(name, _)| *name == "contacts");
    u64::from(found.expect("contacts are counted").1)
}

/// What a first batch needs is foreseen: nothing is compared twice, whatever the number of points.
#[test]
fn a_first_batch_is_not_redone() {
    // 7,854 points, 49,088 and 100,179.
    for spacing in [R, 0.4 * R, 0.28 * R] {
        let samples = sampled_sphere(0.5, spacing);
        for cloud in [samples.bare_cloud(spacing), samples.cloud(spacing)] {
            for share in [SLIGHT, DEEP] {
                let Some(mut backend) = fresh() else { return };
                let query = PairQuery {
                    params: Params::for_radius(spacing),
                    ..apart(&cloud, share)
                };
                let results = compare_on(&mut backend, &[query]);
                assert!(results[0].collides);
                let redos = backend.traffic().redos;
                let needed = backend.needed_elements();
                assert_eq!(redos, 0, "{spacing} at {share}: {needed:?}");
            }
        }
    }
}

/// A point is 12 bytes, 16 with a radius of its own, and 12 more with a normal; known points are none.
#[test]
fn new_points_are_uploaded_as_they_are() {
    let samples = ball();
    let count = samples.points.len();
    let radii: Vec<f32> = (0..count)
        .map(|i| R * (0.9 + 0.2 * (i % 2) as f32))
        .collect();
    let bare = samples.bare_cloud(R);
    let differing = PointCloud::builder(samples.points.clone()).radii(radii);
    let differing = differing.build().expect("they are valid");
    for (cloud, bytes) in [(bare, 12), (differing, 16), (samples.cloud(R), 24)] {
        let Some(mut backend) = fresh() else { return };
        // All are in reach.
        let query = apart(&cloud, 0.0);
        compare_on(&mut backend, &[query]);
        let first = backend.traffic().uploaded;
        compare_on(&mut backend, &[query]);
        let known = backend.traffic().uploaded;
        assert_eq!(first - known, bytes * count as u64);
        // The batch, its pair, and 8 bytes for each block of 256 points of both.
        assert!(known < 1_000 + 8 * 2 * (count as u64 / 256 + 1), "{known}");
    }
}

/// Of a long floor, only blocks within reach of a ball are uploaded, each once, and the answers are those of a floor that is there
/// as a whole.
#[test]
fn only_blocks_in_reach_are_uploaded() {
    // Rows of 16 points across, 256 to a block: a block is 16 rows, 0.32 m long.
    let position = |i: usize| Vec3::new(R * (i / 16) as f32, 0.0, R * (i % 16) as f32);
    let points: Vec<Vec3> = (0..16 * 1600).map(position).collect();
    let count = points.len() as u64;
    let floor = cloud_of(points, R);
    let ball = sampled_sphere(0.1, R).bare_cloud(R);
    let balls = 12 * ball.len() as u64;
    let (a, b) = (Surface::Cloud(&floor), Surface::Cloud(&ball));
    let at = |x: f32| {
        let pose = Pose3::translation(x, 0.099, 8.0 * R);
        aimed(a, b, pose, Params::for_radius(R))
    };
    let (Some(mut backend), Some(mut whole)) = (fresh(), fresh()) else {
        return;
    };
    // One that reaches everywhere.
    let slab = aimed(a, a, Pose3::IDENTITY, Params::for_radius(R));
    compare_on(&mut whole, &[slab]);
    let mut uploaded = 0;
    for step in 0..=16 {
        let query = at(2.0 * step as f32);
        let found = compare_on(&mut backend, &[query]);
        assert!(found[0].collides || !found[0].contacts.is_empty(), "{step}");
        assert_eq!(found, compare_on(&mut whole, &[query]), "{step}");
        let before = uploaded;
        uploaded += backend.traffic().uploaded;
        // The ball and its margin are less than 0.6 m long: parts of three blocks at most, and of the ball all once.
        let of_ball = if step == 0 { balls } else { 0 };
        assert!(
            uploaded - before <= of_ball + 3 * 256 * 12 + 1_000,
            "{step}: {uploaded}"
        );
        // Known blocks are none.
        compare_on(&mut backend, &[query]);
        assert!(backend.traffic().uploaded < 1_000, "{step}");
    }
    compare_on(&mut backend, &[slab]);
    uploaded += backend.traffic().uploaded;
    let all = 12 * count + balls;
    // What tells of 18 batches, and the blocks of the last one, is about 20 kB.
    assert!(
        (all..all + 30_000).contains(&uploaded),
        "{uploaded} of {all}"
    );
}

/// A round of views takes 13 dispatches, 11 where normals are given; what comes before the views 6, or 4. A
/// second round, one more, is only drawn where the first shows no crossing.
#[test]
fn further_views_are_drawn_where_the_first_show_no_crossing() {
    let samples = ball();
    for (cloud, before, round) in [(samples.bare_cloud(R), 6, 13), (samples.cloud(R), 4, 11)] {
        let Some(mut backend) = fresh() else { return };
        let found = compare_on(&mut backend, &[apart(&cloud, DEEP)]);
        assert!(found[0].collides);
        assert_eq!(backend.traffic().dispatches, before + round);
        // Apart by a fifth of a radius: near enough to be drawn, without a crossing.
        let near = apart(&cloud, 1.0 + 0.2 * R);
        let found = compare_on(&mut backend, &[near]);
        assert!(!found[0].collides && !found[0].contacts.is_empty());
        let both = backend.traffic();
        assert_eq!(both.dispatches, before + 2 * round + 1);
        assert_eq!((both.submissions, both.redos), (2, 0));
        // Who only asks for contacts has no further views.
        let asked = PairQuery {
            view: View::Aim {
                policy: CameraPolicy::ContactZone,
                motion: Vec3::ZERO,
                last_axis: None,
            },
            ..near
        };
        compare_on(&mut backend, &[asked]);
        assert_eq!(backend.traffic().dispatches, before + round);
    }
}

/// What comes back are counters, pairs and the contacts that there are, with an eighth more; what was not expected comes
/// in a second copy, and nothing is missing.
#[test]
fn only_what_was_found_is_read_back() {
    let Some(mut backend) = fresh() else { return };
    let ball = ball().bare_cloud(R);
    let far = apart(&ball, 0.999);
    let deep = apart(&ball, DEEP);
    compare_on(&mut backend, &[far]);
    let first = compare_on(&mut backend, &[deep]);
    let found = contacts(&backend);
    assert!(found > 300, "{found}");
    assert_eq!(backend.traffic().submissions, 2);
    let again = compare_on(&mut backend, &[deep]);
    assert_eq!(backend.traffic().submissions, 1);
    assert_eq!(first, again);
    let most = 64 + 116 + 48 * (found + found / 8);
    assert!(
        backend.traffic().read_back <= most,
        "{:?}",
        backend.traffic()
    );
    // A large batch does not make later ones dearer for long.
    let batch = [deep; 20];
    for result in compare_on(&mut backend, &batch) {
        assert_eq!(result, again[0]);
    }
    compare_on(&mut backend, &[deep]);
    compare_on(&mut backend, &[deep]);
    assert!(
        backend.traffic().read_back <= most,
        "{:?}",
        backend.traffic()
    );
}

/// What is filled does not grow with the buffers of earlier batches.
#[test]
fn only_what_is_used_is_filled() {
    let Some(mut backend) = fresh() else { return };
    let ball = ball().bare_cloud(R);
    let slight = apart(&ball, SLIGHT);
    compare_on(&mut backend, &[slight]);
    let filled = backend.traffic().filled;
    compare_on(&mut backend, &[apart(&ball, 0.0); 20]);
    let expected = compare_on(&mut backend, &[slight]);
    assert_eq!(backend.traffic().filled, filled);
    // And what earlier batches left behind is not mistaken for this one's.
    let Some(mut other) = fresh() else { return };
    assert_eq!(expected, compare_on(&mut other, &[slight]));
    assert_eq!(backend.needed_elements(), other.needed_elements());
}
