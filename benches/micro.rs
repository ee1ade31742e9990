//! Times of the CPU's stages, as far as they can be called apart: clouds, images, casts, sweeps, whole
//! comparisons, also with rapier's meshes, and a surface that pushes a body.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rapier3d::parry::query::{NonlinearRigidMotion, QueryDispatcher};
use rapier3d::prelude::*;
use rapier3d_tldi::ExactShape;
use rapier3d_tldi::prelude::{PointCloudShape, TldiConfig, TldiPipeline, sample_shape};
use std::hint::black_box;
use std::time::Duration;
use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Backend, CpuBackend, ImpactQuery, PairQuery, PairResult, Params, PointCloud, Surface,
    VirtualCamera, build,
};
use tldi_benches::placements::{Placement, Source};
use tldi_benches::threads::workers;
use tldi_benches::{SHEET_EDGE, bumpy_sheet};
use tldi_tests::{HalfSpace, aimed};

/// Points of each cloud.
const POINTS: [usize; 2] = [10_000, 100_000];

fn body(points: usize) -> (Vec<Vec3>, f32) {
    let source = Source::Generated(points);
    (source.points(1), radius_of(&source, Placement::Coincident))
}

fn radius_of(source: &Source, placement: Placement) -> f32 {
    let radius = source.radius(placement);
    radius.expect("a generated body has a radius")
}

fn cloud_of(points: &[Vec3], radius: f32) -> PointCloud<'static> {
    let cloud = PointCloud::builder(points.to_vec()).radius(radius).build();
    cloud.expect("the points are finite")
}

/// From points to a cloud.
fn clouds(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("cloud");
    for count in POINTS {
        group.throughput(Throughput::Elements(count as u64));
        let (points, radius) = body(count);
        let id = |name| BenchmarkId::new(name, count);
        let mut warm = cloud_of(&points, radius);
        group.bench_function(id("new points, one radius"), |b| {
            b.iter(|| warm.set_points(black_box(&points), None));
        });
        group.bench_function(id("radii of 7 neighbours"), |b| {
            b.iter(|| PointCloud::builder(&points).knn_radii(7, 0.65).build());
        });
        group.bench_function(id("normals of 16 neighbours"), |b| {
            let builder = || PointCloud::builder(&points).radius(radius);
            b.iter(|| builder().pca_normals(16).build());
        });
    }
    group.finish();
}

/// From a whole cloud to an image of layers.
fn images(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("image of a whole cloud");
    for count in POINTS {
        group.throughput(Throughput::Elements(count as u64));
        let (points, radius) = body(count);
        let cloud = cloud_of(&points, radius);
        let camera = VirtualCamera::along(Vec3::X, radius);
        for (name, params) in [
            ("default", Params::for_radius(radius)),
            ("paper", Params::paper(radius)),
        ] {
            group.bench_function(BenchmarkId::new(name, count), |b| {
                b.iter(|| build(black_box(&cloud), &Pose3::IDENTITY, &camera, &params));
            });
        }
    }
    group.finish();
}

fn query<'a>(a: Surface<'a>, b: &'a PointCloud, pose: Pose3, radius: f32) -> PairQuery<'a> {
    aimed(a, Surface::Cloud(b), pose, Params::for_radius(radius))
}

/// Whole comparisons with warm memory.
fn comparisons(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("compare");
    let (mut backend, mut results) = (CpuBackend::new(), Vec::<PairResult>::new());
    let mut compare = |query: PairQuery| {
        let outcome = backend.compare(&[query], &mut results);
        outcome.expect("the pair is supported");
    };
    for count in POINTS {
        let (points, radius) = body(count);
        for placement in Placement::ALL {
            let source = Source::Generated(count);
            let radius = radius_of(&source, placement);
            let bodies = source.bodies(placement, radius, 1);
            let [a, b] = bodies.map(|points| cloud_of(&points, radius));
            let query = query(Surface::Cloud(&a), &b, Pose3::IDENTITY, radius);
            group.bench_function(BenchmarkId::new(placement.name(), count), |bench| {
                bench.iter(|| compare(query));
            });
        }
        // The bumpy ball, 2 radii deep in the ground: its image against cast rays.
        let ball = cloud_of(&points, radius);
        let up = Pose3::translation(0.0, -ball.bounds().min.y - 2.0 * radius, 0.0);
        let query = query(Surface::Exact(&HalfSpace), &ball, up, radius);
        group.bench_function(BenchmarkId::new("exact half-space", count), |bench| {
            bench.iter(|| compare(query));
        });
    }
    group.finish();
}

/// A ball of points in a bowl of each kind that rapier has, and in one of points.
fn bowls(criterion: &mut Criterion) {
    const CELLS: usize = 56;
    let mut group = criterion.benchmark_group("ball of 3,000 points in a bowl of 6,272 triangles");
    let height = |i: usize, j: usize| {
        let [x, z] = [i, j].map(|k| 4.0 * (k as f32 / CELLS as f32 - 0.5));
        0.15 * (x * x + z * z)
    };
    let places = (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| height(i, j)));
    let heights = Array2::new(CELLS + 1, CELLS + 1, places.collect());
    let field = HeightField::new(heights, Vec3::new(4.0, 1.0, 4.0));
    let (vertices, triangles) = field.to_trimesh();
    let mesh = TriMesh::new(vertices, triangles).expect("has triangles");
    let spacing = 0.02;
    let sampled = sample_shape(&mesh, spacing).expect("has a surface");
    let ball = sample_shape(&Ball::new(0.3), spacing).expect("has a surface");
    let up = Pose3::translation(0.0, 0.3 - 0.1 * spacing, 0.0);
    let (mut backend, mut results) = (CpuBackend::new(), Vec::<PairResult>::new());
    for (name, bowl) in [
        ("triangle mesh", Surface::Exact(&ExactShape(&mesh))),
        ("height field", Surface::Exact(&ExactShape(&field))),
        ("sampled points", Surface::Cloud(&sampled)),
    ] {
        let query = query(bowl, &ball, up, ball.mean_radius());
        group.bench_function(name, |bench| {
            bench.iter(|| backend.compare(&[query], &mut results));
        });
        // None where a filter left them out.
        let mut gaps = results.iter().map(|result| result.gap);
        assert!(
            gaps.all(|gap| gap.is_some_and(|gap| gap < 0.0)),
            "they touch"
        );
    }
    group.finish();
}

/// Sixteen pairs at once, on one worker and on one a core.
fn batches(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("batch of 16 pairs");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (mut backend, mut results) = (CpuBackend::new(), Vec::<PairResult>::new());
    for placement in Placement::ALL {
        let source = Source::Generated(POINTS[0]);
        let radius = radius_of(&source, placement);
        let clouds: Vec<[PointCloud; 2]> = (0..16)
            .map(|seed| source.bodies(placement, radius, seed))
            .map(|bodies| bodies.map(|points| cloud_of(&points, radius)))
            .collect();
        let queries: Vec<PairQuery> = (clouds.iter())
            .map(|[a, b]| query(Surface::Cloud(a), b, Pose3::IDENTITY, radius))
            .collect();
        for count in [1, cores] {
            let workers = workers(count).expect("threads can be started");
            group.bench_function(BenchmarkId::new(placement.name(), count), |bench| {
                workers.install(|| {
                    bench.iter(|| {
                        let outcome = backend.compare(&queries, &mut results);
                        outcome.expect("the pairs are supported");
                    });
                });
            });
        }
    }
    group.finish();
}

/// Straight casts of a cloud onto another.
fn casts(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("cast");
    let backend = CpuBackend::new();
    for count in POINTS {
        let (points, radius) = body(count);
        let cloud = cloud_of(&points, radius);
        let query = ImpactQuery {
            a: Surface::Cloud(&cloud),
            b: Surface::Cloud(&cloud),
            a_from_b: Pose3::translation(3.0, 0.0, 0.0),
            motion: -2.0 * Vec3::X,
            touching: 0.0,
            core_only: false,
            penetration: None,
            turned: &[],
            params: Params::for_radius(radius),
        };
        group.bench_function(BenchmarkId::new("head on", count), |b| {
            b.iter(|| backend.impact(black_box(&query)));
        });
    }
    group.finish();
}

/// Casts of a body that falls and turns over an exact floor, as rapier sweeps what is fast: by seven radii in a step.
fn sweeps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sweep");
    let mut world = PhysicsWorld::default();
    let tldi = TldiPipeline::new(TldiConfig::default()).expect("the defaults are valid");
    tldi.attach(&mut world);
    let (dispatcher, floor) = (
        tldi.dispatcher(),
        rapier3d::prelude::HalfSpace::new(Vector::Y),
    );
    let still = NonlinearRigidMotion::constant_position(Pose::IDENTITY);
    for count in POINTS {
        let (points, radius) = body(count);
        let lowest = points.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
        let body = PointCloudShape::new(cloud_of(&points, radius));
        let way = 7.0 * radius;
        for (name, gap, direction) in [
            ("far from the floor", 3.0 * way, -Vector::Y),
            ("along the floor", 0.0, Vector::X),
            ("onto the floor", 0.5 * way, -Vector::Y),
        ] {
            let start = Pose::from_translation((gap - lowest) * Vector::Y);
            let motion =
                NonlinearRigidMotion::new(start, Vector::ZERO, way * direction, 0.1 * Vector::Z);
            group.bench_function(BenchmarkId::new(name, count), |b| {
                b.iter(|| {
                    let (motion, body) = (black_box(&motion), &body);
                    dispatcher.cast_shapes_nonlinear(motion, body, &still, &floor, 0.0, 1.0, false)
                });
            });
        }
    }
    group.finish();
}

/// A step in which a sheet rises by as much as it was given, with a box on it.
fn pushes(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("push of a surface");
    for count in POINTS {
        let sheet = bumpy_sheet(count, true, 1);
        let low: Vec<Vec3> = sheet.points().to_vec();
        let normals = sheet.normals().map(<[Vec3]>::to_vec);
        let mut world = PhysicsWorld::default();
        let mut tldi = TldiPipeline::new(TldiConfig::default()).expect("the defaults are valid");
        tldi.attach(&mut world);
        let (_, collider) = world.insert(RigidBodyBuilder::fixed(), tldi.collider(sheet));
        let edge = 0.1 * SHEET_EDGE;
        let start = RigidBodyBuilder::dynamic().translation(edge * Vector::Y);
        world.insert(start, ColliderBuilder::cuboid(edge, 0.5 * edge, edge));
        let mut height = 0.0;
        let mut next = || {
            height += 1e-4;
            let up = height * Vec3::Y;
            low.iter().map(|p| *p + up).collect::<Vec<Vec3>>()
        };
        group.bench_function(BenchmarkId::new("deform and step", count), |b| {
            b.iter_batched(
                &mut next,
                |points| {
                    tldi.deform(&mut world, collider, &points, normals.as_deref())
                        .expect("as many points as before");
                    tldi.step(&mut world).expect("the step is possible")
                },
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

criterion_group! {
    name = stages;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2));
    targets = clouds, images, comparisons, bowls, batches, casts, sweeps, pushes
}
criterion_main!(stages);
