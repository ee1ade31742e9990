//! Holes in a floor, and the shadow behind what was scanned from one side.

use crate::suite::arena::{Arena, DT, GRAVITY, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Mesh, Normals, Solid, Surface, slab};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Quat, Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "holes",
    about: "A box (turned by 20°) and a ball of 0.2 m over a square hole in a floor (r̄ = 2 cm), \
            half to twice as wide as they are. A ball falls into the shadow behind a box of \
            which a camera saw only the front.",
    rule: "The body falls through if the hole is wider by more than 2 r̄ on each side. It does \
           not if the hole is as wide as the body or narrower (for the ball: 0.95 of its width). \
           In between, nothing is asked. In the shadow: free fall to 1 %, and ≤ r̄ sideways.",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const EDGE: f32 = 1.2;
/// Turn of the box about the vertical, radians: it then cannot pass a hole of its own width.
const TURN: f32 = 0.349;

fn cases(_: &Scale, cases: &mut Cases) {
    for solid in Solid::ALL {
        let body = solid.name();
        let equal = if solid == Solid::Ball { 0.95 } else { 1.0 };
        for ratio in [0.5, 0.8, equal, 1.75, 2.0] {
            for (normals, kind) in Normals::GIVEN_OR_NOT {
                let name = format!("{body}, hole of {ratio} widths, {kind}");
                cases.add(name, move |setup, verdict| {
                    fall(setup, verdict, solid, ratio, normals)
                });
            }
        }
    }
    cases.add("shadow", shadow);
}

/// A floor with a square hole of this width in its middle.
fn floor_with_hole(width: f32, rng: &mut Rng) -> Surface {
    let mut floor = Surface::flat(Vec2::splat(EDGE), SPACING, Backing::Film, rng);
    let is_floor = |p: &Vec3| p.x.abs().max(p.z.abs()) > 0.5 * width;
    floor.samples.retain(is_floor);
    // The hole's rim is sampled like the floor's.
    let steps = (width / SPACING).ceil() as i32;
    for k in 0..steps {
        let along = width * (k as f32 / steps as f32 - 0.5);
        for corner in 0..4 {
            let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 * corner as f32);
            floor
                .samples
                .points
                .push(turn * Vec3::new(along, 0.0, 0.5 * width));
            floor.samples.normals.push(Vec3::Y);
        }
    }
    // Four strips around the hole.
    let strip = 0.5 * (EDGE - width);
    let middle = 0.5 * (EDGE - strip);
    let strips = [
        (Vec2::new(middle, 0.0), Vec2::new(strip, EDGE)),
        (Vec2::new(-middle, 0.0), Vec2::new(strip, EDGE)),
        (Vec2::new(0.0, middle), Vec2::new(width, strip)),
        (Vec2::new(0.0, -middle), Vec2::new(width, strip)),
    ];
    let mut mesh = Mesh {
        vertices: Vec::new(),
        triangles: Vec::new(),
        one_sided: true,
    };
    for (at, size) in strips {
        let first = mesh.vertices.len() as u32;
        for (x, z) in [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)] {
            mesh.vertices
                .push(Vec3::new(at.x + x * size.x, 0.0, at.y + z * size.y));
        }
        mesh.triangles
            .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    floor.mesh = Ok(mesh);
    floor.primitive = Ok(strips
        .iter()
        .map(|(at, size)| slab(*at, *size, SPACING, Backing::Film))
        .collect());
    floor
}

fn fall(
    setup: &Setup,
    verdict: &mut Verdict,
    solid: Solid,
    ratio: f32,
    normals: Normals,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let floor = floor_with_hole(2.0 * HALF * ratio, &mut rng).with_normals(normals);
    arena.insert(RigidBodyBuilder::fixed(), &floor, Material::default())?;
    let surface = solid.surface(HALF, SPACING, &mut rng);
    let turn = match solid {
        Solid::Ball => Quat::IDENTITY,
        Solid::Box => Quat::from_rotation_y(TURN),
    };
    let pose = Pose::from_parts(Vec3::Y * (HALF + 0.05), turn);
    let body = arena.insert(
        RigidBodyBuilder::dynamic().pose(pose),
        &surface,
        Material::default(),
    )?;
    arena.steps((2.0 / DT) as usize)?;
    let height = verdict.note("height_m", arena.position(&body).y);
    let has_fallen = height < -1.0;
    let must_fall = ratio > 1.0;
    verdict.note("fell", f64::from(u8::from(has_fallen)));
    verdict.require("fell", has_fallen == must_fall, || {
        let outcome = if has_fallen { "fell through" } else { "stayed" };
        format!("{outcome}, height {height:.3} m")
    });
    Ok(())
}

/// What a camera at (0, 1, 2) sees of a floor and of a box of 0.4 m on it: the front of the box,
/// and the floor without what the box hides.
fn seen_from_one_side(camera: Vec3, rng: &mut Rng) -> Surface {
    let front_half = 0.2;
    let mut seen = Surface::flat(Vec2::new(2.0, 2.0), SPACING, Backing::Film, rng);
    let is_seen = |p: &Vec3| {
        // Where the line of sight crosses the plane of the front, z = 0.
        let share = camera.z / (camera.z - p.z);
        let at = camera.lerp(*p, share);
        let is_hidden_there = at.x.abs() < front_half && (0.0..2.0 * front_half).contains(&at.y);
        p.z >= 0.0 || !is_hidden_there
    };
    seen.samples.retain(is_seen);
    let upright = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let front = Surface::flat(Vec2::splat(2.0 * front_half), SPACING, Backing::Film, rng);
    let front = front.moved(&Pose::from_parts(Vec3::Y * front_half, upright));
    let seen = seen.joined(&front).with_normals(Normals::Seen(camera));
    Surface {
        mesh: Err("the seen part of the floor is not meshed"),
        primitive: Err("no primitive stands for half a scan"),
        ..seen
    }
}

fn shadow(setup: &Setup, verdict: &mut Verdict) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let scan = seen_from_one_side(Vec3::new(0.0, 1.0, 2.0), &mut rng);
    arena.insert(RigidBodyBuilder::fixed(), &scan, Material::default())?;
    // Behind the front by the ball's radius and 3 r̄.
    let radius = 0.06;
    let start = Vec3::new(0.0, 0.5, -radius - 3.0 * SPACING);
    let ball = Surface::ball(radius, SPACING);
    let body = RigidBodyBuilder::dynamic().translation(start);
    let ball = arena.insert(body, &ball, Material::default())?;
    let steps = 60;
    arena.steps(steps)?;
    let count = steps as f32;
    // Rapier adds velocity first, then position; its substeps give the mean of both ends or less.
    let [least, most] = [count * count, count * (count + 1.0)].map(|n| 0.5 * GRAVITY * DT * DT * n);
    let end = arena.position(&ball);
    let fallen = f64::from(start.y - end.y);
    let middle = f64::from(0.5 * (least + most));
    verdict.near(
        "fallen_m",
        fallen,
        middle,
        0.01 * middle + f64::from(0.5 * (most - least)),
    );
    let sideways = (end - start).with_y(0.0).length() / SPACING;
    verdict.at_most("sideways_mean_radii", sideways, 1.0);
    Ok(())
}
