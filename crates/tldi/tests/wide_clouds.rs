//! A wide cloud beside a small exact surface takes memory for what the surface covers, not for all that is seen. A binary
//! of its own with one test, since the bytes of all threads are counted.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Aabb, Backend, CpuBackend, ImpactQuery, PairQuery, Params, PointCloud, RayHit, RaySurface,
    Surface, View,
};
use tldi_memory::{Counting, most_held};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// A ball of half a metre.
struct Ball;

const RADIUS: f32 = 0.5;

impl RaySurface for Ball {
    fn bounds(&self) -> Aabb {
        Aabb {
            min: Vec3::splat(-RADIUS),
            max: Vec3::splat(RADIUS),
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, length: f32, hits: &mut Vec<RayHit>) {
        let along = -origin.dot(direction);
        let squared = RADIUS * RADIUS - (origin + along * direction).length_squared();
        if squared < 0.0 {
            return;
        }
        for distance in [along - squared.sqrt(), along + squared.sqrt()] {
            if (0.0..=length).contains(&distance) {
                let normal = (origin + distance * direction) / RADIUS;
                hits.push(RayHit { distance, normal });
            }
        }
    }

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        (point.length() - RADIUS, point.normalize_or(Vec3::Y))
    }

    fn is_closed(&self) -> bool {
        true
    }
}

/// Spacing of the sheet, metres. A pixel is a quarter of it.
const R: f32 = 0.05;

/// Most bytes. Tiles over all that is seen would take about 500 MB.
const MOST: usize = 32 << 20;

#[test]
fn memory_is_that_of_what_meets() {
    let (most, ()) = most_held(compare_and_cast);
    assert!(most < MOST, "{most} B");
}

fn compare_and_cast() {
    let mut points: Vec<Vec3> = (0..441)
        .map(|k| R * Vec3::new((k % 21) as f32 - 10.0, 0.0, (k / 21) as f32 - 10.0))
        .collect();
    points.push(Vec3::new(300.0, 0.0, 300.0));
    let cloud = PointCloud::builder(points).radius(R);
    let cloud = cloud.build().expect("a valid cloud");
    // So far ahead is looked that the point far away is seen, too.
    let params = Params::for_radius(R)
        .with_pixel_size(0.25 * R)
        .with_prediction(1000.0);
    let above = Pose3::from_translation((RADIUS + 0.2) * Vec3::Y);
    let mut backend = CpuBackend::new();
    let mut results = Vec::new();
    let query = PairQuery {
        a: Surface::Cloud(&cloud),
        b: Surface::Exact(&Ball),
        a_from_b: above,
        view: View::aimed(),
        params,
    };
    backend.compare(&[query], &mut results).expect("supported");
    let gap = results[0].gap.expect("the ball is above the sheet");
    assert!((gap - 0.2).abs() < 0.1 * R, "{gap}");
    let impact = backend.impact(&ImpactQuery {
        a: Surface::Cloud(&cloud),
        b: Surface::Exact(&Ball),
        a_from_b: above,
        motion: -Vec3::Y,
        touching: 0.0,
        core_only: false,
        penetration: None,
        turned: &[],
        params,
    });
    let impact = impact
        .expect("supported")
        .expect("the ball meets the sheet");
    assert!(
        (impact.distance - 0.2).abs() < 0.1 * R,
        "{}",
        impact.distance
    );
}
