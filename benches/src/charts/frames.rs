//! What a frame of new points costs, by placement and number of points.

use super::figure::{Axis, Curve, Entry, Figure, Panel, Point, numbered};
use super::looks;
use super::origin::origin;
use crate::stored::{FrameRow, Stored};

/// How the names of peers in their best form end.
const CULLED: &str = ", culled";

type Run = Stored<FrameRow>;

/// A chart for each run.
pub(super) fn figures(runs: &[Run]) -> Vec<Figure> {
    let mut all: Vec<Figure> = Vec::new();
    for run in runs.iter().filter(|run| rows(run).next().is_some()) {
        let figure = match sizes(run).len() {
            1 => by_placement(run),
            _ => by_points(run),
        };
        all.push(numbered(&all, figure));
    }
    all
}

/// Numbers of points, rising.
fn sizes(run: &Run) -> Vec<usize> {
    let mut all: Vec<usize> = run.rows.iter().map(|row| row.points).collect();
    all.sort_unstable();
    all.dedup();
    all
}

fn placements(run: &Run) -> Vec<&str> {
    let mut all: Vec<&str> = Vec::new();
    for row in &run.rows {
        if !all.contains(&&*row.placement) {
            all.push(&row.placement);
        }
    }
    all
}

/// Rows of one thread. Those of several are measured by the clock, not in processor time, so that both
/// do not belong on one axis.
fn rows(run: &Run) -> impl Iterator<Item = &FrameRow> {
    run.rows.iter().filter(|row| row.threads == 1)
}

/// Names of methods, whichever form is faster.
fn methods(run: &Run) -> Vec<&str> {
    let mut all: Vec<&str> = Vec::new();
    for row in rows(run) {
        let method = method(row);
        if !all.contains(&method) {
            all.push(method);
        }
    }
    all
}

fn method(row: &FrameRow) -> &str {
    row.method.strip_suffix(CULLED).unwrap_or(&row.method)
}

fn entries(run: &Run) -> Vec<Entry> {
    methods(run)
        .iter()
        .map(|method| Entry {
            look: looks::look(method),
            label: looks::title(method),
        })
        .collect()
}

/// The faster form of a method's rows.
fn fastest<'a>(rows: impl Iterator<Item = &'a FrameRow>) -> Option<&'a FrameRow> {
    rows.min_by(|a, b| a.total_ms.total_cmp(&b.total_ms))
}

fn point(x: f64, row: &FrameRow) -> Point {
    Point {
        x,
        y: row.total_ms,
        x_spread: None,
        y_spread: Some([row.least_ms, row.most_ms]),
        label: None,
    }
}

fn name(run: &Run) -> String {
    let model: String = run.rows[0]
        .model
        .chars()
        .map(|c| if c.is_alphanumeric() { c } else { '_' })
        .collect();
    format!(
        "frame_cost_{}",
        model.trim_end_matches('_').replace("__", "_")
    )
}

fn notes(run: &Run) -> Vec<String> {
    vec![
        format!(
            "Medians of {} frames; bars from the fastest to the slowest. Peers as they are, or culled \
             to the overlap of both bounds, whichever is faster.",
            run.rows[0].frames
        ),
        "Peers pair balls or voxels, this project finds surfaces, gaps and contact patches: the chart \
         of speed against accuracy says what each answer is worth."
            .to_owned(),
        origin([&run.provenance]),
    ]
}

const ABOUT: &str = "From points to contacts, all points new: building what the method needs, and the query. \
                     Processor time of one thread.";

fn by_points(run: &Run) -> Figure {
    let panels = placements(run)
        .into_iter()
        .map(|placement| {
            let curves: Vec<Curve> = methods(run)
                .iter()
                .rev() // ours, which come first, above the others
                .map(|wanted| Curve {
                    look: looks::look(wanted),
                    points: sizes(run)
                        .into_iter()
                        .filter_map(|points| {
                            let rows = rows(run).filter(|row| {
                                row.placement == placement
                                    && row.points == points
                                    && method(row) == *wanted
                            });
                            fastest(rows).map(|row| point(points as f64, row))
                        })
                        .collect(),
                })
                .collect();
            Panel {
                title: placement.to_owned(),
                x: Axis::log(
                    "points of each body (of the scan)",
                    sizes(run).into_iter().map(|n| n as f64),
                ),
                y: Axis::log("ms for one frame", values(&curves)),
                curves,
                levels: Vec::new(),
            }
        })
        .collect();
    Figure {
        name: name(run),
        title: format!("What a frame of new points costs: {}", run.rows[0].model),
        subtitle: vec![ABOUT.to_owned()],
        panels,
        columns: 3,
        panel_size: [430, 420],
        legend: entries(run),
        notes: notes(run),
    }
}

fn values(curves: &[Curve]) -> Vec<f64> {
    let points = curves.iter().flat_map(|curve| &curve.points);
    points
        .flat_map(|p| p.y_spread.unwrap_or([p.y; 2]))
        .collect()
}

fn by_placement(run: &Run) -> Figure {
    let placements = placements(run);
    let curves: Vec<Curve> = methods(run)
        .iter()
        .rev()
        .map(|wanted| Curve {
            look: looks::look(wanted),
            points: placements
                .iter()
                .enumerate()
                .filter_map(|(k, placement)| {
                    let rows = rows(run)
                        .filter(|row| row.placement == *placement && method(row) == *wanted);
                    fastest(rows).map(|row| point(k as f64, row))
                })
                .collect(),
        })
        .collect();
    let x = Axis {
        label: "how the bodies lie".to_owned(),
        is_log: false,
        range: [-0.5, placements.len() as f64 - 0.5],
        has_zero: false,
        ticks: Some(
            placements
                .iter()
                .enumerate()
                .map(|(k, placement)| (k as f64, (*placement).to_owned()))
                .collect(),
        ),
    };
    Figure {
        name: name(run),
        title: format!(
            "What a frame of new points costs: {}, 2 × {} points",
            run.rows[0].model,
            sizes(run)[0]
        ),
        subtitle: vec![ABOUT.to_owned()],
        panels: vec![Panel {
            title: String::new(),
            x,
            y: Axis::log("ms for one frame", values(&curves)),
            curves,
            levels: Vec::new(),
        }],
        columns: 1,
        panel_size: [980, 560],
        legend: entries(run),
        notes: notes(run),
    }
}
