//! The quadruped stands and walks on scans of rough ground. What it does is measured against the ground as it
//! was generated.

mod common;

use std::path::Path;
use tldi::glamx::Vec3;
use tldi_examples::load;
use tldi_examples::robot::{
    Base, Description, MeshFolders, Motion, RobotScene, RobotSimulation, StandingReport, Walk,
    quadruped,
};
use tldi_examples::terrain::{Ground, Terrain};
use tldi_examples::world::DT;
use tldi_wgpu::BackendChoice;

/// On a terrain stands the quadruped with its twelve joints, unless another robot is named.
#[test]
fn a_terrain_has_the_quadruped() {
    let folder = common::folder("quadruped_alone");
    for (robot, joints) in [("", 12), ("--robot arm", 6)] {
        let options = format!("--terrain ramp --steps 1 {robot}");
        let report = common::report(env!("CARGO_BIN_EXE_robot_in_scan"), &folder, &options);
        assert_eq!(report["driven_joints"], joints, "{options}");
    }
}

/// Stands, walks and stands again, eight seconds in all.
fn walk(ground: Ground, seed: u64) -> StandingReport {
    let terrain = Terrain::new(ground, seed);
    let robot =
        Description::from_text(&quadruped(), &MeshFolders::new(Path::new(""), &[])).unwrap();
    let walk = Walk::of(&robot.kinematics).unwrap();
    let steps = (walk.seconds() / DT).ceil() as usize;
    let scene = RobotScene {
        scan: load::scan_from_surface(terrain.scan()).unwrap(),
        up: Vec3::Z,
        robot,
        base: Base::Auto,
        at: Some(Vec3::ZERO),
        facing: Some(Vec3::X),
        terrain: Some(terrain),
        motion: Some(Motion::Walk(walk)),
        bodies: 0,
        sensor_noise: 0.002,
        own_camera: false,
        self_filter: true,
        seed,
    };
    let backend = BackendChoice::Auto.open().unwrap();
    let mut simulation = RobotSimulation::new(scene, backend).unwrap();
    for step in 1..=steps {
        let stepped = simulation.step();
        stepped.unwrap_or_else(|error| panic!("{ground:?} {seed}: step {step}: {error}"));
    }
    simulation.report().standing.unwrap()
}

/// What of a walk is not as it should be.
fn faults(r: &StandingReport) -> Vec<&'static str> {
    let [least, last] = [r.least_height, r.last_height].map(|height| height / r.start_height);
    [
        (r.feet == 4, "feet"),
        // Legs give way by 2 % under a quarter of the weight, and by twice of that while one is up; the rest is
        // for landing.
        (least > 0.9 && last > 0.95, "height"),
        // At 0.125 m/s for 5.4 s, without slip, 0.68 m. The rough ground begins 8 cm in front of the front feet.
        ((0.3..0.7).contains(&r.way), "way"),
        (r.deepest_radii < 0.5, "depth"),
        // While a foot swings, those beside it on the rim of the trunk's lean carry two shares. Landing without a look
        // at the ground, and on steps, adds up to another.
        (r.max_foot_force < 3.0, "force"),
        // Half a radius, of up to 2 cm far from the scanner, and 4 mm where a foot stands on the rim of a hole.
        (r.feet_under_ground < 0.014, "feet under the ground"),
        (r.links_under_ground == 0.0, "links under the ground"),
    ]
    .into_iter()
    .filter_map(|(holds, name)| (!holds).then_some(name))
    .collect()
}

fn assert_stands(ground: Ground, seed: u64) {
    let report = walk(ground, seed);
    let faults = faults(&report);
    assert!(
        faults.is_empty(),
        "{ground:?}, seed {seed}: {faults:?}, {report:#?}"
    );
}

#[test]
fn the_quadruped_walks_up_a_ramp() {
    assert_stands(Ground::Ramp, 1);
}

#[test]
fn the_quadruped_walks_up_steps() {
    assert_stands(Ground::Steps, 2);
}

#[test]
fn the_quadruped_walks_over_rubble() {
    assert_stands(Ground::Rubble, 3);
}

/// All that the documentation reports; the gait was tuned on seed 1. In one walk a contact is deeper than half a radius, for
/// a reason that is not known.
#[test]
#[ignore = "39 walks take minutes: four on two cores"]
fn all_walks() {
    let mut found = Vec::new();
    for ground in Ground::ALL {
        for seed in 1..=13 {
            let r = walk(ground, seed);
            eprintln!(
                "| {ground:?} | {seed} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} |",
                1e2 * r.least_height / r.start_height,
                1e2 * r.last_height / r.start_height,
                r.way,
                r.deepest_radii,
                r.max_foot_force,
                1e3 * r.feet_under_ground,
                1e3 * r.links_under_ground
            );
            let faults = faults(&r);
            found.extend((!faults.is_empty()).then_some((ground, seed, faults)));
        }
    }
    assert_eq!(found, [(Ground::Rubble, 13, vec!["depth"])]);
}
