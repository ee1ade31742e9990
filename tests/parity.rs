//! The GPU backend gives the results of the CPU backend, whatever becomes of the GPU.
//!
//! Both round products and sums differently (a GPU may fuse them), so that a point within rounding
//! of a pixel's border may fall to either side. Bounds are in mean radii, and how many pixels differ
//! is counted.

use tldi::glamx::{Pose3, Rot3, Vec3};
use tldi::{
    Backend, CameraPolicy, CpuBackend, PairQuery, PairResult, Params, PointCloud, Surface, View,
    VirtualCamera,
};
use tldi_tests::{
    Difference, HalfSpace, PARITY_RADIUS, aimed, aimed_clouds, compare_on, gpu_backend,
    pair_queries, random_pairs, random_unit, sampled_plane, sampled_sphere,
};
use tldi_wgpu::{AdapterChoice, AutoBackend, Gpu, WgpuBackend, wgpu};

const R: f32 = PARITY_RADIUS;

/// As a GPU does it: with small pixels only.
fn on_cpu(batch: &[PairQuery<'_>]) -> Vec<PairResult> {
    compare_on(&mut CpuBackend::without_first_look(), batch)
}

/// As the CPU does it by itself.
fn by_default(batch: &[PairQuery<'_>]) -> Vec<PairResult> {
    compare_on(&mut CpuBackend::new(), batch)
}

/// Clouds much finer than the pixels, of which both take the same points.
#[test]
fn thinned_clouds_are_those_of_the_cpu() {
    let Some(mut gpu) = gpu_backend() else { return };
    let pairs = random_pairs(200..220);
    let mut batch = pair_queries(&pairs);
    for query in &mut batch {
        // Every third point.
        query.params = Params::for_radius(5.5 * R);
    }
    let all = Difference::between(&on_cpu(&batch), &compare_on(&mut gpu, &batch));
    assert!(all.answers == 0 && all.contacts > 200, "{all:?}");
    assert!(100 * all.other_contacts <= all.contacts, "{all:?}");
}

/// A ball of so many points that those around one are represented by a selection: it is even. Its normals are those of
/// the ball, and the same every time, although points come in any order.
#[test]
fn crowds_are_represented_evenly() {
    let Some(mut gpu) = gpu_backend() else { return };
    // 36 points in a square of a radius: 1,000 within the neighbourhood's radius of 3 R, and 2,900 in the cells that hold it.
    let middle = Vec3::new(0.0, 10.0 * R, 0.0);
    let ball = sampled_sphere(10.0 * R, R / 6.0).bare_cloud(R);
    let mut rng = fastrand::Rng::with_seed(12);
    let floor = sampled_plane(0.5, R, &mut rng).cloud(R);
    let query = aimed_clouds(
        &floor,
        &ball,
        Pose3::from_translation(middle - 0.2 * R * Vec3::Y),
        R,
    );
    let found = compare_on(&mut gpu, &[query]);
    for _ in 0..3 {
        assert_eq!(found, compare_on(&mut gpu, &[query]));
    }
    let middle = middle - 0.2 * R * Vec3::Y;
    let normals = found[0].contacts.iter().map(|contact| {
        let truth = (contact.point_b - middle).normalize();
        contact.normal_b.normalize().dot(truth).min(1.0).acos()
    });
    let angles: Vec<f32> = normals.collect();
    let mean = angles.iter().sum::<f32>() / angles.len() as f32;
    let worst = angles.iter().copied().fold(0.0, f32::max);
    eprintln!("{} pixels, mean {mean}, worst {worst}", angles.len());
    assert!(angles.len() > 20, "{}", angles.len());
    assert!(mean < 0.03, "{mean}");
}

/// Whole pairs of all kinds, in one batch; of seeds on which nothing was tuned, too.
///
/// Estimated normals differ by about 0.0005, since neighbours' offsets are summed in steps of 1/2047 of their distance. An
/// axis differs by as much where one direction has most of the normals' variance. Where two have nearly as much, as at an
/// edge of a box, it differs by as many times more as their shares are alike: of these 480 pairs two, by 0.0055 and 0.0096.
/// What such views show is compared by the least gap.
#[test]
fn contacts_are_those_of_the_cpu() {
    let Some(mut gpu) = gpu_backend() else { return };
    for seeds in [0..120, 9000..9120, 20_000..20_120, 30_000..30_120] {
        let pairs = random_pairs(seeds.clone());
        let batch = pair_queries(&pairs);
        let found = Difference::between(&on_cpu(&batch), &compare_on(&mut gpu, &batch));
        let told = format!("{seeds:?}: {found:?}");
        assert!(found.pairs == 120 && found.contacts > 10_000, "{told}");
        // A swap of two surfaces within rounding of each other may be seen by one only.
        assert!(found.answers <= 1, "{told}");
        // Twice what was seen.
        assert!(found.turned <= 2 && found.axis < 0.02, "{told}");
        // Of pixels whose centre is within rounding of a splat's rim, or that one splat more or less tips to the other side
        // of an edge. Seen: 0.15 % of the pixels, and 0.019 mean radii.
        assert!(found.other_contacts * 100 < found.contacts, "{told}");
        // Where a single link decides whether deep pixels continue others at which the surfaces are apart, one may take them
        // for proven and the other not. Seen: one of these 480 pairs, by 0.10.
        let apart = found.gaps.iter().filter(|gap| **gap >= 0.05).count();
        assert!(apart <= 1 && found.gap < 0.2, "{told}");
    }
}

/// With given normals, one given view along an axis of the frame, and coordinates and pixels that
/// are powers of two, nothing is rounded before the layers: pixels are equal, one by one.
#[test]
fn pixels_are_equal_where_nothing_is_rounded() {
    let Some(mut gpu) = gpu_backend() else { return };
    let pixel = 1.0 / 64.0;
    for seed in 0..12 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut cloud = |height: f32, normal: Vec3| {
            let mut at = || (rng.u32(0..256) as f32 - 128.0) / 256.0;
            let position = |_| Vec3::new(at(), at(), height + at() / 16.0);
            let points: Vec<Vec3> = (0..3000).map(position).collect();
            let normals = vec![normal; points.len()];
            let builder = PointCloud::builder(points).radius(pixel).normals(normals);
            builder.build().expect("the points are valid")
        };
        let (a, b) = (cloud(0.0, Vec3::Z), cloud(0.03, -Vec3::Z));
        let mut camera = VirtualCamera::along(-Vec3::Z, pixel);
        camera.view_from_frame.rotation = tldi::glamx::Quat::from_rotation_x(std::f32::consts::PI);
        let query = PairQuery {
            view: View::Fixed(camera),
            ..aimed_clouds(&a, &b, Pose3::IDENTITY, pixel)
        };
        let (cpu, gpu) = (on_cpu(&[query]), compare_on(&mut gpu, &[query]));
        let pixels = |result: &PairResult| -> Vec<_> {
            let contacts = result.contacts.iter();
            contacts.map(|c| (c.view, c.pixel)).collect()
        };
        assert!(cpu[0].contacts.len() > 1000, "{}", cpu[0].contacts.len());
        assert_eq!(pixels(&cpu[0]), pixels(&gpu[0]), "seed {seed}");
        assert_eq!(cpu[0].collides, gpu[0].collides, "seed {seed}");
        for (c, g) in cpu[0].contacts.iter().zip(&gpu[0].contacts) {
            // Layers' depths are quotients of integers: a unit in the last place of a metre.
            assert!((c.gap - g.gap).abs() < 1e-6, "seed {seed}: {c:?} {g:?}");
        }
    }
}

/// All camera policies, with motion and memory.
#[test]
fn policies_are_those_of_the_cpu() {
    let Some(mut gpu) = gpu_backend() else { return };
    let pairs = random_pairs(200..230);
    for policy in [
        CameraPolicy::ContactZone,
        CameraPolicy::AllDirections,
        CameraPolicy::Motion,
        CameraPolicy::Covariance,
        CameraPolicy::SmallestExtent,
        CameraPolicy::LastNormal,
    ] {
        let mut rng = fastrand::Rng::with_seed(7);
        let batch: Vec<PairQuery> = pair_queries(&pairs)
            .into_iter()
            .map(|query| PairQuery {
                view: View::Aim {
                    policy,
                    motion: 0.05 * random_unit(&mut rng),
                    last_axis: rng.bool().then(|| random_unit(&mut rng)),
                },
                ..query
            })
            .collect();
        let found = Difference::between(&on_cpu(&batch), &compare_on(&mut gpu, &batch));
        eprintln!("{policy:?} {found:?}");
        assert!(found.answers <= 1, "{policy:?} {found:?}");
        assert!(found.axis < 2e-3, "{policy:?} {found:?}");
        assert!(
            found.other_contacts * 50 < found.contacts,
            "{policy:?} {found:?}"
        );
    }
}

/// Atomics come in any order; results do not depend on it, nor on what else is in the batch, nor on
/// what was compared before.
#[test]
fn results_are_the_same_every_time() {
    let Some(mut gpu) = gpu_backend() else { return };
    let pairs = random_pairs(300..316);
    let batch = pair_queries(&pairs);
    let first = compare_on(&mut gpu, &batch);
    assert_eq!(first, compare_on(&mut gpu, &batch));
    for (query, expected) in batch.iter().zip(&first) {
        assert_eq!(expected, &compare_on(&mut gpu, &[*query])[0]);
    }
}

/// Buffers that are too small for a batch are found out, grown, and the batch is redone.
#[test]
fn batches_that_outgrow_the_buffers_are_redone() {
    let Some(gpu) = gpu_backend() else { return };
    let mut rng = fastrand::Rng::with_seed(5);
    let sheet = |rng: &mut fastrand::Rng| sampled_plane(1.0, 0.004, rng).cloud(0.004);
    let (a, b) = (sheet(&mut rng), sheet(&mut rng));
    let query = aimed_clouds(&a, &b, Pose3::translation(0.0, 0.002, 0.0), 0.004);
    // Cold, with the least buffers: 62,500 points a side, as many pixels, three times the contacts
    // that fit at first.
    let mut cold = WgpuBackend::new(gpu.gpu().clone()).expect("there is a device");
    let (cpu, gpu) = (on_cpu(&[query]), compare_on(&mut cold, &[query]));
    assert!(cpu[0].contacts.len() > 50_000, "{}", cpu[0].contacts.len());
    let missing = cpu[0].contacts.len().abs_diff(gpu[0].contacts.len());
    assert!(missing * 1000 < cpu[0].contacts.len(), "{missing}");
}

/// Exact surfaces and pixels with thousands of fragments are the CPU's, in the same batch.
#[test]
fn what_the_gpu_does_not_take_the_cpu_compares() {
    let Some(mut backend) = gpu_backend() else {
        return;
    };
    let mut rng = fastrand::Rng::with_seed(3);
    let plain = sampled_plane(0.5, R, &mut rng).cloud(R);
    let ball = sampled_sphere(0.2, R).cloud(R);
    // All at one place, seen from above: a stack of 4000 points in one pixel.
    let stack: Vec<Vec3> = (0..4000)
        .map(|k| Vec3::new(0.0, 1e-4 * k as f32, 0.0))
        .collect();
    let stack = PointCloud::builder(stack)
        .radius(R)
        .normals(vec![Vec3::X; 4000])
        .build()
        .expect("the points are valid");
    let above = |b| {
        let pose = Pose3::translation(0.01, 0.19, 0.0);
        aimed(Surface::Cloud(&plain), b, pose, Params::for_radius(R))
    };
    let mut camera = VirtualCamera::along(-Vec3::Y, R);
    camera.size = None;
    let crowded = PairQuery {
        view: View::Fixed(camera),
        a_from_b: Pose3::translation(0.0, -0.2, 0.0),
        ..above(Surface::Cloud(&stack))
    };
    let paper = PairQuery {
        params: Params::paper(R),
        ..above(Surface::Cloud(&ball))
    };
    let exact = above(Surface::Exact(&HalfSpace));
    let batch = [crowded, above(Surface::Cloud(&ball)), paper, exact];
    let (cpu, gpu) = (on_cpu(&batch), compare_on(&mut backend, &batch));
    assert_eq!(backend.pairs_on_cpu(), 3);
    assert_eq!(cpu[0], gpu[0]);
    assert_eq!(cpu[2], gpu[2]);
    assert!(!cpu[1].contacts.is_empty());
    assert_eq!(cpu[1].contacts.len(), gpu[1].contacts.len());
}

/// New points are uploaded, and old ones are not mistaken for them.
#[test]
fn clouds_follow_their_points() {
    let Some(mut gpu) = gpu_backend() else { return };
    let mut rng = fastrand::Rng::with_seed(9);
    let floor = sampled_plane(0.5, R, &mut rng).cloud(R);
    let mut ball = sampled_sphere(0.2, R).bare_cloud(R).into_owned();
    for frame in 0..12 {
        let height = 0.2 + 0.05 * (frame as f32).sin();
        let samples = sampled_sphere(0.15 + 0.005 * frame as f32, R);
        ball.set_points(&samples.points, None)
            .expect("valid points");
        let query = aimed_clouds(&floor, &ball, Pose3::translation(0.0, height, 0.0), R);
        let found = Difference::between(&on_cpu(&[query]), &compare_on(&mut gpu, &[query]));
        assert!(found.answers == 0 && found.gap < 0.05, "{frame}: {found:?}");
    }
}

/// A device that is lost fails with an error that says so; under `AutoBackend` the batch is
/// finished on the CPU.
#[test]
fn a_lost_device_loses_nothing() {
    let Some(shared) = gpu_backend() else {
        return;
    };
    drop(shared);
    let pairs = random_pairs(400..404);
    let batch = pair_queries(&pairs);
    let open = || Gpu::open(AdapterChoice::Any).and_then(WgpuBackend::new);
    let mut alone = open().expect("there is a device");
    let before = compare_on(&mut alone, &batch);
    alone.gpu().device().destroy();
    let error = alone
        .compare(&batch, &mut Vec::new())
        .expect_err("it is lost");
    assert!(error.to_string().contains("failed"), "{error}");

    let gpu = open().expect("there is a device");
    let device = gpu.gpu().device().clone();
    let mut auto = AutoBackend::with_gpu(gpu, 0);
    assert_eq!(before, compare_on(&mut auto, &batch));
    assert_eq!((auto.name(), auto.fallback()), ("gpu", None));
    device.destroy();
    assert_eq!(by_default(&batch), compare_on(&mut auto, &batch));
    assert_eq!((auto.name(), auto.adapter()), ("cpu", None));
    assert!(
        auto.fallback()
            .is_some_and(|reason| reason.contains("failed"))
    );
}

/// Small batches are the CPU's.
#[test]
fn small_batches_stay_on_the_cpu() {
    let Some(gpu) = gpu_backend() else { return };
    let pairs = random_pairs(500..502);
    let batch = pair_queries(&pairs);
    let mut auto = AutoBackend::with_gpu(gpu, 1_000_000);
    assert_eq!(by_default(&batch), compare_on(&mut auto, &batch));
    assert_eq!((auto.name(), auto.fallback()), ("cpu", None));
}

/// The frame of a view follows its axis, whatever the signs of its zeros.
#[test]
fn views_along_the_axes_have_the_frames_of_the_cpu() {
    let Some(mut gpu) = gpu_backend() else { return };
    let mut rng = fastrand::Rng::with_seed(11);
    let (a, b) = (
        sampled_plane(0.3, R, &mut rng).bare_cloud(R),
        sampled_sphere(0.1, R).bare_cloud(R),
    );
    let axes = [-1.0, -0.0, 0.0, 1.0];
    for axis in axes
        .map(|x| axes.map(|y| axes.map(|z| Vec3::new(x, y, z))))
        .into_iter()
        .flatten()
        .flatten()
    {
        let query = PairQuery {
            view: View::Aim {
                policy: CameraPolicy::LastNormal,
                motion: Vec3::ZERO,
                last_axis: Some(axis),
            },
            ..aimed_clouds(&a, &b, Pose3::translation(0.0, 0.1, 0.0), R)
        };
        let found = Difference::between(&on_cpu(&[query]), &compare_on(&mut gpu, &[query]));
        assert!(
            found.answers == 0 && found.turned == 0 && found.other_contacts <= 2,
            "{axis}: {found:?}"
        );
    }
}

/// What the CPU refuses, the GPU does, by the same words and the place in the batch.
#[test]
fn bad_queries_are_refused_as_by_the_cpu() {
    let Some(mut gpu) = gpu_backend() else { return };
    let pairs = random_pairs(700..702);
    let good = pair_queries(&pairs);
    let moving = |motion| View::Aim {
        policy: CameraPolicy::ContactZone,
        motion,
        last_axis: None,
    };
    for bad in [
        PairQuery {
            view: moving(Vec3::splat(f32::NAN)),
            ..good[1]
        },
        PairQuery {
            a_from_b: Pose3::translation(f32::INFINITY, 0.0, 0.0),
            ..good[1]
        },
        PairQuery {
            a_from_b: Pose3::from_rotation(Rot3::from_xyzw(0.0, 0.0, 0.0, 1.001)),
            ..good[1]
        },
        PairQuery {
            view: View::Fixed(VirtualCamera {
                size: Some([0, 8]),
                ..VirtualCamera::along(Vec3::Z, good[1].params.pixel_size)
            }),
            ..good[1]
        },
    ] {
        let refused = |backend: &mut dyn Backend| {
            let outcome = backend.compare(&[good[0], bad], &mut Vec::new());
            outcome.expect_err("it is no query").to_string()
        };
        assert_eq!(refused(&mut CpuBackend::new()), refused(&mut gpu));
    }
}

/// A backend on a device that allows so many bytes in a buffer.
fn small_device(bytes: u64) -> WgpuBackend {
    let limits = wgpu::Limits {
        max_storage_buffer_binding_size: bytes,
        ..wgpu::Limits::default()
    };
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let instance = wgpu::Instance::new(descriptor);
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))
        .expect("there is an adapter");
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_limits: limits,
        ..Default::default()
    }))
    .expect("there is a device");
    WgpuBackend::new(Gpu::shared(device, queue)).expect("the stages fit")
}

/// A device that has no room for a batch takes it in parts, down to a pair; a pair that is too large
/// by itself is the CPU's in that batch only.
#[test]
fn a_device_without_room_for_a_batch_takes_it_in_parts() {
    let Some(mut large) = gpu_backend() else {
        return;
    };
    let pairs = random_pairs(600..648);
    let mut batch = pair_queries(&pairs);
    let whole = compare_on(&mut large, &batch);
    assert_eq!(large.pairs_on_cpu(), 0);
    // Four megabytes a buffer: enough for any of these pairs, and less than all of them need.
    let mut auto = AutoBackend::with_gpu(small_device(1 << 22), 0);
    assert_eq!(whole, compare_on(&mut auto, &batch));
    assert_eq!((auto.name(), auto.fallback()), ("gpu", None));
    let mut small = small_device(1 << 22);
    assert_eq!(whole, compare_on(&mut small, &batch));
    assert_eq!(small.pairs_on_cpu(), 0);

    // 90,000 points a side, all in reach, of 32 bytes each: more than four megabytes.
    let mut rng = fastrand::Rng::with_seed(8);
    let sheet = sampled_plane(1.2, 0.004, &mut rng).cloud(0.004);
    let too_large = aimed_clouds(&sheet, &sheet, Pose3::translation(0.0, 0.002, 0.0), 0.004);
    batch.push(too_large);
    let results = compare_on(&mut small, &batch);
    assert_eq!(small.pairs_on_cpu(), 1);
    assert_eq!(results[48], by_default(&[too_large])[0]);
    assert_eq!(results[..48], whole);
    batch.pop();
    assert_eq!(whole, compare_on(&mut small, &batch));
    assert_eq!(small.pairs_on_cpu(), 0);
}
