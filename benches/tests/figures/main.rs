//! The figures of the README and of the pages of `docs` are those of the stored results, rounded to the digits shown.

mod accuracy;
mod budgets;
mod frames;
mod gpu_day;
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

/// A stored file under `benches/results`.
fn stored_file(name: &str) -> Value {
    let path = top().join("benches/results").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Rows of a stored file under `benches/results`.
fn stored(name: &str) -> Vec<Value> {
    stored_file(name)["rows"].as_array().expect("rows").clone()
}

fn number(row: &Value, key: &str) -> f64 {
    let value = &row[key];
    value.as_f64().unwrap_or_else(|| panic!("{key} of {row}"))
}
