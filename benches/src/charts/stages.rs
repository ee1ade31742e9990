//! On which stages this project spends a frame, by placement and number of points.

use super::figure::{Axis, Curve, Entry, Figure, Line, Look, Mark, Panel, Point, lines};
use super::looks;
use super::origin::origin;
use super::ticks::label;
use crate::distinct::{distinct, rising};
use crate::stored::{FrameRow, StageRow, Stored};
use std::cmp::Reverse;

type Run = Stored<FrameRow>;

/// Upper edge of a bar above its middle, in distances of bars. Half: words lie on the bar; twice:
/// they seem to belong to the bar above.
const BAR_TOP: f64 = 0.24;

/// Room for a letter in a bar, as a share of the frame, %: 8 of a panel's pixels. Half: words reach into the next stage;
/// twice: most stages have no words.
const LETTER: f64 = 1.4;

/// A chart of the run over most numbers of points of those that tell stages; why there is none.
pub(super) fn figures(runs: &[Run]) -> Result<Vec<Figure>, String> {
    let telling = runs.iter().filter(|run| rows(run).next().is_some());
    let run = telling.min_by_key(|run| Reverse(sizes(run).len()));
    match run {
        None if !runs.is_empty() => Err(
            "stages: no chart, since no run of bvh_vs_tldi told its stages; run it again with --json"
                .to_owned(),
        ),
        run => Ok(run.map(figure).into_iter().collect()),
    }
}

/// Rows that tell stages which took some time.
fn rows(run: &Run) -> impl Iterator<Item = (&FrameRow, &[StageRow])> {
    let all = run.rows.iter();
    let told = all.filter_map(|row| Some((row, row.stages.as_deref()?)));
    told.filter(|(_, stages)| stages.iter().any(|stage| stage.ms > 0.0))
}

/// Numbers of points, rising.
fn sizes(run: &Run) -> Vec<usize> {
    rising(rows(run).map(|(row, _)| row.points))
}

/// Stages of all rows in the order of their looks, which is that in which they run.
fn names(run: &Run) -> Vec<&str> {
    let stages = rows(run).flat_map(|(_, stages)| stages);
    let mut all = distinct(stages.map(|stage| &*stage.name));
    all.sort_by_key(|name| looks::stage(name).0);
    all
}

fn figure(run: &Run) -> Figure {
    let sizes = sizes(run);
    let names = names(run);
    let panels: Vec<Panel> = sizes.iter().map(|size| panel(run, *size, &names)).collect();
    let most = panels.iter().map(|panel| panel.y.range[1]);
    let bars = most.fold(0.0, f64::max);
    let entry = |name: &&str| Entry::new(Look::marks(looks::stage(name).1, Mark::Square), *name);
    Figure {
        name: "stages".to_owned(),
        title: "What a frame spends its time on".to_owned(),
        subtitle: vec![format!(
            "{}, all points new: share of each stage, without the stages within it. One thread.",
            run.rows[0].model
        )],
        columns: panels.len().min(2),
        panels,
        panel_size: [620, 84 + (54.0 * bars) as i32],
        legend: names.iter().map(entry).collect(),
        notes: lines([
            "Medians by the clock, of frames that are compared once more for their stages. The time beside a placement \
             is that of the frames that were timed.",
            "\"points\": both clouds take their points. \"cells\" and \"windows\": the first look. \"rest\": what is \
             outside of all stages.",
            &origin([&run.provenance]),
        ]),
    }
}

/// A bar for each placement, the first on top.
fn panel(run: &Run, size: usize, names: &[&str]) -> Panel {
    let here: Vec<_> = rows(run).filter(|(row, _)| row.points == size).collect();
    let mut curves = Vec::new();
    for (k, (row, stages)) in here.iter().enumerate() {
        let y = (here.len() - k) as f64;
        let sum: f64 = stages.iter().map(|stage| stage.ms).sum();
        let mut start = 0.0;
        for name in names {
            let Some(stage) = stages.iter().find(|stage| stage.name == **name) else {
                continue;
            };
            let end = start + 100.0 * stage.ms / sum;
            curves.push(part(name, [start, end], y));
            start = end;
        }
        let words = Point {
            label: Some(format!("{}: {} ms", row.placement, short(row.total_ms))),
            ..Point::new(0.0, y + BAR_TOP)
        };
        curves.push(Curve {
            look: Look::marks(looks::BLACK, Mark::None),
            points: vec![words],
        });
    }
    let y = Axis {
        ticks: Some(Vec::new()),
        ..Axis::over("", [0.5, here.len() as f64 + 0.75])
    };
    let x = Axis::linear("share of a frame's time, %", [0.0, 100.0]);
    let title = format!("{} points of each cloud (of the scan)", label(size as f64));
    Panel::new(title, x, y, curves)
}

/// A stage's part of a bar, with its name where there is room.
fn part(name: &str, [start, end]: [f64; 2], y: f64) -> Curve {
    let share = end - start;
    let words = [format!("{name} {share:.0} %"), name.to_owned()];
    let fits = |words: &String| LETTER * (words.len() + 1) as f64 <= share;
    let from = Point {
        label: words.into_iter().find(fits),
        ..Point::new(start, y)
    };
    Curve {
        look: Look {
            line: Line::Bar,
            ..Look::marks(looks::stage(name).1, Mark::None)
        },
        points: vec![from, Point::new(end, y)],
    }
}

/// Milliseconds with three digits that count.
fn short(ms: f64) -> String {
    let decimals = (2 - ms.max(1e-3).log10().floor() as i32).clamp(0, 4);
    format!("{ms:.*}", decimals as usize)
}
