//! What is stored has the form that the code reads, and a run gives that form.

use super::*;
use crate::placements::Placement;
use crate::stored::write_json;
use serde_json::Value;
use tldi_tests::gpu_backend;

const STORED: &str = include_str!("../../results/gpu_day/llvmpipe_small.json");

/// Every part is there, and every number is possible.
fn check(report: &Report) {
    assert_eq!(report.kind, KIND);
    assert_eq!(report.faults, [""; 0]);
    assert!(report.provenance.adapter.as_ref() == Some(&report.card.name));
    assert!(report.card.offered_limits.contains_key("max_buffer_size"));
    let floors = &report.floors;
    for moved in [&floors.copies, &floors.uploads, &floors.readbacks] {
        assert!(!moved.is_empty() && moved.iter().all(|m| m.bytes_per_second > 0.0));
    }
    assert_eq!(floors.dispatches.len(), 4);
    let parity = report.correctness.parity.as_ref().expect("it was measured");
    assert_eq!(parity.pairs as u64, report.settings.parity_pairs);
    let binned: usize = parity.gaps.iter().map(|bin| bin.count).sum();
    assert!(binned > 0 && binned <= parity.pairs);
    assert_eq!(report.correctness.counters.len(), 3);
    assert_eq!(report.host_costs.len(), 6);
    for row in &report.workloads {
        for spread in [row.resident, row.uploaded, row.built] {
            assert!(
                spread.p50_ms > 0.0 && spread.p50_ms <= spread.p95_ms,
                "{row:?}"
            );
        }
        let is_apart = row.placement == Placement::NearMiss.name();
        assert_eq!(row.contacts == 0, is_apart, "{row:?}");
    }
    let scenes = report.settings.sizes.len() * Placement::ALL.len() * Kind::ALL.len();
    let rows = scenes + report.settings.batches.len();
    assert_eq!(report.workloads.len(), rows, "{:?}", report.skipped);
}

#[test]
fn stored_results_have_the_form_of_the_code() {
    let report: Report = serde_json::from_str(STORED).expect("it has the form");
    check(&report);
    assert!(report.card.name.contains("llvmpipe"));
    let again = serde_json::to_string(&report).expect("it can be written");
    assert!(form(&again) == form(STORED), "a member is lost or added");
}

/// All members, without their numbers, of which the last digit is not kept.
fn form(text: &str) -> Value {
    fn without_numbers(value: Value) -> Value {
        match value {
            Value::Number(_) => Value::Null,
            Value::Array(all) => all.into_iter().map(without_numbers).collect(),
            Value::Object(all) => {
                let members = all.into_iter();
                members
                    .map(|(name, value)| (name, without_numbers(value)))
                    .collect()
            }
            other => other,
        }
    }
    without_numbers(serde_json::from_str(text).expect("it is JSON"))
}

/// A short run of all parts.
#[test]
fn a_run_measures_all_parts() {
    if gpu_backend().is_none() {
        return;
    }
    let settings = Settings {
        sizes: vec![1_000],
        batches: vec![2],
        repeats: 1,
        parity_pairs: 10,
        equal_batches: 1,
        copy_bytes: 1_000_000,
        host_cost_points: 2_000,
        ..Settings::small()
    };
    let out = std::env::temp_dir().join(format!("gpu_day_{}", std::process::id()));
    std::fs::create_dir_all(&out).expect("a folder for temporary files");
    let report = Report::measure(settings, Some(&out)).expect("the device works");
    check(&report);
    let pictures = std::fs::read_dir(&out).expect("it is there");
    let names = pictures.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    assert_eq!(names.filter(|name| name.ends_with(".png")).count(), 6);
    assert_eq!(report.frames.len(), 10);
    let json = out.join("report.json");
    write_json(&json, &report).expect("it is writable");
    let text = std::fs::read_to_string(&json).expect("it was written");
    let read: Report = serde_json::from_str(&text).expect("it has the form");
    let again = serde_json::to_string(&read).expect("it can be written");
    assert!(form(&again) == form(&text), "a member is lost or added");
    std::fs::remove_dir_all(&out).expect("it is ours");
}

/// A run without time says what it did not measure.
#[test]
fn a_run_without_time_says_so() {
    if gpu_backend().is_none() {
        return;
    }
    let settings = Settings {
        seconds: 0.0,
        ..Settings::full()
    };
    let report = Report::measure(settings, None).expect("the device works");
    let rows = 4 * Placement::ALL.len() * Kind::ALL.len();
    assert!(report.skipped.len() > rows, "{}", report.skipped.len());
    assert!(report.workloads.is_empty() && report.correctness.parity.is_none());
}
