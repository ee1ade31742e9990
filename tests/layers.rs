//! The image of one cloud against brute force and analytic truth.

use tldi::glamx::{Pose3, Vec3};
use tldi::{Facing, Layer, Params, PointCloud, Tldi, VirtualCamera, build};
use tldi_tests::{OracleLayer, oracle_layers, random_unit, sampled_plane, sampled_sphere};

/// Every pixel's layers equal those of an O(n²) sort-and-merge in f64.
#[test]
fn layers_equal_brute_force() {
    let (mut compared, mut too_close) = (0, 0);
    let (mut creased, mut unclear_face) = (0, 0);
    for seed in 0..60 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let count = rng.usize(1..120);
        let spread = 0.02 + 0.3 * rng.f32();
        let mut point = || Vec3::from_array(std::array::from_fn(|_| spread * (rng.f32() - 0.5)));
        let points: Vec<_> = (0..count).map(|_| point()).collect();
        let radii: Vec<_> = (0..count).map(|_| 0.002 + 0.02 * rng.f32()).collect();
        let normals: Vec<_> = (0..count).map(|_| random_unit(&mut rng)).collect();
        let cloud = PointCloud::builder(&points)
            .radii(radii)
            .normals(normals)
            .build()
            .expect("random points are valid");
        let params = Params::for_radius(0.01);
        let camera = VirtualCamera::along(Vec3::Z, params.pixel_size);
        // The camera's own frame, so that the oracle needs no rotation.
        let image = build(&cloud, &camera.view_from_frame.inverse(), &camera, &params);
        for j in 0..image.size[1] {
            for i in 0..image.size[0] {
                let [u, v] = [image.origin[0] + i as i32, image.origin[1] + j as i32];
                let Some(truth) = oracle_layers(&cloud, u, v, &params) else {
                    too_close += 1;
                    continue;
                };
                compared += 1;
                let mut layers = image.layers_at(i, j).to_vec();
                layers.sort_by(|a, b| a.near.total_cmp(&b.near));
                assert_eq!(layers.len(), truth.len(), "seed {seed}, pixel ({u}, {v})");
                for (layer, truth) in layers.iter().zip(truth) {
                    let OracleLayer { near, far, surface } = truth;
                    // Depths are even numbers of steps (thickness / 4096), weights 255ths: of the
                    // layer's spread.
                    let step = f64::from(params.thickness) / 4096.0;
                    let spread = (far - near) / 100.0;
                    assert!(
                        (f64::from(layer.near) - near).abs() < 3.0 * step,
                        "seed {seed}"
                    );
                    assert!(
                        (f64::from(layer.far) - far).abs() < 3.0 * step,
                        "seed {seed}"
                    );
                    if surface.depth.is_nan() {
                        unclear_face += 1;
                        continue;
                    }
                    assert!(
                        (f64::from(layer.depth) - surface.depth).abs() < 3.0 * step + spread,
                        "seed {seed}"
                    );
                    // Normals are kept in steps of 1 / 16384, weights in 255ths.
                    let off = layer.normal.as_dvec3() - surface.normal;
                    assert!(off.length() < 2e-3, "seed {seed}: {layer:?}, {surface:?}");
                    // Random normals: a layer of several points has faces.
                    creased += usize::from(far - near > 10.0 * step);
                }
            }
        }
    }
    assert!(compared > 20_000, "{compared}");
    assert!(
        too_close * 50 < compared,
        "{too_close} of {compared} undecided"
    );
    assert!(
        creased > 500 && unclear_face * 5 < creased,
        "{unclear_face} of {creased} depths at creases undecided"
    );
}

/// A sphere is entered and left at the analytic depths, with the analytic normals.
#[test]
fn a_sphere_has_two_layers_at_the_analytic_depths() {
    let (radius, r) = (0.2, 0.01);
    let cloud = sampled_sphere(radius, r).cloud(r);
    let params = Params::for_radius(r);
    let mut rng = fastrand::Rng::with_seed(7);
    for _ in 0..8 {
        let camera = VirtualCamera::along(random_unit(&mut rng), r);
        let image = build(&cloud, &Pose3::IDENTITY, &camera, &params);
        for j in 0..image.size[1] {
            for i in 0..image.size[0] {
                let x = (image.origin[0] + i as i32) as f32 + 0.5;
                let y = (image.origin[1] + j as i32) as f32 + 0.5;
                let rho = r * x.hypot(y);
                // Steeper than 60° the damped slope lags behind the surface.
                if rho > radius * 0.87 {
                    continue;
                }
                let layers = image.layers_at(i, j);
                assert_eq!(layers.len(), 2, "at {rho}");
                let depth = (radius * radius - rho * rho).sqrt();
                for (layer, facing, sign) in [
                    (&layers[0], Facing::Entry, -1.0),
                    (&layers[1], Facing::Exit, 1.0),
                ] {
                    assert_eq!(layer.facing, facing);
                    // A quarter of a radius: slope damping leaves 0.3 of tan 60° of the mean
                    // offset of the splats around a pixel's centre.
                    assert!(
                        (layer.depth - sign * depth).abs() < 0.25 * r,
                        "at {rho}: {layer:?}"
                    );
                    let normal = Vec3::new(r * x, r * y, sign * depth) / radius;
                    assert!(layer.normal.dot(normal) > 0.99, "at {rho}: {layer:?}");
                }
            }
        }
    }
}

/// A disc that a perspective camera sees aslant is where the rays of its pixels meet its plane. Seen with parallel rays, it
/// would be up to a tenth of its radius off.
#[test]
fn rays_that_spread_meet_a_disc_in_its_plane() {
    let mut rng = fastrand::Rng::with_seed(4);
    let (radius, mut layers) = (0.1, 0);
    let params = Params {
        slope_damping: 1.0,
        ..Params::for_radius(radius)
    };
    for _ in 0..40 {
        let point = Vec3::new(0.4 * (rng.f32() - 0.5), 0.2 * (rng.f32() - 0.5), 1.0);
        let normal = random_unit(&mut rng);
        if normal.dot(point.normalize()).abs() < 0.3 {
            continue;
        }
        let cloud = PointCloud::builder(vec![point]).radius(radius);
        let cloud = cloud.normals(vec![normal]).build().expect("a valid point");
        let camera =
            VirtualCamera::perspective(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0, [320, 240], 0.1, 10.0);
        let image = build(&cloud, &Pose3::IDENTITY, &camera, &params);
        let pixels = (0..image.size[1]).flat_map(|j| (0..image.size[0]).map(move |i| [i, j]));
        for [i, j] in pixels {
            let [u, v] = [image.origin[0] + i as i32, image.origin[1] + j as i32];
            // Of the plane that is a metre deep.
            let ray = camera.point_at(u as f32 + 0.5, v as f32 + 0.5, 1.0);
            let depth = normal.dot(point) / normal.dot(ray);
            // Rises of more than a radius are cut off.
            let is_cut = (depth - point.z).abs() > 0.9 * radius;
            for layer in image.layers_at(i, j).iter().filter(|_| !is_cut) {
                let off = layer.depth - depth;
                assert!(off.abs() < 1e-4, "{off} in ({u}, {v}): {normal}");
                layers += 1;
            }
        }
    }
    assert!(layers > 10_000, "{layers}");
}

/// Two sheets without normals, 1.5 radii apart, are two layers, where they are; told that so much is noise,
/// they are one.
#[test]
fn near_sheets_are_two_layers() {
    let (r, apart) = (0.01, 0.015);
    let mut rng = fastrand::Rng::with_seed(9);
    for noise in [0.0, r] {
        for _ in 0..6 {
            let mut points = sampled_plane(0.4, r, &mut rng).points;
            let upper = sampled_plane(0.4, r, &mut rng).points;
            points.extend(upper.into_iter().map(|p| p + apart * Vec3::Y));
            let cloud = PointCloud::builder(points).radius(r).noise(noise).build();
            let cloud = cloud.expect("the points are valid");
            // Within 22° of the normal.
            let axis = (0.4 * random_unit(&mut rng).reject_from(Vec3::Y) - Vec3::Y).normalize();
            let camera = VirtualCamera::along(axis, r);
            let image = build(&cloud, &Pose3::IDENTITY, &camera, &Params::for_radius(r));
            let (mut seen, mut as_expected) = (0, 0);
            for (i, j) in (0..image.size[0]).flat_map(|i| (0..image.size[1]).map(move |j| (i, j))) {
                let [u, v] = [image.origin[0] + i as i32, image.origin[1] + j as i32];
                let heights: Vec<f32> = (image.layers_at(i, j).iter())
                    .map(|l| camera.point_at(u as f32 + 0.5, v as f32 + 0.5, l.depth))
                    .filter(|p| p.x.abs().max(p.z.abs()) < 0.17)
                    .map(|p| p.y)
                    .collect();
                if heights.is_empty() {
                    continue;
                }
                seen += 1;
                let truth: &[f32] = if noise > 0.0 {
                    &[0.5 * apart]
                } else {
                    &[apart, 0.0]
                };
                let near = |(height, truth): (&f32, &f32)| (height - truth).abs() < 0.4 * r;
                as_expected += usize::from(
                    heights.len() == truth.len() && heights.iter().zip(truth).all(near),
                );
            }
            // Estimated of both sheets at once, normals are some degrees off.
            assert!(seen > 500, "{seen}");
            assert!(
                as_expected * 10 > seen * 9,
                "{noise}: {as_expected} of {seen}"
            );
        }
    }
}

/// The image along +z over the camera's own frame, with pixels of 1 cm.
fn image_along_z(cloud: &PointCloud) -> Tldi {
    let camera = VirtualCamera::along(Vec3::Z, 0.01);
    let frame_from_cloud = camera.view_from_frame.inverse();
    let params = Params::for_radius(0.01);
    build(cloud, &frame_from_cloud, &camera, &params)
}

/// Layers of the pixel with the corners (0, 0) and (1 cm, 1 cm).
fn layers_at_origin(image: &Tldi) -> &[Layer] {
    let [i, j] = image.origin.map(|k| (0 - k) as u32);
    image.layers_at(i, j)
}

/// 10⁵ points in one pixel are one layer, exactly in the middle.
#[test]
fn a_hot_pixel_is_one_layer() {
    let points: Vec<_> = (0..100_000)
        .map(|k| Vec3::new(0.005, 0.005, k as f32 * 1e-6 - 0.05))
        .collect();
    let cloud = PointCloud::builder(&points)
        .radius(0.01)
        .normals(vec![Vec3::Z; points.len()])
        .build()
        .expect("the points are valid");
    let image = image_along_z(&cloud);
    let layers = layers_at_origin(&image);
    assert_eq!(layers.len(), 1);
    assert!(layers[0].depth.abs() < 1e-5, "{:?}", layers[0]);
}

/// Points of many weights, depths, slopes and colours in few pixels: the same bits in any order.
#[test]
fn layers_do_not_depend_on_the_order_of_points() {
    let mut rng = fastrand::Rng::with_seed(5);
    // Depths from a set of 50: fragments of equal depth have no order of their own.
    let mut points: Vec<_> = (0..20_000)
        .map(|_| {
            let depth = f32::from(rng.u8(..50)) * 0.01;
            let point = Vec3::new(0.03 * rng.f32(), 0.03 * rng.f32(), depth);
            let radius = 0.005 + 0.01 * rng.f32();
            let color: [u8; 4] = std::array::from_fn(|_| rng.u8(..));
            let flat = rng.bool();
            let normal = if flat { Vec3::Z } else { random_unit(&mut rng) };
            (point, radius, normal, color)
        })
        .collect();
    let image = |points: &[(Vec3, f32, Vec3, [u8; 4])]| {
        let cloud = PointCloud::builder(points.iter().map(|p| p.0).collect::<Vec<_>>())
            .radii(points.iter().map(|p| p.1).collect::<Vec<_>>())
            .normals(points.iter().map(|p| p.2).collect::<Vec<_>>())
            .colors(points.iter().map(|p| p.3).collect::<Vec<_>>())
            .build()
            .expect("the points are valid");
        image_along_z(&cloud)
    };
    let straight = image(&points);
    assert!(straight.max_layers() >= 2);
    rng.shuffle(&mut points);
    assert_eq!(straight.layers(), image(&points).layers());
}

/// Colours blend with the same weights as depths; a cloud without colours has alpha 0.
#[test]
fn colours_blend() {
    // Seen from the pixel's centre: full weight, 1 + 254, and 7 mm off: 1 + 254 · 0.51, cut to 130.
    let points = vec![Vec3::new(0.005, 0.005, 0.0), Vec3::new(0.012, 0.005, 0.0)];
    let builder = || {
        PointCloud::builder(&points)
            .radius(0.01)
            .normals(vec![Vec3::Z; 2])
    };
    let colored = builder()
        .colors(vec![[200, 0, 100, 255], [100, 50, 0, 255]])
        .build()
        .expect("the points are valid");
    let blend = |c: [f32; 2]| ((255.0 * c[0] + 130.0 * c[1]) / 385.0).round() as u8;
    let expected = [
        blend([200.0, 100.0]),
        blend([0.0, 50.0]),
        blend([100.0, 0.0]),
        255,
    ];
    let image = image_along_z(&colored);
    let layers = layers_at_origin(&image);
    assert_eq!(layers.len(), 1);
    assert_eq!(layers[0].color, expected);
    let bare = image_along_z(&builder().build().expect("the points are valid"));
    assert_eq!(layers_at_origin(&bare)[0].color, [0; 4]);
}
