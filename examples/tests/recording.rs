//! Recordings of the stories, with the feature `rerun` and without it.

mod common;

use common::{assert_refused, folder};

const GALLOP: &str = env!("CARGO_BIN_EXE_gallop");

#[cfg(not(feature = "rerun"))]
#[test]
fn without_the_feature_it_is_said_how_to_get_it() {
    let folder = folder("recording_not_built");
    let binaries = [
        GALLOP,
        env!("CARGO_BIN_EXE_robot_in_scan"),
        env!("CARGO_BIN_EXE_depth_camera"),
    ];
    let case = ("--rerun run.rrd", 2, "--features tldi-examples/rerun");
    for binary in binaries {
        assert_refused(binary, &folder, &[case]);
    }
}

/// Points of the ground alone are 12 bytes each, new in every step.
#[cfg(feature = "rerun")]
#[test]
fn a_recording_holds_the_points_of_every_step() {
    let folder = folder("recording");
    let record = |steps: usize, file: &str| {
        let options = format!("--steps {steps} --bodies 1 --rerun {file}");
        let report = common::report(GALLOP, &folder, &options);
        let bytes = std::fs::read(folder.join(file)).unwrap();
        assert_eq!(&bytes[..3], b"RRF");
        let points = common::number(&report["ground_points"]);
        (bytes.len(), points as usize)
    };
    let ((few, points), (many, _)) = (record(2, "few.rrd"), record(6, "many.rrd"));
    // Heights of a smooth wave are compressed, but not to less than a byte each.
    assert!(
        few > 2 * points && many - few > 4 * points,
        "{few} {many} {points}"
    );
    let bad = ("--rerun run.txt", 2, "neither live nor a file");
    assert_refused(GALLOP, &folder, &[bad]);
}
