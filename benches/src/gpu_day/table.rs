//! A run in short.

#![allow(clippy::print_stdout, reason = "the table is the output")]

use super::{Report, Spread};

/// Prints what a reader wants to know first.
pub fn print(report: &Report) {
    let card = &report.card;
    println!(
        "{} ({}, {}, {} {}), subgroups {} to {}; stages compiled in {:.2} s, again in {:.2} s",
        card.name,
        card.device_type,
        card.api,
        card.driver,
        card.driver_info,
        card.subgroup_sizes[0],
        card.subgroup_sizes[1],
        card.compile_seconds,
        card.compile_again_seconds
    );
    floors(report);
    correctness(report);
    println!(
        "\n{:<14} {:>8} {:<11} {:>10} {:>10} {:>10} {:>6} {:>6}",
        "host costs", "points", "frame", "kB up", "kB down", "kB filled", "disp.", "redos"
    );
    for row in &report.host_costs {
        let kb = |bytes: u64| bytes as f64 * 1e-3;
        println!(
            "{:<14} {:>8} {:<11} {:>10.1} {:>10.1} {:>10.1} {:>6} {:>6}",
            row.placement,
            row.points,
            row.frame,
            kb(row.uploaded),
            kb(row.read_back),
            kb(row.filled),
            row.dispatches,
            row.redos
        );
    }
    println!(
        "\n{:<14} {:<8} {:>8} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "ms",
        "kind",
        "points",
        "pairs",
        "resident",
        "p95",
        "uploaded",
        "p95",
        "stages",
        "CPU",
        "one core"
    );
    for row in &report.workloads {
        // Where no pair is in reach, no stage ran.
        let sum = || row.stages.iter().map(|stage| stage.ms).sum();
        let stages: Option<f64> = (!row.stages.is_empty()).then(sum).flatten();
        println!(
            "{:<14} {:<8} {:>8} {:>6} {:>9.3} {:>9.3} {:>9.3} {:>9.3} {:>9} {:>9} {:>9}",
            row.placement,
            row.kind,
            row.points,
            row.pairs,
            row.resident.p50_ms,
            row.resident.p95_ms,
            row.uploaded.p50_ms,
            row.uploaded.p95_ms,
            number(stages),
            median(row.cpu),
            median(row.cpu_one_core)
        );
    }
    stages(report);
    for what in &report.skipped {
        println!("skipped: {what}");
    }
    for fault in &report.faults {
        println!("FAULT: {fault}");
    }
    println!(
        "{:.0} s, {} skipped, {} faults",
        report.seconds,
        report.skipped.len(),
        report.faults.len()
    );
}

fn median(spread: Option<Spread>) -> String {
    number(spread.map(|spread| spread.p50_ms))
}

fn number(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.3}"))
}

/// Of the scene with the most contacts.
fn stages(report: &Report) {
    let measured = report.workloads.iter().filter(|row| !row.stages.is_empty());
    let Some(row) = measured.max_by_key(|row| row.contacts) else {
        return;
    };
    println!(
        "\n{:<16} {:>9} {:>9} {:>9}   {} {}, {} points, {} pairs, {} contact pixels",
        "stage",
        "ms",
        "floor ms",
        "MB",
        row.placement,
        row.kind,
        row.points,
        row.pairs,
        row.contacts
    );
    for stage in &row.stages {
        println!(
            "{:<16} {:>9} {:>9} {:>9.3}",
            stage.stage,
            number(stage.ms),
            number(stage.floor_ms),
            stage.bytes as f64 * 1e-6
        );
    }
}

fn floors(report: &Report) {
    let floors = &report.floors;
    for (name, all) in [
        ("copies", &floors.copies),
        ("uploads", &floors.uploads),
        ("readbacks", &floors.readbacks),
    ] {
        let of = all.iter().map(|m| {
            let (mb, rate) = (m.bytes as f64 * 1e-6, m.bytes_per_second * 1e-9);
            format!("{mb} MB {rate:.2}")
        });
        println!("{name}, GB/s: {}", of.collect::<Vec<_>>().join(", "));
    }
    if let Some(submit) = floors.submit {
        println!("submission until done: {:.1} us", submit.p50_ms * 1e3);
    }
    for row in &floors.dispatches {
        println!(
            "{} dependent dispatches: {:.1} us direct, {:.1} us indirect",
            row.count,
            row.direct.p50_ms * 1e3,
            row.indirect.p50_ms * 1e3
        );
    }
}

fn correctness(report: &Report) {
    let found = &report.correctness;
    if let Some(parity) = &found.parity {
        println!(
            "parity: {} of {} pairs with other answers, {} turned, {} of {} contact pixels differ",
            parity.other_answers,
            parity.pairs,
            parity.turned,
            parity.other_contacts,
            parity.contacts
        );
    }
    if let Some(repeats) = found.repeats {
        println!("repeats: {} of {} equal", repeats.equal, repeats.runs);
    }
    if let Some(limits) = &found.default_limits {
        let reason = limits.failure.as_deref().unwrap_or("");
        println!("default limits: equal {} {reason}", limits.equal);
    }
}
