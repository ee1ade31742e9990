//! Runs the binary `gallop` as a user would.

mod common;

use common::{
    PICTURES, TIMES, assert_keys, assert_pictures, assert_refused, ball, data, folder, list,
    number, ply, report, seeded_report,
};
use serde_json::Value;
use std::fs;
use std::path::Path;

const BINARY: &str = env!("CARGO_BIN_EXE_gallop");

/// A ball of 400 points that hops: z up, frames × points × 3 as numpy.save writes them.
fn write_hopping_ball(path: &Path) {
    let (frames, points) = (8, 400);
    let mut data = Vec::new();
    for frame in 0..frames {
        let height = 0.5 * (frame as f64 / frames as f64 * std::f64::consts::TAU).sin();
        for [x, y, z] in ball(points) {
            for c in [x, y, z + height] {
                data.extend((c as f32).to_le_bytes());
            }
        }
    }
    let header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({frames}, {points}, 3), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    fs::write(path, bytes).unwrap();
}

#[test]
fn the_creature_kicks_and_equal_seeds_give_equal_reports() {
    let folder = folder("gallop_generated");
    let frame_times = "deform_ms step_ms";
    let first = seeded_report(BINARY, &folder, "--steps 120", TIMES, frame_times);
    assert_keys(
        &first,
        "backend adapter steps dt frames contact_steps max_penetration",
    );
    assert_eq!(list(&first["frames"]).len(), 120);
    assert_eq!(first["pairs_missed"], 0);
    // Hooves, waves and bodies have known shapes. Depths are told within a radius, and hooves that move into bodies no
    // less deep than their deepest point is, but for that: the way out of a body may be longer.
    let radius = number(&first["mean_radius"]);
    for (kind, least) in [("scripted", 15.0), ("squeezed", 1.0), ("resting", 100.0)] {
        let of_kind = &first["true_depths"][kind];
        assert!(number(&of_kind["compared"]) >= least, "{kind}: {of_kind}");
        let worst = &of_kind["worst"];
        let error = number(&worst["told"]) - number(&worst["truth"]);
        assert!(error.abs() < radius, "{kind}: {of_kind}");
        assert!(
            number(&of_kind["mean_error"]) < 0.3 * radius,
            "{kind}: {of_kind}"
        );
    }
    let pushed = &first["true_depths"]["pushed"];
    let error = number(&pushed["worst"]["told"]) - number(&pushed["worst"]["truth"]);
    assert!(error > -radius, "{pushed}");
    assert!(number(&first["deepest"]["scripted"]["depth"]) > radius);
    // Feet are down for a good part of every cycle, and off the ground in others.
    let contact_steps = number(&first["contact_steps"]);
    assert!((20.0..120.0).contains(&contact_steps), "{contact_steps}");
    let bodies = list(&first["bodies"]);
    assert_eq!(bodies.len(), 8);
    let is_gone = |b: &Value| b["kicked"] == true && number(&b["displacement"]) > 0.1;
    assert!(bodies.iter().any(is_gone), "{bodies:?}");
    // What lies on the waves rises and falls with them, and stays on them.
    for body in bodies.iter().filter(|b| b["kicked"] == false) {
        let height = number(&body["translation"][1]);
        assert!((-0.05..0.25).contains(&height), "{body}");
    }
    assert_pictures(&folder.join("out/gallop"), PICTURES);
}

/// It touches where the ground, whose waves are known, is higher than its lowest point.
#[test]
fn a_hopping_ball_touches_where_it_is_low() {
    let folder = folder("gallop_ball");
    write_hopping_ball(&folder.join("ball.npy"));
    let options =
        "--frames ball.npy --up 0,0,1 --size 1 --cycle 0.8 --bodies 0 --speed 1 --steps 160";
    let report = report(BINARY, &folder, options);
    assert_eq!([&report["points"], &report["cycle_frames"]], [400, 8]);
    let tau = std::f64::consts::TAU;
    let mut certain = [0, 0];
    for frame in list(&report["frames"]) {
        let time = number(&frame["time"]);
        // Three metres high in its file, one metre here: it hops by a sixth of a metre.
        let bottom = (1.0 + (tau * time / 0.8).sin()) / 6.0;
        // It starts 1.9 m before the middle of waves that are 2.5 cm high and 0.9 m long.
        let x = -1.9 + time;
        let ground = 0.025 * (tau * x / 0.9 - tau * time / 1.6).sin();
        // 1 cm: a fifth of the ball's coarse radii. 3 cm: where the ground slopes by 10°, the ball
        // meets it 0.5 cm earlier, and gaps of a fifth of a radius count as touching.
        let touches = number(&frame["contacts"]) > 0.0;
        if ground - bottom > 0.01 {
            assert!(touches, "{frame}");
            certain[0] += 1;
        } else if ground - bottom < -0.03 {
            assert!(!touches, "{frame}");
            certain[1] += 1;
        }
    }
    assert!(certain[0] > 0 && certain[1] > 50, "{certain:?}");
}

#[test]
fn what_is_wrong_is_said() {
    let folder = folder("gallop_errors");
    write_hopping_ball(&folder.join("ball.npy"));
    let bytes = fs::read(folder.join("ball.npy")).unwrap();
    fs::write(folder.join("short.npy"), &bytes[..bytes.len() / 2]).unwrap();
    fs::create_dir_all(folder.join("empty")).unwrap();
    let other = ply("x y z", &"0 0 0\n".repeat(500), "3 0 1 450\n");
    fs::write(folder.join("other.ply"), other).unwrap();
    let cases = [
        ("--frames short.npy", 1, "frame 3 of 8 ends early"),
        ("--frames empty", 1, "no cloud in empty"),
        ("--frames lost.npy", 1, "lost.npy"),
        (
            "--frames ball.npy --faces other.ply",
            1,
            "other.ply has 500 points and the frames have 400",
        ),
        ("--faces other.ply", 2, "--frames"),
        ("--size -1", 2, "greater than 0"),
        ("--backend fast", 2, "is no backend"),
    ];
    assert_refused(BINARY, &folder, &cases);
}

#[test]
fn the_horse_gallops() {
    let (frames, faces) = ("positions_24x8431x3_f32.npy.gz", "frame01.ply.gz");
    if [frames, faces]
        .map(|name| data(&format!("horse_gallop/{name}")))
        .contains(&None)
    {
        return;
    }
    let folder = folder("gallop_horse");
    let horse = "$TLDI_DATA/horse_gallop";
    let options = format!("--frames {horse}/{frames} --faces {horse}/{faces} --steps 70");
    let report = report(BINARY, &folder, &options);
    assert_eq!([&report["points"], &report["cycle_frames"]], [8431, 24]);
    // Its hooves go back by some 3 m in a cycle of 0.8 s.
    let speed = number(&report["speed"]);
    assert!((2.0..6.0).contains(&speed), "{speed}");
    assert!(number(&report["contact_steps"]) > 20.0);
}
