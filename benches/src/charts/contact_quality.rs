//! Contact quality against time: every method that tells its deepest contact.

use super::figure::{Axis, Curve, Entry, Figure, Level, Panel, Point, lines, numbered};
use super::front::{front, steps};
use super::looks;
use super::origin::origin;
use crate::distinct::distinct;
use crate::stored::{ContactRow, Stored};
use tldi_tests::Regime;

type Run = Stored<ContactRow>;

/// An error that is drawn.
struct Quantity {
    axis: &'static str,
    title: &'static str,
    median: fn(&ContactRow) -> Option<f64>,
    p95: fn(&ContactRow) -> Option<f64>,
    /// The median error of an answer that takes no look at the points.
    blind: fn(Regime) -> Level,
    /// Whether the setting of ours matters.
    says_setting: bool,
}

const QUANTITIES: [Quantity; 2] = [
    Quantity {
        axis: "error of the normal, degrees",
        title: "Normal",
        median: |row| row.normal_median_deg,
        p95: |row| row.normal_p95_deg,
        blind: |_| Level {
            y: 90.0,
            label: "a guess: any direction".to_owned(),
        },
        says_setting: false,
    },
    Quantity {
        axis: "error of the depth, r",
        title: "Depth",
        median: |row| row.depth_median_radii,
        p95: |row| row.depth_p95_radii,
        blind: |regime| {
            let [low, high] = regime.depths().map(f64::from);
            Level {
                y: 0.5 * (low + high),
                label: "no answer: always 0".to_owned(),
            }
        },
        says_setting: true,
    },
];

/// A row that has a place in a panel.
#[derive(Clone, Copy)]
struct Placed<'a> {
    row: &'a ContactRow,
    error: f64,
}

/// A chart for each run that has rows of all pairs.
pub(super) fn figures(runs: &[Run]) -> Vec<Figure> {
    let mut all = Vec::new();
    for run in runs.iter().filter(|run| of_all_pairs(run).next().is_some()) {
        all.push(numbered(&all, figure(run)));
    }
    all
}

fn of_all_pairs(run: &Run) -> impl Iterator<Item = &ContactRow> {
    run.rows.iter().filter(|row| row.pair.is_none())
}

/// Names of methods, ours last, so that it is painted above the others.
fn methods(run: &Run) -> Vec<&str> {
    let mut all = distinct(of_all_pairs(run).map(|row| &*row.variant));
    all.sort_by_key(|method| looks::look(method) == looks::OURS);
    all
}

fn setting_label(row: &ContactRow) -> Option<String> {
    row.pixel_scale.map(|scale| format!("pixel {scale} r"))
}

fn figure(run: &Run) -> Figure {
    let methods = methods(run);
    let mut panels = Vec::new();
    for regime in Regime::ALL {
        for quantity in &QUANTITIES {
            panels.push(panel(run, &methods, regime, quantity));
        }
    }
    let entry = |method: &&str| Entry::new(looks::look(method), looks::title(method));
    let mut legend: Vec<Entry> = methods.iter().rev().map(entry).collect();
    legend.push(Entry::new(looks::FRONT, "Pareto front (points alone)"));
    Figure {
        name: "contact_quality".to_owned(),
        title: "How wrong are the normal and the depth of a contact, and how long does it take?"
            .to_owned(),
        subtitle: lines([
            "Spheres, boxes, edges and corners in each other, in planes and on ramps, sampled without \
             normals: the deepest contact that a method tells, held against the shapes' own.",
            "Every case is a frame of new points: building and finding the contacts is counted, in \
             processor time of one thread. Lower left is better.",
        ]),
        columns: QUANTITIES.len(),
        panels,
        panel_size: [640, 400],
        legend,
        notes: lines([
            "r: spacing of the points. Along a curve varies, of this project: the pixel's edge; of the \
             grid of balls: their radius; of voxels: half their edge.",
            "Balls: the pair that is deepest in each other, its normal from centre to centre, its depth \
             2 radii less the distance. Voxels and meshes: the deepest point of rapier's manifolds.",
            "Marks: the median of all cases; bars, on the front: what 95 % of the cases are below. A missed \
             contact is infinitely wrong; what misses half is not drawn.",
            &given_note(run),
            "On the front no other method that is given points alone is both faster and less wrong.",
            &origin([&run.provenance]),
        ]),
    }
}

/// What methods know beside the points.
fn given_note(run: &Run) -> String {
    let motion = match of_all_pairs(run).all(|row| row.tells_motion) {
        true => {
            "The motion of the bodies, as an engine knows it, is told; only this project uses it."
        }
        false => "The motion of the bodies, which an engine knows, is not told.",
    };
    format!(
        "Meshes are given their triangles, as fine as the points; the others only points. {motion}"
    )
}

fn panel(run: &Run, methods: &[&str], regime: Regime, quantity: &Quantity) -> Panel {
    let of_regime = of_all_pairs(run).filter(|row| row.regime == regime);
    let placed: Vec<Placed> = of_regime
        .filter_map(|row| (quantity.median)(row).map(|error| Placed { row, error }))
        .collect();
    let at = |placed: &Placed| [placed.row.median_ms, placed.error];
    // Meshes have no radius.
    let of_points = placed.iter().filter(|p| p.row.radius_scale.is_some());
    let of_points: Vec<Placed> = of_points.copied().collect();
    let places: Vec<[f64; 2]> = of_points.iter().map(at).collect();
    let on_front: Vec<Placed> = front(&places).into_iter().map(|i| of_points[i]).collect();
    let x = Axis::log(
        "time for one frame, ms (median of all cases)",
        placed.iter().map(|p| p.row.median_ms),
    );
    let blind = (quantity.blind)(regime);
    let most = on_front.iter().filter_map(|p| (quantity.p95)(p.row));
    let errors = placed.iter().map(|p| p.error).chain(most);
    let mut y = Axis::log(quantity.axis, errors.chain([blind.y]));
    y.range[0] /= 1.4; // room for whole marks
    let mut curves = vec![Curve {
        look: looks::FRONT,
        points: steps(on_front.iter().map(at)),
    }];
    for method in methods {
        let of_method = |p: &&Placed| p.row.variant == *method;
        let best: Vec<&Placed> = on_front.iter().filter(of_method).collect();
        let point = |p: &Placed| {
            let is = |other: &&Placed| std::ptr::eq(other.row, p.row);
            let is_on_front = best.iter().any(is);
            let is_said = quantity.says_setting
                && looks::look(method) == looks::OURS
                && best.last().is_some_and(is);
            let most = (quantity.p95)(p.row).unwrap_or(y.range[1]);
            Point {
                y_spread: is_on_front.then_some([p.error, most]),
                label: is_said.then(|| setting_label(p.row)).flatten(),
                ..Point::new(p.row.median_ms, p.error)
            }
        };
        curves.push(Curve {
            look: looks::look(method),
            points: placed.iter().filter(of_method).map(point).collect(),
        });
    }
    let [low, high] = regime.depths();
    let cases = placed.iter().map(|p| p.row.cases).max().unwrap_or(0);
    let title = quantity.title;
    let title = format!("{title}, contacts {low} to {high} r deep, {cases} cases");
    Panel {
        levels: vec![blind],
        ..Panel::new(title, x, y, curves)
    }
}
