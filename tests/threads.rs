//! The same bits at any number of threads.

use tldi::glamx::Pose3;
use tldi::{CpuBackend, PairQuery, PairResult};
use tldi_tests::{aimed_clouds, compare_on, random_pose, sampled_sphere};

#[test]
fn results_do_not_depend_on_threads() {
    let mut rng = fastrand::Rng::with_seed(11);
    // Large enough for the cull to run in several tasks.
    let (big, small) = (sampled_sphere(1.0, 0.009), sampled_sphere(0.3, 0.01));
    let clouds = [
        big.cloud(0.009),
        small.cloud(0.01),
        big.bare_cloud(0.009),
        small.bare_cloud(0.01),
    ];
    assert!(clouds[0].len() > 100_000);
    let poses: Vec<Pose3> = (0..8)
        .map(|_| {
            let mut pose = random_pose(&mut rng, 0.0);
            // From deep in each other, which large pixels settle, to a touch.
            pose.translation = pose.rotation * tldi::glamx::Vec3::X * (0.9 + 0.41 * rng.f32());
            pose
        })
        .collect();
    let run = |threads: usize| -> Vec<PairResult> {
        let batch: Vec<_> = poses
            .iter()
            .enumerate()
            .map(|(k, pose)| {
                let [a, b] = [0, 1].map(|side| &clouds[2 * (k % 2) + side]);
                aimed_clouds(a, b, *pose, 0.01)
            })
            .collect();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads can be started");
        pool.install(|| {
            let mut backend = CpuBackend::new();
            let cold = compare_on(&mut backend, &batch);
            // Warm memory must not show either, least of all what it held for another pair.
            let reversed: Vec<PairQuery> = batch.iter().rev().copied().collect();
            let mut warm = compare_on(&mut backend, &reversed);
            warm.reverse();
            assert_eq!(cold, warm, "{threads} threads");
            cold
        })
    };
    let one = run(1);
    assert!(one.iter().filter(|r| !r.contacts.is_empty()).count() >= 4);
    for threads in [2, 7] {
        assert_eq!(one, run(threads), "{threads} threads");
    }
}
