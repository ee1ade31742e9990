//! How much a comparison models: no more than the scene needs.

use std::f32::consts::{PI, TAU};
use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Backend, CpuBackend, Looked, PairQuery, PairResult, Params, PointCloud, Surface, View, Work,
};

/// Points of a ball.
const COUNT: usize = 20_000;

/// Where the ball is in the direction `p`.
fn bumpy(p: Vec3) -> Vec3 {
    let wave = (6.0 * p.x).sin() + (7.0 * p.y).sin() + (5.0 * p.z).cos();
    p * (1.0 + 0.1 * wave / 3.0)
}

/// A ball of about 1 m with bumps of a tenth, of random points in random order, bare.
fn bumpy_ball(seed: u64) -> PointCloud<'static> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let point = |_| {
        let (height, turn) = (2.0 * rng.f32() - 1.0, TAU * rng.f32());
        let across = (1.0 - height * height).sqrt();
        let p = Vec3::new(across * turn.cos(), height, across * turn.sin());
        bumpy(p)
    };
    let points: Vec<Vec3> = (0..COUNT).map(point).collect();
    // 0.65 of the distance to the 7th neighbour.
    let radius = 0.65 * (8.0 * 4.0 * PI / (PI * COUNT as f32)).sqrt();
    let cloud = PointCloud::builder(points).radius(radius).build();
    cloud.expect("the points are finite")
}

/// Two balls, the second one moved by each of `offsets`, metres.
fn compared<const N: usize>(offsets: [Vec3; N]) -> ([PairResult; N], [PointCloud<'static>; 2]) {
    let balls = [1, 2].map(bumpy_ball);
    let batch = offsets.map(|offset| PairQuery {
        a: Surface::Cloud(&balls[0]),
        b: Surface::Cloud(&balls[1]),
        a_from_b: Pose3::from_translation(offset),
        view: View::aimed(),
        params: Params::for_radius(balls[0].mean_radius()),
    });
    let mut results = Vec::new();
    let outcome = CpuBackend::new().compare(&batch, &mut results);
    outcome.expect("two clouds are supported");
    (results.try_into().expect("a result a pair"), balls)
}

/// Points of both balls that are less than `beyond` metres outside the other one, along its radius.
fn within(balls: &[PointCloud<'static>; 2], offset: Vec3, beyond: f32) -> usize {
    let is_within = |q: &Vec3| {
        let direction = q.normalize();
        q.length() - bumpy(direction).length() < beyond
    };
    let [a, b] = [0, 1].map(|side| balls[side].points());
    let of_a = a.iter().map(|&p| p - offset).filter(is_within).count();
    of_a + b.iter().map(|&p| p + offset).filter(is_within).count()
}

/// What is deep by many pixels is settled by large ones and three windows: no fine look, and no more than a tenth of
/// the points. A fine look at all of the zone models half of them.
#[test]
fn deep_balls_get_no_fine_look() {
    let ([result], _) = compared([1.2 * Vec3::X]);
    assert!(result.collides);
    let Work {
        windows,
        fine,
        large,
        ..
    } = result.work;
    assert_eq!(fine, Looked::default());
    assert!(
        large.layers > 0 && windows.layers > 0,
        "{large:?} {windows:?}"
    );
    // Two images of three windows of 16 × 16 pixels.
    assert!(windows.pixels <= 2 * 3 * 16 * 16, "{windows:?}");
    let looked = result.work.looked();
    assert!(looked.points < 2 * COUNT / 10, "{looked:?}");
}

/// Of what is shallow, all points that are in the other ball are modelled finely, and none that is far from it. What is
/// modelled: whole tiles of the image, of 3 r̄, in which the balls are within 4 r̄ of each other along the view, which the
/// slanted surface makes twice as much at the rim.
#[test]
fn shallow_balls_get_a_fine_look_at_their_zone() {
    let offsets = [2.0 * Vec3::X, 2.1 * Vec3::X];
    let (results, balls) = compared(offsets);
    for (result, offset) in results.iter().zip(offsets) {
        assert!(result.collides);
        let Work { fine, .. } = result.work;
        let [inside, near] =
            [0.0, 12.0].map(|radii| within(&balls, offset, radii * balls[0].mean_radius()));
        assert!(
            (inside..near).contains(&fine.points),
            "{inside} {fine:?} {near}"
        );
        assert_eq!(result.work.looked(), fine);
    }
}

/// Nothing is modelled of what does not meet: without a look at any point where bounds are apart, and after a cull where
/// only these overlap.
#[test]
fn what_is_apart_is_not_modelled() {
    let ([beside, across], _) = compared([2.3 * Vec3::X, 1.4 * Vec3::ONE]);
    assert!(!beside.collides && !across.collides);
    assert_eq!(beside.work, Work::default());
    assert!(across.work.culled > 0);
    assert_eq!(across.work.looked(), Looked::default());
}
