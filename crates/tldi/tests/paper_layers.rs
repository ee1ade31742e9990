//! Layers of the paper's variant on random clouds, poses and cameras, against brute force. Every
//! failure names the seed that replays it.

mod paper_support;

use paper_support::oracle::{Connectivity, Scene};
use paper_support::{DEPTH_TOLERANCE, RandomCloud, build, camera, pixels, pose, unit};
use tldi::glamx::{Pose3, Vec3};
use tldi::{Facing, Params, Tldi, VirtualCamera};

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
