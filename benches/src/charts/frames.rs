//! What a frame of new points costs, by placement and number of points.

use super::figure::{Axis, Curve, Entry, Figure, Panel, Point, lines, numbered};
use super::looks;
use super::origin::origin;
use crate::distinct::{distinct, rising};
use crate::stored::{FrameRow, Stored};

/// How the names of peers in their best form end.
const CULLED: &str = ", culled";

type Run = Stored<FrameRow>;

/// A chart for each run.
pub(super) fn figures(runs: &[Run]) -> Vec<Figure> {
    let mut all: Vec<Figure> = Vec::new();
    for run in runs.iter().filter(|run| rows(run).next().is_some()) {
        all.push(numbered(&all, figure(run)));
    }
    all
}

/// Rows of one thread. Those of several are measured by the clock, not in processor time, so that both
/// do not belong on one axis.
fn rows(run: &Run) -> impl Iterator<Item = &FrameRow> {
    run.rows.iter().filter(|row| row.threads == 1)
}

/// The method of a row, in whichever form.
fn method(row: &FrameRow) -> &str {
    row.method.strip_suffix(CULLED).unwrap_or(&row.method)
}

fn methods(run: &Run) -> Vec<&str> {
    distinct(rows(run).map(method))
}

/// A curve for each method, by the faster form of its rows. A curve has a point at each of `places` along x, of the rows
/// that `is_at` finds to be of that place, by its number.
fn curves(run: &Run, places: &[f64], is_at: impl Fn(&FrameRow, usize) -> bool) -> Vec<Curve> {
    let point = |wanted: &str, k: usize| {
        let here = rows(run).filter(|row| method(row) == wanted && is_at(row, k));
        let row = here.min_by(|a, b| a.total_ms.total_cmp(&b.total_ms))?;
        Some(Point {
            y_spread: Some([row.least_ms, row.most_ms]),
            ..Point::new(places[k], row.total_ms)
        })
    };
    let curve = |wanted: &&str| Curve {
        look: looks::look(wanted),
        points: (0..places.len()).filter_map(|k| point(wanted, k)).collect(),
    };
    // Ours, which come first, above the others.
    methods(run).iter().rev().map(curve).collect()
}

fn panel(title: &str, x: Axis, curves: Vec<Curve>) -> Panel {
    let points = curves.iter().flat_map(|curve| &curve.points);
    let times = points.flat_map(|p| p.y_spread.unwrap_or([p.y; 2]));
    let y = Axis::log("ms for one frame", times);
    Panel::new(title, x, y, curves)
}

/// A panel for each placement, over the numbers of points.
fn by_points(run: &Run, placements: &[&str], sizes: &[usize]) -> Vec<Panel> {
    let places: Vec<f64> = sizes.iter().map(|n| *n as f64).collect();
    let of = |placement: &&str| {
        let is_at =
            |row: &FrameRow, k: usize| row.placement == *placement && row.points == sizes[k];
        let x = Axis::log("points of each body (of the scan)", places.iter().copied());
        panel(placement, x, curves(run, &places, is_at))
    };
    placements.iter().map(of).collect()
}

/// One panel over the placements.
fn by_placement(run: &Run, placements: &[&str]) -> Panel {
    let places: Vec<f64> = (0..placements.len()).map(|k| k as f64).collect();
    let names = placements.iter().map(|name| (*name).to_owned());
    let x = Axis {
        ticks: Some(places.iter().copied().zip(names).collect()),
        ..Axis::over("how the bodies lie", [-0.5, placements.len() as f64 - 0.5])
    };
    let is_at = |row: &FrameRow, k: usize| row.placement == placements[k];
    panel("", x, curves(run, &places, is_at))
}

fn figure(run: &Run) -> Figure {
    let sizes = rising(run.rows.iter().map(|row| row.points));
    let placements = distinct(run.rows.iter().map(|row| &*row.placement));
    let title = format!("What a frame of new points costs: {}", run.rows[0].model);
    let (title, panels, columns, panel_size) = match sizes[..] {
        [size] => {
            let title = format!("{title}, 2 × {size} points");
            (title, vec![by_placement(run, &placements)], 1, [980, 560])
        }
        _ => (title, by_points(run, &placements, &sizes), 3, [430, 420]),
    };
    let entry = |method: &&str| Entry::new(looks::look(method), looks::title(method));
    Figure {
        name: name(run),
        title,
        subtitle: lines([
            "From points to contacts, all points new: building what the method needs, and the query. \
             Processor time of one thread.",
        ]),
        panels,
        columns,
        panel_size,
        legend: methods(run).iter().map(entry).collect(),
        notes: lines([
            &format!(
                "Medians of {} frames; bars from the fastest to the slowest. Peers as they are, or culled \
                 to the overlap of both bounds, whichever is faster.",
                run.rows[0].frames
            ),
            "Peers pair balls or voxels, this project finds surfaces, gaps and contact patches: the chart \
             of speed against accuracy says what each answer is worth.",
            &origin([&run.provenance]),
        ]),
    }
}

fn name(run: &Run) -> String {
    let model = run.rows[0]
        .model
        .replace(|c: char| !c.is_alphanumeric(), "_");
    let model = model.trim_end_matches('_').replace("__", "_");
    format!("frame_cost_{model}")
}
