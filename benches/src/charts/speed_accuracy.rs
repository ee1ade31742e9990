//! Speed against accuracy: every method on the accuracy protocol.

use super::figure::{Axis, Curve, Entry, Figure, Panel, Point};
use super::front::{front, steps};
use super::looks;
use super::origin::origin;
use crate::stored::{AccuracyRow, Provenance, Stored};

/// Models in the main chart: those with the most points.
const IN_MAIN: usize = 2;

const RADIUS_NOTE: &str = "r: the points' mean radius, 0.65 × the distance of the 7th neighbour. On \
                           the front no other method that is given points alone is both faster and \
                           more often right.";

type Run = Stored<AccuracyRow>;

/// What all runs say of one model without noise.
struct Model<'a> {
    rows: Vec<&'a AccuracyRow>,
    provenances: Vec<&'a Provenance>,
}

/// The main chart, the same for smaller models, and what kinds of errors are made.
pub(super) fn figures(runs: &[Run]) -> Vec<Figure> {
    let models = models(runs);
    let (main, rest) = models.split_at(models.len().min(IN_MAIN));
    let mut all = Vec::new();
    for (models, suffix) in [(main, ""), (rest, "_small")] {
        if !models.is_empty() {
            all.push(figure(models, format!("speed_accuracy{suffix}")));
            all.push(kinds_figure(models, format!("false_answers{suffix}")));
        }
    }
    all
}

/// Models of which peers were measured, those with the most points first. Where several runs have one
/// method with the same settings, that with the most cases counts.
fn models(runs: &[Run]) -> Vec<Model<'_>> {
    let has_peers = |run: &&Run| run.rows.iter().any(|row| row.noise == 0.0 && is_peer(row));
    let mut all: Vec<Model> = Vec::new();
    for run in runs.iter().filter(has_peers) {
        let name = &run.rows[0].model;
        let index = match all.iter().position(|model| model.rows[0].model == *name) {
            Some(index) => index,
            None => {
                all.push(Model {
                    rows: Vec::new(),
                    provenances: Vec::new(),
                });
                all.len() - 1
            }
        };
        let model = &mut all[index];
        model.provenances.push(&run.provenance);
        for row in run.rows.iter().filter(|row| row.noise == 0.0) {
            match model.rows.iter_mut().find(|other| is_same(other, row)) {
                Some(other) if other.cases < row.cases => *other = row,
                Some(_) => {}
                None => model.rows.push(row),
            }
        }
    }
    all.sort_by_key(|model| std::cmp::Reverse(model.rows[0].points));
    all
}

fn is_peer(row: &AccuracyRow) -> bool {
    !matches!(&*row.variant, "default" | "paper")
}

/// Whether two rows are of one method with one setting.
fn is_same(a: &AccuracyRow, b: &AccuracyRow) -> bool {
    let settings = |row: &AccuracyRow| {
        let AccuracyRow {
            rho,
            resolution,
            pixel_scale,
            radius_scale,
            ..
        } = *row;
        (rho, resolution, pixel_scale, radius_scale)
    };
    a.variant == b.variant && settings(a) == settings(b)
}

/// Rows of each method, in the order of their settings.
fn by_method<'a>(model: &Model<'a>) -> Vec<(&'a str, Vec<&'a AccuracyRow>)> {
    let mut all: Vec<(&str, Vec<&AccuracyRow>)> = Vec::new();
    for &row in &model.rows {
        match all.iter_mut().find(|(method, _)| *method == row.variant) {
            Some((_, rows)) => rows.push(row),
            None => all.push((&row.variant, vec![row])),
        }
    }
    for (_, rows) in &mut all {
        rows.sort_by(|a, b| setting(a).total_cmp(&setting(b)));
    }
    // Ours last, so that it is painted above the others.
    all.sort_by_key(|(method, _)| (looks::look(method) == looks::OURS, *method == "paper"));
    all
}

/// Whether a method is given points alone: meshes have no radius.
fn knows_points(row: &AccuracyRow) -> bool {
    row.radius_scale.is_some()
}

/// What is varied along a method's curve.
fn setting(row: &AccuracyRow) -> f64 {
    match (row.resolution, row.pixel_scale, row.radius_scale) {
        (Some(pixels), ..) => f64::from(pixels),
        (_, Some(scale), _) | (_, _, Some(scale)) => f64::from(scale),
        _ => 0.0,
    }
}

fn setting_label(row: &AccuracyRow) -> String {
    match (row.resolution, row.pixel_scale, row.radius_scale) {
        (Some(pixels), ..) => format!("{pixels}²"),
        (_, Some(scale), _) => format!("pixel {scale} r"),
        (_, _, Some(scale)) => format!("{scale} r"),
        _ => String::new(),
    }
}

fn figure(models: &[Model], name: String) -> Figure {
    let mut methods: Vec<&str> = Vec::new();
    let mut panels = Vec::new();
    for model in models {
        let grouped = by_method(model);
        for (method, _) in &grouped {
            if !methods.contains(method) {
                methods.push(method);
            }
        }
        panels.push(panel(&grouped));
    }
    methods.sort_by_key(|method| looks::look(method) != looks::OURS);
    let mut legend: Vec<Entry> = methods
        .iter()
        .map(|method| Entry {
            look: looks::look(method),
            label: looks::title(method),
        })
        .collect();
    legend.push(Entry {
        look: looks::FRONT,
        label: "Pareto front (points alone)".to_owned(),
    });
    Figure {
        name,
        title: "How often is the answer \"they touch\" wrong, and how long does it take?"
            .to_owned(),
        subtitle: vec![
            "Two copies of a model at 31 distances and 900 rotations, judged from their points \
             alone; the truth is exact tests of the mesh's triangles."
                .to_owned(),
            "Every case is a frame of new points: building what the method needs and finding all \
             contacts is counted, in processor time of one thread. Lower left is better."
                .to_owned(),
        ],
        columns: panels.len().min(2),
        panels,
        panel_size: [640, 520],
        legend,
        notes: vec![
            settings_note(models),
            RADIUS_NOTE.to_owned(),
            "Thin bars, on the front: the middle half of the cases. \"culled\": points outside of the overlap of \
             both bounds are dropped first. Meshes are given their triangles, the others only \
             points."
                .to_owned(),
            origin(provenances(models)),
        ],
    }
}

/// What is varied along the curves.
fn settings_note(models: &[Model]) -> String {
    let span = |values: Vec<f32>| {
        let low = values.iter().copied().fold(f32::MAX, f32::min);
        let high = values.iter().copied().fold(0.0, f32::max);
        format!("{low} to {high}")
    };
    let rows = || models.iter().flat_map(|model| &model.rows).copied();
    let of = |value: fn(&AccuracyRow) -> Option<f32>| rows().filter_map(value).collect::<Vec<_>>();
    let mut parts = Vec::new();
    let balls = of(
        |row| match row.variant == "default" || row.variant == "paper" {
            true => None,
            false => row.radius_scale,
        },
    );
    if !balls.is_empty() {
        parts.push(format!(
            "peers: the radius of balls or half edge of voxels, {} r",
            span(balls)
        ));
    }
    let pixels = of(|row| row.pixel_scale);
    if !pixels.is_empty() {
        parts.push(format!("this project: the pixel, {} r", span(pixels)));
    }
    let images = of(|row| row.resolution.map(|pixels| pixels as f32));
    if !images.is_empty() {
        parts.push(format!(
            "the paper: the image's edge, {} pixels",
            span(images)
        ));
    }
    format!("Along a curve varies, of {}.", parts.join("; of "))
}

fn panel(grouped: &[(&str, Vec<&AccuracyRow>)]) -> Panel {
    let rows: Vec<&AccuracyRow> = grouped.iter().flat_map(|(_, rows)| rows).copied().collect();
    let on_front: Vec<&AccuracyRow> = {
        let rows: Vec<&AccuracyRow> = rows.iter().copied().filter(|r| knows_points(r)).collect();
        let points: Vec<[f64; 2]> = rows.iter().map(|r| [r.median_ms, r.error_pct]).collect();
        front(&points).into_iter().map(|i| rows[i]).collect()
    };
    let is_on_front = |row: &AccuracyRow| on_front.iter().any(|other| std::ptr::eq(*other, row));
    let curve = |(method, rows): &(&str, Vec<&AccuracyRow>)| Curve {
        look: looks::look(method),
        points: rows
            .iter()
            .map(|row| Point {
                x: row.median_ms,
                y: row.error_pct,
                x_spread: is_on_front(row)
                    .then_some([row.lower_quartile_ms, row.upper_quartile_ms]),
                y_spread: None,
                label: is_on_front(row).then(|| setting_label(row)),
            })
            .collect(),
    };
    let on_front_at = on_front.iter().map(|row| [row.median_ms, row.error_pct]);
    let mut curves = vec![Curve {
        look: looks::FRONT,
        points: steps(on_front_at),
    }];
    curves.extend(grouped.iter().map(curve));
    let spreads = on_front
        .iter()
        .flat_map(|row| [row.lower_quartile_ms, row.upper_quartile_ms])
        .chain(rows.iter().map(|row| row.median_ms));
    Panel {
        title: panel_title(&rows),
        x: Axis::log("time for one frame, ms (median of all cases)", spreads),
        y: Axis::log(
            "wrong answers, % of all cases",
            rows.iter().map(|r| r.error_pct),
        ),
        curves,
        levels: Vec::new(),
    }
}

fn panel_title(rows: &[&AccuracyRow]) -> String {
    let row = rows[0];
    let fewest = rows.iter().map(|row| row.cases).min().unwrap_or(0);
    let most = rows.iter().map(|row| row.cases).max().unwrap_or(0);
    let cases = match fewest == most {
        true => format!("{most} cases"),
        false => format!("{fewest} to {most} cases"),
    };
    format!("{}: 2 × {} points, {cases}", row.model, row.points)
}

fn provenances<'a>(models: &[Model<'a>]) -> impl Iterator<Item = &'a Provenance> {
    models.iter().flat_map(|model| model.provenances.clone())
}

/// What is said where the curve begins and ends, if it goes anywhere.
fn end_label(rows: &[&AccuracyRow], index: usize) -> Option<String> {
    let place = |row: &AccuracyRow| [row.false_positive_pct, row.false_negative_pct];
    let (first, last) = (rows.first()?, rows.last()?);
    let is_end = index == 0 || index + 1 == rows.len();
    let goes_anywhere = place(first) != place(last);
    (is_end && goes_anywhere).then(|| setting_label(rows[index]))
}

/// Missed against invented contacts.
fn kinds_figure(models: &[Model], name: String) -> Figure {
    let mut legend: Vec<Entry> = Vec::new();
    let mut panels = Vec::new();
    for model in models {
        let answers = |rows: &[&AccuracyRow]| -> Vec<[f64; 2]> {
            let of = |row: &&AccuracyRow| [row.false_positive_pct, row.false_negative_pct];
            rows.iter().map(of).collect()
        };
        // Methods that answer alike share a curve: all that test balls do.
        let mut alike: Vec<(Vec<&str>, &Vec<&AccuracyRow>)> = Vec::new();
        let grouped = by_method(model);
        for (method, rows) in &grouped {
            match alike
                .iter_mut()
                .find(|(_, other)| answers(other) == answers(rows))
            {
                Some((methods, _)) => methods.push(method),
                None => alike.push((vec![method], rows)),
            }
        }
        let mut curves = Vec::new();
        for (methods, rows) in &alike {
            let look = looks::look(methods[0]);
            let label = match methods.len() {
                1 => looks::title(methods[0]),
                more => format!("{} and {} that answer alike", methods[0], more - 1),
            };
            if !legend.iter().any(|entry| entry.look == look) {
                legend.push(Entry { look, label });
            }
            curves.push(Curve {
                look,
                points: rows
                    .iter()
                    .enumerate()
                    .map(|(k, row)| Point {
                        x: row.false_positive_pct,
                        y: row.false_negative_pct,
                        label: end_label(rows, k),
                        ..Point::default()
                    })
                    .collect(),
            });
        }
        let all = || grouped.iter().flat_map(|(_, rows)| rows);
        panels.push(Panel {
            title: panel_title(&model.rows),
            x: Axis::log(
                "invented: said to touch, but do not, % of all cases",
                all().map(|row| row.false_positive_pct),
            ),
            y: Axis::log(
                "missed: touch, but said not to, % of all cases",
                all().map(|row| row.false_negative_pct),
            ),
            curves,
            levels: Vec::new(),
        });
    }
    Figure {
        name,
        title: "Which errors are made: contacts that are missed, contacts that are invented"
            .to_owned(),
        subtitle: vec![
            "The same cases as in the chart of speed against accuracy. Lower left is better; \
             missed contacts let bodies sink into each other."
                .to_owned(),
        ],
        columns: panels.len().min(2),
        panels,
        panel_size: [640, 500],
        legend,
        notes: vec![
            settings_note(models),
            RADIUS_NOTE.to_owned(),
            origin(provenances(models)),
        ],
    }
}
