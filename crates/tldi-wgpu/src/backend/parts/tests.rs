use super::*;
use crate::counters::Counters;
use crate::testing;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Params, PointCloud, Surface, View};

const R: f32 = 0.05;

/// Flat sheets of `edge` points a side, one above the other by the shares of `R`.
fn sheet(edge: usize) -> PointCloud<'static> {
    let position = |i: usize| Vec3::new((i % edge) as f32, 0.0, (i / edge) as f32) * R;
    let positions: Vec<Vec3> = (0..edge * edge).map(position).collect();
    let built = PointCloud::builder(positions).radius(R).build();
    built.expect("the points are valid")
}

fn queries<'a>(sheet: &'a PointCloud<'static>, pairs: usize) -> Vec<PairQuery<'a>> {
    let query = |k: usize| PairQuery {
        a: Surface::Cloud(sheet),
        b: Surface::Cloud(sheet),
        a_from_b: Pose3::translation(0.0, R * (k + 1) as f32 / (pairs + 1) as f32, 0.0),
        view: View::aimed(),
        params: Params::for_radius(R),
    };
    (0..pairs).map(query).collect()
}

fn compared(backend: &mut WgpuBackend, batch: &[PairQuery<'_>]) -> Vec<PairResult> {
    let mut results = Vec::new();
    let outcome = backend.compare(batch, &mut results);
    outcome.expect("nothing fails");
    results
}

/// A batch with more splats than fragments can number is compared in parts, with the same
/// results; a pair that alone has more is the CPU's, and the next batch the device's again.
#[test]
fn batches_with_too_many_splats_are_halved() {
    let Some(gpu) = testing::open() else {
        return;
    };
    let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
    let (small, large) = (sheet(40), sheet(80));
    let mut batch = queries(&small, 7);
    let whole = compared(&mut backend, &batch);
    let of_batch = backend.last.splats;
    // As if a fragment had room for the numbers of two pairs' splats only.
    let most = Counters {
        splats: of_batch / 3,
        ..backend.most
    };
    backend.most = most;
    backend.capacities = backend.capacities.min(&most);
    assert_eq!(whole, compared(&mut backend, &batch));
    assert_eq!(backend.pairs_on_cpu(), 0);
    assert!(backend.capacities.splats <= most.splats);

    batch[3] = queries(&large, 1)[0];
    let results = compared(&mut backend, &batch);
    assert_eq!(backend.pairs_on_cpu(), 1);
    let mut on_cpu = Vec::new();
    let outcome = tldi::CpuBackend::new().compare(&batch[3..4], &mut on_cpu);
    outcome.expect("the CPU takes it");
    assert_eq!(results[3], on_cpu[0]);
    assert_eq!((&results[..3], &results[4..]), (&whole[..3], &whole[4..]));

    batch.remove(3);
    compared(&mut backend, &batch);
    assert_eq!(backend.pairs_on_cpu(), 0);
}

/// A batch is not answered where a dropped one still is. Which of both would be read depends on when the device is
/// asked; a driver that ends one submission before it takes the next seldom shows it.
#[test]
fn a_dropped_batch_takes_its_readback_with_it() {
    let Some(gpu) = testing::open() else {
        return;
    };
    let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
    let small = sheet(40);
    let batch = queries(&small, 3);
    let readback = |backend: &mut WgpuBackend| {
        drop(backend.begin(&batch).expect("it is submitted"));
        backend.buffers.readback.get().cloned()
    };
    let of_dropped = readback(&mut backend);
    assert!(of_dropped.is_some() && of_dropped != readback(&mut backend));
    // Batches that end keep it.
    compared(&mut backend, &batch);
    let kept = backend.buffers.readback.get().cloned();
    compared(&mut backend, &batch);
    assert_eq!(backend.buffers.readback.get(), kept.as_ref());
}

/// What earlier batches needed does not keep a batch from the device.
#[test]
fn a_batch_does_not_suffer_from_earlier_ones() {
    let Some(gpu) = testing::open() else {
        return;
    };
    let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
    let small = sheet(40);
    let batch = queries(&small, 2);
    let cold = compared(&mut backend, &batch);
    // Contacts share a buffer with the pairs: there is room for either.
    backend.capacities.contacts = backend.most.contacts;
    assert_eq!(cold, compared(&mut backend, &batch));
    assert_eq!(backend.pairs_on_cpu(), 0);
}

/// A pair that is too large, and whose points only the device has, is refused by its place in the
/// batch, and the device goes on; so is one that neither takes.
#[test]
fn points_of_the_device_are_not_left_to_the_cpu() {
    let Some(gpu) = testing::open() else {
        return;
    };
    let mut backend = WgpuBackend::new(gpu.clone()).expect("the stages fit");
    let (small, large) = (sheet(40), sheet(80));
    let points: Vec<[f32; 4]> = large
        .points()
        .iter()
        .map(|p| p.extend(R).to_array())
        .collect();
    let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    let bytes: &[u8] = bytemuck::cast_slice(&points);
    let buffer = crate::buffers::create(&gpu, "points", usage, bytes.len() as u64);
    let buffer = buffer.expect("there is room");
    gpu.queue.write_buffer(&buffer, 0, bytes);
    let told = tldi::DeviceCloud {
        id: 0,
        len: points.len(),
        bounds: large.bounds(),
        mean_radius: R,
        max_radius: R,
    };
    let on_device = backend.adopt(&buffer, told).expect("it is valid");
    let mut batch = queries(&small, 3);
    batch[2] = PairQuery {
        b: Surface::Device(&on_device),
        ..queries(&large, 1)[0]
    };
    compared(&mut backend, &batch);
    assert_eq!(backend.pairs_on_cpu(), 0);
    let whole = compared(&mut backend, &batch[..2]);
    let of_two = backend.last.splats;

    let refused = |backend: &mut WgpuBackend, batch: &[PairQuery<'_>]| match backend
        .compare(batch, &mut Vec::new())
    {
        Err(BackendError::Unsupported { pair, reason }) => (pair, reason),
        other => panic!("{other:?}"),
    };
    let neither = PairQuery {
        params: Params::paper(R),
        ..batch[2]
    };
    assert_eq!(refused(&mut backend, &[batch[0], neither]).0, 1);
    // Half of what the large pair has.
    backend.most.splats = of_two;
    backend.capacities = backend.capacities.min(&backend.most);
    let (pair, reason) = refused(&mut backend, &batch);
    assert_eq!(pair, 2);
    assert!(reason.contains("larger buffers"), "{reason}");
    assert_eq!(whole, compared(&mut backend, &batch[..2]));
}

/// A pair whose first try was too small stays on the device: what it needs fits, though twice of it does not.
#[test]
fn a_redo_asks_for_no_more_than_it_needs() {
    let Some(gpu) = testing::open_small(1 << 20) else {
        return;
    };
    let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
    let step = 8.0 * R / 1.2;
    let at = |i: usize| Vec3::new((i % 27) as f32, 0.0, (i / 27) as f32) * step;
    let points: Vec<Vec3> = (0..27 * 27).map(at).collect();
    let normals = vec![Vec3::Y; points.len()];
    let cloud = PointCloud::builder(points).radius(R).normals(normals);
    let cloud = cloud.build().expect("the points are valid");
    let batch = [PairQuery {
        a_from_b: Pose3::translation(0.0, 0.5 * R, 0.0),
        params: Params::for_radius(R).with_pixel_size(R / 1.2),
        ..queries(&cloud, 1)[0]
    }];
    compared(&mut backend, &batch);
    assert_eq!(backend.pairs_on_cpu(), 0);
    assert!(backend.traffic().redos > 0, "the test shows nothing");
}

/// Two backends of one device do not take each other's points.
#[test]
fn points_are_those_of_one_backend() {
    let Some(gpu) = testing::open() else {
        return;
    };
    let points: Vec<[f32; 4]> = vec![[0.0, 0.0, 0.0, R]; 8];
    let bytes: &[u8] = bytemuck::cast_slice(&points);
    let buffer = crate::buffers::create(
        &gpu,
        "points",
        wgpu::BufferUsages::COPY_SRC,
        bytes.len() as u64,
    );
    let buffer = buffer.expect("there is room");
    let small = sheet(4);
    let told = tldi::DeviceCloud {
        id: 0,
        len: points.len(),
        bounds: small.bounds(),
        mean_radius: R,
        max_radius: R,
    };
    let mut backends = [0, 1].map(|_| WgpuBackend::new(gpu.clone()).expect("the stages fit"));
    let clouds =
        (backends.each_mut()).map(|b| b.adopt(&buffer, told.clone()).expect("it is valid"));
    let query = PairQuery {
        b: Surface::Device(&clouds[0]),
        ..queries(&small, 1)[0]
    };
    let refused = backends[1].compare(&[query], &mut Vec::new());
    assert!(
        matches!(refused, Err(BackendError::Unsupported { pair: 0, .. })),
        "{refused:?}"
    );
}
