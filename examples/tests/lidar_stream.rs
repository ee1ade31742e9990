//! Runs the binary `lidar_stream` as a user would.

mod common;

use common::{assert_refused, folder, list, number, report, report_with_pictures, vector};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tldi::glamx::Vec3;
use tldi_examples::lidar::SweepSource;

const BINARY: &str = env!("CARGO_BIN_EXE_lidar_stream");

/// Asserts that the bodies lie on the ground, up to `slack` metres.
fn assert_on_ground(report: &Value, slack: f64) {
    for body in list(&report["bodies"]) {
        assert_eq!(body["lost"], false, "{body}");
        assert!(number(&body["height"]).abs() < slack, "{body}");
        assert!(number(&body["linear_speed"]) < 0.2, "{body}");
    }
}

#[test]
fn bodies_rest_on_a_generated_street() {
    let folder = folder("lidar_generated");
    let options = "--count 15 --seed 4 --bodies 3";
    let report = report_with_pictures(BINARY, &folder, options);
    assert_eq!(report["up"], serde_json::json!([0.0, 0.0, 1.0]));
    assert_eq!([&report["steps"], &report["pairs_missed"]], [90, 0]);
    let sweeps = list(&report["sweeps"]);
    assert_eq!(sweeps.len(), 15);
    let is_full = |sweep: &Value| number(&sweep["points"]) > 50_000.0;
    assert!(sweeps.iter().all(is_full), "{sweeps:?}");
    // Errors of ranges are up to 17 mm, of heights a third of it; the place is the highest point of all
    // under a body.
    assert_on_ground(&report, 0.03);
    assert!(folder.join("out/lidar_stream/final.png").exists());
}

/// Sweeps in KITTI's layout: the scanner looks along x with z up, poses are those of a camera that looks along
/// z with y down. The ground is a grid 1.5 m below, and two rays of each sweep met nothing: NaN, and the scanner's own place.
fn write_sweeps(folder: &Path, count: usize) {
    let mut poses = String::new();
    for k in 0..count {
        let ahead = 0.1 * k as f32;
        poses += &format!("1 0 0 0  0 1 0 0  0 0 1 {ahead}\n");
        let mut bytes = Vec::new();
        let mut push = |p: [f32; 3]| {
            for value in [p[0], p[1], p[2], 0.5] {
                bytes.extend(value.to_le_bytes());
            }
        };
        for i in -60..=60 {
            for j in -60..=60 {
                push([0.05 * i as f32 - ahead, 0.05 * j as f32, -1.5]);
            }
        }
        push([f32::NAN, 0.0, 0.0]);
        push([0.0; 3]);
        fs::write(folder.join(format!("{k:06}.bin")), bytes).unwrap();
    }
    fs::write(folder.join("poses.txt"), poses).unwrap();
    let calib = "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0  0 0 -1 0  1 0 0 0\n";
    fs::write(folder.join("calib.txt"), calib).unwrap();
}

#[test]
fn a_folder_of_sweeps_is_read_with_its_poses() {
    let folder = folder("lidar_folder");
    write_sweeps(&folder, 12);
    let report = report(BINARY, &folder, "--sweeps . --bodies 2 --size 0.6");
    assert_eq!(report["up"], serde_json::json!([0.0, -1.0, 0.0]));
    let sweeps = list(&report["sweeps"]);
    assert_eq!(sweeps.len(), 12);
    for sweep in sweeps {
        assert_eq!([&sweep["points"], &sweep["dropped"]], [121 * 121, 2]);
    }
    // The grid is exact; contacts scatter by a tenth of its radius.
    assert_on_ground(&report, 0.02);
}

/// Sweeps without points: files of no bytes, and rays that all met nothing. Bodies lie where the last sweep with points
/// was; the run starts at the first.
#[test]
fn sweeps_without_points_are_passed_over() {
    let folder = folder("lidar_empty");
    write_sweeps(&folder, 12);
    for k in [0, 1, 5, 11] {
        fs::write(folder.join(format!("{k:06}.bin")), []).unwrap();
    }
    fs::write(folder.join("000007.bin"), [0; 160]).unwrap();
    let report = report(BINARY, &folder, "--sweeps . --bodies 2 --size 0.6");
    let sweeps = list(&report["sweeps"]);
    assert_eq!(sweeps[0]["name"], "000002");
    assert_eq!(sweeps.len(), 10);
    for (k, sweep) in sweeps.iter().enumerate() {
        let expected = match [3, 5, 9].contains(&k) {
            true => 0,
            false => 121 * 121,
        };
        assert_eq!(sweep["points"], expected, "{sweep}");
    }
    assert_on_ground(&report, 0.02);
    for k in 0..12 {
        fs::write(folder.join(format!("{k:06}.bin")), []).unwrap();
    }
    let case = ("--sweeps .", 1, "none of the 12 sweeps has a point");
    assert_refused(BINARY, &folder, &[case]);
}

/// Asserts that the first point of every sweep, the grid's, is one place in the world.
fn assert_first_points(source: &SweepSource, place: Vec3) {
    for k in 0..source.count() {
        let sweep = source.sweep(k).unwrap();
        let first = sweep.world_from_scanner * sweep.points[0];
        assert!(first.distance(place) < 1e-5, "{k}: {first}");
    }
}

/// Files that are numbered without zeros in front have the poses of their numbers, packed ones among them.
#[test]
fn numbered_sweeps_have_their_poses() {
    let folder = folder("lidar_numbered");
    write_sweeps(&folder, 12);
    for k in 0..12 {
        let name = if k == 7 {
            "7.bin.gz"
        } else {
            &format!("{k}.bin")
        };
        fs::rename(folder.join(format!("{k:06}.bin")), folder.join(name)).unwrap();
    }
    let poses = fs::read_to_string(folder.join("poses.txt")).unwrap();
    fs::write(
        folder.join("poses.txt"),
        format!("# camera to world\n{poses}"),
    )
    .unwrap();
    let source = SweepSource::open(&folder).unwrap();
    assert_eq!(source.count(), 12);
    for k in 0..12 {
        assert_eq!(source.sweep(k).unwrap().name, k.to_string());
    }
    assert_first_points(&source, Vec3::new(3.0, 1.5, -3.0));
}

/// The same sweeps in coordinates of a map, where a step of `f32` is half a metre: they have the same places, relative to an
/// origin that the report tells.
#[test]
fn poses_may_be_those_of_a_map() {
    let map = [691_000.0_f64, 5_336_000.0, 8520.0];
    let folder = folder("lidar_map");
    write_sweeps(&folder, 3);
    let [x, y, z] = [map[0] + 0.25, map[1] + 0.125, map[2]];
    let poses: String = (0..3)
        .map(|k| format!("1 0 0 {x}  0 1 0 {y}  0 0 1 {}\n", z + 0.1 * f64::from(k)))
        .collect();
    fs::write(folder.join("poses.txt"), poses).unwrap();
    let source = SweepSource::open(&folder).unwrap();
    assert_eq!(source.origin().to_array(), map);
    assert_first_points(&source, Vec3::new(3.25, 1.625, -3.0));
    let report = report(BINARY, &folder, "--sweeps . --bodies 1 --size 0.6");
    assert_eq!(report["origin"], serde_json::json!(map));
    let place = vector(&report["bodies"][0]["translation"]);
    assert!(place.iter().all(|c| c.abs() < 10.0), "{place:?}");
}

#[test]
fn what_is_missing_is_named() {
    let folder = folder("lidar_refused");
    let refused = |message: &str| {
        assert_refused(BINARY, &folder, &[("--sweeps data", 1, message)]);
    };
    refused("data");
    let data = folder.join("data");
    fs::create_dir(&data).unwrap();
    refused("poses.txt");
    write_sweeps(&data, 2);
    fs::write(data.join("poses.txt"), "1 0 0 0 0 1 0 0 0 0 1 0\n").unwrap();
    refused("2 .bin files, but poses.txt has 1 poses");
    fs::write(data.join("poses.txt"), "1 0 0 0 0 1 0 0 0 0 1 0\n1 2 3\n").unwrap();
    refused("poses.txt, line 2: 3 numbers where 12 or 16 belong");
    fs::write(data.join("poses.txt"), "2 0 0 0 0 1 0 0 0 0 1 0\n").unwrap();
    refused("poses.txt, line 1: the matrix is no pose");
    fs::write(data.join("calib.txt"), "P0: 1\n").unwrap();
    refused("no line `Tr:`");
    assert_refused(BINARY, &folder, &[("--count 0", 2, "--count")]);
}
