//! What the tests of the binaries share.
#![allow(dead_code, reason = "each test file uses a part")]

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// An empty folder of this test's own.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder).unwrap();
    }
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Writes points as an ASCII PLY file.
pub(crate) fn write_ply(path: &Path, points: &[[f32; 3]]) {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\nend_header\n",
        points.len()
    );
    for [x, y, z] in points {
        text += &format!("{x} {y} {z}\n");
    }
    fs::write(path, text).unwrap();
}

/// Corners of a cube of 2 m about the origin, as Blender saves it, and its sides, anticlockwise as seen from outside.
pub(crate) const CORNERS: [[f32; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];
pub(crate) const SIDES: [[usize; 4]; 6] = [
    [0, 2, 3, 1],
    [4, 5, 7, 6],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 4, 6, 2],
    [1, 3, 7, 5],
];

/// The cube as ASCII STL, whose solid has no name.
pub(crate) fn cube_as_stl() -> String {
    let halves = SIDES.iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let facets = halves.map(|corners| {
        let vertex = |k: &usize| {
            let [x, y, z] = CORNERS[*k];
            format!("vertex {x} {y} {z}\n")
        };
        let vertices: String = corners.into_iter().map(vertex).collect();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    });
    format!("solid\n{}endsolid\n", facets.collect::<String>())
}

/// The pictures of a run.
pub(crate) const PICTURES: [&str; 3] = ["initial.png", "mid.png", "final.png"];

/// The content of a JSON file.
pub(crate) fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The keys of an object, sorted.
pub(crate) fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    keys
}

/// Runs a binary in `folder`.
pub(crate) fn run(binary: &str, folder: &Path, options: &[&str]) -> Output {
    Command::new(binary)
        .current_dir(folder)
        .args(options)
        .output()
        .unwrap()
}

/// Runs a binary in `folder` without its pictures and gives its report; it must succeed.
pub(crate) fn report(binary: &str, folder: &Path, options: &[&str]) -> Value {
    report_with_pictures(binary, folder, &[options, &["--no-pictures"]].concat())
}

/// Runs a binary in `folder` and gives its report; it must succeed.
pub(crate) fn report_with_pictures(binary: &str, folder: &Path, options: &[&str]) -> Value {
    let output = run(
        binary,
        folder,
        &[&["--json", "report.json"], options].concat(),
    );
    assert!(output.status.success(), "{options:?}: {}", stderr(&output));
    json(folder.join("report.json"))
}

/// Runs a binary twice with one seed, first with its pictures, and once with another: but for times, the first two
/// reports must be equal, and the third must not. Gives the first. `times` are the keys of the report that differ
/// from run to run, `frame_times` those of each of its `frames`, where it has any.
pub(crate) fn seeded_report(
    binary: &str,
    folder: &Path,
    options: &[&str],
    times: &[&str],
    frame_times: &[&str],
) -> Value {
    type Run = fn(&str, &Path, &[&str]) -> Value;
    let run = |report: Run, seed: &str| {
        let mut report = report(binary, folder, &[options, &["--seed", seed]].concat());
        without_times(&mut report, times);
        let frames = report.get_mut("frames").and_then(Value::as_array_mut);
        for frame in frames.into_iter().flatten() {
            without_times(frame, frame_times);
        }
        report
    };
    let first = run(report_with_pictures, "1");
    assert_eq!(run(report, "1"), first);
    assert_ne!(run(report, "2"), first);
    first
}

/// Keys of a report's times.
pub(crate) const TIMES: [&str; 2] = ["wall_seconds", "real_time_factor"];

/// Runs a binary with options that it must refuse: with this exit status, and a message that says so.
pub(crate) fn assert_refused(binary: &str, folder: &Path, cases: &[(&[&str], i32, &str)]) {
    for (options, code, message) in cases {
        let output = run(binary, folder, options);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(*code), "{options:?}: {said}");
        assert!(said.contains(message), "{options:?}: {said}");
    }
}

/// Takes numbers that differ from run to run, as times do, out of a report; they must be above 0.
pub(crate) fn without_times(report: &mut Value, keys: &[&str]) {
    for key in keys {
        assert!(number(&report[key]) > 0.0, "{key}: {}", report[key]);
        report[key] = Value::Null;
    }
}

/// Asserts that a report has all of these fields.
pub(crate) fn assert_keys(report: &Value, expected: &[&str]) {
    for key in expected {
        assert!(keys(report).contains(key), "{key}");
    }
}

/// Asserts that these pictures lie in a folder.
pub(crate) fn assert_pictures(folder: &Path, names: &[&str]) {
    for name in names {
        let png = fs::read(folder.join(name)).unwrap();
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n", "{name}");
    }
}

/// A number of a report.
pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// What a run wrote for people, to its standard error.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Test data that is not part of the project, or `None`, said aloud, where it is not at hand.
pub(crate) fn data(name: &str) -> Option<PathBuf> {
    let folder = std::env::var("TLDI_DATA").map_or_else(
        |_| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!(
        "SKIPPED: no test data at {} (set TLDI_DATA)",
        path.display()
    );
    None
}
