//! The paper's variant on scenes whose layers are known.

mod paper_support;

use paper_support::build as build_at;
use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Backend, CpuBackend, Facing, Layer, PairQuery, Params, PointCloud, Surface, Tldi, View,
    VirtualCamera, paper,
};

fn build(cloud: &PointCloud, camera: &VirtualCamera, params: &Params) -> Tldi {
    build_at(cloud, &Pose3::IDENTITY, camera, params)
}

/// Looks along z with one pixel of 1 m whose centre is on the z axis.
fn one_pixel() -> VirtualCamera {
    VirtualCamera {
        view_from_frame: Pose3::translation(0.5, 0.5, 0.0),
        size: Some([1, 1]),
        ..VirtualCamera::along(Vec3::Z, 1.0)
    }
}

/// The layers along the z axis of points on it.
fn layers_on_axis(depths: &[f32], radii: &[f32], params: &Params) -> Vec<Layer> {
    let points: Vec<Vec3> = depths.iter().map(|z| Vec3::new(0.0, 0.0, *z)).collect();
    let cloud = PointCloud::builder(&points).radii(radii).build().unwrap();
    build(&cloud, &one_pixel(), params).layers().to_vec()
}

fn ranges(layers: &[Layer]) -> Vec<[f32; 2]> {
    layers.iter().map(|layer| [layer.near, layer.far]).collect()
}

fn assert_ranges(layers: &[Layer], expected: &[[f32; 2]], tolerance: f32) {
    let found = ranges(layers);
    assert_eq!(found.len(), expected.len(), "{found:?} for {expected:?}");
    for (f, e) in found.iter().zip(expected) {
        let close = (f[0] - e[0]).abs() < tolerance && (f[1] - e[1]).abs() < tolerance;
        assert!(close, "{found:?} for {expected:?}");
    }
}

/// A square sheet across the z axis, 1 m wide.
fn sheet(spacing: f32, z: f32) -> Vec<Vec3> {
    let n = (1.0 / spacing) as usize + 1;
    (0..n * n)
        .map(|k| Vec3::new((k % n) as f32 * spacing, (k / n) as f32 * spacing, z))
        .collect()
}

#[test]
fn parallel_sheets_collide_within_the_compressed_thickness() {
    let points = sheet(0.05, 0.0);
    let radius = 0.05;
    let cloud = PointCloud::builder(&points).radius(radius).build().unwrap();
    // The same sheet, elsewhere in a frame of its own: a backend must look at it where its pose puts it.
    let lifted = sheet(0.05, 0.3);
    let lifted = PointCloud::builder(&lifted).radius(radius).build().unwrap();
    let (mut backend, mut results) = (CpuBackend::new(), Vec::new());
    let camera = VirtualCamera::along(Vec3::Z, 0.03);
    for rho in [0.0, 0.05, 0.5] {
        let params = Params {
            rho,
            ..Params::paper(radius)
        };
        let still = build(&cloud, &camera, &params);
        assert_ranges(
            still.layers(),
            &vec![[-radius, radius]; still.layers().len()],
            1e-7,
        );
        // Either range is 2 r (1 − ρ) long.
        let thickness = 2.0 * radius * (1.0 - rho);
        for (distance, collides) in [
            (0.0, true),
            (0.999 * thickness, true),
            (1.001 * thickness, false),
            (0.7, false),
        ] {
            for sign in [1.0, -1.0] {
                let away = Pose3::translation(0.0, 0.0, sign * distance);
                let moved = build_at(&cloud, &away, &camera, &params);
                let found = paper::compare(&still, &moved, &params);
                assert_eq!(found.collides, collides, "rho {rho} distance {distance}");
                let gap = (distance - thickness).max(0.0);
                // Rounding of depths below 1 m.
                assert!(
                    (found.gap.unwrap() - gap).abs() < 1e-6,
                    "{found:?} for {gap}"
                );
                let query = PairQuery {
                    a: Surface::Cloud(&cloud),
                    b: Surface::Cloud(&lifted),
                    a_from_b: Pose3::translation(0.0, 0.0, sign * distance - 0.3),
                    view: View::Fixed(camera),
                    params,
                };
                backend.compare(&[query], &mut results).unwrap();
                let [result] = &results[..] else {
                    panic!("{results:?}");
                };
                assert_eq!(result.collides, collides, "rho {rho} distance {distance}");
                assert!((result.gap.unwrap() - gap).abs() < 1e-6, "{gap}");
            }
        }
    }
}

#[test]
fn a_sphere_is_entered_and_left_at_its_surface() {
    // A Fibonacci lattice of 20,000 points on the unit sphere: about 0.025 m apart.
    let count = 20_000;
    let points: Vec<Vec3> = (0..count)
        .map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / count as f64;
            let angle = k as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
            let r = (1.0 - z * z).sqrt();
            Vec3::new((r * angle.cos()) as f32, (r * angle.sin()) as f32, z as f32)
        })
        .collect();
    let radius = 0.035;
    let cloud = PointCloud::builder(&points).radius(radius).build().unwrap();
    // 2 m before the sphere, 256 pixels over 90° and over the orthographic 2.4 m.
    let perspective = VirtualCamera::perspective(
        Vec3::new(0.0, 0.0, -2.0),
        Vec3::ZERO,
        Vec3::Y,
        std::f32::consts::FRAC_PI_2,
        [256, 256],
        0.5,
        4.0,
    );
    let orthographic = VirtualCamera::along(Vec3::new(0.4, 0.2, 1.0), 0.02);
    for camera in [perspective, orthographic] {
        let image = build(&cloud, &camera, &Params::paper(radius));
        let center = camera.view_from_point(Vec3::ZERO);
        let (mut pixels, mut squared) = (0, 0.0);
        for j in 0..image.size[1] {
            for i in 0..image.size[0] {
                // The ray through the pixel's centre, and where it meets the sphere.
                let u = (image.origin[0] + i as i32) as f32 + 0.5;
                let v = (image.origin[1] + j as i32) as f32 + 0.5;
                let origin = camera.view_at(u, v, 1.0);
                let direction = (camera.view_at(u, v, 2.0) - origin).normalize();
                let to_center = center - origin;
                let along = to_center.dot(direction);
                let off = (to_center - along * direction).length();
                if off > 0.7 {
                    continue;
                }
                let half = (1.0 - off * off).sqrt();
                let layers = image.layers_at(i, j);
                assert_eq!(layers.len(), 2, "at {off} from the axis: {layers:?}");
                for (layer, t) in layers.iter().zip([along - half, along + half]) {
                    let depth = (origin + t * direction).z;
                    // Up to 0.7 from the axis, and at most 27° off the view axis, a surface point
                    // within a radius across is within 2 radii in depth; the depth blends those
                    // around the ray, whose slopes cancel but for the irregular spacing.
                    let error = layer.depth - depth;
                    assert!(error.abs() < radius, "{error} at {off} from the axis");
                    assert!(
                        layer.near < depth && depth < layer.far,
                        "{layer:?} for {depth}"
                    );
                    assert_eq!((layer.normal, layer.facing), (Vec3::ZERO, Facing::Unknown));
                    pixels += 1;
                    squared += error * error;
                }
            }
        }
        assert!(pixels > 5000, "{pixels}");
        let rms = (squared / pixels as f32).sqrt();
        assert!(rms < 0.2 * radius, "root mean square error {rms}");
    }
}

#[test]
fn one_cylinder_is_as_deep_as_its_ball() {
    let layers = layers_on_axis(&[2.0], &[0.25], &Params::paper(0.25));
    assert_eq!(ranges(&layers), [[1.75, 2.25]]);
    assert_eq!(layers[0].color, [0; 4]);
}

#[test]
fn cylinders_that_all_overlap_are_blended_alike() {
    // On the axis all weights are equal: plain means.
    let layers = layers_on_axis(&[1.0, 1.1, 1.3], &[0.2; 3], &Params::paper(0.2));
    assert_ranges(&layers, &[[3.4 / 3.0 - 0.2, 3.4 / 3.0 + 0.2]], 1e-6);
}

#[test]
fn a_blend_is_within_what_it_blends() {
    // Equal depths, unequal weights: rounding must not move the mean beyond them.
    let mut rng = fastrand::Rng::with_seed(9);
    for _ in 0..200 {
        let points: Vec<Vec3> = (0..50)
            .map(|_| Vec3::new(0.2 * rng.f32(), 0.2 * rng.f32(), 0.0))
            .collect();
        let radius = 0.3 + rng.f32();
        let cloud = PointCloud::builder(&points).radius(radius).build().unwrap();
        let image = build(&cloud, &one_pixel(), &Params::paper(radius));
        let layer = image.layers()[0];
        assert!(
            layer.near == -radius && layer.far <= radius,
            "{layer:?} for {radius}"
        );
        assert!(layer.far > 0.99999 * radius, "{layer:?} for {radius}");
    }
}

#[test]
fn weights_are_gaussian_with_half_the_radius_as_standard_deviation() {
    // The second disc's centre is 0.3 from the pixel's, at a radius of 0.4: exp(−½ (0.3 / 0.2)²).
    let points = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.3, 0.0, 1.2)];
    let cloud = PointCloud::builder(&points[..])
        .radius(0.4)
        .build()
        .unwrap();
    let image = build(&cloud, &one_pixel(), &Params::paper(0.4));
    let weight = (-1.125f32).exp();
    let mean = (1.0 + weight * 1.2) / (1.0 + weight);
    assert_ranges(image.layers(), &[[mean - 0.4, mean + 0.4]], 1e-6);
}

#[test]
fn a_wall_seen_edge_on_is_one_long_stack() {
    // Points 0.015 apart with radius 0.02 along the ray: each overlaps the next two.
    let depths: Vec<f32> = (0..=100).map(|k| 0.015 * k as f32).collect();
    let layers = layers_on_axis(&depths, &[0.02; 101], &Params::paper(0.02));
    // Near is the mean of the first three, far of the last three.
    assert_ranges(&layers, &[[0.015 - 0.02, 1.485 + 0.02]], 1e-6);
    assert!((layers[0].depth - 0.75).abs() < 1e-6);
}

#[test]
fn a_run_beyond_the_mask_is_split() {
    // Segments are 0.04 high: the 128th ends 5.12 behind the front. Points 0.03 apart: the first
    // 171 begin before that.
    let at = |count: usize, segments: u32| {
        let depths: Vec<f32> = (0..count).map(|k| 0.02 + 0.03 * k as f32).collect();
        let params = Params {
            stack_segments: segments,
            ..Params::paper(0.02)
        };
        layers_on_axis(&depths, &vec![0.02; count], &params)
    };
    // Near and far are means of two cylinders, 0.015 inside.
    assert_ranges(&at(171, 128), &[[0.015, 5.125]], 1e-5);
    // Cut where the next layer begins: at 5.13 only, so that the blended depth stays.
    let expected = [[0.015, 5.125], [5.13, 5.17]];
    assert_ranges(&at(172, 128), &expected, 1e-5);
    assert_ranges(&at(172, 1000), &expected, 1e-5);
    // 16 segments: 0.64, 22 points a layer, 172 = 7 × 22 + 18.
    assert_eq!(at(172, 16).len(), 8);
    // One segment: 0.04, 2 points a layer. None is read as one.
    assert_eq!(at(172, 1).len(), 86);
    assert_eq!(at(172, 1), at(172, 0));
}

#[test]
fn a_split_layer_ends_where_the_next_begins() {
    // A thin cylinder in front sets segments of 0.02; the mask ends at 2.56. A thick one reaches from
    // 0.025, in the next segment, to 4.025 and meets one that begins at 3.
    let radii = [0.01, 2.0, 0.5];
    let layers = layers_on_axis(&[0.01, 2.025, 3.5], &radii, &Params::paper(0.1));
    assert_ranges(&layers, &[[0.0, 3.0], [3.0, 4.0]], 1e-5);
    assert_eq!(layers[0].depth, 0.5 * (layers[0].near + layers[0].far));
}

#[test]
fn a_gap_of_two_segments_parts_layers() {
    let params = Params::paper(0.5);
    let part = |gap: f32| layers_on_axis(&[0.5, 1.5 + gap], &[0.5; 2], &params).len();
    // The front fills segment 0, [0, 1). Whatever begins in segment 1 joins it.
    assert_eq!([part(0.0), part(0.9), part(1.0), part(2.1)], [1, 1, 2, 2]);
}

#[test]
fn a_hundred_thousand_points_in_one_pixel() {
    let count = 100_000;
    let mut rng = fastrand::Rng::with_seed(3);
    // One thick run: all overlap a neighbour, no two ends overlap.
    let mut depths: Vec<f32> = (0..count).map(|_| rng.f32()).collect();
    let layers = layers_on_axis(&depths, &vec![0.02; count], &Params::paper(0.02));
    // Near blends a uniform [0, 0.04], far [0.96, 1]; sampled by 4,000 points each: the standard
    // error is 0.04 / √12 / √4000 = 0.0002, five of which are allowed.
    assert_ranges(&layers, &[[0.0, 1.0]], 1e-3);

    // As many layers as points, in an order that is not that of depth.
    depths = (0..count).map(|k| k as f32).collect();
    rng.shuffle(&mut depths);
    let layers = layers_on_axis(&depths, &vec![0.25; count], &Params::paper(0.25));
    assert_eq!(layers.len(), count);
    for (k, layer) in layers.iter().enumerate() {
        assert_eq!([layer.near, layer.far], [k as f32 - 0.25, k as f32 + 0.25]);
    }

    // Layers as long as the mask: every one of them looks at all its segments.
    depths = (0..count).map(|k| 0.3 * k as f32).collect();
    let layers = layers_on_axis(&depths, &vec![0.25; count], &Params::paper(0.25));
    // 64 m hold 214 points 0.3 m apart; f32 depths of 30 km are 2 mm apart, so that now and then
    // a layer holds one more or less.
    let expected = count.div_ceil(214);
    assert!(
        layers.len().abs_diff(expected) < 5,
        "{} for {expected}",
        layers.len()
    );
}

#[test]
fn a_disc_smaller_than_a_pixel_covers_the_pixel_it_is_in() {
    let mut rng = fastrand::Rng::with_seed(5);
    let points: Vec<Vec3> = (0..200)
        .map(|_| Vec3::new(20.0 * rng.f32() - 10.0, 20.0 * rng.f32() - 10.0, rng.f32()))
        .collect();
    let camera = VirtualCamera::along(Vec3::Z, 1.0);
    for point in points {
        for radius in [1e-12, 1e-3, 0.2] {
            let cloud = PointCloud::builder(vec![Vec3::ZERO])
                .radius(radius)
                .build()
                .unwrap();
            let pose = Pose3::from_translation(point);
            let image = build_at(&cloud, &pose, &camera, &Params::paper(radius));
            let [u, v] = camera.pixel_from_view(camera.view_from_point(point));
            assert_eq!(image.size, [1, 1]);
            assert_eq!(image.origin, [u.floor() as i32, v.floor() as i32]);
            assert_eq!(image.layers().len(), 1);
            let layer = image.layers()[0];
            assert!(layer.near.is_finite() && layer.near <= layer.far);
            assert!((layer.depth - point.z).abs() < 1e-6);
        }
    }
}

#[test]
fn depth_planes_cull_points() {
    let points = [-3.0, 0.0, 0.5, 0.99, 1.01, 2.0, 5.99, 6.01, 1e12].map(|z| Vec3::Z * z);
    let camera = VirtualCamera::perspective(
        Vec3::ZERO,
        Vec3::Z,
        Vec3::Y,
        std::f32::consts::FRAC_PI_2,
        [3, 3],
        1.0,
        6.0,
    );
    let radii = [1e-3f32, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e11];
    let cloud = PointCloud::builder(&points[..])
        .radii(&radii[..])
        .build()
        .unwrap();
    let image = build(&cloud, &camera, &Params::paper(1e-3));
    let depths: Vec<f32> = image
        .layers_at(1, 1)
        .iter()
        .map(|layer| layer.depth)
        .collect();
    assert_eq!(image.layers().len(), 3);
    for (depth, expected) in depths.iter().zip([1.01, 2.0, 5.99]) {
        assert!((depth - expected).abs() < 1e-6, "{depths:?}");
    }
}

#[test]
fn nothing_in_view_is_an_empty_image() {
    let cloud = PointCloud::builder(vec![Vec3::ZERO])
        .radius(0.1)
        .build()
        .unwrap();
    let params = Params::paper(0.1);
    let seen = build(&cloud, &one_pixel(), &params);
    let nan = Pose3::translation(f32::NAN, 0.0, 0.0);
    let far = Pose3::translation(1e30, 0.0, 0.0);
    for pose in [nan, far, Pose3::translation(0.0, 0.0, f32::INFINITY)] {
        for camera in [
            one_pixel(),
            VirtualCamera {
                size: None,
                ..one_pixel()
            },
        ] {
            let image = build_at(&cloud, &pose, &camera, &params);
            assert_eq!(image.size, camera.size.unwrap_or([0, 0]));
            assert!(image.layers().is_empty());
            assert_eq!(image.max_layers(), 0);
            for (a, b) in [(&image, &seen), (&seen, &image), (&image, &image)] {
                assert_eq!(
                    paper::compare(a, b, &params),
                    paper::PaperComparison::default()
                );
            }
        }
    }
    // An image that was filled before is emptied.
    let mut reused = seen.clone();
    let mut scratch = paper::Scratch::default();
    paper::build(
        &cloud,
        &far,
        &one_pixel(),
        &params,
        &mut scratch,
        &mut reused,
    );
    assert!(reused.layers().is_empty());
}

#[test]
fn images_that_share_no_pixel_have_no_gap() {
    let cloud = PointCloud::builder(vec![Vec3::ZERO])
        .radius(0.1)
        .build()
        .unwrap();
    let camera = VirtualCamera::along(Vec3::Z, 0.1);
    let params = Params::paper(0.1);
    let a = build(&cloud, &camera, &params);
    let b = build_at(&cloud, &Pose3::translation(1.0, 0.0, 0.0), &camera, &params);
    assert_eq!(
        paper::compare(&a, &b, &params),
        paper::PaperComparison::default()
    );
}

#[test]
#[should_panic(expected = "different cameras")]
fn images_of_different_cameras_are_refused() {
    let cloud = PointCloud::builder(vec![Vec3::ZERO])
        .radius(0.1)
        .build()
        .unwrap();
    let params = Params::paper(0.1);
    let a = build(&cloud, &VirtualCamera::along(Vec3::Z, 0.1), &params);
    let b = build(&cloud, &VirtualCamera::along(Vec3::X, 0.1), &params);
    paper::compare(&a, &b, &params);
}

#[test]
#[should_panic(expected = "too large")]
fn absurd_images_are_refused() {
    let points = [Vec3::ZERO, Vec3::new(1e3, 1e3, 0.0)];
    let cloud = PointCloud::builder(&points[..])
        .radius(0.1)
        .build()
        .unwrap();
    build(
        &cloud,
        &VirtualCamera::along(Vec3::Z, 1e-2),
        &Params::paper(0.1),
    );
}

#[test]
fn colour_is_that_of_the_seen_side() {
    let points = [0.0, 0.1, 0.3].map(|z| Vec3::Z * z);
    let colors = [[255, 0, 10, 255], [0, 100, 11, 255], [9, 9, 255, 255]];
    // The third overlaps the second, not the first: a stack.
    let cloud = PointCloud::builder(&points[..])
        .radius(0.12)
        .colors(&colors[..])
        .build()
        .unwrap();
    let image = build(&cloud, &one_pixel(), &Params::paper(0.12));
    assert_eq!(image.layers().len(), 1);
    // Means of the first two, rounded.
    assert_eq!(image.layers()[0].color, [128, 50, 11, 255]);
}
