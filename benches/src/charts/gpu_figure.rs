//! What all figures of `gpu_day` share.

use super::figure::{Entry, Figure, Panel};
use super::origin::origin;
use crate::gpu_day::Report;

/// A figure of these panels, each of such a size, unless none of them has a point.
pub(super) fn figure(
    report: &Report,
    name: &str,
    title: &str,
    panels: Vec<Panel>,
    panel_size: [i32; 2],
    legend: Vec<Entry>,
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
        panel_size,
        legend,
        notes: vec![origin([&report.provenance])],
    })
}
