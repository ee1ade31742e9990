//! The figures of the paper that vary one thing: ρ, distance, resolution, noise, size of splats.

use super::figure::{Axis, Curve, Entry, Figure, Level, Look, Mark, Panel, Point, lines, points};
use super::looks;
use super::origin::origin;
use crate::accuracy::TOLD;
use crate::distinct::{distinct, rising};
use crate::stored::{AccuracyRow, Stored};

type Run = Stored<AccuracyRow>;

/// The settings of the paper's own runs.
const PAPER_RHO: f32 = 0.05;
const PAPER_RESOLUTION: u32 = 1024;

/// The paper's Table 1 at ρ = 0.05: model, thousands of points, error in %.
const PAPER_TABLE_1: [(&str, u32, f64); 4] = [
    ("Bunny", 36, 0.39),
    ("Armadillo", 173, 0.18),
    ("Dragon", 438, 0.16),
    ("Happy Buddha", 544, 0.03),
];

/// "Error below 3 % at any distance, and below 3 % with noise of σ up to the mean radius."
const PAPER_LIMIT: f64 = 3.0;

/// Whose method a curve is of.
const PAPERS: &str = "the paper's";
const OURS: &str = "this project";

const ERROR: &str = "wrong answers, % of all cases";
const RUN_HERE: &str =
    "The paper's method is run here, on the CPU, as this project understands it.";
const PROTOCOL: &str = "Two copies of a model at 31 distances and 900 rotations, judged from their \
                        points; the truth is exact tests of the mesh's triangles.";

/// A chart for each thing that the runs vary.
pub(super) fn figures(runs: &[Run]) -> Vec<Figure> {
    [rho, distance, resolution, noise, radius_scale]
        .into_iter()
        .filter_map(|figure| figure(runs))
        .collect()
}

/// Of each model the run with the most different values of one setting, at least two.
fn varying(runs: &[Run], setting: impl Fn(&AccuracyRow) -> Option<f32>) -> Vec<&Run> {
    let count = |run: &Run| {
        let values = run.rows.iter().filter_map(&setting);
        rising(values.map(f32::to_bits)).len()
    };
    best_of_models(runs.iter().filter(|run| count(run) > 1), |run| {
        (count(run), run.rows[0].cases)
    })
}

/// One run a model: that with the greatest worth. Models by their points.
fn best_of_models<'a, W: Ord>(
    runs: impl Iterator<Item = &'a Run>,
    worth: impl Fn(&Run) -> W,
) -> Vec<&'a Run> {
    let mut best: Vec<&Run> = Vec::new();
    for run in runs {
        let model = |other: &&mut &Run| other.rows[0].model == run.rows[0].model;
        match best.iter_mut().find(model) {
            Some(other) if worth(run) > worth(other) => *other = run,
            Some(_) => {}
            None => best.push(run),
        }
    }
    best.sort_by_key(|run| run.rows[0].points);
    best
}

fn is_paper(row: &AccuracyRow) -> bool {
    row.variant == "paper"
}

fn is_told(row: &AccuracyRow) -> bool {
    row.variant == TOLD && row.pixel_scale == Some(1.0)
}

fn is_default(row: &AccuracyRow) -> bool {
    row.variant == "default"
}

/// Whether all but what a chart varies are as in the paper, or by default.
fn is_plain_paper(row: &AccuracyRow) -> bool {
    is_paper(row) && row.rho == Some(PAPER_RHO) && row.resolution == Some(PAPER_RESOLUTION)
}

fn is_plain_default(row: &AccuracyRow) -> bool {
    is_default(row) && row.pixel_scale == Some(1.0)
}

fn is_clean(row: &AccuracyRow) -> bool {
    row.noise == 0.0 && row.radius_scale == Some(1.0)
}

/// A curve of rows, by rising `x`.
fn curve<'a>(
    rows: impl Iterator<Item = &'a AccuracyRow>,
    look: Look,
    x: impl Fn(&AccuracyRow) -> Option<f32>,
) -> Curve {
    let mut points = points(rows.filter_map(|row| Some((f64::from(x(row)?), row.error_pct))));
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    Curve { look, points }
}

/// A panel of curves and levels. Errors are on a logarithmic axis, and so is what is varied if `x_is_log`.
fn panel(
    title: impl Into<String>,
    [x, y]: [&str; 2],
    x_is_log: bool,
    curves: Vec<Curve>,
    levels: Vec<Level>,
) -> Panel {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let xs = points().map(|p| p.x);
    let x = match x_is_log {
        true => Axis::log(x, xs),
        false => Axis::linear(x, xs),
    };
    let ys = points().map(|p| p.y).chain(levels.iter().map(|l| l.y));
    let y = Axis::log(y, ys);
    Panel {
        levels,
        ..Panel::new(title, x, y, curves)
    }
}

fn describe(run: &Run) -> String {
    let row = &run.rows[0];
    format!("{} ({} points)", row.model, row.points)
}

fn cases_note(runs: &[&Run]) -> String {
    let of = |run: &&Run| format!("{}: {}", run.rows[0].model, run.rows[0].cases);
    let all: Vec<String> = runs.iter().map(of).collect();
    format!(
        "Cases of 27,900: {}. \"0\": no wrong answer in all of them. {RUN_HERE}",
        all.join(", "),
    )
}

/// What is said below a chart of these runs.
fn notes(runs: &[&Run]) -> Vec<String> {
    let provenances = runs.iter().map(|run| &run.provenance);
    vec![cases_note(runs), origin(provenances)]
}

/// One panel for all models, and what is said of it.
struct Single {
    name: &'static str,
    title: &'static str,
    about: &'static str,
    x: &'static str,
    x_is_log: bool,
    y: &'static str,
}

impl Single {
    /// `None` without curves.
    fn figure(
        self,
        runs: &[&Run],
        curves: Vec<Curve>,
        levels: Vec<Level>,
        legend: Vec<Entry>,
    ) -> Option<Figure> {
        (!curves.is_empty()).then(|| Figure {
            name: self.name.to_owned(),
            title: self.title.to_owned(),
            subtitle: lines([PROTOCOL, self.about]),
            panels: vec![panel("", [self.x, self.y], self.x_is_log, curves, levels)],
            columns: 1,
            panel_size: [980, 470],
            legend,
            notes: notes(runs),
        })
    }
}

/// Table 1.
fn rho(runs: &[Run]) -> Option<Figure> {
    let runs = varying(runs, |row| row.rho);
    if runs.is_empty() {
        return None;
    }
    let (mut curves, mut legend) = (Vec::new(), Vec::new());
    for (k, run) in runs.iter().enumerate() {
        let look = looks::paper_look(looks::model_color(k));
        let rows = run.rows.iter().filter(|row| {
            is_paper(row) && is_clean(row) && row.resolution == Some(PAPER_RESOLUTION)
        });
        curves.push(curve(rows, look, |row| row.rho));
        let label = format!("{}, measured here", describe(run));
        legend.push(Entry::new(look, label));
    }
    let look = Look::marks(looks::BLACK, Mark::Diamond);
    let of_paper = PAPER_TABLE_1.map(|(model, points, error)| Point {
        label: Some(format!("{model} {points}k: {error} %")),
        ..Point::new(f64::from(PAPER_RHO), error)
    });
    curves.push(Curve {
        look,
        points: of_paper.to_vec(),
    });
    let label = "the paper's own figures at 0.05 (Table 1)";
    legend.push(Entry::new(look, label));
    let single = Single {
        name: "error_rho",
        title: "The paper's Table 1: errors of its method against the compression of depth ranges",
        about: "The paper found 0.01 to 0.05 best, and used 0.05.",
        x: "compression ρ",
        x_is_log: true,
        y: ERROR,
    };
    single.figure(&runs, curves, Vec::new(), legend)
}

/// Whether a row belongs to a curve.
type IsOfCurve = fn(&AccuracyRow) -> bool;

/// For every model a curve of the paper, of the default, and of the default that is told the noise, where there are any.
fn of_all_methods(
    runs: &[&Run],
    is_shown: impl Fn(&AccuracyRow) -> bool,
    x: impl Fn(&AccuracyRow) -> Option<f32>,
) -> (Vec<Curve>, Vec<Entry>) {
    let told = "this project, told how large the noise is";
    let (mut curves, mut legend) = (Vec::new(), Vec::new());
    for (k, run) in runs.iter().enumerate() {
        let color = looks::model_color(k);
        let methods: [(Look, IsOfCurve, &str); 3] = [
            (looks::paper_look(color), is_plain_paper, PAPERS),
            (looks::default_look(color), is_plain_default, OURS),
            (looks::told_look(color), is_told, told),
        ];
        for (look, is_of_curve, who) in methods {
            let rows = run
                .rows
                .iter()
                .filter(|row| is_shown(row) && is_of_curve(row));
            if rows.clone().next().is_some() {
                curves.push(curve(rows, look, &x));
                legend.push(Entry::new(look, format!("{}, {who}", describe(run))));
            }
        }
    }
    (curves, legend)
}

/// Figure 13.
fn noise(runs: &[Run]) -> Option<Figure> {
    let runs = varying(runs, |row| Some(row.noise));
    let is_shown = |row: &AccuracyRow| row.radius_scale == Some(1.0);
    let (curves, legend) = of_all_methods(&runs, is_shown, |row| Some(row.noise));
    let levels = vec![Level {
        y: PAPER_LIMIT,
        label: "the paper, up to 1: below 3 %".to_owned(),
    }];
    let single = Single {
        name: "error_noise",
        title: "The paper's Figure 13: errors against noise on the points",
        about: "Noise is normal, the same in every direction, and different on both copies.",
        x: "standard deviation of the noise, mean radii of the points",
        x_is_log: false,
        y: ERROR,
    };
    single.figure(&runs, curves, levels, legend)
}

/// Figure 8.
fn distance(runs: &[Run]) -> Option<Figure> {
    let is_shown =
        |row: &AccuracyRow| is_clean(row) && (is_plain_paper(row) || is_plain_default(row));
    // Of each model and method the row of the most cases.
    let mut best: Vec<(&Run, &AccuracyRow)> = Vec::new();
    for run in runs {
        for row in run.rows.iter().filter(|row| is_shown(row)) {
            let is_same = |(_, other): &&mut (&Run, &AccuracyRow)| {
                other.model == row.model && other.variant == row.variant
            };
            match best.iter_mut().find(is_same) {
                Some(other) if other.1.cases < row.cases => *other = (run, row),
                Some(_) => {}
                None => best.push((run, row)),
            }
        }
    }
    best.sort_by(|(_, a), (_, b)| {
        let key = |row: &AccuracyRow| (row.points, row.model.clone(), row.variant.clone());
        key(a).cmp(&key(b))
    });
    let models = distinct(best.iter().map(|(_, row)| &*row.model));
    let (mut curves, mut legend) = (Vec::new(), Vec::new());
    for (_, row) in &best {
        let index = models.iter().position(|model| *model == row.model);
        let color = looks::model_color(index.unwrap_or(0));
        let (look, who) = match is_paper(row) {
            true => (looks::paper_look(color), PAPERS),
            false => (looks::default_look(color), OURS),
        };
        let errors = row.by_distance.iter().map(|tally| {
            let wrong = tally.false_negatives + tally.false_positives;
            let percent = 100.0 * wrong as f64 / tally.cases as f64;
            (f64::from(tally.distance), percent)
        });
        curves.push(Curve {
            look,
            points: points(errors),
        });
        let label = format!(
            "{} ({} points), {who}: {} cases",
            row.model, row.points, row.cases
        );
        legend.push(Entry::new(look, label));
    }
    let levels = vec![Level {
        y: PAPER_LIMIT,
        label: "the paper, at every distance: below 3 %".to_owned(),
    }];
    let shown: Vec<&Run> = best.iter().map(|(run, _)| *run).collect();
    let single = Single {
        name: "error_distance",
        title: "The paper's Figure 8: errors against the distance of the copies",
        about: "Copies are 2 large. Errors are made where they barely touch or barely do not.",
        x: "distance of the middles",
        x_is_log: false,
        y: "wrong answers, % of the cases at this distance",
    };
    let mut figure = single.figure(&shown, curves, levels, legend)?;
    // The legend has the cases.
    figure.notes[0] = format!("\"0\": no wrong answer at this distance. {RUN_HERE}");
    Some(figure)
}

/// Figure 9.
fn resolution(runs: &[Run]) -> Option<Figure> {
    let pixels = |row: &AccuracyRow| row.resolution.map(|pixels| pixels as f32);
    let mut shown = varying(runs, pixels);
    shown.extend(varying(runs, |row| row.pixel_scale));
    let shown = best_of_models(shown.into_iter(), |run| run.rows.len());
    let (mut paper, mut ours, mut legend) = (Vec::new(), Vec::new(), Vec::new());
    for (k, run) in shown.iter().enumerate() {
        let color = looks::model_color(k);
        let [of_paper, of_ours] = [looks::paper_look(color), looks::default_look(color)];
        let rows = || run.rows.iter().filter(|row| is_clean(row));
        let is_shown = |row: &&AccuracyRow| is_paper(row) && row.rho == Some(PAPER_RHO);
        paper.push(curve(rows().filter(is_shown), of_paper, pixels));
        let is_shown = |row: &&AccuracyRow| is_default(row);
        ours.push(curve(rows().filter(is_shown), of_ours, |row| {
            row.pixel_scale
        }));
        for (look, who) in [(of_paper, PAPERS), (of_ours, OURS)] {
            legend.push(Entry::new(look, format!("{}, {who}", describe(run))));
        }
    }
    let varies = |curves: &[Curve]| curves.iter().any(|curve| curve.points.len() > 1);
    if !varies(&paper) || !varies(&ours) {
        return None;
    }
    let panel = |title, curves, x| panel(title, [x, ERROR], true, curves, Vec::new());
    Some(Figure {
        name: "error_resolution".to_owned(),
        title: "The paper's Figure 9: errors against resolution".to_owned(),
        subtitle: lines([
            PROTOCOL,
            "The paper has one camera for the whole scene, with an image of 1024 × 1024 pixels; \
             here the camera faces the contact, with pixels as large as the points' mean radius.",
        ]),
        panels: vec![
            panel("The paper's method", paper, "edge of the image, pixels"),
            panel(
                "This project",
                ours,
                "edge of a pixel, mean radii of the points",
            ),
        ],
        columns: 2,
        panel_size: [600, 430],
        legend,
        notes: notes(&shown),
    })
}

/// Table 3.
fn radius_scale(runs: &[Run]) -> Option<Figure> {
    let is_ours_or_paper = |row: &AccuracyRow| is_paper(row) || is_default(row);
    let runs = varying(runs, |row| {
        row.radius_scale.filter(|_| is_ours_or_paper(row))
    });
    let (mut panels, mut legend) = (Vec::new(), Vec::<Entry>::new());
    for run in &runs {
        let resolutions = rising(run.rows.iter().filter_map(|row| row.resolution));
        let rows = || run.rows.iter().filter(|row| row.noise == 0.0);
        let mut curves = Vec::new();
        for (k, &pixels) in resolutions.iter().enumerate() {
            let look = looks::paper_look(looks::resolution_color(k));
            let of_paper = rows().filter(|row| is_paper(row) && row.resolution == Some(pixels));
            curves.push(curve(of_paper, look, |row| row.radius_scale));
            let label = format!("the paper's, image of {pixels} × {pixels} pixels");
            if !legend.iter().any(|entry| entry.label == label) {
                legend.push(Entry::new(look, label));
            }
        }
        let ours = rows().filter(|row| is_plain_default(row));
        curves.push(curve(ours, looks::OURS, |row| row.radius_scale));
        let axes = ["radii, times those of the paper", ERROR];
        panels.push(panel(describe(run), axes, true, curves, Vec::new()));
    }
    let label = "this project, pixels as large as the radii";
    legend.push(Entry::new(looks::OURS, label));
    (!panels.is_empty()).then(|| Figure {
        name: "error_splat_scale".to_owned(),
        title: "The paper's Table 3: errors against resolution and the size of splats".to_owned(),
        subtitle: lines([
            PROTOCOL,
            "The paper's radii are 0.65 × the distance of the 7th neighbour of each point.",
        ]),
        columns: panels.len().min(2),
        panels,
        panel_size: [600, 430],
        legend,
        notes: notes(&runs),
    })
}
