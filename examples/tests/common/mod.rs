//! What the tests of the binaries share.
#![allow(dead_code, reason = "each test file uses a part")]

#[allow(
    dead_code,
    unreachable_pub,
    reason = "a part of another package, of which this one uses a part"
)]
#[path = "../../../tests/testkit/skip.rs"]
pub(crate) mod skip;

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

/// Lines of numbers.
pub(crate) fn lines<const N: usize>(rows: impl IntoIterator<Item = [f32; N]>) -> String {
    let line = |row: [f32; N]| row.map(|number| number.to_string()).join(" ") + "\n";
    rows.into_iter().map(line).collect()
}

/// An ASCII PLY file. Lines of vertices have these properties, lines of faces a count and indices.
pub(crate) fn ply(properties: &str, vertices: &str, faces: &str) -> String {
    let count = |lines: &str| lines.lines().count();
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\n",
        count(vertices)
    );
    for name in properties.split_whitespace() {
        let is_color = ["red", "green", "blue"].contains(&name);
        let kind = if is_color { "uchar" } else { "float" };
        text += &format!("property {kind} {name}\n");
    }
    if !faces.is_empty() {
        let list = "property list uchar uint vertex_indices";
        text += &format!("element face {}\n{list}\n", count(faces));
    }
    text + "end_header\n" + vertices + faces
}

/// Writes points as an ASCII PLY file.
pub(crate) fn write_ply(path: &Path, points: &[[f32; 3]]) {
    fs::write(path, ply("x y z", &lines(points.iter().copied()), "")).unwrap();
}

/// Points of a ball of radius 1 about the origin, on a golden spiral.
pub(crate) fn ball(count: usize) -> Vec<[f64; 3]> {
    (0..count)
        .map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / count as f64;
            let angle = k as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
            let ring = (1.0 - z * z).sqrt();
            [ring * angle.cos(), ring * angle.sin(), z]
        })
        .collect()
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
        let vertex = |k: &usize| "vertex ".to_owned() + &lines([CORNERS[*k]]);
        let vertices: String = corners.into_iter().map(vertex).collect();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    });
    format!("solid\n{}endsolid\n", facets.collect::<String>())
}

/// The pictures of most runs.
pub(crate) const PICTURES: &str = "initial.png mid.png final.png";

/// The content of a JSON file.
pub(crate) fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The keys of an object, sorted.
pub(crate) fn keys(value: &Value) -> String {
    let mut keys: Vec<&str> = (value.as_object().unwrap().keys())
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    keys.join(" ")
}

/// Runs a binary in `folder`. White space is between options; `$TLDI_DATA` stands for the folder of test data.
pub(crate) fn run(binary: &str, folder: &Path, options: &str) -> Output {
    let data = skip::data_folder(CHECKOUT);
    let options = options.split_whitespace();
    Command::new(binary)
        .current_dir(folder)
        .args(options.map(|option| option.replace("$TLDI_DATA", data.to_str().unwrap())))
        .output()
        .unwrap()
}

/// Runs a binary in `folder` without its pictures and gives its report; it must succeed.
pub(crate) fn report(binary: &str, folder: &Path, options: &str) -> Value {
    report_with_pictures(binary, folder, &format!("{options} --no-pictures"))
}

/// Runs a binary in `folder` and gives its report; it must succeed.
pub(crate) fn report_with_pictures(binary: &str, folder: &Path, options: &str) -> Value {
    let output = run(binary, folder, &format!("{options} --json report.json"));
    assert!(output.status.success(), "{options}: {}", stderr(&output));
    json(folder.join("report.json"))
}

/// Runs a binary twice with one seed, first with its pictures, and once with another: but for times, the first two
/// reports must be equal, and the third must not. Gives the first. `times` are the keys of the report that differ
/// from run to run, `frame_times` those of each of its `frames`, where it has any.
pub(crate) fn seeded_report(
    binary: &str,
    folder: &Path,
    options: &str,
    times: &str,
    frame_times: &str,
) -> Value {
    let run = |options: String| {
        let mut report = report_with_pictures(binary, folder, &options);
        without_times(&mut report, times);
        let frames = report.get_mut("frames").and_then(Value::as_array_mut);
        for frame in frames.into_iter().flatten() {
            without_times(frame, frame_times);
        }
        report
    };
    let first = run(format!("{options} --seed 1"));
    let again = |seed| run(format!("{options} --seed {seed} --no-pictures"));
    assert_eq!(again(1), first);
    assert_ne!(again(2), first);
    first
}

/// Keys of a report's times.
pub(crate) const TIMES: &str = "wall_seconds real_time_factor";

/// Runs a binary with options that it must refuse: with this exit status, and a message that says so.
pub(crate) fn assert_refused(binary: &str, folder: &Path, cases: &[(&str, i32, &str)]) {
    for (options, code, message) in cases {
        let output = run(binary, folder, options);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(*code), "{options}: {said}");
        assert!(said.contains(message), "{options}: {said}");
    }
}

/// Takes numbers that differ from run to run, as times do, out of a report; they must be above 0.
fn without_times(report: &mut Value, keys: &str) {
    for key in keys.split_whitespace() {
        assert!(number(&report[key]) > 0.0, "{key}: {}", report[key]);
        report[key] = Value::Null;
    }
}

/// Asserts that a report has all of these fields.
pub(crate) fn assert_keys(report: &Value, expected: &str) {
    for key in expected.split_whitespace() {
        assert!(report.get(key).is_some(), "{key}");
    }
}

/// Asserts that these pictures lie in a folder.
pub(crate) fn assert_pictures(folder: &Path, names: &str) {
    for name in names.split_whitespace() {
        let png = fs::read(folder.join(name)).unwrap();
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n", "{name}");
    }
}

/// A number of a report.
pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// A place or a direction of a report.
pub(crate) fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| number(&value[k]))
}

/// A list of a report.
pub(crate) fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

/// What a run wrote for people, to its standard error.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

const CHECKOUT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Test data that is not part of the project, or `None`, said aloud, where it is not at hand; a failure where the variable
/// `TLDI_REQUIRE_DATA` is set.
pub(crate) fn data(name: &str) -> Option<PathBuf> {
    skip::test_data(CHECKOUT, name)
}
