//! What all figures of `gpu_day` share.

use super::figure::{Figure, Panel, Point};
use super::origin::origin;
use crate::gpu_day::Report;

/// A figure of these panels, unless none of them has a point.
pub(super) fn figure(
    report: &Report,
    name: &str,
    title: &str,
    panels: Vec<Panel>,
) -> Option<Figure> {
    let has_points = |panel: &Panel| panel.curves.iter().any(|curve| !curve.points.is_empty());
    panels.iter().any(has_points).then(|| Figure {
        name: format!("gpu_day_{name}"),
        title: title.to_owned(),
        subtitle: vec![format!(
            "{} ({}, {} {})",
            report.card.name, report.card.api, report.card.driver, report.card.driver_info
        )],
        columns: panels.len().min(3),
        panels,
        panel_size: [400, 330],
        legend: Vec::new(),
        notes: vec![origin([&report.provenance])],
    })
}

/// Points of curves without ranges.
pub(super) fn points(values: impl Iterator<Item = (f64, f64)>) -> Vec<Point> {
    let plain = values.map(|(x, y)| Point {
        x,
        y,
        ..Point::default()
    });
    plain.collect()
}
