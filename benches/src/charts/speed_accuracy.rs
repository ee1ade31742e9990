//! Speed against accuracy: every method on the accuracy protocol.

use super::figure::{Axis, Curve, Entry, Figure, Panel, Point, lines};
use super::front::{front, steps};
use super::looks;
use super::origin::origin;
use crate::distinct::distinct;
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
        let radii = (row.pixel_scale, row.radius_scale);
        (row.rho, row.resolution, radii)
    };
    a.variant == b.variant && settings(a) == settings(b)
}

/// Rows of each method, in the order of their settings.
fn by_method<'a>(model: &Model<'a>) -> Vec<(&'a str, Vec<&'a AccuracyRow>)> {
    let mut methods = distinct(model.rows.iter().map(|row| &*row.variant));
    // Ours last, so that it is painted above the others.
    methods.sort_by_key(|method| (looks::look(method) == looks::OURS, *method == "paper"));
    let with_rows = |method: &'a str| {
        let own = model.rows.iter().filter(|row| row.variant == method);
        let mut rows: Vec<&AccuracyRow> = own.copied().collect();
        rows.sort_by(|a, b| setting(a).total_cmp(&setting(b)));
        (method, rows)
    };
    methods.into_iter().map(with_rows).collect()
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
    let grouped: Vec<_> = models.iter().map(by_method).collect();
    let panels: Vec<Panel> = grouped.iter().map(|grouped| panel(grouped)).collect();
    let mut methods = distinct(grouped.iter().flatten().map(|(method, _)| *method));
    methods.sort_by_key(|method| looks::look(method) != looks::OURS);
    let entry = |method: &&str| Entry::new(looks::look(method), looks::title(method));
    let mut legend: Vec<Entry> = methods.iter().map(entry).collect();
    legend.push(Entry::new(looks::FRONT, "Pareto front (points alone)"));
    Figure {
        name,
        title: "How often is the answer \"they touch\" wrong, and how long does it take?"
            .to_owned(),
        subtitle: lines([
            "Two copies of a model at 31 distances and 900 rotations, judged from their points \
             alone; the truth is exact tests of the mesh's triangles.",
            "Every case is a frame of new points: building what the method needs and finding all \
             contacts is counted, in processor time of one thread. Lower left is better.",
        ]),
        columns: panels.len().min(2),
        panels,
        panel_size: [640, 520],
        legend,
        notes: lines([
            &settings_note(models),
            RADIUS_NOTE,
            "Thin bars, on the front: the middle half of the cases. \"culled\": points outside of the overlap of \
             both bounds are dropped first. Meshes are given their triangles, the others only \
             points.",
            &origin(provenances(models)),
        ]),
    }
}

/// What is varied along the curves.
fn settings_note(models: &[Model]) -> String {
    let rows = || models.iter().flat_map(|model| &model.rows).copied();
    let part = |of_what: &str, unit: &str, value: fn(&AccuracyRow) -> Option<f32>| {
        let low = rows().filter_map(value).reduce(f32::min)?;
        let high = rows().filter_map(value).reduce(f32::max)?;
        Some(format!("{of_what}, {low} to {high} {unit}"))
    };
    let balls = "peers: the radius of balls or half edge of voxels";
    let parts = [
        part(balls, "r", |row| row.radius_scale.filter(|_| is_peer(row))),
        part("this project: the pixel", "r", |row| row.pixel_scale),
        part("the paper: the image's edge", "pixels", |row| {
            row.resolution.map(|pixels| pixels as f32)
        }),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
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
    let quartiles = |row: &AccuracyRow| [row.lower_quartile_ms, row.upper_quartile_ms];
    let point = |row: &&AccuracyRow| Point {
        x_spread: is_on_front(row).then(|| quartiles(row)),
        label: is_on_front(row).then(|| setting_label(row)),
        ..Point::new(row.median_ms, row.error_pct)
    };
    let mut curves = vec![Curve {
        look: looks::FRONT,
        points: steps(on_front.iter().map(|row| [row.median_ms, row.error_pct])),
    }];
    curves.extend(grouped.iter().map(|(method, rows)| Curve {
        look: looks::look(method),
        points: rows.iter().map(point).collect(),
    }));
    let spreads = on_front.iter().flat_map(|row| quartiles(row));
    let times = spreads.chain(rows.iter().map(|row| row.median_ms));
    let x = Axis::log("time for one frame, ms (median of all cases)", times);
    let errors = rows.iter().map(|row| row.error_pct);
    let y = Axis::log("wrong answers, % of all cases", errors);
    Panel::new(panel_title(&rows), x, y, curves)
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

/// Contacts that a row invents, and those that it misses, in % of the cases.
fn kinds(row: &AccuracyRow) -> [f64; 2] {
    [row.false_positive_pct, row.false_negative_pct]
}

/// What is said where the curve begins and ends, if it goes anywhere.
fn end_label(rows: &[&AccuracyRow], index: usize) -> Option<String> {
    let (first, last) = (rows.first()?, rows.last()?);
    let is_end = index == 0 || index + 1 == rows.len();
    let goes_anywhere = kinds(first) != kinds(last);
    (is_end && goes_anywhere).then(|| setting_label(rows[index]))
}

/// Missed against invented contacts of one model; new looks get an entry in the legend.
fn kinds_panel(model: &Model, legend: &mut Vec<Entry>) -> Panel {
    let answers = |rows: &[&AccuracyRow]| -> Vec<_> { rows.iter().map(|row| kinds(row)).collect() };
    // Methods that answer alike share a curve: all that test balls do.
    let mut alike: Vec<(Vec<&str>, Vec<&AccuracyRow>)> = Vec::new();
    for (method, rows) in by_method(model) {
        let is_alike = |(_, other): &&mut (_, Vec<_>)| answers(other) == answers(&rows);
        match alike.iter_mut().find(is_alike) {
            Some((methods, _)) => methods.push(method),
            None => alike.push((vec![method], rows)),
        }
    }
    let mut curves = Vec::new();
    for (methods, rows) in &alike {
        let look = looks::look(methods[0]);
        if !legend.iter().any(|entry| entry.look == look) {
            let label = match methods.len() {
                1 => looks::title(methods[0]),
                more => format!("{} and {} that answer alike", methods[0], more - 1),
            };
            legend.push(Entry::new(look, label));
        }
        let point = |(k, row): (usize, &&AccuracyRow)| Point {
            label: end_label(rows, k),
            ..Point::new(row.false_positive_pct, row.false_negative_pct)
        };
        let points = rows.iter().enumerate().map(point).collect();
        curves.push(Curve { look, points });
    }
    let all = |k: usize| model.rows.iter().map(move |row| kinds(row)[k]);
    let x = "invented: said to touch, but do not, % of all cases";
    let y = "missed: touch, but said not to, % of all cases";
    let (x, y) = (Axis::log(x, all(0)), Axis::log(y, all(1)));
    Panel::new(panel_title(&model.rows), x, y, curves)
}

fn kinds_figure(models: &[Model], name: String) -> Figure {
    let mut legend: Vec<Entry> = Vec::new();
    let panels = models.iter().map(|model| kinds_panel(model, &mut legend));
    let panels: Vec<Panel> = panels.collect();
    Figure {
        name,
        title: "Which errors are made: contacts that are missed, contacts that are invented"
            .to_owned(),
        subtitle: lines([
            "The same cases as in the chart of speed against accuracy. Lower left is better; \
             missed contacts let bodies sink into each other.",
        ]),
        columns: panels.len().min(2),
        panels,
        panel_size: [640, 500],
        legend,
        notes: lines([
            &settings_note(models),
            RADIUS_NOTE,
            &origin(provenances(models)),
        ]),
    }
}
