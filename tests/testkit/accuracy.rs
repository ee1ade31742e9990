//! How well the comparison measures contacts of known normal and depth, by angle of motion.

use crate::{Samples, random_unit, sampled_box, sampled_plane, sampled_ramp, sampled_sphere};
use crate::{compare_batch, deepest_contact};
use serde::{Deserialize, Serialize};
use std::fmt;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{CameraPolicy, PairQuery, PairResult, Params, PointCloud, Surface, View};

/// Spacing of the samples of [`ContactClouds`] and their radius r̄, metres.
pub const CONTACT_SPACING: f32 = 0.01;

const R: f32 = CONTACT_SPACING;

/// Radii of the spheres, metres.
const BIG: f32 = 0.25;
const SMALL: f32 = 0.2;

/// Half the edges of the box, metres.
const HALF: Vec3 = Vec3::new(0.15, 0.12, 0.18);

/// Edges of the plane, metres.
const PLANE: f32 = 1.0;

/// Edges of the ramp, metres: along its foot, height, depth.
const RAMP: Vec3 = Vec3::new(0.9, 0.4, 0.8);

/// Length of the motions, metres: 3 m/s at 60 Hz.
const MOTION: f32 = 0.05;

/// Edge of a bin of angles of motion, degrees.
pub const ANGLE_STEP: usize = 10;

/// Bins of angles, 0 to 90°.
pub const ANGLE_BINS: usize = 90 / ANGLE_STEP;

/// Limits of the medians in each bin: of the normal's error in degrees, and of the depth's in r̄ up
/// to 2 r̄ and in parts of the depth beyond.
pub const NORMAL_LIMIT: f32 = 1.0;
/// See [`NORMAL_LIMIT`].
pub const SHALLOW_LIMIT: f32 = 0.1;
/// See [`NORMAL_LIMIT`].
pub const DEEP_LIMIT: f32 = 0.05;

/// A pair of shapes in contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactPair {
    /// A sphere in a sphere.
    SphereSphere,
    /// A sphere in a plane.
    SpherePlane,
    /// A box with a face in a plane.
    BoxPlane,
    /// A box with a face in the slope of a ramp.
    BoxRamp,
    /// A box with an edge in a plane, its faces 20° to 70° from it.
    EdgePlane,
    /// A box with a corner in a plane, every face at least 20° from it.
    CornerPlane,
}

impl ContactPair {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::SphereSphere,
        Self::SpherePlane,
        Self::BoxPlane,
        Self::BoxRamp,
        Self::EdgePlane,
        Self::CornerPlane,
    ];

    /// Short name.
    pub fn name(self) -> &'static str {
        match self {
            Self::SphereSphere => "sphere × sphere",
            Self::SpherePlane => "sphere × plane",
            Self::BoxPlane => "box × plane",
            Self::BoxRamp => "box × ramp",
            Self::EdgePlane => "edge × plane",
            Self::CornerPlane => "corner × plane",
        }
    }
}

/// How deep the surfaces are in each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// Up to 2 r̄.
    Shallow,
    /// 2 r̄ to 10 r̄.
    Deep,
}

impl Regime {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Shallow, Self::Deep];

    /// Short name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shallow => "shallow",
            Self::Deep => "deep",
        }
    }

    /// Least and greatest depth, in r̄.
    pub fn depths(self) -> [f32; 2] {
        match self {
            Self::Shallow => [0.0, 2.0],
            Self::Deep => [2.0, 10.0],
        }
    }

    /// A depth within, metres.
    pub fn random_depth(self, rng: &mut fastrand::Rng) -> f32 {
        let [low, high] = self.depths();
        (low + (high - low) * rng.f32()) * R
    }

    /// Error of a depth in the unit of the regime's limit: r̄ where shallow, parts of the depth
    /// where deep.
    fn error(self, measured: f32, depth: f32) -> f32 {
        match self {
            Self::Shallow => (measured - depth) / R,
            Self::Deep => (measured - depth) / depth,
        }
    }
}

/// Errors of the contacts of one pair, in one bin of angles. Infinite (`null` as JSON): missed.
#[derive(Clone, Debug, Serialize)]
pub struct AccuracyRow {
    /// The shapes.
    pub pair: ContactPair,
    /// Whether the clouds have normals.
    pub with_normals: bool,
    /// Depths.
    pub regime: Regime,
    /// Index of the bin: angles between motion and true normal from `angle_bin` ×
    /// [`ANGLE_STEP`] degrees on.
    pub angle_bin: usize,
    /// Contacts tried.
    pub cases: usize,
    /// Contacts without any patch; their errors count as infinite.
    pub missed: usize,
    /// Median angle between measured and true normal, degrees.
    pub normal_median: f32,
    /// Greatest angle between measured and true normal, degrees.
    pub normal_max: f32,
    /// Median absolute error of the deepest point's depth: in r̄ where shallow, in parts of the
    /// depth where deep.
    pub depth_median: f32,
    /// Greatest absolute error of the depth.
    pub depth_max: f32,
    /// Median of the signed error of the depth; positive: too deep.
    pub depth_bias: f32,
}

impl fmt::Display for AccuracyRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let from = self.angle_bin * ANGLE_STEP;
        write!(
            f,
            "{:7} {:15} {:8} {:2}–{:2}° {:3} missed {:3}, normal {:7.2}° (max {:6.2}°), depth {:6.3} \
             (max {:6.3}, bias {:+6.3})",
            if self.with_normals { "normals" } else { "none" },
            self.pair.name(),
            self.regime.name(),
            from,
            from + ANGLE_STEP,
            self.cases,
            self.missed,
            self.normal_median,
            self.normal_max,
            self.depth_median,
            self.depth_max,
            self.depth_bias,
        )
    }
}

/// A shape about the origin of its frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactShape {
    /// A sphere of this radius.
    Sphere(f32),
    /// A box with these halves of its edges.
    Box(Vec3),
    /// A square of this edge in the plane y = 0.
    Plane(f32),
    /// A wedge of this size, as [`sampled_ramp`] has it.
    Ramp(Vec3),
}

/// Clouds in a pose to each other, with the truth.
pub struct ContactCase<'a> {
    /// The first.
    pub a: &'a PointCloud<'a>,
    /// The second.
    pub b: &'a PointCloud<'a>,
    /// What the clouds were sampled from, in the frame of each.
    pub shapes: [ContactShape; 2],
    /// From the frame of `b` to that of `a`.
    pub a_from_b: Pose3,
    /// From `a` towards `b`, unit length, in the frame of `a`.
    pub normal: Vec3,
    /// Metres.
    pub depth: f32,
}

/// The clouds of all pairs.
pub struct ContactClouds {
    big: PointCloud<'static>,
    small: PointCloud<'static>,
    boxed: PointCloud<'static>,
    plane: PointCloud<'static>,
    ramp: PointCloud<'static>,
    /// From the frame in which the slope is the plane y = 0, its middle the origin.
    ramp_from_slope: Pose3,
}

impl ContactClouds {
    /// Samples all shapes, [`CONTACT_SPACING`] apart, with or without normals.
    pub fn new(with_normals: bool) -> Self {
        let mut rng = fastrand::Rng::with_seed(1);
        let cloud = |samples: &Samples| {
            if with_normals {
                samples.cloud(R)
            } else {
                samples.bare_cloud(R)
            }
        };
        let (ramp, ramp_from_slope) = sampled_ramp(RAMP, R, &mut rng);
        Self {
            big: cloud(&sampled_sphere(BIG, R)),
            small: cloud(&sampled_sphere(SMALL, R)),
            boxed: cloud(&sampled_box(HALF, R, &mut rng)),
            plane: cloud(&sampled_plane(PLANE, R, &mut rng)),
            ramp: cloud(&ramp),
            ramp_from_slope,
        }
    }

    /// The pair, `depth` metres deep, at a random rotation to each other and to the frame.
    pub fn case(&self, pair: ContactPair, depth: f32, rng: &mut fastrand::Rng) -> ContactCase<'_> {
        // In a frame where the normal is +y and the surface of `a` passes through the origin.
        let spin = |rng: &mut fastrand::Rng| {
            Quat::from_axis_angle(Vec3::Y, std::f32::consts::TAU * rng.f32())
        };
        let aside = Vec3::new(rng.f32() - 0.5, 0.0, rng.f32() - 0.5) * 0.1;
        let (b, rotation) = match pair {
            ContactPair::SphereSphere | ContactPair::SpherePlane => {
                (&self.small, random_rotation(rng))
            }
            ContactPair::BoxPlane | ContactPair::BoxRamp => (&self.boxed, spin(rng)),
            ContactPair::EdgePlane => {
                let tilt = (20.0 + 50.0 * rng.f32()).to_radians();
                let tilted = Quat::from_axis_angle(Vec3::X, tilt);
                (&self.boxed, spin(rng) * tilted)
            }
            ContactPair::CornerPlane => (&self.boxed, on_a_corner(rng)),
        };
        let (shape_b, lowest) = match pair {
            ContactPair::SphereSphere | ContactPair::SpherePlane => {
                (ContactShape::Sphere(SMALL), -SMALL)
            }
            _ => {
                let reach = (rotation.inverse() * Vec3::Y).abs().dot(HALF);
                (ContactShape::Box(HALF), -reach)
            }
        };
        let mut contact_from_b = Pose3::from_parts(Vec3::Y * (-depth - lowest), rotation);
        let (a, shape_a, a_from_contact) = match pair {
            ContactPair::SphereSphere => {
                let rotation = random_rotation(rng);
                let top = Pose3::from_parts(rotation * (Vec3::Y * BIG), rotation);
                (&self.big, ContactShape::Sphere(BIG), top)
            }
            ContactPair::BoxRamp => {
                contact_from_b.translation += aside;
                (&self.ramp, ContactShape::Ramp(RAMP), self.ramp_from_slope)
            }
            _ => {
                contact_from_b.translation += aside;
                (&self.plane, ContactShape::Plane(PLANE), Pose3::IDENTITY)
            }
        };
        ContactCase {
            a,
            b,
            shapes: [shape_a, shape_b],
            a_from_b: a_from_contact * contact_from_b,
            normal: a_from_contact.rotation * Vec3::Y,
            depth,
        }
    }
}

fn random_rotation(rng: &mut fastrand::Rng) -> Quat {
    Quat::from_axis_angle(random_unit(rng), std::f32::consts::TAU * rng.f32())
}

/// A rotation after which every face of a box is at least 20° from the plane y = 0.
fn on_a_corner(rng: &mut fastrand::Rng) -> Quat {
    loop {
        let rotation = random_rotation(rng);
        let down = rotation.inverse() * Vec3::Y;
        if down.abs().max_element() < 20f32.to_radians().cos() {
            return rotation;
        }
    }
}

/// Number of rows that [`measure_accuracy`] gives.
pub const ACCURACY_ROWS: usize = 2 * ContactPair::ALL.len() * Regime::ALL.len() * ANGLE_BINS;

/// Measures `cases` contacts for each pair, regime and bin of angles, with and without normals:
/// at random places, rotations and depths, the camera aimed with the angle of the bin between the
/// hint and the true normal. The deepest patch is judged. `done` is called after each row.
pub fn measure_accuracy(
    cases: usize,
    seed: u64,
    policy: CameraPolicy,
    mut done: impl FnMut(&AccuracyRow),
) -> Vec<AccuracyRow> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut rows = Vec::new();
    for with_normals in [true, false] {
        let clouds = ContactClouds::new(with_normals);
        for pair in ContactPair::ALL {
            for regime in Regime::ALL {
                for angle_bin in 0..ANGLE_BINS {
                    let mut errors = Errors::default();
                    for _ in 0..cases {
                        let depth = regime.random_depth(&mut rng);
                        let case = clouds.case(pair, depth, &mut rng);
                        let angle =
                            ((angle_bin as f32 + rng.f32()) * ANGLE_STEP as f32).to_radians();
                        let result = case.compare(angle, policy, &mut rng);
                        errors.push(&case, &result, regime);
                    }
                    let row = errors.row(pair, with_normals, regime, angle_bin);
                    done(&row);
                    rows.push(row);
                }
            }
        }
    }
    rows
}

impl ContactCase<'_> {
    /// A motion of `b` relative to `a` against the true normal, but for `angle` radians to a random
    /// side: over a step, metres, in the frame of `a`.
    pub fn motion(&self, angle: f32, rng: &mut fastrand::Rng) -> Vec3 {
        let tangent = loop {
            let across = random_unit(rng).reject_from(self.normal);
            if let Some(tangent) = across.try_normalize() {
                break tangent;
            }
        };
        -MOTION * (angle.cos() * self.normal + angle.sin() * tangent)
    }

    /// Compares with a hint `angle` radians from the true normal.
    fn compare(&self, angle: f32, policy: CameraPolicy, rng: &mut fastrand::Rng) -> PairResult {
        let query = PairQuery {
            a: Surface::Cloud(self.a),
            b: Surface::Cloud(self.b),
            a_from_b: self.a_from_b,
            view: View::Aim {
                policy,
                motion: self.motion(angle, rng),
                last_axis: None,
            },
            params: Params::for_radius(R),
        };
        compare_batch(&[query]).remove(0)
    }
}

/// Errors of one bin.
#[derive(Default)]
struct Errors {
    normal: Vec<f32>,
    depth: Vec<f32>,
    missed: usize,
}

impl Errors {
    fn push(&mut self, case: &ContactCase, result: &PairResult, regime: Regime) {
        let Some((normal, measured)) = deepest_contact(result) else {
            self.missed += 1;
            self.normal.push(f32::INFINITY);
            self.depth.push(f32::INFINITY);
            return;
        };
        self.normal
            .push(normal.angle_between(case.normal).to_degrees());
        self.depth.push(regime.error(measured, case.depth));
    }

    fn row(
        mut self,
        pair: ContactPair,
        with_normals: bool,
        regime: Regime,
        angle_bin: usize,
    ) -> AccuracyRow {
        let median_and_max = |errors: &mut Vec<f32>| {
            errors.sort_by(f32::total_cmp);
            [errors[errors.len() / 2], errors[errors.len() - 1]]
        };
        let cases = self.normal.len();
        let [normal_median, normal_max] = median_and_max(&mut self.normal);
        let [depth_bias, _] = median_and_max(&mut self.depth);
        let mut depth: Vec<f32> = self.depth.iter().map(|error| error.abs()).collect();
        let [depth_median, depth_max] = median_and_max(&mut depth);
        AccuracyRow {
            pair,
            with_normals,
            regime,
            angle_bin,
            cases,
            missed: self.missed,
            normal_median,
            normal_max,
            depth_median,
            depth_max,
            depth_bias,
        }
    }
}
