//! Error against time.

use crate::table::{Table, numbers};
use crate::{number, stored};
use serde_json::Value;

#[test]
fn budgets() {
    let rows = stored("budgets/scan_and_bodies.json");
    let settings = Table::read(
        "docs/benchmarks.md",
        "processor time of one thread for all of a step's batch",
    );
    settings.check(|name, k| {
        let row = rows.iter().find(|row| row["setting"] == name)?;
        let key = ["median_ms", "median_error_mm", "p95_error_mm"].get(k)?;
        Some(vec![number(row, key)])
    });
    for shown in &settings.rows {
        let row = rows.iter().find(|row| row["setting"] == *shown[0]);
        let is_on_front = row.expect("a setting")["is_on_front"] == true;
        assert_eq!(shown[4] == "yes", is_on_front, "{shown:?}");
    }
    Table::read("docs/benchmarks.md", "A ball of 0.1 m, one r deep").check(|name, k| {
        let points: u64 = numbers(name)[0].parse().expect("points");
        let of = |setting: &str, key: &str| {
            let is_it = |row: &&Value| row["scan_points"] == points && row["setting"] == setting;
            rows.iter().find(is_it).map(|row| number(row, key))
        };
        let figure = match k {
            0 => of("random order", "floor_ms"),
            1 => of("random order", "median_ms"),
            _ => of("spatial order", "median_ms"),
        };
        figure.map(|figure| vec![figure])
    });
}
