//! Charts of a run of `gpu_day`.

use super::error::ChartError;
use super::figure::{Axis, Color, Curve, Entry, Figure, Line, Look, Mark, Panel, Point};
use super::gpu_figure::{figure, points};
use super::gpu_layers::layers;
use super::{looks, paint};
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

fn look(index: usize) -> Look {
    looks::placement_look(index)
}

/// A panel of curves with both axes logarithmic.
fn log_log(title: &str, x: &str, y: &str, curves: Vec<Vec<(f64, f64)>>) -> Panel {
    let all = || curves.iter().flatten();
    Panel {
        title: title.to_owned(),
        x: Axis::log(x, all().map(|p| p.0)),
        y: Axis::log(y, all().map(|p| p.1)),
        levels: Vec::new(),
        curves: curves
            .iter()
            .enumerate()
            .map(|(k, values)| Curve {
                look: look(k),
                points: points(values.iter().copied()),
            })
            .collect(),
    }
}

fn entries(labels: &[&str]) -> Vec<Entry> {
    let entry = |(k, label): (usize, &&str)| Entry {
        look: look(k),
        label: (*label).to_owned(),
    };
    labels.iter().enumerate().map(entry).collect()
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
    let panels = vec![
        log_log(
            "Bytes moved",
            "MB",
            "GB/s",
            vec![
                rate(&floors.copies),
                rate(&floors.uploads),
                rate(&floors.readbacks),
            ],
        ),
        log_log(
            "Dependent dispatches until done",
            "dispatches in a submission",
            "microseconds",
            vec![
                dispatches(|d| d.direct.p50_ms),
                dispatches(|d| d.indirect.p50_ms),
            ],
        ),
    ];
    let figure = figure(
        report,
        "floors",
        "Floors: what the device cannot do faster",
        panels,
    )?;
    Some(Figure {
        legend: entries(&[
            "left: copy on the device, read + written; right: direct",
            "left: upload; right: indirect",
            "left: readback",
        ]),
        ..figure
    })
}

fn workloads(report: &Report) -> Option<Figure> {
    // A batch of one pair is a scene once more.
    let scene = |w: &Workload| (w.placement.clone(), w.kind.clone(), w.points);
    let mut single: Vec<&Workload> = Vec::new();
    for row in report.workloads.iter().filter(|w| w.pairs == 1) {
        if !single.iter().any(|other| scene(other) == scene(row)) {
            single.push(row);
        }
    }
    let mut placements: Vec<&str> = Vec::new();
    for row in &single {
        if !placements.contains(&&*row.placement) {
            placements.push(&row.placement);
        }
    }
    let panel = |placement: &&str| {
        let rows =
            || (single.iter()).filter(move |w| w.placement == *placement && w.kind == "bare");
        let curve = |ms: &dyn Fn(&Workload) -> Option<f64>| -> Vec<(f64, f64)> {
            let of = |w: &&&Workload| Some((w.points as f64, ms(w)?));
            rows().collect::<Vec<_>>().iter().filter_map(of).collect()
        };
        let curves = vec![
            curve(&|w| Some(w.resident.p50_ms)),
            curve(&|w| Some(w.uploaded.p50_ms)),
            curve(&|w| Some(w.cpu?.p50_ms)),
            curve(&|w| Some(w.cpu_one_core?.p50_ms)),
        ];
        log_log(placement, "points of each body", "ms (median)", curves)
    };
    let panels: Vec<Panel> = placements.iter().map(panel).collect();
    let figure = figure(
        report,
        "workloads",
        "From the call to the contacts on the host, bare clouds",
        panels,
    )?;
    Some(Figure {
        legend: entries(&[
            "device, points are there",
            "device, points are new",
            "CPU, all cores",
            "CPU, one core",
        ]),
        ..figure
    })
}

fn stages(report: &Report) -> Option<Figure> {
    // Of the largest scenes of both.
    let largest = |placement: &str| {
        let measured = report.workloads.iter().filter(|w| {
            w.placement == placement && w.kind == "bare" && w.pairs == 1 && !w.stages.is_empty()
        });
        measured.max_by_key(|w| w.points)
    };
    let panel = |row: &Workload| {
        let place = |k: usize| (row.stages.len() - k) as f64;
        let (mut taken, mut floor) = (Vec::new(), Vec::new());
        // Shorter ones are at the end of the axis.
        let shown = |ms: f64| ms.max(1e-5);
        for (k, stage) in row.stages.iter().enumerate() {
            if let Some(ms) = stage.ms {
                taken.push(Point {
                    x: shown(ms),
                    y: place(k),
                    label: Some(stage.stage.clone()),
                    ..Point::default()
                });
            }
            if let Some(ms) = stage.floor_ms {
                floor.push((shown(ms), place(k)));
            }
        }
        let x = taken.iter().map(|p| p.x).chain(floor.iter().map(|p| p.0));
        let mut y = Axis::linear("stages in order", [0.0, row.stages.len() as f64 + 1.0]);
        y.ticks = Some(Vec::new());
        Panel {
            title: format!("{}, {} points", row.placement, row.points),
            x: Axis::log("ms", x),
            y,
            curves: vec![
                Curve {
                    look: Look {
                        line: Line::None,
                        ..look(1)
                    },
                    points: taken,
                },
                Curve {
                    look: Look {
                        line: Line::None,
                        ..look(0)
                    },
                    points: points(floor.into_iter()),
                },
            ],
            levels: Vec::new(),
        }
    };
    let rows = ["slight", "deep"].into_iter().filter_map(largest);
    let figure = figure(
        report,
        "stages",
        "Stages beside the bytes that they must move",
        rows.map(panel).collect(),
    )?;
    Some(Figure {
        panel_size: [480, 640],
        legend: vec![
            Entry {
                look: look(1),
                label: "device time (median)".to_owned(),
            },
            Entry {
                look: look(0),
                label: "its bytes at the bandwidth of the largest copies".to_owned(),
            },
        ],
        ..figure
    })
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
        Panel {
            title: title.to_owned(),
            x,
            y: Axis::linear("number", counts.clone()),
            curves: vec![Curve {
                look: look(1),
                points: points(counts.enumerate().map(|(k, count)| (k as f64, count))),
            }],
            levels: Vec::new(),
        }
    };
    let panels = vec![
        panel("Least gap of a pair, mean radii", &parity.gaps),
        panel("Axis of a view, radians", &parity.axes),
    ];
    let title = format!(
        "Differences from the CPU over {} random pairs",
        parity.pairs
    );
    figure(report, "differences", &title, panels)
}

/// From blue for the deepest to red for the widest gap.
const OF_GAPS: [Color; 5] = [
    [33, 60, 158],
    [60, 140, 200],
    [150, 190, 150],
    [230, 160, 60],
    [200, 60, 40],
];

fn contact_pixels(
    report: &Report,
    contacts: &[(&str, Vec<ContactPixel>)],
    radius: f32,
) -> Option<Figure> {
    let first_view = |all: &'_ [ContactPixel]| -> Vec<ContactPixel> {
        all.iter().filter(|c| c.view == 0).copied().collect()
    };
    let shown: Vec<_> = contacts
        .iter()
        .map(|(title, all)| (title, first_view(all)))
        .collect();
    let all = || shown.iter().flat_map(|(_, contacts)| contacts);
    let range = |k: usize| {
        let at = || all().map(move |c| f64::from(c.pixel[k]));
        let (low, high) = (at().fold(f64::MAX, f64::min), at().fold(f64::MIN, f64::max));
        [low - 1.0, high + 1.0]
    };
    let axis = |label: &str, k: usize| Axis {
        label: label.to_owned(),
        is_log: false,
        range: range(k),
        has_zero: false,
        ticks: None,
    };
    // Bounds of the colours, in mean radii.
    let edges = [-1.0, -0.25, 0.25, 1.0];
    let color_of = |c: &ContactPixel| edges.partition_point(|edge| c.gap / radius > *edge);
    let dot = |k: usize| Look {
        color: OF_GAPS[k],
        mark: Mark::Square,
        line: Line::None,
    };
    let panel = |(title, contacts): &(&&str, Vec<ContactPixel>)| Panel {
        title: format!("{title}: {} pixels", contacts.len()),
        x: axis("column", 0),
        y: axis("row", 1),
        curves: (0..OF_GAPS.len())
            .map(|k| {
                let own = contacts.iter().filter(|c| color_of(c) == k);
                let at = own.map(|c| c.pixel.map(f64::from));
                Curve {
                    look: dot(k),
                    points: points(at.map(|[x, y]| (x, y))),
                }
            })
            .collect(),
        levels: Vec::new(),
    };
    let figure = figure(
        report,
        "contacts",
        "Contact pixels of one view",
        shown.iter().map(panel).collect(),
    )?;
    let labels = [
        "deeper than 1 mean radius",
        "0.25 to 1 deep",
        "within 0.25",
        "0.25 to 1 apart",
        "farther apart",
    ];
    let entry = |(k, label): (usize, &str)| Entry {
        look: dot(k),
        label: label.to_owned(),
    };
    Some(Figure {
        panel_size: [560, 560],
        legend: labels.into_iter().enumerate().map(entry).collect(),
        ..figure
    })
}
