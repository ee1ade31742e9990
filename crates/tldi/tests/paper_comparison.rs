//! Comparison of images of the paper's variant: against every pair of layers, and its symmetries.
//! Every failure names the seed that replays it.

mod paper_support;

use paper_support::oracle::Connectivity;
use paper_support::{DEPTH_TOLERANCE, RandomCloud, build, camera, pixels, pose};
use tldi::glamx::{Pose3, Vec3};
use tldi::{Params, Tldi, VirtualCamera, paper};

/// Two images from one camera, of clouds that may or may not touch.
fn random_pair(seed: u64) -> ([Tldi; 2], fastrand::Rng) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let camera = camera(&mut rng);
    let frames = [pose(&mut rng, 0.5), pose(&mut rng, 0.5)];
    let images = frames.map(|frame_from_cloud| {
        let count = rng.usize(1..40);
        let mut random = RandomCloud::new(&mut rng, count, [0.02, 0.15]);
        let flat = rng.f32();
        random.points.iter_mut().for_each(|p| p.z *= flat);
        let camera = if rng.bool() { camera } else { sizeless(camera) };
        build(
            &random.cloud(),
            &frame_from_cloud,
            &camera,
            &Params::paper(0.1),
        )
    });
    (images, rng)
}

/// The same camera with an image that follows the cloud, where that keeps the pixel grid.
fn sizeless(camera: VirtualCamera) -> VirtualCamera {
    match camera.projection {
        tldi::Projection::Orthographic { .. } => VirtualCamera {
            size: None,
            ..camera
        },
        tldi::Projection::Perspective { .. } => camera,
    }
}

#[test]
fn comparison_is_that_of_every_pair_of_layers() {
    let (mut hits, mut misses, mut unshared) = (0, 0, 0);
    for seed in 0..400 {
        let ([a, b], mut rng) = random_pair(seed);
        let rho = rng.f32();
        let params = Params {
            rho,
            ..Params::paper(0.1)
        };
        // In f32 as defined, so that yes-or-no answers can be compared exactly; gaps up to the
        // rounding of a difference of depths below 8 m.
        let mut gap = None::<f32>;
        let mut colliding = Vec::new();
        for (i, j, layers_a) in pixels(&a) {
            let at = [i - b.origin[0], j - b.origin[1]];
            if (0..2).any(|k| at[k] < 0 || at[k] >= b.size[k] as i32) {
                continue;
            }
            let mut overlap = false;
            for la in layers_a {
                for lb in b.layers_at(at[0] as u32, at[1] as u32) {
                    let [na, fa] = shrunk(la, rho);
                    let [nb, fb] = shrunk(lb, rho);
                    let distance = (na - fb).max(nb - fa).max(0.0);
                    overlap |= distance == 0.0;
                    gap = Some(gap.map_or(distance, |g| g.min(distance)));
                }
            }
            if overlap {
                colliding.push([i, j]);
            }
        }
        let found = paper::compare(&a, &b, &params);
        assert_eq!(found.collides, !colliding.is_empty(), "seed {seed}");
        match (found.gap, gap) {
            (Some(f), Some(g)) => assert!((f - g).abs() < 1e-6, "seed {seed}: {f} for {g}"),
            (f, g) => assert_eq!(f, g, "seed {seed}"),
        }
        assert_eq!(found.gap == Some(0.0), found.collides, "seed {seed}");
        let mut listed = vec![[7, 7]];
        paper::colliding_pixels(&a, &b, &params, &mut listed);
        assert_eq!(listed, colliding, "seed {seed}");
        match found.gap {
            None => unshared += 1,
            Some(_) if found.collides => hits += 1,
            Some(_) => misses += 1,
        }
    }
    assert!(
        hits > 50 && misses > 50 && unshared > 0,
        "{hits} {misses} {unshared}"
    );
}

fn shrunk(layer: &tldi::Layer, rho: f32) -> [f32; 2] {
    let margin = 0.5 * rho * (layer.far - layer.near);
    [
        (layer.near + margin).min(layer.depth),
        (layer.far - margin).max(layer.depth),
    ]
}

#[test]
fn comparison_is_symmetric() {
    for seed in 0..400 {
        let ([a, b], mut rng) = random_pair(seed);
        let params = Params {
            rho: rng.f32(),
            ..Params::paper(0.1)
        };
        let found = paper::compare(&a, &b, &params);
        assert_eq!(found, paper::compare(&b, &a, &params), "seed {seed}");
    }
}

#[test]
fn collision_and_gap_are_monotone_in_rho() {
    let mut changes = 0;
    for seed in 0..400 {
        let ([a, b], mut rng) = random_pair(seed);
        let mut rhos: Vec<f32> = (0..12).map(|_| rng.f32()).collect();
        rhos.extend([-1.0, 0.0, 1.0, 2.0]);
        rhos.sort_by(f32::total_cmp);
        let found: Vec<_> = rhos
            .iter()
            .map(|&rho| {
                paper::compare(
                    &a,
                    &b,
                    &Params {
                        rho,
                        ..Params::paper(0.1)
                    },
                )
            })
            .collect();
        // Beyond 0 and 1 nothing changes.
        let end = found.len() - 1;
        assert_eq!(
            [found[0], found[end]],
            [found[1], found[end - 1]],
            "seed {seed}"
        );
        for (pair, rhos) in found.windows(2).zip(rhos.windows(2)) {
            let wider = pair[0].collides || !pair[1].collides;
            assert!(
                wider && pair[0].gap <= pair[1].gap,
                "seed {seed} {rhos:?}: {pair:?}"
            );
            changes += usize::from(pair[0].collides != pair[1].collides);
        }
    }
    assert!(changes > 20, "rho decided only {changes} pairs");
}

#[test]
fn a_common_rigid_motion_changes_nothing() {
    let (mut compared, mut skipped) = (0, 0);
    for seed in 0..300 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let camera = camera(&mut rng);
        let motion = pose(&mut rng, 2.0);
        let moved_camera = VirtualCamera {
            view_from_frame: camera.view_from_frame * motion.inverse(),
            ..camera
        };
        let params = Params::paper(0.1);
        let mut images = Vec::new();
        let mut decided = true;
        for _ in 0..2 {
            let count = rng.usize(1..8);
            let random = RandomCloud::new(&mut rng, count, [0.05, 0.15]);
            let frame_from_cloud = pose(&mut rng, 0.3);
            let cloud = random.cloud();
            let image = build(&cloud, &frame_from_cloud, &camera, &params);
            let moved = build(&cloud, &(motion * frame_from_cloud), &moved_camera, &params);
            let scene = random.scene(frame_from_cloud, camera);
            decided &= pixels(&image)
                .all(|(i, j, _)| scene.pixel(i, j, Connectivity::Segments(128)).decided);
            images.push([image, moved]);
        }
        if !decided {
            // Some pixel may fall to either side by rounding.
            skipped += 1;
            continue;
        }
        compared += 1;
        let [before, after] = [0, 1].map(|k| paper::compare(&images[0][k], &images[1][k], &params));
        match (before.gap, after.gap) {
            // Twice the tolerance of a depth: a gap is the difference of two.
            (Some(g), Some(h)) => {
                assert!(
                    (g - h).abs() < 2.0 * DEPTH_TOLERANCE as f32,
                    "seed {seed}: {g} {h}"
                );
                let near_tie = g.max(h) < 2.0 * DEPTH_TOLERANCE as f32 && g != h;
                assert!(before.collides == after.collides || near_tie, "seed {seed}");
            }
            (g, h) => assert_eq!(g, h, "seed {seed}"),
        }
    }
    assert!(compared > 60, "{compared} compared, {skipped} skipped");
}

#[test]
fn threads_and_warm_memory_change_nothing() {
    let mut rng = fastrand::Rng::with_seed(7);
    let camera = VirtualCamera::along(Vec3::new(0.3, -0.5, 0.8), 0.02);
    let params = Params::paper(0.03);
    let clouds: Vec<RandomCloud> = [5000, 20_000, 300, 9000]
        .map(|count| RandomCloud::new(&mut rng, count, [0.01, 0.05]))
        .into();
    let run = |threads: usize, warm: bool| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut scratch = paper::Scratch::default();
            let images: Vec<Tldi> = clouds
                .iter()
                .map(|random| {
                    if !warm {
                        scratch = paper::Scratch::default();
                    }
                    let mut image = Tldi::default();
                    let pose = Pose3::IDENTITY;
                    paper::build(
                        &random.cloud(),
                        &pose,
                        &camera,
                        &params,
                        &mut scratch,
                        &mut image,
                    );
                    image
                })
                .collect();
            let found: Vec<_> = images
                .windows(2)
                .map(|pair| paper::compare(&pair[0], &pair[1], &params))
                .collect();
            let layers: Vec<_> = images
                .iter()
                .map(|image| (image.origin, image.size, image.layers().to_vec()))
                .collect();
            (layers, found)
        })
    };
    let expected = run(1, false);
    for threads in [1, 2, 7] {
        assert!(run(threads, true) == expected, "{threads} threads");
    }
}
