//! The paper's variant on random clouds, poses and cameras: against brute force, and its
//! symmetries. Every failure names the seed that replays it.

mod paper_oracle;

use paper_oracle::{Connectivity, Scene};
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{Facing, Params, PointCloud, Tldi, VirtualCamera, paper};

/// Blended depths, metres: depths up to 8 m carry f32 errors of about 1e-6, weights relative ones
/// of 1e-5 (pixel coordinates good to 1e-5 over a disc of a few pixels), which act on extents of
/// at most a few radii of 0.3 m.
const DEPTH_TOLERANCE: f64 = 2e-5;

fn unit(rng: &mut fastrand::Rng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| 2.0 * rng.f32() - 1.0))
}

fn pose(rng: &mut fastrand::Rng, reach: f32) -> Pose3 {
    let rotation = Quat::from_scaled_axis(3.0 * unit(rng));
    Pose3::from_parts(reach * unit(rng), rotation)
}

/// A camera at about 4 m from the origin, of either kind, with 40 × 40 pixels over about 2 m.
fn camera(rng: &mut fastrand::Rng) -> VirtualCamera {
    let eye = 4.0 * unit(rng).normalize_or(Vec3::Z);
    let size = [40, 40];
    let perspective =
        VirtualCamera::perspective(eye, 0.3 * unit(rng), Vec3::Y, 0.5, size, 2.8, 5.2);
    if rng.bool() {
        return perspective;
    }
    let corner = Pose3::translation(1.0, 1.0, 0.0);
    VirtualCamera {
        view_from_frame: corner * perspective.view_from_frame,
        size: Some(size),
        ..VirtualCamera::along(Vec3::Z, 0.05)
    }
}

struct RandomCloud {
    points: Vec<Vec3>,
    radii: Vec<f32>,
    colors: Vec<[u8; 4]>,
}

impl RandomCloud {
    fn new(rng: &mut fastrand::Rng, count: usize, radii: [f32; 2]) -> Self {
        Self {
            points: (0..count).map(|_| unit(rng)).collect(),
            radii: (0..count)
                .map(|_| radii[0] + (radii[1] - radii[0]) * rng.f32())
                .collect(),
            colors: (0..count)
                .map(|_| std::array::from_fn(|_| rng.u8(..)))
                .collect(),
        }
    }

    fn cloud(&self) -> PointCloud<'_> {
        PointCloud::builder(&self.points)
            .radii(&self.radii[..])
            .colors(&self.colors[..])
            .build()
            .unwrap()
    }

    fn scene(&self, frame_from_cloud: Pose3, camera: VirtualCamera) -> Scene<'_> {
        Scene {
            points: &self.points,
            radii: &self.radii,
            colors: &self.colors,
            frame_from_cloud,
            camera,
        }
    }
}

fn build(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    camera: &VirtualCamera,
    params: &Params,
) -> Tldi {
    let mut image = Tldi::default();
    let mut scratch = paper::Scratch::default();
    paper::build(
        cloud,
        frame_from_cloud,
        camera,
        params,
        &mut scratch,
        &mut image,
    );
    image
}

/// Pixels of an image in the camera's grid.
fn pixels(image: &Tldi) -> impl Iterator<Item = (i32, i32, &[tldi::Layer])> {
    (0..image.size[1]).flat_map(move |j| {
        (0..image.size[0]).map(move |i| {
            let [x, y] = [image.origin[0] + i as i32, image.origin[1] + j as i32];
            (x, y, image.layers_at(i, j))
        })
    })
}

/// Compares every decided pixel with the oracle; returns how many pixels with layers were decided
/// and how many were not.
fn check(seed: u64, image: &Tldi, scene: &Scene, connectivity: Connectivity) -> [usize; 2] {
    let mut counts = [0, 0];
    for (i, j, layers) in pixels(image) {
        let expected = scene.pixel(i, j, connectivity);
        if !expected.decided {
            counts[1] += 1;
            continue;
        }
        counts[0] += usize::from(!layers.is_empty());
        let at = format!(
            "seed {seed} pixel ({i}, {j}): {layers:?} for {:?}",
            expected.layers
        );
        assert_eq!(layers.len(), expected.layers.len(), "{at}");
        for (layer, expected) in layers.iter().zip(&expected.layers) {
            let close = |a: f32, b: f64| (f64::from(a) - b).abs() < DEPTH_TOLERANCE;
            assert!(
                close(layer.near, expected.near) && close(layer.far, expected.far),
                "{at}"
            );
            assert_eq!(layer.depth, 0.5 * (layer.near + layer.far), "{at}");
            assert_eq!(
                (layer.normal, layer.facing),
                (Vec3::ZERO, Facing::Unknown),
                "{at}"
            );
            for (c, e) in layer.color.iter().zip(expected.color) {
                // Rounded to integers; 255 × the relative error of the weights is far below.
                assert!((f64::from(*c) - e).abs() < 0.51, "{at}");
            }
        }
    }
    counts
}

#[test]
fn layers_are_those_of_brute_force() {
    let mut total = [0, 0];
    for seed in 0..24 {
        let mut rng = fastrand::Rng::with_seed(seed);
        // From smaller than a pixel (0.05 m) to several of them; from sparse to one thick stack.
        let radii = [[0.005, 0.06], [0.05, 0.3], [0.08, 0.08]][seed as usize % 3];
        let count = rng.usize(1..300);
        let random = RandomCloud::new(&mut rng, count, radii);
        let frame_from_cloud = pose(&mut rng, 0.2);
        let camera = camera(&mut rng);
        let segments = [128, 128, 5, 1][rng.usize(0..4)];
        let params = Params {
            stack_segments: segments,
            ..Params::paper(0.1)
        };
        let image = build(&random.cloud(), &frame_from_cloud, &camera, &params);
        let scene = random.scene(frame_from_cloud, camera);
        let counts = check(
            seed,
            &image,
            &scene,
            Connectivity::Segments(segments as usize),
        );
        total = [total[0] + counts[0], total[1] + counts[1]];
    }
    assert!(
        total[0] > 4000 && total[1] * 20 < total[0],
        "decided, undecided: {total:?}"
    );
}

#[test]
fn the_image_of_a_sizeless_camera_holds_all_and_no_more() {
    for seed in 0..12 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let random = RandomCloud::new(&mut rng, 40, [0.01, 0.2]);
        let camera = VirtualCamera::along(unit(&mut rng), 0.05);
        let params = Params::paper(0.1);
        let image = build(&random.cloud(), &Pose3::IDENTITY, &camera, &params);
        let scene = random.scene(Pose3::IDENTITY, camera);
        check(seed, &image, &scene, Connectivity::Segments(128));
        let [w, h] = image.size.map(|n| n as i32);
        let mut border = [false; 4];
        for j in -1..=h {
            for i in -1..=w {
                let outside = i < 0 || j < 0 || i == w || j == h;
                let at = [image.origin[0] + i, image.origin[1] + j];
                if outside {
                    let expected = scene.pixel(at[0], at[1], Connectivity::Segments(128));
                    assert!(
                        expected.layers.is_empty() || !expected.decided,
                        "seed {seed} {at:?}"
                    );
                } else if !image.layers_at(i as u32, j as u32).is_empty() {
                    // A disc may reach a row's height without reaching a centre in that row.
                    let on = [i <= 1, j <= 1, i >= w - 2, j >= h - 2];
                    border = std::array::from_fn(|k| border[k] || on[k]);
                }
            }
        }
        assert_eq!(
            border, [true; 4],
            "seed {seed}: empty rows or columns at the border"
        );
    }
}

#[test]
fn separate_runs_are_the_components_of_overlapping_ranges() {
    for seed in 0..8 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let camera = VirtualCamera {
            size: Some([40, 40]),
            ..VirtualCamera::along(Vec3::Z, 0.05)
        };
        // Cylinders 0.2 high in slabs 0.05 thick and 0.75 apart: between the slabs' cylinders 0.5
        // stays empty, more than the 0.4 (two segments) that the mask may close.
        let mut random = RandomCloud::new(&mut rng, 300, [0.1, 0.1]);
        for point in &mut random.points {
            *point += Vec3::ONE;
            point.z = 0.75 * (3.0 * point.z).floor() + 0.05 * rng.f32();
        }
        let params = Params::paper(0.1);
        let image = build(&random.cloud(), &Pose3::IDENTITY, &camera, &params);
        let scene = random.scene(Pose3::IDENTITY, camera);
        let [decided, _] = check(seed, &image, &scene, Connectivity::Overlap);
        assert!(decided > 800, "seed {seed}: {decided}");
    }
}

#[test]
fn layers_are_ordered_and_apart() {
    for seed in 0..60 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let count = rng.usize(1..2000);
        let random = RandomCloud::new(&mut rng, count, [0.001, 0.3]);
        let camera = camera(&mut rng);
        let params = Params {
            stack_segments: rng.u32(0..200),
            ..Params::paper(0.1)
        };
        let image = build(&random.cloud(), &pose(&mut rng, 0.2), &camera, &params);
        for (i, j, layers) in pixels(&image) {
            for layer in layers {
                let ordered = layer.near <= layer.depth && layer.depth <= layer.far;
                assert!(ordered, "seed {seed} ({i}, {j}): {layer:?}");
            }
            for pair in layers.windows(2) {
                assert!(
                    pair[0].far <= pair[1].near,
                    "seed {seed} ({i}, {j}): {pair:?}"
                );
            }
        }
    }
}

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
