//! One row of pixels of a run of `gpu_day`: layers, and the contacts that the device found on them.

use super::figure::{Axis, Color, Curve, Entry, Figure, Line, Look, Mark, Panel};
use super::gpu_figure::{figure, points};
use crate::gpu_day::{Report, Shown};

const OF_CLOUDS: [Color; 2] = [[90, 140, 200], [220, 130, 60]];
const OF_CONTACTS: [Color; 2] = [[20, 40, 110], [140, 20, 20]];

pub(super) fn layers(report: &Report, shown: &Shown) -> Option<Figure> {
    let section = &shown.section;
    let radius = f64::from(shown.radius);
    let all = || section.layers.iter().chain(&section.contacts).flatten();
    let at_contacts = || section.contacts.iter().flatten().map(|place| place[1]);
    let middle = at_contacts().sum::<f64>() / at_contacts().count().max(1) as f64;
    let in_radii = |place: &[f64; 2]| (place[0], (place[1] - middle) / radius);
    let look = |color, mark| Look {
        color,
        mark,
        line: Line::None,
    };
    let curve = |places: &Vec<[f64; 2]>, look| Curve {
        look,
        points: points(places.iter().map(in_radii)),
    };
    let looks = [
        look(OF_CLOUDS[0], Mark::Square),
        look(OF_CLOUDS[1], Mark::Square),
        look(OF_CONTACTS[0], Mark::Disc),
        look(OF_CONTACTS[1], Mark::Disc),
    ];
    let places = section.layers.iter().chain(&section.contacts);
    let panel = Panel {
        title: format!(
            "Row {}: {} contacts",
            section.row,
            section.contacts[0].len()
        ),
        x: axis("column", all().map(|place| place[0])),
        y: axis(
            "depth along the view, mean radii",
            all().map(|place| in_radii(place).1),
        ),
        curves: places
            .zip(looks)
            .map(|(places, look)| curve(places, look))
            .collect(),
        levels: Vec::new(),
    };
    let labels = [
        "layers of the scan, drawn by the CPU",
        "layers of the body, drawn by the CPU",
        "contacts of the device, on the scan",
        "contacts of the device, on the body",
    ];
    let entry = |(look, label): (Look, &str)| Entry {
        look,
        label: label.to_owned(),
    };
    Some(Figure {
        panel_size: [900, 420],
        legend: looks.into_iter().zip(labels).map(entry).collect(),
        ..figure(
            report,
            "layers",
            "Layers and contacts of one row of pixels",
            vec![panel],
        )?
    })
}

/// From the least value to the greatest, a little wider.
fn axis(label: &str, values: impl Iterator<Item = f64>) -> Axis {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    Axis {
        label: label.to_owned(),
        is_log: false,
        range: [low - 1.0, high + 1.0],
        has_zero: false,
        ticks: None,
    }
}
