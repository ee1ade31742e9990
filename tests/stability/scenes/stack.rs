//! A tower of boxes.

use crate::suite::arena::{Arena, DT, Material, Placed};
use crate::suite::case::{Case, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::method::Method;
use crate::suite::surface::{Backing, Normals, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "stack",
    about: "10 boxes of 0.2 m, each a cloud of its own (r̄ = 2 cm), one on the other on a plane, \
            with rapier's 4 solver iterations and with 12; and, of rapier's own shapes alone, convex hulls \
            whose corners are off in height by up to 0.1 r̄, or not at all.",
    rule: "Stands for 10 s: the top box drifts ≤ r̄ sideways, and is within 10 r̄ (1 r̄ a box) of its \
           height.",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const BOXES: usize = 10;
const SECONDS: f32 = 10.0;

/// Solver iterations of a step with which a stack of clouds stands.
const MANY: usize = 12;

/// What is stacked.
#[derive(Clone, Copy)]
enum Bodies {
    /// Clouds of boxes, with these normals.
    Boxes(Normals),
    /// Rapier's convex hulls of the corners of boxes, each off in height by up to so many metres: how
    /// exactly the solver wants to know surfaces.
    Hulls(f32),
}

fn cases(scale: &Scale) -> Vec<Case> {
    let mut cases = Vec::new();
    for &seed in &scale.seeds {
        let default = IntegrationParameters::default().num_solver_iterations;
        let [oriented, bare] = [Normals::Given, Normals::Absent].map(Bodies::Boxes);
        let (exact, rough) = (Bodies::Hulls(0.0), Bodies::Hulls(0.1 * SPACING));
        for (bodies, iterations, name) in [
            (oriented, default, "10 boxes, oriented"),
            (bare, default, "10 boxes, bare"),
            (oriented, MANY, "10 boxes, 12 solver iterations, oriented"),
            (bare, MANY, "10 boxes, 12 solver iterations, bare"),
            (exact, default, "10 hulls, exact"),
            (rough, default, "10 hulls, corners off by 0.1 r̄"),
        ] {
            let run = move |setup: &Setup, verdict: &mut Verdict| {
                stack(setup, verdict, bodies, iterations, seed)
            };
            cases.push(Case::new(SCENE.name, name.to_owned(), seed, run));
        }
    }
    cases
}

impl Bodies {
    fn surface(self, rng: &mut Rng) -> Surface {
        let half = Vec3::splat(HALF);
        let surface = Surface::cuboid(half, SPACING, rng);
        let off = match self {
            Bodies::Boxes(normals) => return surface.with_normals(normals),
            Bodies::Hulls(off) => off,
        };
        let (mut corners, _) = Cuboid::new(half).to_trimesh();
        for corner in &mut corners {
            corner.y += off * (2.0 * rng.f32() - 1.0);
        }
        let hull = SharedShape::convex_hull(&corners).ok_or("the corners have no convex hull");
        Surface {
            primitive: hull.map(|hull| vec![(Pose::IDENTITY, hull)]),
            ..surface
        }
    }
}

fn stack(
    setup: &Setup,
    verdict: &mut Verdict,
    bodies: Bodies,
    iterations: usize,
    seed: u64,
) -> Result<(), Stop> {
    let normals = match bodies {
        Bodies::Boxes(normals) => normals,
        Bodies::Hulls(_) if setup.method == Method::Primitive => Normals::Absent,
        Bodies::Hulls(_) => return Err(Stop::Unfit("it is a shape of rapier's own")),
    };
    let mut rng = Rng::with_seed(seed);
    let mut arena = Arena::new(setup)?;
    arena.set_solver_iterations(iterations);
    let floor = Surface::flat(Vec2::splat(1.0), SPACING, Backing::Solid, &mut rng);
    let floor = floor.with_normals(normals);
    arena.insert(RigidBodyBuilder::fixed(), &floor, Material::default())?;
    let mut boxes: Vec<Placed> = Vec::new();
    let mut top_of_stack = 0.0;
    for k in 0..BOXES {
        let surface = bodies.surface(&mut rng);
        let lift = match k {
            0 => surface.lift_on(&floor, setup.method),
            _ => surface.lift_on(&surface, setup.method),
        };
        top_of_stack += lift + 2.0 * HALF;
        let height = top_of_stack - HALF;
        let body = RigidBodyBuilder::dynamic().translation(Vec3::Y * height);
        boxes.push(arena.insert(body, &surface, Material::default())?);
    }
    let (Some(bottom), Some(top)) = (boxes.first(), boxes.last()) else {
        return Ok(());
    };
    let mut drift = 0.0_f32;
    for _ in 0..(SECONDS / DT) as usize {
        arena.step()?;
        drift = drift.max(arena.position(top).with_y(0.0).length());
    }
    let height = arena.position(top).y - HALF * (2 * BOXES - 1) as f32;
    verdict.at_most("top_drift_mean_radii", drift / SPACING, 1.0);
    verdict.near(
        "top_height_error_mean_radii",
        height / SPACING,
        0.0,
        BOXES as f64,
    );
    verdict.note(
        "bottom_height_error_mean_radii",
        (arena.position(bottom).y - HALF) / SPACING,
    );
    verdict.note("end_speed_m_s", arena.speed(top));
    let awake = boxes
        .iter()
        .filter(|b| !arena.body(b).is_sleeping())
        .count();
    verdict.note("awake", awake as f64);
    Ok(())
}
