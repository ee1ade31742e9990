//! Contacts of known normal and depth: how well every method tells the deepest one, and how long it
//! takes.

mod meshes;

use crate::accuracy::Contender;
use crate::peers::{Deepest, Frame};
use crate::stored::ContactRow;
use meshes::Mesh;
use tldi::glamx::{Pose3, Vec3};
use tldi_tests::{CONTACT_SPACING, ContactCase, ContactClouds, ContactPair, Regime, random_pose};

/// How far the bodies lie from the origin at most, metres.
const REACH: f32 = 1.0;

/// Greatest angle between the motion and the true normal, degrees: beyond, it hardly tells from which
/// side a body came.
const MOST_ANGLE: f32 = 80.0;

/// Which contacts are measured.
pub struct Plan<'a> {
    /// Of which shapes.
    pub pairs: &'a [ContactPair],
    /// Contacts for each pair and regime.
    pub cases: usize,
    /// Of the random places, rotations, depths and motions.
    pub seed: u64,
    /// Whether methods are told how the second body moves: at 3 m/s towards the first, up to 80° from the
    /// true normal, as an engine knows it.
    pub tells_motion: bool,
}

/// What was told of some cases.
#[derive(Clone, Default)]
struct Told {
    seconds: Vec<f64>,
    /// Degrees; infinite where missed.
    normal_errors: Vec<f64>,
    /// Absolute, in r̄; infinite where missed.
    depth_errors: Vec<f64>,
}

/// Points of both bodies in the frame in which they are compared, all new, and the meshes of what they
/// were sampled from.
struct Scene {
    points: [Vec<Vec3>; 2],
    meshes: [Mesh; 2],
    motion: Vec3,
    truth: Deepest,
}

impl Scene {
    /// The case, in a frame in which the first body lies in the pose `of_a`; the motion is given in that
    /// of the first body.
    fn new(case: &ContactCase, of_a: &Pose3, motion: Vec3) -> Self {
        let poses = [*of_a, *of_a * case.a_from_b];
        let side = |k: usize| {
            let points = [case.a, case.b][k].points();
            let mesh = Mesh::new(case.shapes[k], CONTACT_SPACING);
            (
                points.iter().map(|p| poses[k] * *p).collect(),
                mesh.moved(&poses[k]),
            )
        };
        let [(a, mesh_a), (b, mesh_b)] = [0, 1].map(side);
        Self {
            points: [a, b],
            meshes: [mesh_a, mesh_b],
            motion: of_a.rotation * motion,
            truth: Deepest {
                normal: of_a.rotation * case.normal,
                depth: case.depth,
            },
        }
    }

    /// What a method is given: points, or meshes as fine as the points.
    fn frame(&self, contender: &Contender) -> Frame<'_> {
        let radius = contender.radius_scale.unwrap_or(1.0) * CONTACT_SPACING;
        if !contender.peer.needs_faces() {
            return Frame {
                motion: self.motion,
                ..Frame::new(&self.points[0], &self.points[1], radius)
            };
        }
        let [a, b] = &self.meshes;
        Frame {
            faces: Some([&a.faces, &b.faces]),
            ..Frame::new(&a.vertices, &b.vertices, radius)
        }
    }
}

/// Deepest contacts of all contenders in the cases of `plan`, at random places, rotations and depths, from
/// clouds without normals whose spacing and radius is r̄. A row a contender, regime and pair, and one for
/// all pairs together. `on_case` is called after each case.
///
/// Seconds go from points to contacts: all points are taken to be new. All contenders answer a case
/// before the next, so that a change of the machine's speed meets all alike; the first case is answered
/// twice, so that memory is warm.
pub fn measure(
    contenders: &mut [Contender],
    plan: &Plan,
    mut on_case: impl FnMut(),
) -> Vec<ContactRow> {
    let mut rng = fastrand::Rng::with_seed(plan.seed);
    let clouds = ContactClouds::new(false);
    let mut rows = Vec::new();
    let mut is_warm = false;
    for regime in Regime::ALL {
        let mut all = vec![Told::default(); contenders.len()];
        for &pair in plan.pairs {
            let mut told = vec![Told::default(); contenders.len()];
            for _ in 0..plan.cases {
                let depth = regime.random_depth(&mut rng);
                let case = clouds.case(pair, depth, &mut rng);
                let angle = (MOST_ANGLE * rng.f32()).to_radians();
                let motion = case.motion(angle, &mut rng);
                let told_motion = if plan.tells_motion {
                    motion
                } else {
                    Vec3::ZERO
                };
                let scene = Scene::new(&case, &random_pose(&mut rng, REACH), told_motion);
                for (contender, told) in contenders.iter_mut().zip(&mut told) {
                    let frame = scene.frame(contender);
                    if !is_warm {
                        contender.peer.compare(&frame);
                    }
                    let found = contender.peer.compare(&frame);
                    let seconds = found.build_seconds + found.query_seconds;
                    told.push(seconds, found.deepest, &scene.truth);
                }
                is_warm = true;
                on_case();
            }
            for ((contender, told), all) in contenders.iter().zip(told).zip(&mut all) {
                all.append(&told);
                rows.push(told.row(contender, plan, Some(pair), regime));
            }
        }
        let of_all = contenders.iter().zip(all);
        rows.extend(of_all.map(|(contender, told)| told.row(contender, plan, None, regime)));
    }
    rows
}

impl Told {
    fn push(&mut self, seconds: f64, deepest: Option<Deepest>, truth: &Deepest) {
        let errors = deepest.map(|told| {
            // In f32, the angles of almost equal directions come in steps of 0.02°.
            let [normal, truly] = [told.normal, truth.normal].map(|n| n.as_dvec3());
            let off = (told.depth - truth.depth).abs() / CONTACT_SPACING;
            [normal.angle_between(truly).to_degrees(), f64::from(off)]
        });
        let [normal, depth] = errors.unwrap_or([f64::INFINITY; 2]);
        self.seconds.push(seconds);
        self.normal_errors.push(normal);
        self.depth_errors.push(depth);
    }

    fn append(&mut self, other: &Self) {
        self.seconds.extend(&other.seconds);
        self.normal_errors.extend(&other.normal_errors);
        self.depth_errors.extend(&other.depth_errors);
    }

    fn row(
        mut self,
        contender: &Contender,
        plan: &Plan,
        pair: Option<ContactPair>,
        regime: Regime,
    ) -> ContactRow {
        for values in [
            &mut self.seconds,
            &mut self.normal_errors,
            &mut self.depth_errors,
        ] {
            values.sort_unstable_by(f64::total_cmp);
        }
        let cases = self.seconds.len();
        let share = |is_so: fn(&&f64) -> bool| {
            100.0 * self.normal_errors.iter().filter(is_so).count() as f64 / cases as f64
        };
        let at = |sorted: &[f64], percent: usize| sorted[(percent * cases / 100).min(cases - 1)];
        let ms = |percent: usize| 1e3 * at(&self.seconds, percent);
        let finite = |sorted: &[f64], percent: usize| {
            Some(at(sorted, percent)).filter(|error| error.is_finite())
        };
        ContactRow {
            pair,
            regime,
            cases,
            variant: contender.variant.clone(),
            backend: contender.peer.backend().map(|b| b.name().to_owned()),
            pixel_scale: contender.pixel_scale,
            radius_scale: contender.radius_scale,
            tells_motion: plan.tells_motion,
            missed_pct: share(|error| error.is_infinite()),
            wrong_side_pct: share(|error| error.is_finite() && **error > 90.0),
            normal_median_deg: finite(&self.normal_errors, 50),
            normal_p95_deg: finite(&self.normal_errors, 95),
            depth_median_radii: finite(&self.depth_errors, 50),
            depth_p95_radii: finite(&self.depth_errors, 95),
            median_ms: ms(50),
            lower_quartile_ms: ms(25),
            upper_quartile_ms: ms(75),
        }
    }
}

#[cfg(test)]
mod tests;
