//! How much of two clouds this project models, by placement and number of points.

use super::figure::{Axis, Curve, Figure, Line, Look, Mark, Panel, Point, numbered};
use super::looks;
use super::origin::origin;
use super::ticks::label;
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
    let mut all: Vec<usize> = rows(run).map(|(row, _)| row.points).collect();
    all.sort_unstable();
    all.dedup();
    all.into_iter().map(|n| n as f64).collect()
}

fn figure(run: &Run, sizes: &[f64]) -> Figure {
    let mut names: Vec<&str> = Vec::new();
    for (row, _) in rows(run) {
        if !names.contains(&&*row.placement) {
            names.push(&row.placement);
        }
    }
    let given = Curve {
        look: Look {
            color: looks::BLACK,
            mark: Mark::None,
            line: Line::Dashed,
        },
        points: points(sizes.iter().map(|n| (*n, 2.0 * n))),
    };
    let of = |(k, name): (usize, &&str)| {
        let here = rows(run).filter(|(row, _)| row.placement == **name);
        let mut modelled: Vec<(f64, f64)> = here
            .map(|(row, work)| (row.points as f64, work.modelled() as f64))
            .collect();
        modelled.sort_by(|p, q| p.0.total_cmp(&q.0));
        let curve = Curve {
            look: looks::placement_look(k),
            points: points(modelled.into_iter()),
        };
        ((*name).to_owned(), curve)
    };
    let mut named: Vec<(String, Curve)> = names.iter().enumerate().map(of).collect();
    named.push(("points of both clouds".to_owned(), given));
    let mut x = Axis::log("points of each cloud (of the scan)", sizes.iter().copied());
    let [low, high] = x.range;
    x.range[1] = low * (high / low).powf(1.0 / (1.0 - WORDS));
    x.ticks = Some(sizes.iter().map(|n| (*n, label(*n))).collect());
    let values = named
        .iter()
        .flat_map(|(_, curve)| &curve.points)
        .map(|p| p.y);
    let y = Axis::log("points and pixels modelled", values);
    let beside = words(&named, &y);
    let curves = named
        .into_iter()
        .map(|(_, curve)| curve)
        .chain(beside)
        .collect();
    Figure {
        name: "work".to_owned(),
        title: "No more than the scene needs: what is modelled of two clouds".to_owned(),
        subtitle: vec![format!(
            "{}, all points new: points that become part of an image, and pixels of the images.",
            run.rows[0].model
        )],
        panels: vec![Panel {
            title: String::new(),
            x,
            y,
            curves,
            levels: Vec::new(),
        }],
        columns: 1,
        panel_size: [900, 560],
        legend: Vec::new(),
        notes: vec![
            "Sums over all views and over looks with large pixels, through windows and with small pixels, of both \
             clouds. Counted, not timed."
                .to_owned(),
            origin([&run.provenance]),
        ],
    }
}

fn points(values: impl Iterator<Item = (f64, f64)>) -> Vec<Point> {
    let plain = values.map(|(x, y)| Point {
        x,
        y,
        ..Point::default()
    });
    plain.collect()
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
        Curve {
            look: Look {
                mark: Mark::None,
                line: Line::None,
                ..look
            },
            points: vec![Point {
                x,
                y: above,
                label: Some(format!("{name}: {}", short(end))),
                ..Point::default()
            }],
        }
    });
    beside.collect()
}

/// With two digits that count.
fn short(value: f64) -> String {
    let step = 10f64.powf(value.max(1.0).log10().floor() - 1.0);
    label((value / step).round() * step)
}
