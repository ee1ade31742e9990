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
