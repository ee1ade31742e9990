//! One drop: its random parameters, its run, and whether the body passed.

use super::ground::{Ground, WAVE_AMPLITUDE};
use crate::suite::arena::{Arena, DT, GRAVITY, Material, Placed, SamePoints};
use crate::suite::case::{Setup, Stop};
use crate::suite::scan_spots::spots;
use crate::suite::surface::{Backing, Normals, Solid, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use std::f32::consts::TAU;
use tldi::glamx::{Quat, Vec2, Vec3};
use tldi_tests::random_unit;

/// What bodies are dropped on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// A flat sheet of one layer of points.
    Sheet,
    /// A spot of a scan.
    Scan,
    /// A sheet that waves, with new points in every frame.
    Waves,
}

impl Target {
    pub(super) const ALL: [Self; 3] = [Self::Sheet, Self::Scan, Self::Waves];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Sheet => "sheet",
            Self::Scan => "scan",
            Self::Waves => "waves",
        }
    }
}

/// Sizes of bodies, metres, drawn with even logarithms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SizeClass {
    Small,
    Medium,
    Large,
}

impl SizeClass {
    pub(super) const ALL: [Self; 3] = [Self::Small, Self::Medium, Self::Large];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Small => "2-20 mm",
            Self::Medium => "20-200 mm",
            Self::Large => "0.2-1 m",
        }
    }

    fn range(self) -> (f32, f32) {
        match self {
            Self::Small => (0.002, 0.02),
            Self::Medium => (0.02, 0.2),
            Self::Large => (0.2, 1.0),
        }
    }
}

/// How a drop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The body never came near the surface within its rim.
    Missed,
    /// It came near and did not pass.
    Stopped,
    /// Its middle passed through.
    Passed,
}

/// Fastest bodies, m/s.
const TOP_SPEED: f32 = 200.0;
/// Largest angle between motion and the surface's normal.
const MOST_OBLIQUE_DEG: f32 = 75.0;
/// Fastest spin, rad/s.
const TOP_SPIN: f32 = 50.0;
/// Steps that are watched after the time of impact, and steps of a drop at most.
const STEPS_AFTER: usize = 12;
const MOST_STEPS: usize = 90;

fn between(low: f32, high: f32, rng: &mut Rng) -> f32 {
    low + (high - low) * rng.f32()
}

fn log_between(low: f32, high: f32, rng: &mut Rng) -> f32 {
    between(low.ln(), high.ln(), rng).exp()
}

/// What a drop draws.
struct Plan {
    solid: Solid,
    size: f32,
    /// Points of the body.
    spacing: f32,
    /// Points of the sheet.
    radius: f32,
    /// Edge of the sheet, or diameter of the spot.
    extent: f32,
    speed: f32,
    direction: Vec3,
    spin: Vec3,
    rotation: Quat,
    /// Start of the body's middle.
    start: Vec3,
    oriented: bool,
    wave_phase: f32,
}

impl Plan {
    fn draw(target: Target, size: SizeClass, rng: &mut Rng) -> Self {
        let (low, high) = size.range();
        let size = log_between(low, high, rng);
        let solid = if rng.bool() { Solid::Box } else { Solid::Ball };
        let points_along = match solid {
            Solid::Box => 8.0,
            Solid::Ball => 10.0,
        };
        let spacing = size / points_along;
        let radius = spacing * log_between(1.0, 3.0, rng);
        let extent = (4.0 * size).max(24.0 * radius);
        let speed = if rng.bool() {
            between(0.0, TOP_SPEED, rng)
        } else {
            log_between(0.1, TOP_SPEED, rng)
        };
        let (sin, cos) = between(0.0, MOST_OBLIQUE_DEG, rng).to_radians().sin_cos();
        let (z, x) = between(0.0, TAU, rng).sin_cos();
        let direction = Vec3::new(sin * x, -cos, sin * z);
        let aim = Vec2::new(rng.f32() - 0.5, rng.f32() - 0.5) * (0.2 * extent);
        let reach = 0.87 * size;
        let clearance = reach + (3.0 + WAVE_AMPLITUDE) * radius;
        let way = clearance / cos + speed * DT * between(0.0, 3.0, rng);
        let is_waving = target == Target::Waves;
        Self {
            solid,
            size,
            spacing,
            radius,
            extent,
            speed,
            direction,
            spin: random_unit(rng) * between(0.0, TOP_SPIN, rng),
            rotation: Quat::from_axis_angle(random_unit(rng), between(0.0, TAU, rng)),
            start: Vec3::new(aim.x, 0.0, aim.y) - direction * way,
            oriented: rng.bool(),
            wave_phase: if is_waving {
                between(0.0, TAU, rng)
            } else {
                0.0
            },
        }
    }

    fn wave(&self) -> Ground {
        Ground::Waves {
            radius: self.radius,
            phase: self.wave_phase,
        }
    }

    fn waves(&self, seconds: f32, rng: &mut Rng) -> Surface {
        let size = Vec2::splat(self.extent);
        Surface::terrain(size, self.radius, rng, |at| self.wave().height(at, seconds))
            .with_normals(self.normals())
    }

    fn normals(&self) -> Normals {
        if self.oriented {
            Normals::Given
        } else {
            Normals::Absent
        }
    }

    /// Steps until the body reaches the mean plane, by gravity or by its speed, whichever comes
    /// first.
    fn steps_to_impact(&self) -> usize {
        let down = -self.direction.y * self.speed;
        let height = self.start.y;
        let seconds = ((down * down + 2.0 * GRAVITY * height).sqrt() - down) / GRAVITY;
        (seconds / DT).ceil() as usize
    }

    fn describe(&self) -> String {
        format!(
            "{} {:.4} m, {:.1} m/s, {:.0}° off the normal, spin {:.0} rad/s, r̄ {:.4} m{}",
            self.solid.name(),
            self.size,
            self.speed,
            (-self.direction.y).acos().to_degrees(),
            self.spin.length(),
            self.radius,
            if self.oriented { ", oriented" } else { "" },
        )
    }
}

/// Runs the drop of a seed; with what it was.
pub(super) fn run_drop(
    setup: &Setup,
    target: Target,
    size: SizeClass,
    seed: u64,
) -> Result<(Outcome, String), Stop> {
    let mut rng = Rng::with_seed(seed);
    let mut plan = Plan::draw(target, size, &mut rng);
    let surface = match target {
        Target::Sheet => {
            let size = Vec2::splat(plan.extent);
            Surface::flat(size, plan.radius, Backing::Film, &mut rng).with_normals(plan.normals())
        }
        Target::Scan => {
            let spots = spots();
            let spot = &spots[rng.usize(..spots.len())];
            let scale = plan.radius / spot.mean_radius;
            plan.extent = 2.0 * spot.radius * scale / std::f32::consts::SQRT_2;
            plan.oriented = false;
            spot.surface(scale)
        }
        Target::Waves => plan.waves(0.0, &mut rng),
    };
    let mut arena = Arena::new(setup)?;
    // Rapier asks for this where bodies are not of human size; the same for all methods.
    arena.set_length_unit(plan.size.min(1.0));
    let floor = arena.insert(RigidBodyBuilder::fixed(), &surface, Material::default())?;
    let body = RigidBodyBuilder::dynamic()
        .pose(Pose::from_parts(plan.start, plan.rotation))
        .linvel(plan.direction * plan.speed)
        .angvel(plan.spin)
        .ccd_enabled(true);
    let surface_of_body = (plan.solid).surface(0.5 * plan.size, plan.spacing, &mut rng);
    let body = arena.insert(body, &surface_of_body, Material::default())?;
    let ground = match target {
        Target::Sheet => Ground::Flat,
        Target::Waves => plan.wave(),
        Target::Scan => Ground::Scan {
            radius: plan.radius,
            points: surface.samples.points,
        },
    };
    let outcome = watch(&mut arena, &plan, &ground, [&floor, &body], &mut rng)?;
    Ok((outcome, plan.describe()))
}

/// Steps until the body has passed, has left the sheet, or time is up.
fn watch(
    arena: &mut Arena,
    plan: &Plan,
    ground: &Ground,
    [floor, body]: [&Placed; 2],
    rng: &mut Rng,
) -> Result<Outcome, Stop> {
    // Where a body's middle may be so that all of the body is over the sheet.
    let within = 0.5 * plan.extent - 0.87 * plan.size.min(0.25 * plan.extent);
    let is_within = |at: Vec3| at.x.abs().max(at.z.abs()) < within;
    let mut seconds = 0.0;
    let mut last = plan.start;
    let mut last_height = ground.over(last, seconds);
    let mut outcome = Outcome::Missed;
    for _ in 0..(plan.steps_to_impact() + STEPS_AFTER).min(MOST_STEPS) {
        seconds += DT;
        if matches!(ground, Ground::Waves { .. }) {
            arena.reshape(floor, &plan.waves(seconds, rng), SamePoints::No)?;
        }
        arena.step()?;
        let at = arena.position(body);
        let height = ground.over(at, seconds);
        if height < 0.0 && last_height >= 0.0 {
            let crossing = ground.crossing(last, at, seconds);
            return Ok(if crossing.is_some_and(is_within) {
                Outcome::Passed
            } else {
                outcome
            });
        }
        if height < plan.size && is_within(at) {
            outcome = Outcome::Stopped;
        }
        last = at;
        last_height = height;
    }
    Ok(outcome)
}
