//! Charts of a run of `gpu_day`.

use super::error::ChartError;
use super::figure::{Axis, Color, Curve, Entry, Figure, Look, Mark, Panel, Point, points};
use super::gpu_figure::figure;
use super::gpu_layers::layers;
use super::{looks, paint};
use crate::distinct::distinct;
use crate::gpu_day::{Bin, Dispatches, Moved, Report, Shown, Workload};
use std::path::{Path, PathBuf};
use tldi::ContactPixel;

/// Draws floors, workloads, stages, differences from the CPU, and of one scene the contact pixels on the device and on
/// the CPU, and a row of layers. Each as SVG and PNG.
pub(crate) fn draw(report: &Report, shown: &Shown, out: &Path) -> Result<Vec<PathBuf>, ChartError> {
    let figures = [
        floors(report),
        workloads(report),
        stages(report),
        differences(report),
        contact_pixels(report, &shown.contacts, shown.radius),
        layers(report, shown),
    ];
    let mut files = Vec::new();
    for figure in figures.into_iter().flatten() {
        files.extend(paint::save(&figure, out)?);
    }
    Ok(files)
}

/// Of most panels.
const PANEL: [i32; 2] = [400, 330];

fn look(index: usize) -> Look {
    looks::placement_look(index)
}

/// A panel of curves with both axes logarithmic.
fn log_log(title: &str, [x, y]: [&str; 2], curves: Vec<Vec<(f64, f64)>>) -> Panel {
    let all = || curves.iter().flatten();
    let (x, y) = (
        Axis::log(x, all().map(|p| p.0)),
        Axis::log(y, all().map(|p| p.1)),
    );
    let curve = |(k, values): (usize, &Vec<(f64, f64)>)| Curve {
        look: look(k),
        points: points(values.iter().copied()),
    };
    let curves = curves.iter().enumerate().map(curve).collect();
    Panel::new(title, x, y, curves)
}

fn entries<const N: usize>(labels: [&str; N]) -> Vec<Entry> {
    let labels = labels.into_iter().enumerate();
    labels
        .map(|(k, label)| Entry::new(look(k), label))
        .collect()
}

fn floors(report: &Report) -> Option<Figure> {
    let floors = &report.floors;
    let rate = |all: &[Moved]| -> Vec<(f64, f64)> {
        let of = |m: &Moved| (m.bytes as f64 * 1e-6, m.bytes_per_second * 1e-9);
        all.iter().map(of).collect()
    };
    let dispatches = |ms: fn(&Dispatches) -> f64| -> Vec<(f64, f64)> {
        let of = |d: &Dispatches| (f64::from(d.count), ms(d) * 1e3);
        floors.dispatches.iter().map(of).collect()
    };
    let rates = [&floors.copies, &floors.uploads, &floors.readbacks].map(|all| rate(all));
    let times = [
        dispatches(|d| d.direct.p50_ms),
        dispatches(|d| d.indirect.p50_ms),
    ];
    let of_times = ["dispatches in a submission", "microseconds"];
    let panels = vec![
        log_log("Bytes moved", ["MB", "GB/s"], rates.into()),
        log_log("Dependent dispatches until done", of_times, times.into()),
    ];
    let legend = entries([
        "left: copy on the device, read + written; right: direct",
        "left: upload; right: indirect",
        "left: readback",
    ]);
    let title = "Floors: what the device cannot do faster";
    figure(report, "floors", title, panels, PANEL, legend)
}

/// Whether a row is of a pair of clouds without normals and noise.
fn is_bare_pair(row: &Workload) -> bool {
    row.kind == "bare" && row.pairs == 1
}

fn workloads(report: &Report) -> Option<Figure> {
    let all = || report.workloads.iter();
    let placements = distinct(all().filter(|w| w.pairs == 1).map(|w| &*w.placement));
    let panel = |placement: &&str| {
        let here = all().filter(|w| is_bare_pair(w) && w.placement == *placement);
        // A batch of one pair is a scene once more.
        let sizes = distinct(here.clone().map(|w| w.points));
        let first = |size| here.clone().find(|w| w.points == size);
        let rows: Vec<&Workload> = sizes.into_iter().filter_map(first).collect();
        let curve = |ms: fn(&Workload) -> Option<f64>| -> Vec<(f64, f64)> {
            let of = |w: &&Workload| Some((w.points as f64, ms(w)?));
            rows.iter().filter_map(of).collect()
        };
        let curves = vec![
            curve(|w| Some(w.resident.p50_ms)),
            curve(|w| Some(w.uploaded.p50_ms)),
            curve(|w| Some(w.cpu?.p50_ms)),
            curve(|w| Some(w.cpu_one_core?.p50_ms)),
        ];
        log_log(placement, ["points of each body", "ms (median)"], curves)
    };
    let panels = placements.iter().map(panel).collect();
    let legend = entries([
        "device, points are there",
        "device, points are new",
        "CPU, all cores",
        "CPU, one core",
    ]);
    let title = "From the call to the contacts on the host, bare clouds";
    figure(report, "workloads", title, panels, PANEL, legend)
}

fn stages(report: &Report) -> Option<Figure> {
    // Of the largest scenes of both.
    let largest = |placement: &str| {
        let measured = (report.workloads.iter())
            .filter(|w| w.placement == placement && is_bare_pair(w) && !w.stages.is_empty());
        measured.max_by_key(|w| w.points)
    };
    let [taken_look, floor_look] = [look(1), look(0)];
    let panel = |row: &Workload| {
        // Shorter times are at the end of the axis.
        let point = |k: usize, ms: f64| Point::new(ms.max(1e-5), (row.stages.len() - k) as f64);
        let (mut taken, mut floor) = (Vec::new(), Vec::new());
        for (k, stage) in row.stages.iter().enumerate() {
            taken.extend(stage.ms.map(|ms| Point {
                label: Some(stage.stage.clone()),
                ..point(k, ms)
            }));
            floor.extend(stage.floor_ms.map(|ms| point(k, ms)));
        }
        let x = Axis::log("ms", taken.iter().chain(&floor).map(|p| p.x));
        let mut y = Axis::linear("stages in order", [0.0, row.stages.len() as f64 + 1.0]);
        y.ticks = Some(Vec::new());
        let curves = [(taken_look, taken), (floor_look, floor)];
        let curves = curves.map(|(look, points)| Curve {
            look: Look::marks(look.color, look.mark),
            points,
        });
        let title = format!("{}, {} points", row.placement, row.points);
        Panel::new(title, x, y, curves.into())
    };
    let rows = ["slight", "deep"].into_iter().filter_map(largest);
    let floor = "its bytes at the bandwidth of the largest copies";
    let legend = vec![
        Entry::new(taken_look, "device time (median)"),
        Entry::new(floor_look, floor),
    ];
    let title = "Stages beside the bytes that they must move";
    let panels = rows.map(panel).collect();
    figure(report, "stages", title, panels, [480, 640], legend)
}

fn differences(report: &Report) -> Option<Figure> {
    let parity = report.correctness.parity.as_ref()?;
    let panel = |title: &str, bins: &[Bin]| {
        let labels = [
            "≤ 1e-6", "≤ 1e-5", "≤ 1e-4", "≤ 1e-3", "≤ 0.01", "≤ 0.1", "more",
        ];
        let tick = |(k, label): (usize, &str)| (k as f64, label.to_owned());
        let mut x = Axis::linear("difference", [0.0, 6.0]);
        x.ticks = Some(labels.into_iter().enumerate().map(tick).collect());
        let counts = bins.iter().map(|bin| bin.count as f64);
        let y = Axis::linear("number", counts.clone());
        let curve = Curve {
            look: look(1),
            points: points(counts.enumerate().map(|(k, count)| (k as f64, count))),
        };
        Panel::new(title, x, y, vec![curve])
    };
    let panels = vec![
        panel("Least gap of a pair, mean radii", &parity.gaps),
        panel("Axis of a view, radians", &parity.axes),
    ];
    let title = format!(
        "Differences from the CPU over {} random pairs",
        parity.pairs
    );
    figure(report, "differences", &title, panels, PANEL, Vec::new())
}

/// From blue for the deepest to red for the widest gap.
const OF_GAPS: [(Color, &str); 5] = [
    ([33, 60, 158], "deeper than 1 mean radius"),
    ([60, 140, 200], "0.25 to 1 deep"),
    ([150, 190, 150], "within 0.25"),
    ([230, 160, 60], "0.25 to 1 apart"),
    ([200, 60, 40], "farther apart"),
];

fn contact_pixels(
    report: &Report,
    contacts: &[(&str, Vec<ContactPixel>)],
    radius: f32,
) -> Option<Figure> {
    let of_first_view = |all: &'_ [ContactPixel]| -> Vec<ContactPixel> {
        all.iter().filter(|c| c.view == 0).copied().collect()
    };
    let shown: Vec<_> = (contacts.iter())
        .map(|(title, all)| (title, of_first_view(all)))
        .collect();
    let axis = |label: &str, k: usize| {
        let all = shown.iter().flat_map(|(_, contacts)| contacts);
        Axis::around(label, all.map(|c| f64::from(c.pixel[k])))
    };
    // Bounds of the colours, in mean radii.
    let edges = [-1.0, -0.25, 0.25, 1.0];
    let color_of = |c: &ContactPixel| edges.partition_point(|edge| c.gap / radius > *edge);
    let looks = OF_GAPS.map(|(color, _)| Look::marks(color, Mark::Square));
    let panel = |(title, contacts): &(&&str, Vec<ContactPixel>)| {
        let curve = |(k, look): (usize, Look)| {
            let own = contacts.iter().filter(|c| color_of(c) == k);
            let at = own.map(|c| c.pixel.map(f64::from));
            let points = points(at.map(|[x, y]| (x, y)));
            Curve { look, points }
        };
        let title = format!("{title}: {} pixels", contacts.len());
        let curves = looks.into_iter().enumerate().map(curve).collect();
        Panel::new(title, axis("column", 0), axis("row", 1), curves)
    };
    let panels = shown.iter().map(panel).collect();
    let labels = OF_GAPS.map(|(_, label)| label);
    let legend = looks.into_iter().zip(labels);
    let legend = legend
        .map(|(look, label)| Entry::new(look, label))
        .collect();
    let title = "Contact pixels of one view";
    figure(report, "contacts", title, panels, [560, 560], legend)
}
