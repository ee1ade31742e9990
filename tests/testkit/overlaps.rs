//! Closed clouds that overlap at random, and how deep they are told to be beside the least way out.

use crate::{
    WayOut, compare_batch, data_file, deepest_contact, random_pose, random_unit, scale_to,
};
use rapier3d::prelude::SharedShape;
use rapier3d_tldi::sample_shape;
use rayon::prelude::*;
use serde::Serialize;
use tldi::glamx::{Pose3, Vec3};
use tldi::{PairQuery, Params, PointCloud, Surface, View};

/// Spacing of the samples of primitives and their radius, metres. These are 15 to 40 radii wide.
const R: f32 = 0.01;

/// Largest extent of a model, metres.
const MODEL: f32 = 0.5;

/// Least and greatest depth along the way in, in radii of the coarser cloud.
const DEPTHS: [f32; 2] = [0.2, 20.0];

/// Length of motions, metres: 3 m/s at 60 Hz.
const MOTION: f32 = 0.05;

/// A closed surface.
pub struct ClosedShape {
    /// Short name.
    pub name: &'static str,
    /// With normals, and without.
    clouds: [PointCloud<'static>; 2],
    /// Samples for the oracle.
    dense: Vec<Vec3>,
    /// How far these are apart, metres.
    spacing: f32,
}

impl ClosedShape {
    fn sampled(name: &'static str, shape: &SharedShape) -> Self {
        let sampled = |spacing| sample_shape(&**shape, spacing).expect("the shape has a surface");
        let cloud = sampled(R);
        let points: Vec<Vec3> = cloud.points().to_vec();
        let bare = (PointCloud::builder(points).radius(R).build()).expect("points of a cloud");
        let spacing = 0.5 * R;
        Self {
            name,
            clouds: [cloud, bare],
            dense: sampled(spacing).points().to_vec(),
            spacing,
        }
    }

    /// Sphere, box and capsule.
    pub fn primitives() -> Vec<Self> {
        vec![
            Self::sampled("sphere", &SharedShape::ball(0.2)),
            Self::sampled("box", &SharedShape::cuboid(0.15, 0.12, 0.18)),
            Self::sampled("capsule", &SharedShape::capsule_y(0.12, 0.08)),
        ]
    }

    /// The closed models of the test data, where it is at hand.
    pub fn models() -> Vec<Self> {
        let files = [
            ("bunny", "stanford/bunny_watertight.ply.gz"),
            ("armadillo", "stanford/armadillo_86k.ply.gz"),
        ];
        (files.into_iter())
            .filter_map(|(name, file)| Self::model(name, file))
            .collect()
    }

    fn model(name: &'static str, file: &str) -> Option<Self> {
        let mut raw = tldi_sources::read(&data_file(file)?, &Default::default())
            .expect("the test data can be read");
        scale_to(&mut raw.points, MODEL);
        let bare = (PointCloud::builder(raw.points.clone())
            .knn_radii(7, 0.65)
            .build())
        .expect("the test data is valid");
        let spacing = bare.mean_radius();
        let mesh = SharedShape::trimesh(raw.points.clone(), raw.faces.clone())
            .expect("the model has faces");
        let dense = sample_shape(&*mesh, spacing).expect("a mesh has a surface");
        let dense = dense.points().to_vec();
        let cloud =
            (raw.into_builder().knn_radii(7, 0.65).build()).expect("the test data is valid");
        Some(Self {
            name,
            clouds: [cloud, bare],
            dense,
            spacing,
        })
    }

    fn radius(&self) -> f32 {
        self.clouds[0].mean_radius()
    }
}

/// What was told of one overlap. Lengths are in radii of the coarser cloud.
#[derive(Clone, Debug, Serialize)]
pub struct Overlap {
    /// Number of the pose.
    pub pose: u32,
    /// Names of the shapes.
    pub shapes: [&'static str; 2],
    /// Whether the clouds have normals.
    pub with_normals: bool,
    /// The least way out, at most what they were pushed into each other.
    pub least: f32,
    /// Depth of the deepest contact, or `None` without one.
    pub told: Option<f32>,
}

impl Overlap {
    /// Whether the surfaces are told to be much deeper in each other than they are.
    pub fn is_falsely_deep(&self) -> bool {
        (self.told).is_some_and(|told| told > 3.0 * self.least.max(0.0) + 1.0)
    }
}

/// Pushes pairs of `shapes` into each other, 0.2 to 20 radii along a random way, and compares them; half of them without
/// normals, a third each without motion, with motion along the way and in any direction. `done` is called after each pose.
pub fn measure_overlaps(
    shapes: &[ClosedShape],
    poses: u32,
    seed: u64,
    done: impl Fn() + Sync,
) -> Vec<Overlap> {
    let overlap = |pose| {
        let overlap = overlap(shapes, pose, seed);
        done();
        overlap
    };
    (0..poses).into_par_iter().filter_map(overlap).collect()
}

/// `None` where the shapes do not meet along the way.
fn overlap(shapes: &[ClosedShape], pose: u32, seed: u64) -> Option<Overlap> {
    let mut rng = fastrand::Rng::with_seed(seed << 32 | u64::from(pose));
    let [a, b] = [(); 2].map(|()| &shapes[rng.usize(0..shapes.len())]);
    let is_bare = rng.bool();
    let radius = a.radius().max(b.radius());
    let mut a_from_b = random_pose(&mut rng, 0.1);
    let way = random_unit(&mut rng);
    let depth = radius * DEPTHS[0] * (DEPTHS[1] / DEPTHS[0]).powf(rng.f32());
    let oracle = |a_from_b: &Pose3| {
        let moved = b.dense.iter().map(|p| *a_from_b * *p).collect();
        WayOut::new(a.dense.clone(), moved, a.spacing.max(b.spacing))
    };
    let touching = oracle(&a_from_b).along(way);
    if !touching.is_finite() {
        return None;
    }
    a_from_b.translation += (touching - depth) * way;
    let motion = match rng.u8(0..3) {
        0 => Vec3::ZERO,
        1 => -MOTION * way,
        _ => MOTION * random_unit(&mut rng),
    };
    let query = PairQuery {
        a: Surface::Cloud(&a.clouds[usize::from(is_bare)]),
        b: Surface::Cloud(&b.clouds[usize::from(is_bare)]),
        a_from_b,
        view: View::Aim {
            policy: Default::default(),
            motion,
            last_axis: None,
        },
        params: Params::for_radius(radius),
    };
    let result = compare_batch(&[query]).remove(0);
    let told = deepest_contact(&result).map(|(_, depth)| depth / radius);
    // Where less than a radius is told, no way out makes it false.
    let least = match told {
        Some(told) if told > 1.0 => oracle(&a_from_b).least(way),
        _ => depth,
    };
    Some(Overlap {
        pose,
        shapes: [a.name, b.name],
        with_normals: !is_bare,
        least: least / radius,
        told,
    })
}
