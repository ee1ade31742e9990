//! The chart: share of passed cases, scene by method, as SVG and PNG.

use super::report::Report;
use anyhow::{Context, anyhow};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;

const CELL: (i32, i32) = (150, 34);
const LEFT: i32 = 150;
const TOP: i32 = 90;
const BOTTOM: i32 = 40;
const FONT: &str = "sans-serif";

/// Writes `stability.svg` and `stability.png`.
pub(crate) fn draw(report: &Report, folder: &Path) -> anyhow::Result<()> {
    // An error means only that the font is registered already.
    plotters::style::register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_| anyhow!("the built-in font cannot be read"))?;
    let columns = report.methods().len() as i32;
    let rows = report.scenes().len() as i32;
    let size = (
        (LEFT + columns * CELL.0 + 20).max(700) as u32,
        (TOP + rows * CELL.1 + BOTTOM) as u32,
    );
    let svg = folder.join("stability.svg");
    let png = folder.join("stability.png");
    paint(report, &SVGBackend::new(&svg, size).into_drawing_area())
        .with_context(|| format!("cannot draw {}", svg.display()))?;
    paint(report, &BitMapBackend::new(&png, size).into_drawing_area())
        .with_context(|| format!("cannot draw {}", png.display()))
}

fn paint<B: DrawingBackend<ErrorType: 'static>>(
    report: &Report,
    area: &DrawingArea<B, plotters::coord::Shift>,
) -> anyhow::Result<()> {
    area.fill(&WHITE)?;
    let style = |size: i32, horizontal: HPos| {
        (FONT, size)
            .into_font()
            .color(&BLACK)
            .pos(Pos::new(horizontal, VPos::Center))
    };
    let text = |words: &str, at: (i32, i32), style: TextStyle| area.draw_text(words, &style, at);
    text(
        "Cases passed, by scene and method",
        (16, 22),
        style(20, HPos::Left),
    )?;
    text(&report.provenance(), (16, 46), style(11, HPos::Left))?;
    let methods = report.methods();
    for (i, method) in methods.iter().enumerate() {
        let x = LEFT + i as i32 * CELL.0 + CELL.0 / 2;
        text(method.name(), (x, TOP - 16), style(15, HPos::Center))?;
    }
    for (j, scene) in report.scenes().into_iter().enumerate() {
        let y = TOP + j as i32 * CELL.1;
        text(scene, (LEFT - 12, y + CELL.1 / 2), style(14, HPos::Right))?;
        for (i, method) in methods.iter().enumerate() {
            let x = LEFT + i as i32 * CELL.0;
            let tally = report.tally(scene, *method);
            let (color, label) = if tally.applicable == 0 {
                (RGBColor(225, 225, 225), "n/a".to_owned())
            } else {
                let share = tally.passed as f64 / tally.applicable as f64;
                let not_applicable = tally.rows - tally.applicable;
                let mut label = format!("{} of {}", tally.passed, tally.applicable);
                if not_applicable > 0 {
                    label += &format!(" ({not_applicable} n/a)");
                }
                (shade(share), label)
            };
            let corners = [(x + 2, y + 2), (x + CELL.0 - 2, y + CELL.1 - 2)];
            area.draw(&Rectangle::new(corners, color.filled()))?;
            let middle = (x + CELL.0 / 2, y + CELL.1 / 2);
            text(&label, middle, style(14, HPos::Center))?;
        }
    }
    area.present()?;
    Ok(())
}

/// From orange (none) to blue (all), which readers who see no red or green can tell apart.
fn shade(share: f64) -> RGBColor {
    let mix = |none: f64, all: f64| (none + (all - none) * share).round() as u8;
    RGBColor(mix(240.0, 120.0), mix(160.0, 185.0), mix(90.0, 235.0))
}
