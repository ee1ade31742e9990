//! The chart: errors against the angle of motion, as SVG and PNG.

use anyhow::{Context, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::path::Path;
use tldi_tests::{
    ANGLE_STEP, AccuracyRow, ContactPair, DEEP_LIMIT, NORMAL_LIMIT, Regime, SHALLOW_LIMIT,
};

const SIZE: (u32, u32) = (1300, 1050);
const FONT: &str = "sans-serif";

/// Smaller errors are drawn as this, so that they have a place on a logarithmic axis.
const LEAST: f64 = 1e-3;

/// One colour a pair, told apart by the colour-blind too (Okabe and Ito).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(230, 159, 0),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
];

/// One of the four panels.
struct Panel {
    title: &'static str,
    regime: Regime,
    error: fn(&AccuracyRow) -> f32,
    limit: f32,
    greatest: f64,
}

const PANELS: [Panel; 4] = [
    Panel {
        title: "Up to 2 r deep: median error of the normal, degrees",
        regime: Regime::Shallow,
        error: |row| row.normal_median,
        limit: NORMAL_LIMIT,
        greatest: 100.0,
    },
    Panel {
        title: "Up to 2 r deep: median error of the depth, r",
        regime: Regime::Shallow,
        error: |row| row.depth_median,
        limit: SHALLOW_LIMIT,
        greatest: 10.0,
    },
    Panel {
        title: "2 r to 10 r deep: median error of the normal, degrees",
        regime: Regime::Deep,
        error: |row| row.normal_median,
        limit: NORMAL_LIMIT,
        greatest: 100.0,
    },
    Panel {
        title: "2 r to 10 r deep: median error of the depth, part of it",
        regime: Regime::Deep,
        error: |row| row.depth_median,
        limit: DEEP_LIMIT,
        greatest: 10.0,
    },
];

/// Writes `contact_accuracy.svg` and `contact_accuracy.png`, `suffix` added to their names.
pub(crate) fn draw(rows: &[AccuracyRow], suffix: &str, folder: &Path) -> anyhow::Result<()> {
    plotters::style::register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT)
        .map_err(|_| anyhow!("the built-in font cannot be read"))?;
    let svg = folder.join(format!("contact_accuracy{suffix}.svg"));
    let png = folder.join(format!("contact_accuracy{suffix}.png"));
    paint(rows, &SVGBackend::new(&svg, SIZE).into_drawing_area())
        .with_context(|| format!("cannot draw {}", svg.display()))?;
    paint(rows, &BitMapBackend::new(&png, SIZE).into_drawing_area())
        .with_context(|| format!("cannot draw {}", png.display()))
}

fn paint<B: DrawingBackend<ErrorType: 'static>>(
    rows: &[AccuracyRow],
    area: &DrawingArea<B, Shift>,
) -> anyhow::Result<()> {
    area.fill(&WHITE)?;
    let area = area.titled(
        "Contacts against analytic truth, by the angle between the motion and the true normal",
        (FONT, 22),
    )?;
    let (top, legend) = area.split_vertically(SIZE.1 - 90);
    for (panel, area) in PANELS.iter().zip(top.split_evenly((2, 2))) {
        paint_panel(rows, panel, &area)?;
    }
    for (k, (pair, color)) in ContactPair::ALL.into_iter().zip(COLORS).enumerate() {
        let x = 20 + 210 * k as i32;
        legend.draw(&PathElement::new(
            [(x, 12), (x + 30, 12)],
            color.stroke_width(3),
        ))?;
        let name = pair.name().replace('×', "on");
        legend.draw(&Text::new(name, (x + 36, 4), (FONT, 16)))?;
    }
    let note = "filled: clouds with normals; open: without; dashed: the limit; errors below 0.001 \
                are drawn there";
    legend.draw(&Text::new(note, (20, 32), (FONT, 15)))?;
    Ok(())
}

fn paint_panel<B: DrawingBackend<ErrorType: 'static>>(
    rows: &[AccuracyRow],
    panel: &Panel,
    area: &DrawingArea<B, Shift>,
) -> anyhow::Result<()> {
    let mut chart = ChartBuilder::on(area)
        .caption(panel.title, (FONT, 17))
        .margin(10)
        .x_label_area_size(34)
        .y_label_area_size(50)
        .build_cartesian_2d(0.0..90.0, (LEAST..panel.greatest).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("angle of motion, degrees")
        .x_labels(10)
        .y_label_formatter(&|y| format!("{y}"))
        .label_style((FONT, 13))
        .light_line_style(TRANSPARENT)
        .draw()?;
    let limit = f64::from(panel.limit);
    for k in 0..30 {
        let from = 3.0 * f64::from(k);
        let dash = [(from, limit), (from + 1.5, limit)];
        chart.draw_series([PathElement::new(dash, BLACK.stroke_width(2))])?;
    }
    for (pair, color) in ContactPair::ALL.into_iter().zip(COLORS) {
        for with_normals in [true, false] {
            let points: Vec<(f64, f64)> = rows
                .iter()
                .filter(|row| row.pair == pair && row.regime == panel.regime)
                .filter(|row| row.with_normals == with_normals)
                .map(|row| {
                    let angle = (row.angle_bin as f64 + 0.5) * ANGLE_STEP as f64;
                    let error = f64::from((panel.error)(row));
                    (angle, error.clamp(LEAST, panel.greatest))
                })
                .collect();
            let style = if with_normals {
                color.filled()
            } else {
                color.stroke_width(2)
            };
            let line = color.mix(if with_normals { 1.0 } else { 0.5 });
            chart.draw_series([PathElement::new(points.clone(), line.stroke_width(2))])?;
            chart.draw_series(points.into_iter().map(|at| Circle::new(at, 4, style)))?;
        }
    }
    Ok(())
}
