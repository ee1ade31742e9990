//! Clouds that are born on the device give the contacts of the same points on the host.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Aabb, Backend, BackendError, CpuBackend, DeviceCloud, PairQuery, PairResult, Params,
    PointCloud, Radii, Surface, View, VirtualCamera,
};
use tldi_tests::{aimed, compare_on, gpu_backend, sampled_plane, sampled_sphere};
use tldi_wgpu::{AutoBackend, DepthCamera, Gpu, GpuError, WgpuBackend, wgpu};

const R: f32 = 0.02;

fn compared(backend: &mut dyn Backend, query: PairQuery<'_>) -> PairResult {
    compare_on(backend, &[query]).remove(0)
}

/// What matters of two results, within rounding: device clouds know looser bounds, of which the
/// first view follows a little.
fn assert_like(host: &PairResult, device: &PairResult) {
    assert_eq!(host.collides, device.collides);
    let (gap, other) = (host.gap.expect("near"), device.gap.expect("near"));
    assert!((gap - other).abs() < 0.1 * R, "{gap} {other}");
    assert_eq!(host.axes.len(), device.axes.len());
    assert!(host.axes[0].dot(device.axes[0]) > 0.999);
    let (count, other) = (host.contacts.len(), device.contacts.len());
    assert!(count > 20, "{count}");
    assert!(count.abs_diff(other) * 20 <= count, "{count} {other}");
}

fn buffer(gpu: &Gpu, points: &[[f32; 4]]) -> wgpu::Buffer {
    let bytes: Vec<u8> = points
        .iter()
        .flatten()
        .flat_map(|c| c.to_le_bytes())
        .collect();
    let buffer = gpu.device().create_buffer(&wgpu::BufferDescriptor {
        label: Some("a simulation's points"),
        size: bytes.len() as u64,
        usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue().write_buffer(&buffer, 0, &bytes);
    buffer
}

/// Points in a buffer of the caller's, which change without any call.
#[test]
fn points_of_a_buffer_are_those_of_a_cloud() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let gpu = backend.gpu().clone();
    let mut rng = fastrand::Rng::with_seed(2);
    let floor = sampled_plane(0.6, R, &mut rng).cloud(R);
    let mut ball = sampled_sphere(0.15, R).points;
    let radii: Vec<f32> = ball.iter().map(|_| R * (0.8 + 0.4 * rng.f32())).collect();
    let gather = |ball: &[Vec3]| -> Vec<[f32; 4]> {
        let points = ball.iter().zip(&radii);
        points.map(|(p, r)| [p.x, p.y, p.z, *r]).collect()
    };
    let points = buffer(&gpu, &gather(&ball));
    let on_device = backend
        .adopt(
            &points,
            DeviceCloud {
                id: 0,
                len: ball.len(),
                bounds: Aabb {
                    min: Vec3::splat(-0.2),
                    max: Vec3::splat(0.2),
                },
                mean_radius: R,
                max_radius: 1.2 * R,
            },
        )
        .expect("the buffer is valid");
    for frame in 0..3 {
        let host = PointCloud::builder(ball.clone())
            .radii(radii.clone())
            .build()
            .expect("valid points");
        assert!(matches!(host.radii(), Radii::PerPoint(_)));
        let query = |b| {
            let pose = Pose3::translation(0.02, 0.145, 0.03);
            aimed(Surface::Cloud(&floor), b, pose, Params::for_radius(R))
        };
        assert_like(
            &compared(&mut CpuBackend::new(), query(Surface::Cloud(&host))),
            &compared(&mut backend, query(Surface::Device(&on_device))),
        );
        for p in &mut ball {
            *p *= 1.0 + 0.02 * (frame + 1) as f32;
        }
        // A simulation writes the next frame.
        let next = buffer(&gpu, &gather(&ball));
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&next, 0, &points, 0, points.size());
        gpu.queue().submit([encoder.finish()]);
    }
    backend.release(on_device.id);
    let query = aimed(
        Surface::Cloud(&floor),
        Surface::Device(&on_device),
        Pose3::IDENTITY,
        Params::for_radius(R),
    );
    let error = backend
        .compare(&[query], &mut Vec::new())
        .expect_err("it is gone");
    assert!(error.to_string().contains("released"), "{error}");
}

/// A depth image, unprojected on the device, and on the host.
#[test]
fn a_depth_image_is_a_cloud() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let camera = DepthCamera {
        size: [161, 121],
        focal_px: [150.0, 148.0],
        principal_px: [80.0, 60.5],
        metres_per_unit: 0.001,
        range: [0.3, 100.0],
        radius_px: 2.0,
    };
    // A wall 2 m away that leans, with holes, and with what is out of range.
    let depth = |i: u32, j: u32| match (i + 3 * j) % 97 {
        0 => 0,
        1 => u16::MAX,
        2 => 200,
        _ => 1900 + i as u16 + (j / 2) as u16,
    };
    let pixels = (0..camera.size[1]).flat_map(|j| (0..camera.size[0]).map(move |i| (i, j)));
    let image: Vec<u16> = pixels.clone().map(|(i, j)| depth(i, j)).collect();
    let id = backend.add_depth_camera(camera).expect("a valid camera");
    let wall = backend.set_depth(id, &image).expect("a valid image");

    let unprojected = |image: &[u16]| {
        let (mut points, mut radii) = (vec![], vec![]);
        for ((i, j), units) in pixels.clone().zip(image) {
            let z = f32::from(*units) * camera.metres_per_unit;
            if *units != 0 && *units != u16::MAX && (0.3..=100.0).contains(&z) {
                let [x, y] = [
                    (i as f32 - camera.principal_px[0]) / camera.focal_px[0] * z,
                    (j as f32 - camera.principal_px[1]) / camera.focal_px[1] * z,
                ];
                points.push(Vec3::new(x, y, z));
                radii.push(camera.radius_px * z / camera.focal_px[0]);
            }
        }
        let host = PointCloud::builder(points).radii(radii).build();
        host.expect("valid points")
    };
    let host = unprojected(&image);
    assert!((wall.mean_radius / host.mean_radius() - 1.0).abs() < 1e-3);
    let ball = sampled_sphere(0.2, R).cloud(R);
    let query = |a, z| {
        let pose = Pose3::translation(0.1, -0.05, z);
        aimed(a, Surface::Cloud(&ball), pose, Params::for_radius(R))
    };
    assert_like(
        &compared(&mut CpuBackend::new(), query(Surface::Cloud(&host), 1.82)),
        &compared(&mut backend, query(Surface::Device(&wall), 1.82)),
    );
    // The next image, as if the wall were nearer: what was told of the last one is not true of it.
    let nearer: Vec<u16> = image.iter().map(|depth| depth / 2).collect();
    let next = backend.set_depth(id, &nearer).expect("a valid image");
    let refused = backend.compare(&[query(Surface::Device(&wall), 1.82)], &mut Vec::new());
    let error = refused.expect_err("it is gone").to_string();
    assert!(error.contains("last image"), "{error}");
    let host = unprojected(&nearer);
    assert_like(
        &compared(&mut CpuBackend::new(), query(Surface::Cloud(&host), 0.87)),
        &compared(&mut backend, query(Surface::Device(&next), 0.87)),
    );
    // The CPU cannot, and says so.
    let error = CpuBackend::new()
        .compare(&[query(Surface::Device(&wall), 1.82)], &mut Vec::new())
        .expect_err("the points are not here");
    assert!(
        matches!(error, BackendError::Unsupported { pair: 0, .. }),
        "{error}"
    );
}

/// Bad buffers, cameras and images are typed errors.
#[test]
fn bad_sources_are_refused() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let points = buffer(backend.gpu(), &[[0.0; 4]; 8]);
    let cloud = |len, mean_radius| DeviceCloud {
        id: 0,
        len,
        bounds: Aabb {
            min: Vec3::ZERO,
            max: Vec3::ONE,
        },
        mean_radius,
        max_radius: 0.1,
    };
    let endless = DeviceCloud {
        bounds: Aabb {
            min: Vec3::NEG_INFINITY,
            max: Vec3::INFINITY,
        },
        ..cloud(8, 0.1)
    };
    for bad in [
        cloud(9, 0.1),
        cloud(0, 0.1),
        cloud(8, f32::NAN),
        cloud(8, 0.2),
        endless,
    ] {
        let error = backend.adopt(&points, bad).expect_err("it makes no sense");
        assert!(matches!(error, GpuError::BadSource { .. }), "{error}");
    }
    let camera = DepthCamera {
        size: [4, 2],
        focal_px: [3.0; 2],
        principal_px: [2.0, 1.0],
        metres_per_unit: 0.001,
        range: [0.1, 4.0],
        radius_px: 0.9,
    };
    for bad in [
        DepthCamera {
            size: [0, 2],
            ..camera
        },
        DepthCamera {
            focal_px: [0.0, 1.0],
            ..camera
        },
        DepthCamera {
            range: [2.0, 1.0],
            ..camera
        },
        DepthCamera {
            radius_px: f32::INFINITY,
            ..camera
        },
    ] {
        let refused = backend.add_depth_camera(bad).err();
        assert!(
            matches!(refused, Some(GpuError::BadSource { .. })),
            "{bad:?}: {refused:?}"
        );
    }
    let id = backend.add_depth_camera(camera).expect("a valid camera");
    for bad in [&[1000; 7][..], &[0; 8], &[50; 8]] {
        let error = backend.set_depth(id, bad).expect_err("a bad image");
        assert!(matches!(error, GpuError::BadSource { .. }), "{error}");
    }
    let refused = backend.set_depth(7, &[1000; 8]).err();
    assert!(
        matches!(refused, Some(GpuError::BadSource { .. })),
        "{refused:?}"
    );
    assert!(backend.set_depth(id, &[1000; 8]).is_ok());
}

/// The points of a ball of 15 cm in a buffer, with a radius of `R`.
fn ball_points() -> Vec<[f32; 4]> {
    let points = sampled_sphere(0.15, R).points;
    points.iter().map(|p| p.extend(R).to_array()).collect()
}

/// Such points, taken by a backend.
fn adopted(backend: &mut WgpuBackend, points: &[[f32; 4]]) -> DeviceCloud {
    let told = DeviceCloud {
        id: 0,
        len: points.len(),
        bounds: Aabb {
            min: Vec3::splat(-0.2),
            max: Vec3::splat(0.2),
        },
        mean_radius: R,
        max_radius: R,
    };
    let adopted = backend.adopt(&buffer(backend.gpu(), points), told);
    adopted.expect("the buffer is valid")
}

fn on_floor<'a>(floor: &'a PointCloud<'a>, ball: &'a DeviceCloud) -> PairQuery<'a> {
    let pose = Pose3::translation(0.02, 0.145, 0.03);
    let (a, b) = (Surface::Cloud(floor), Surface::Device(ball));
    aimed(a, b, pose, Params::for_radius(R))
}

/// Points that are none, or have no radius, do not take part; those of larger radii than any point has do, with that.
#[test]
fn points_that_are_none_are_left_out() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let mut rng = fastrand::Rng::with_seed(2);
    let floor = sampled_plane(0.6, R, &mut rng).cloud(R);
    let sound = ball_points();
    let mut spoiled = sound.clone();
    for [x, y, z, radius] in &sound[..400] {
        spoiled.extend([
            [f32::NAN, *y, *z, *radius],
            [*x, f32::INFINITY, *z, *radius],
            [0.9 * x, 1.1 * y, *z, f32::NAN],
            [0.9 * x, 1.1 * y, *z, f32::INFINITY],
            [0.9 * x, 1.1 * y, *z, 0.0],
            [0.9 * x, 1.1 * y, *z, -R],
        ]);
    }
    for point in &mut spoiled[..sound.len()] {
        point[3] *= 3.0;
    }
    let [expected, found] = [sound, spoiled].map(|points| {
        let ball = adopted(&mut backend, &points);
        compared(&mut backend, on_floor(&floor, &ball))
    });
    assert!(expected.contacts.len() > 20, "{expected:?}");
    assert!(expected == found, "{expected:?} {found:?}");
}

/// What is asked about points of the device is checked as for those of the host, and so is what is told of them; the
/// device goes on.
#[test]
fn bad_queries_about_the_device_are_refused() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let mut rng = fastrand::Rng::with_seed(2);
    let floor = sampled_plane(0.6, R, &mut rng).cloud(R);
    let ball = adopted(&mut backend, &ball_points());
    let good = on_floor(&floor, &ball);
    let expected = compared(&mut backend, good);
    let changed = |change: &dyn Fn(&mut DeviceCloud)| {
        let mut changed = ball.clone();
        change(&mut changed);
        changed
    };
    let [longer, shorter, endless, unknown] = [
        changed(&|cloud| cloud.len += 1),
        changed(&|cloud| cloud.len -= 1),
        changed(&|cloud| cloud.bounds.max.x = f32::INFINITY),
        changed(&|cloud| cloud.id = 12),
    ];
    let mut camera = VirtualCamera::along(-Vec3::Y, R);
    camera.view_from_frame.translation.x = f32::NAN;
    let mut finer = good.params;
    finer.pixel_size = 1e-12;
    for (bad, expected) in [
        (on_floor(&floor, &longer), "adopted with"),
        (on_floor(&floor, &shorter), "adopted with"),
        (on_floor(&floor, &endless), "bounds"),
        (on_floor(&floor, &unknown), "released"),
        (
            PairQuery {
                a_from_b: Pose3::translation(f32::NAN, 0.0, 0.0),
                ..good
            },
            "a_from_b",
        ),
        (
            PairQuery {
                view: View::Fixed(camera),
                ..good
            },
            "view_from_frame",
        ),
        (
            PairQuery {
                params: finer,
                ..good
            },
            "pixel_size",
        ),
    ] {
        match backend.compare(&[good, bad], &mut Vec::new()) {
            Err(BackendError::Unsupported { pair: 1, reason }) => {
                assert!(reason.contains(expected), "{expected}: {reason}");
            }
            other => panic!("{expected}: {other:?}"),
        }
    }
    assert!(expected == compared(&mut backend, good));
}

/// What only the GPU can compare is its own, however small; a cloud that it does not have is no failure of it.
#[test]
fn small_batches_of_the_device_stay_there() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let mut rng = fastrand::Rng::with_seed(2);
    let floor = sampled_plane(0.6, R, &mut rng).cloud(R);
    let ball = adopted(&mut backend, &ball_points());
    let query = on_floor(&floor, &ball);
    let expected = compared(&mut backend, query);
    let released = adopted(&mut backend, &ball_points());
    backend.release(released.id);
    let mut auto = AutoBackend::with_gpu(backend, usize::MAX);
    for _ in 0..2 {
        let gone = auto.compare(&[on_floor(&floor, &released)], &mut Vec::new());
        let error = gone.expect_err("it is gone").to_string();
        assert!(error.contains("released"), "{error}");
        assert!(compare_on(&mut auto, &[query])[0] == expected);
        assert_eq!((auto.name(), auto.fallback()), ("gpu", None));
    }
}
