//! Bodies that are poured on a heap.

use crate::suite::arena::{Arena, DT, Material, Placed};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Normals, Surface};
use rapier3d::prelude::*;
use tldi::glamx::{Pose3, Quat, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "heap",
    about: "24 boxes of 0.4 × 0.2 × 0.28 m (r̄ = 2.5 cm), turned at random, fall into a bin of 1.4 × 1.4 m, whose floor and \
            walls are rapier's cuboids.",
    rule: "All sleep within 8 s, and none is outside the bin.",
    cases,
};

const SPACING: f32 = 0.025;
const HALF: Vec3 = Vec3::new(0.2, 0.1, 0.14);
const BOXES: usize = 24;
/// Half the width of the bin, metres.
const BIN: f32 = 0.7;
const SECONDS: f32 = 8.0;

fn cases(_: &Scale, cases: &mut Cases) {
    for (normals, kind) in Normals::GIVEN_OR_NOT {
        let name = format!("{BOXES} boxes, {kind}");
        cases.add(name, move |setup, verdict| heap(setup, verdict, normals));
    }
}

fn heap(setup: &Setup, verdict: &mut Verdict, normals: Normals) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    insert_bin(&mut arena);
    let mut boxes: Vec<Placed> = Vec::new();
    for k in 0..BOXES {
        let surface = Surface::cuboid(HALF, SPACING, &mut rng).with_normals(normals);
        let mut any = || rng.f32() - 0.5;
        let turn = Quat::from_scaled_axis(6.0 * Vec3::new(any(), any(), any()));
        let [column, row, layer] = [k % 3, k / 3 % 3, k / 9].map(|cell| cell as f32);
        let at = Vec3::new(column - 1.0, 1.0 + layer, row - 1.0);
        let body = RigidBodyBuilder::dynamic().pose(Pose3::from_parts(0.45 * at, turn));
        boxes.push(arena.insert(body, &surface, Material::default())?);
    }
    let mut asleep_after = None;
    for step in 1..=(SECONDS / DT) as usize {
        arena.step()?;
        if boxes.iter().all(|placed| arena.body(placed).is_sleeping()) {
            asleep_after = Some(step as f32 * DT);
            break;
        }
    }
    verdict.asleep_within(SECONDS.into(), asleep_after);
    let is_outside = |placed: &&Placed| {
        let at = arena.position(placed);
        at.y < 0.0 || at.x.abs().max(at.z.abs()) > BIN
    };
    let outside = boxes.iter().filter(is_outside).count();
    verdict.at_most("outside", outside as f64, 0.0);
    Ok(())
}

fn insert_bin(arena: &mut Arena) {
    const THICK: f32 = 0.5;
    const HIGH: f32 = 3.0;
    let walls = [
        (Vec3::new(BIN, THICK, BIN), -Vec3::Y),
        (Vec3::new(THICK, HIGH, BIN), Vec3::X),
        (Vec3::new(THICK, HIGH, BIN), -Vec3::X),
        (Vec3::new(BIN, HIGH, THICK), Vec3::Z),
        (Vec3::new(BIN, HIGH, THICK), -Vec3::Z),
    ];
    for (half, out) in walls {
        let beside = (BIN + THICK) * out.with_y(0.0) + THICK * out.y * Vec3::Y;
        let collider = ColliderBuilder::cuboid(half.x, half.y, half.z).translation(beside);
        arena.world.insert(RigidBodyBuilder::fixed(), collider);
    }
}
