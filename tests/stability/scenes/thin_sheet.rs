//! Bodies on both sides of sheets that are one layer of points.

use crate::suite::arena::{Arena, DT, Material, Placed};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Normals, Solid, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Quat, Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "thin-sheet",
    about: "Bodies of 0.2 m reach a sheet of one layer of points (r̄ = 2 cm) from above and from \
            below (gravity reversed). They reach two sheets 1.5 r̄ apart in one cloud from both \
            sides.",
    rule: "The body's middle stays on its side in every step. After 2 s, the body is within 0.5 \
           r̄ of where it rests on its sheet.",
    cases,
};

/// Distance of points, and their radius, metres.
const SPACING: f32 = 0.02;
/// Half the size of the bodies, metres.
const HALF: f32 = 0.1;
/// Edge of the sheets, metres.
const EDGE: f32 = 0.8;
/// Distance of the two sheets, metres.
const APART: f32 = 1.5 * SPACING;
const SECONDS: f32 = 2.0;

fn cases(scale: &Scale, cases: &mut Cases) {
    let speeds: &[f32] = scale.pick(&[0.0, 3.0], &[0.0, 1.0, 3.0, 5.0]);
    for solid in Solid::ALL {
        for (normals, kind) in Normals::GIVEN_OR_NOT {
            for (side, place) in [(1.0, "above"), (-1.0, "below")] {
                for &speed in speeds {
                    let name = format!("{} from {place}, {kind}, {speed} m/s", solid.name());
                    cases.add(name, move |setup, verdict| {
                        one_sheet(setup, verdict, solid, normals, side, speed)
                    });
                }
            }
            let name = format!("{} on each of two sheets, {kind}", solid.name());
            cases.add(name, move |setup, verdict| {
                two_sheets(setup, verdict, solid, normals)
            });
        }
    }
}

/// A body that is pulled to `height` from one side (`side` is 1 from above, -1 from below), with
/// a start 3 `SPACING` away from the sheet, and `speed` towards it.
fn insert(
    arena: &mut Arena,
    surface: &Surface,
    side: f32,
    height: f32,
    speed: f32,
) -> Result<Placed, Stop> {
    let start = Vec3::Y * (height + side * (HALF + 3.0 * SPACING));
    let body = RigidBodyBuilder::dynamic()
        .translation(start)
        .linvel(Vec3::NEG_Y * (side * speed))
        .gravity_scale(side)
        .ccd_enabled(true);
    arena.insert(body, surface, Material::default())
}

/// How far each body's middle is on its side of its sheet, at least and in the end, metres.
fn watch(arena: &mut Arena, bodies: &[(Placed, f32, f32)]) -> Result<Vec<(f32, f32)>, Stop> {
    let mut heights = vec![(f32::INFINITY, 0.0); bodies.len()];
    for _ in 0..(SECONDS / DT) as usize {
        arena.step()?;
        for ((placed, side, sheet), (least, last)) in bodies.iter().zip(&mut heights) {
            *last = side * (arena.position(placed).y - sheet);
            *least = least.min(*last);
        }
    }
    Ok(heights)
}

fn judge(verdict: &mut Verdict, name: &str, (least, last): (f32, f32)) {
    let of = |what: &str| format!("{name}{what}");
    verdict.at_least(&of("least_height_m"), least, 0.0);
    let error = (last - HALF) / SPACING;
    verdict.near(&of("height_error_mean_radii"), error, 0.0, 0.5);
}

fn one_sheet(
    setup: &Setup,
    verdict: &mut Verdict,
    solid: Solid,
    normals: Normals,
    side: f32,
    speed: f32,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let sheet = Surface::flat(Vec2::splat(EDGE), SPACING, Backing::Film, &mut rng);
    let sheet = sheet.with_normals(normals);
    arena.insert(RigidBodyBuilder::fixed(), &sheet, Material::default())?;
    let body = insert(
        &mut arena,
        &solid.surface(HALF, SPACING, &mut rng),
        side,
        0.0,
        speed,
    )?;
    let heights = watch(&mut arena, &[(body, side, 0.0)])?;
    judge(verdict, "", heights[0]);
    Ok(())
}

/// Two sheets, facing away from each other, in one cloud: at 0 and at `-APART`.
fn sheet_pair(rng: &mut Rng) -> Surface {
    let mut sheet = || Surface::flat(Vec2::splat(EDGE), SPACING, Backing::Film, rng);
    let (upper, lower) = (sheet(), sheet());
    let turned = Quat::from_rotation_x(std::f32::consts::PI);
    upper.joined(&lower.moved(&Pose::from_parts(Vec3::NEG_Y * APART, turned)))
}

fn two_sheets(
    setup: &Setup,
    verdict: &mut Verdict,
    solid: Solid,
    normals: Normals,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let sheets = sheet_pair(&mut rng).with_normals(normals);
    arena.insert(RigidBodyBuilder::fixed(), &sheets, Material::default())?;
    let surface = solid.surface(HALF, SPACING, &mut rng);
    let upper = insert(&mut arena, &surface, 1.0, 0.0, 0.0)?;
    let lower = insert(&mut arena, &surface, -1.0, -APART, 0.0)?;
    let heights = watch(&mut arena, &[(upper, 1.0, 0.0), (lower, -1.0, -APART)])?;
    judge(verdict, "upper_", heights[0]);
    judge(verdict, "lower_", heights[1]);
    Ok(())
}
