//! Thin plates that cross at every angle, each edge-on to views that see others: held against the exact
//! answer of their rectangles, on the CPU and the GPU.

use rapier3d::parry::query::QueryDispatcher;
use rapier3d_tldi::{PointCloudShape, TldiConfig, TldiPipeline};
use tldi::glamx::{Pose3, Vec3};
use tldi::{Backend, CpuBackend, PairQuery, PointCloud};
use tldi_tests::{
    aimed_clouds, cloud_of, compare_on, gpu_backend, random_pose, random_unit, sampled_plane,
};

/// Spacing of the samples, and mean radius, metres.
const R: f32 = 0.01;
/// Of a plate, metres.
const EDGE: f32 = 0.2;
const PAIRS: u64 = 200;

/// Three square plates of [`EDGE`] that cross each other at right angles.
struct Jack {
    plates: [Pose3; 3],
    cloud: PointCloud<'static>,
}

impl Jack {
    fn new(rng: &mut fastrand::Rng) -> Self {
        let quarter = std::f32::consts::FRAC_PI_2;
        let plates = [
            Pose3::IDENTITY,
            Pose3::rotation(quarter * Vec3::X),
            Pose3::rotation(quarter * Vec3::Z),
        ];
        let points = plates.map(|plate| sampled_plane(EDGE, R, rng).moved(&plate).points);
        let cloud = cloud_of(points.concat(), R);
        Self { plates, cloud }
    }

    /// Whether an edge of a plate of one passes through a plate of the other, all plates `wider` by so much
    /// on every side, metres.
    fn crosses(&self, other: &Self, self_from_other: &Pose3, wider: f32) -> bool {
        let half = 0.5 * EDGE + wider;
        let corners = [[-half, -half], [-half, half], [half, half], [half, -half]];
        let passes = |plate_from_edges: &Pose3| {
            (0..4).any(|k| {
                let [from, to] = [corners[k], corners[(k + 1) % 4]]
                    .map(|[x, z]| *plate_from_edges * Vec3::new(x, 0.0, z));
                let at = from.lerp(to, from.y / (from.y - to.y));
                from.y * to.y < 0.0 && at.x.abs() < half && at.z.abs() < half
            })
        };
        self.plates.iter().any(|a| {
            other.plates.iter().any(|b| {
                let a_from_b = a.inverse() * *self_from_other * *b;
                passes(&a_from_b) || passes(&a_from_b.inverse())
            })
        })
    }

    /// Least distance between the samples.
    fn distance(&self, other: &Self, self_from_other: &Pose3) -> f32 {
        let others: Vec<Vec3> = other
            .cloud
            .points()
            .iter()
            .map(|&p| *self_from_other * p)
            .collect();
        let nearest = |p: Vec3| others.iter().map(move |q| p.distance(*q));
        self.cloud
            .points()
            .iter()
            .copied()
            .flat_map(nearest)
            .fold(f32::MAX, f32::min)
    }
}

struct Scene {
    jacks: [Jack; 2],
    a_from_b: Pose3,
    /// `None` where plates end within two radii of each other.
    crosses: Option<bool>,
}

fn scenes() -> Vec<Scene> {
    let scene = |seed| {
        let mut rng = fastrand::Rng::with_seed(seed);
        let jacks = [Jack::new(&mut rng), Jack::new(&mut rng)];
        let mut a_from_b = random_pose(&mut rng, 0.0);
        a_from_b.translation = EDGE * (0.6 + 0.8 * rng.f32()) * random_unit(&mut rng);
        let [a, b] = &jacks;
        let crosses = if a.crosses(b, &a_from_b, -2.0 * R) {
            Some(true)
        } else {
            (a.distance(b, &a_from_b) > 2.0 * R).then_some(false)
        };
        Scene {
            jacks,
            a_from_b,
            crosses,
        }
    };
    (0..PAIRS).map(scene).collect()
}

/// How many crossings a backend misses, of how many, and how many it invents, of how many.
fn wrong_answers(scenes: &[Scene], backend: &mut dyn Backend) -> [[usize; 2]; 2] {
    let queries = scenes.iter().map(|scene| {
        let [a, b] = &scene.jacks;
        aimed_clouds(&a.cloud, &b.cloud, scene.a_from_b, R)
    });
    let batch: Vec<PairQuery> = queries.collect();
    let results = compare_on(backend, &batch);
    [true, false].map(|truth| {
        let of_truth = || {
            scenes
                .iter()
                .zip(&results)
                .filter(|(s, _)| s.crosses == Some(truth))
        };
        let wrong = of_truth().filter(|(_, result)| result.collides != truth);
        [wrong.count(), of_truth().count()]
    })
}

/// Views of the contact zone alone miss every fifth crossing.
#[test]
fn plates_that_cross_are_found_at_every_angle() {
    let scenes = scenes();
    let check = |backend: &mut dyn Backend| {
        let [missed, invented] = wrong_answers(&scenes, backend);
        assert_eq!([missed[0], invented[0]], [0, 0], "{}", backend.name());
        assert!(
            missed[1] > 50 && invented[1] > 20,
            "{missed:?} {invented:?}"
        );
    };
    check(&mut CpuBackend::new());
    if let Some(mut gpu) = gpu_backend() {
        check(&mut gpu);
    }
}

/// As rapier asks, of sensors for one.
#[test]
fn intersection_tests_look_from_all_directions() {
    let pipeline = TldiPipeline::new(TldiConfig::default()).expect("valid settings");
    let dispatcher = pipeline.dispatcher();
    for (seed, scene) in scenes().into_iter().enumerate() {
        let Some(crosses) = scene.crosses else {
            continue;
        };
        let [a, b] = scene.jacks.map(|jack| PointCloudShape::new(jack.cloud));
        let answer = dispatcher.intersection_test(&scene.a_from_b, &a, &b);
        assert_eq!(
            answer.expect("both are clouds").intersecting,
            crosses,
            "{seed}"
        );
    }
}

#[test]
fn a_surface_meets_its_own_copy() {
    let cloud = Jack::new(&mut fastrand::Rng::with_seed(0)).cloud;
    let query = aimed_clouds(&cloud, &cloud, Pose3::IDENTITY, R);
    assert!(compare_on(&mut CpuBackend::new(), &[query])[0].collides);
    if let Some(mut gpu) = gpu_backend() {
        assert!(compare_on(&mut gpu, &[query])[0].collides);
    }
}
