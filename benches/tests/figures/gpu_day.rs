//! What a batch costs the host, on the page of the day with a GPU.

use crate::table::Table;
use crate::{number, stored_file};

/// The rows of the present version. Those of earlier ones have no stored file.
#[test]
fn host_costs() {
    let file = stored_file("gpu_day/llvmpipe_small.json");
    let rows = file["host_costs"].as_array().expect("rows");
    Table::read("docs/gpu_day.md", "## Host costs")
        .only(|name| name.contains(", now, "))
        .check(|name, k| {
            let frame = match name.contains("first frame") {
                true => "cold",
                false => "new points",
            };
            let is_it = |row: &&serde_json::Value| {
                row["frame"] == frame
                    && row["placement"] == name.split(',').next().unwrap_or_default()
            };
            let row = rows.iter().find(is_it)?;
            let keys = ["uploaded", "read_back", "filled", "dispatches", "redos"];
            let unit = if k < 3 { 1e6 } else { 1.0 };
            Some(vec![number(row, keys.get(k)?) / unit])
        });
}
