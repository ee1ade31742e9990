//! One row of pixels of a run of `gpu_day`: layers, and the contacts that the device found on them.

use super::figure::{Axis, Color, Curve, Entry, Figure, Look, Mark, Panel, points};
use super::gpu_figure::figure;
use crate::gpu_day::{Report, Shown};

const OF_CLOUDS: [Color; 2] = [[90, 140, 200], [220, 130, 60]];
const OF_CONTACTS: [Color; 2] = [[20, 40, 110], [140, 20, 20]];

pub(super) fn layers(report: &Report, shown: &Shown) -> Option<Figure> {
    let section = &shown.section;
    let radius = f64::from(shown.radius);
    let places = || section.layers.iter().chain(&section.contacts);
    let at_contacts = || section.contacts.iter().flatten().map(|place| place[1]);
    let middle = at_contacts().sum::<f64>() / at_contacts().count().max(1) as f64;
    let in_radii = |place: &[f64; 2]| (place[0], (place[1] - middle) / radius);
    let all = || places().flatten().map(in_radii);
    let looks = [
        Look::marks(OF_CLOUDS[0], Mark::Square),
        Look::marks(OF_CLOUDS[1], Mark::Square),
        Look::marks(OF_CONTACTS[0], Mark::Disc),
        Look::marks(OF_CONTACTS[1], Mark::Disc),
    ];
    let curves = places().zip(looks).map(|(places, look)| Curve {
        look,
        points: points(places.iter().map(in_radii)),
    });
    let (row, count) = (section.row, section.contacts[0].len());
    let panel = Panel::new(
        format!("Row {row}: {count} contacts"),
        Axis::around("column", all().map(|place| place.0)),
        Axis::around(
            "depth along the view, mean radii",
            all().map(|place| place.1),
        ),
        curves.collect(),
    );
    let labels = [
        "layers of the scan, drawn by the CPU",
        "layers of the body, drawn by the CPU",
        "contacts of the device, on the scan",
        "contacts of the device, on the body",
    ];
    let entries = looks.into_iter().zip(labels);
    figure(
        report,
        "layers",
        "Layers and contacts of one row of pixels",
        vec![panel],
        [900, 420],
        entries
            .map(|(look, label)| Entry::new(look, label))
            .collect(),
    )
}
