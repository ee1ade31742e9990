//! A warm backend allocates nothing, for comparisons and for casts. A binary of its own with one test, since the allocations of
//! all threads are counted.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Aabb, Backend, CpuBackend, ImpactQuery, PairQuery, PairResult, Params, PointCloud, RayHit,
    RaySurface, Surface, View,
};
use tldi_memory::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// The half-space y < 0.
struct Ground;

impl RaySurface for Ground {
    fn bounds(&self) -> Aabb {
        Aabb {
            min: Vec3::NEG_INFINITY,
            max: Vec3::new(f32::INFINITY, 0.0, f32::INFINITY),
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>) {
        let distance = -origin.y / direction.y;
        if (0.0..=max_distance).contains(&distance) {
            hits.push(RayHit {
                distance,
                normal: Vec3::Y,
            });
        }
    }

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        (point.y, Vec3::Y)
    }

    fn is_closed(&self) -> bool {
        true
    }
}

/// Points about `r` apart on a unit sphere, in random order, with and without normals, and with some that are coarse.
fn spheres(r: f32) -> [PointCloud<'static>; 3] {
    let count = (4.0 * std::f32::consts::PI / (r * r)) as usize;
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let mut points: Vec<Vec3> = (0..count)
        .map(|i| {
            let y = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
            let (s, c) = (golden * i as f32).sin_cos();
            let across = (1.0 - y * y).sqrt();
            Vec3::new(across * c, y, across * s)
        })
        .collect();
    fastrand::Rng::with_seed(1).shuffle(&mut points);
    let builder = || PointCloud::builder(points.clone()).radius(r);
    let radii = (0..points.len()).map(|k| if k.is_multiple_of(4) { 4.0 * r } else { r });
    let radii: Vec<f32> = radii.collect();
    let built = [
        builder().normals(points.clone()).build(),
        builder().build(),
        builder().radii(radii).build(),
    ];
    built.map(|cloud| cloud.expect("the points are valid"))
}

#[test]
fn a_warm_backend_allocates_nothing() {
    let r = 0.02;
    let clouds = spheres(r);
    let ground = Ground;
    // One thread: with several, rayon's queues of waiting jobs grow as they happen to fill, and
    // the scratch memory of one thread may go to a pair that needs more than its last one did.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread can be started");
    let (mut backend, mut results) = (CpuBackend::new(), Vec::<PairResult>::new());
    // The depth of contact, in radii; `turn` changes the relative pose.
    let mut round = || {
        for turn in 4..12 {
            for depth in [-1.0, 2.0, 15.0, 30.0] {
                let rotation = Vec3::new(0.3, 1.1, 0.7) * turn as f32;
                let apart = |other: f32| other + 1.0 - r * depth;
                let up = Pose3::new(Vec3::Y * apart(0.0), rotation);
                let beside = Pose3::new(Vec3::new(0.6, 0.8, 0.0) * apart(1.0), rotation);
                for cloud in &clouds {
                    let query = |a, a_from_b: Pose3| PairQuery {
                        a,
                        b: Surface::Cloud(cloud),
                        a_from_b,
                        view: View::aimed(),
                        params: Params::for_radius(r),
                    };
                    for query in [
                        query(Surface::Cloud(cloud), beside),
                        query(Surface::Exact(&ground), up),
                    ] {
                        backend
                            .compare(&[query], &mut results)
                            .expect("the pair is supported");
                        assert!(!results[0].contacts.is_empty(), "{depth}");
                    }
                    let cast = ImpactQuery {
                        a: Surface::Cloud(cloud),
                        b: Surface::Cloud(cloud),
                        a_from_b: Pose3::new(Vec3::Y * 2.5, rotation),
                        motion: -Vec3::Y,
                        touching: 0.0,
                        core_only: false,
                        penetration: None,
                        turned: &[],
                        params: Params::for_radius(r),
                    };
                    let impact = backend.impact(&cast).expect("the pair is supported");
                    assert!(impact.is_some());
                }
            }
        }
    };
    pool.install(|| {
        assert!(
            allocations(|| drop(clouds[0].clone())) > 0,
            "the counter works"
        );
        // Which points are near, and how many views and pixels they need, changes with the pose: the same frames again.
        round();
        assert_eq!(allocations(&mut round), 0);
    });
}
