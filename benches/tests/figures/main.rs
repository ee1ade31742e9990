//! The figures of the README and of `docs/benchmarks.md` are those of the stored results, rounded to the digits shown.

mod accuracy;
mod budgets;
mod frames;
mod readme;
mod table;

use serde_json::Value;
use std::path::{Path, PathBuf};

fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn page(name: &str) -> String {
    std::fs::read_to_string(top().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Rows of a stored file under `benches/results`.
fn stored(name: &str) -> Vec<Value> {
    let path = top().join("benches/results").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
    let file: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
    file["rows"].as_array().expect("rows").clone()
}

fn number(row: &Value, key: &str) -> f64 {
    let value = &row[key];
    value.as_f64().unwrap_or_else(|| panic!("{key} of {row}"))
}

fn done(wrong: Vec<String>) {
    assert!(
        wrong.is_empty(),
        "{} are wrong:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}
