//! Runs the binary `drop` as a user would.

mod common;

use common::{
    PICTURES, TIMES, assert_pictures, assert_refused, folder, json, keys, list, number, run,
    seeded_report, stderr, write_ply,
};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

/// A level floor of 1.6 × 1.6 m with a block on it, z up.
fn floor_with_block() -> Vec<[f32; 3]> {
    let mut points = Vec::new();
    for i in 0..80 {
        for j in 0..80 {
            let height = if i < 20 && j < 20 { 0.2 } else { 0.0 };
            points.push([i as f32 * 0.02, j as f32 * 0.02, height]);
        }
    }
    for i in 0..20 {
        for k in 1..10 {
            points.push([i as f32 * 0.02, 0.39, k as f32 * 0.02]);
            points.push([0.39, i as f32 * 0.02, k as f32 * 0.02]);
        }
    }
    points
}

/// The surface of a cube 20 cm wide.
fn cube() -> Vec<[f32; 3]> {
    let mut points = Vec::new();
    for i in 0..=20 {
        for j in 0..=20 {
            for k in 0..=20 {
                if [i, j, k].iter().any(|c| *c == 0 || *c == 20) {
                    points.push([i, j, k].map(|c| c as f32 * 0.01));
                }
            }
        }
    }
    points
}

const BINARY: &str = env!("CARGO_BIN_EXE_drop");
/// Two cubes over a floor with a block.
const SCENE: &str = "--scan scan.ply --body body.ply --count 2";

fn write_scene(folder: &Path) {
    write_ply(&folder.join("scan.ply"), &floor_with_block());
    write_ply(&folder.join("body.ply"), &cube());
}

fn drop_in(folder: &Path, options: &str) -> Output {
    run(BINARY, folder, &format!("{SCENE} {options}"))
}

#[test]
fn bodies_come_to_rest_and_equal_seeds_give_equal_reports() {
    let folder = folder("rest");
    write_scene(&folder);
    let options = format!("{SCENE} --steps 120");
    let report = seeded_report(BINARY, &folder, &options, TIMES, "");
    let table = String::from_utf8(drop_in(&folder, "--steps 1 --animate").stdout).unwrap();
    assert_pictures(&folder.join("out/drop"), "motion.png");

    assert_eq!(
        keys(&report),
        "adapter backend bodies contact_steps dt fallback max_penetration mean_radius pairs_batched pairs_missed \
         real_time_factor scan_points steps up wall_seconds"
    );
    assert_eq!(report["backend"], "cpu");
    assert_eq!(report["adapter"], Value::Null);
    assert_eq!(report["steps"], 120);
    assert_eq!(report["scan_points"], floor_with_block().len());
    assert!(number(&report["up"][2]) > 0.999);
    // The scan is the coarser cloud: 0.65 of a diagonal of its grid of 2 cm, where the 7th
    // neighbour is; 5 %: points at rims and edges have farther or nearer ones.
    let mean_radius = number(&report["mean_radius"]);
    assert!((mean_radius / 0.0184 - 1.0).abs() < 0.05, "{mean_radius}");
    assert!(number(&report["contact_steps"]) > 60.0);
    let bodies = list(&report["bodies"]);
    assert_eq!(bodies.len(), 2);
    for body in bodies {
        assert_eq!(
            keys(body),
            "inside_bounds linear_speed max_penetration name points sleeping slept_at_seconds translation"
        );
        assert_eq!(body["points"], cube().len());
        assert_eq!(body["inside_bounds"], true);
        let name = body["name"].as_str().unwrap();
        assert!(name.starts_with("body ") && table.contains(name), "{table}");
        // A cube 20 cm wide at rest on the floor or on the block: its middle is 10 cm above.
        // Half a centimetre: half the radii of scan and body.
        let height = number(&body["translation"][2]);
        assert!(
            (height - 0.1).abs() < 0.005 || (height - 0.3).abs() < 0.005,
            "{body}"
        );
    }
    assert_pictures(&folder.join("out/drop"), PICTURES);
}

#[test]
fn a_body_that_falls_out_of_the_scan_is_a_failure() {
    let folder = folder("lost");
    write_scene(&folder);
    // A floor 40° off level, where the default friction of 0.5 holds up to 27°: all slide off.
    let output = drop_in(
        &folder,
        "--up 0.643,0,0.766 --steps 150 --json lost.json --no-pictures",
    );
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("fell out of the scan: body 1, body 2"),
        "{said}"
    );
    // The report is written all the same, and says so too.
    let report = json(folder.join("lost.json"));
    assert_eq!(report["bodies"][0]["inside_bounds"], false);
}

#[test]
fn bad_options_say_what_is_wrong() {
    let folder = folder("options");
    write_scene(&folder);
    for (options, code, message) in [
        ("--backend fast", 2, "is no backend"),
        ("--up 0,0,0", 2, "not an up direction"),
        ("--size -1", 2, "greater than 0"),
        ("--size 5", 1, "no level surface"),
        ("--scan-file x", 2, "unexpected argument"),
    ] {
        let options = format!("{SCENE} {options}");
        assert_refused(BINARY, &folder, &[(&options, code, message)]);
    }
    assert_refused(BINARY, &folder, &[("--scan missing.ply", 1, "missing.ply")]);
}
