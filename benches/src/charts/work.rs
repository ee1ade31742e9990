//! How much of two clouds this project models, by placement and number of points.

use super::figure::{Axis, Curve, Figure, Line, Look, Mark, Panel, Point, lines, numbered, points};
use super::looks;
use super::origin::origin;
use super::ticks::label;
use crate::distinct::{distinct, rising};
use crate::stored::{FrameRow, Stored, WorkRow};

type Run = Stored<FrameRow>;

/// Room for words beside the last points, as a share of the axis, which is logarithmic.
const WORDS: f64 = 0.24;

/// Least distance of words beside each other, as a share of the axis: a line of them.
const LINE: f64 = 0.035;

/// A chart for each run over several numbers of points that counted; why there is none.
pub(super) fn figures(runs: &[Run]) -> Result<Vec<Figure>, String> {
    let mut all = Vec::new();
    for run in runs {
        let sizes = sizes(run);
        if sizes.len() > 1 {
            all.push(numbered(&all, figure(run, &sizes)));
        }
    }
    match all.is_empty() && !runs.is_empty() {
        true => Err(
            "work: no chart, since no run of bvh_vs_tldi over several numbers of points counted what it \
             modelled; run it again with --points N,N --json"
                .to_owned(),
        ),
        false => Ok(all),
    }
}

/// Rows that counted, one a frame: all threads count alike.
fn rows(run: &Run) -> impl Iterator<Item = (&FrameRow, WorkRow)> {
    let counted = run.rows.iter().filter(|row| row.threads == 1);
    counted.filter_map(|row| Some((row, row.work?)))
}

/// Numbers of points, rising.
fn sizes(run: &Run) -> Vec<f64> {
    let all = rising(rows(run).map(|(row, _)| row.points));
    all.into_iter().map(|n| n as f64).collect()
}

/// How much is modelled in each placement, and all points that there are: what the curve is of, and the curve.
fn named_curves(run: &Run, sizes: &[f64]) -> Vec<(String, Curve)> {
    let names = distinct(rows(run).map(|(row, _)| &*row.placement));
    let of = |(k, name): (usize, &str)| {
        let here = rows(run).filter(|(row, _)| row.placement == name);
        let modelled = here.map(|(row, work)| (row.points as f64, work.modelled() as f64));
        let mut points = points(modelled);
        points.sort_by(|p, q| p.x.total_cmp(&q.x));
        let look = looks::placement_look(k);
        (name.to_owned(), Curve { look, points })
    };
    let mut named: Vec<(String, Curve)> = names.into_iter().enumerate().map(of).collect();
    let look = Look {
        line: Line::Dashed,
        ..Look::marks(looks::BLACK, Mark::None)
    };
    let points = points(sizes.iter().map(|n| (*n, 2.0 * n)));
    named.push(("points of both clouds".to_owned(), Curve { look, points }));
    named
}

fn figure(run: &Run, sizes: &[f64]) -> Figure {
    let named = named_curves(run, sizes);
    let mut x = Axis::log("points of each cloud (of the scan)", sizes.iter().copied());
    let [low, high] = x.range;
    x.range[1] = low * (high / low).powf(1.0 / (1.0 - WORDS));
    x.ticks = Some(sizes.iter().map(|n| (*n, label(*n))).collect());
    let values = named.iter().flat_map(|(_, curve)| &curve.points);
    let y = Axis::log("points and pixels modelled", values.map(|p| p.y));
    let words = words(&named, &y);
    let curves = named.into_iter().map(|(_, curve)| curve);
    let curves = curves.chain(words).collect();
    Figure {
        name: "work".to_owned(),
        title: "No more than the scene needs: what is modelled of two clouds".to_owned(),
        subtitle: vec![format!(
            "{}, all points new: points that become part of an image, and pixels of the images.",
            run.rows[0].model
        )],
        panels: vec![Panel::new("", x, y, curves)],
        columns: 1,
        panel_size: [900, 560],
        legend: Vec::new(),
        notes: lines([
            "Sums over all views and over looks with large pixels, through windows and with small pixels, of both \
             clouds. Counted, not timed.",
            &origin([&run.provenance]),
        ]),
    }
}

/// The names of curves, each beside its last point or, where others are there, below them.
fn words(curves: &[(String, Curve)], y: &Axis) -> Vec<Curve> {
    let [low, high] = y.range;
    let line = (high / low).powf(LINE);
    let ends = curves.iter().filter_map(|(name, curve)| {
        let Point { x, y, .. } = curve.points.last()?;
        Some((name, curve.look, *x, *y))
    });
    let mut ends: Vec<_> = ends.collect();
    ends.sort_by(|p, q| q.3.total_cmp(&p.3));
    let mut above = f64::MAX;
    let beside = ends.into_iter().map(|(name, look, x, end)| {
        // Words stand above their place: half a line lower their middle is there.
        above = (end / line.sqrt()).min(above / line);
        let words = Point {
            label: Some(format!("{name}: {}", short(end))),
            ..Point::new(x, above)
        };
        Curve {
            look: Look::marks(look.color, Mark::None),
            points: vec![words],
        }
    });
    beside.collect()
}

/// With two digits that count.
fn short(value: f64) -> String {
    let step = 10f64.powf(value.max(1.0).log10().floor() - 1.0);
    label((value / step).round() * step)
}
