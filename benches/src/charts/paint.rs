//! Figures as SVG and PNG.

use super::canvas::{At, Canvas, FONT, Outcome, Words};
use super::error::ChartError;
use super::figure::{Axis, Color, Curve, Figure, Line, Panel, ZERO_SHARE};
use super::ticks::ticks;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use std::error::Error;
use std::path::{Path, PathBuf};

const MARGIN: i32 = 18;
/// Around the plot of a panel: left, top, right, bottom.
const FRAME: [i32; 4] = [70, 32, 18, 52];
const LEGEND_ROW: i32 = 23;
const NOTE_ROW: i32 = 19;
const GRID: Color = [226, 226, 226];
const FADED: Color = [95, 95, 95];
const DARK: Color = [30, 30, 30];

/// Pixels of the PNG to a unit, so that small words are clear.
const PNG_SCALE: i32 = 2;

/// Writes the figure as `<name>.svg` and `<name>.png` and returns both.
pub(super) fn save(figure: &Figure, folder: &Path) -> Result<[PathBuf; 2], ChartError> {
    let [svg, png] = ["svg", "png"].map(|kind| folder.join(format!("{}.{kind}", figure.name)));
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source: Box<dyn Error>| ChartError::Picture {
            path,
            reason: source.to_string(),
        }
    };
    let fonts = epaint_default_fonts::UBUNTU_LIGHT;
    plotters::style::register_font(FONT, FontStyle::Normal, fonts)
        .map_err(|_| failed(&png)("the built-in font cannot be read".into()))?;
    let [width, height] = size(figure);
    let pixels = |scale: i32| ((scale * width) as u32, (scale * height) as u32);
    draw(figure, SVGBackend::new(&svg, pixels(1)), 1).map_err(failed(&svg))?;
    let bitmap = BitMapBackend::new(&png, pixels(PNG_SCALE));
    draw(figure, bitmap, PNG_SCALE).map_err(failed(&png))?;
    Ok([svg, png])
}

fn draw<B: DrawingBackend<ErrorType: 'static>>(figure: &Figure, backend: B, scale: i32) -> Outcome {
    let area = backend.into_drawing_area();
    paint(figure, &Canvas { area: &area, scale })
}

/// As wide as the panels, or as the longest line if that is wider.
fn width(figure: &Figure) -> i32 {
    let length = |line: &String, size: i32| line.chars().count() as i32 * size / 2;
    let lines = figure.subtitle.iter().map(|line| length(line, 15));
    let notes = figure.notes.iter().map(|line| length(line, 14));
    let words = lines.chain(notes).chain([length(&figure.title, 23)]).max();
    let panels = figure.columns as i32 * figure.panel_size[0];
    2 * MARGIN + panels.max(words.unwrap_or(0))
}

fn panel_size(figure: &Figure) -> [i32; 2] {
    let width = (width(figure) - 2 * MARGIN) / figure.columns as i32;
    [width, figure.panel_size[1]]
}

fn legend_columns(figure: &Figure) -> i32 {
    let widest = figure.legend.iter().map(|e| e.label.chars().count()).max();
    let column = 52 + 8 * widest.unwrap_or(0) as i32;
    (width(figure) - 2 * MARGIN).max(column) / column
}

fn legend_rows(figure: &Figure) -> i32 {
    (figure.legend.len() as i32 + legend_columns(figure) - 1) / legend_columns(figure)
}

fn head(figure: &Figure) -> i32 {
    MARGIN + 32 + NOTE_ROW * figure.subtitle.len() as i32 + 8
}

fn size(figure: &Figure) -> [i32; 2] {
    let rows = figure.panels.len().div_ceil(figure.columns) as i32;
    let below = LEGEND_ROW * legend_rows(figure) + 12 + NOTE_ROW * figure.notes.len() as i32;
    let height = head(figure) + rows * figure.panel_size[1] + below + MARGIN;
    [width(figure), height]
}

fn paint<B: DrawingBackend<ErrorType: 'static>>(figure: &Figure, canvas: &Canvas<B>) -> Outcome {
    canvas.area.fill(&WHITE)?;
    let left = |size, color| Words::new(size, color, HPos::Left, VPos::Top);
    canvas.text(&figure.title, left(23, DARK), (MARGIN, MARGIN))?;
    for (k, line) in figure.subtitle.iter().enumerate() {
        let at = (MARGIN, MARGIN + 32 + NOTE_ROW * k as i32);
        canvas.text(line, left(15, FADED), at)?;
    }
    let top = head(figure);
    for (k, panel) in figure.panels.iter().enumerate() {
        let (row, column) = ((k / figure.columns) as i32, (k % figure.columns) as i32);
        let [w, h] = panel_size(figure);
        let corner = (MARGIN + column * w, top + row * h);
        paint_panel(panel, &Plot::new(panel, corner, [w, h]), canvas)?;
    }
    let rows = figure.panels.len().div_ceil(figure.columns) as i32;
    let mut y = top + rows * figure.panel_size[1];
    let column_width = (width(figure) - 2 * MARGIN) / legend_columns(figure);
    let legend_rows = legend_rows(figure);
    for (k, entry) in figure.legend.iter().enumerate() {
        // Down the columns, as a list is read.
        let (column, row) = (k as i32 / legend_rows, k as i32 % legend_rows);
        let (x, y) = (MARGIN + column * column_width, y + LEGEND_ROW * row + 10);
        canvas.line(&[(x, y), (x + 34, y)], &entry.look)?;
        canvas.mark((x + 17, y), &entry.look)?;
        let words = Words::new(15, DARK, HPos::Left, VPos::Center);
        canvas.text(&entry.label, words, (x + 42, y))?;
    }
    y += LEGEND_ROW * legend_rows + 12;
    for (k, note) in figure.notes.iter().enumerate() {
        canvas.text(note, left(14, FADED), (MARGIN, y + NOTE_ROW * k as i32))?;
    }
    canvas.area.present()?;
    Ok(())
}

/// Where a panel's values are on the picture.
struct Plot<'a> {
    x: &'a Axis,
    y: &'a Axis,
    /// Left and top.
    low: At,
    /// Right and bottom.
    high: At,
}

impl<'a> Plot<'a> {
    fn new(panel: &'a Panel, corner: At, [w, h]: [i32; 2]) -> Self {
        Self {
            x: &panel.x,
            y: &panel.y,
            low: (corner.0 + FRAME[0], corner.1 + FRAME[1]),
            high: (corner.0 + w - FRAME[2], corner.1 + h - FRAME[3]),
        }
    }

    fn x(&self, value: f64) -> i32 {
        self.low.0 + (f64::from(self.high.0 - self.low.0) * self.x.place(value)).round() as i32
    }

    fn y(&self, value: f64) -> i32 {
        self.high.1 - (f64::from(self.high.1 - self.low.1) * self.y.place(value)).round() as i32
    }

    fn at(&self, x: f64, y: f64) -> At {
        (self.x(x), self.y(y))
    }

    /// A horizontal line.
    fn across(&self, y: i32) -> [At; 2] {
        [(self.low.0, y), (self.high.0, y)]
    }
}

fn paint_panel<B: DrawingBackend<ErrorType: 'static>>(
    panel: &Panel,
    plot: &Plot,
    canvas: &Canvas<B>,
) -> Outcome {
    paint_axes(panel, plot, canvas)?;
    for level in &panel.levels {
        let y = plot.y(level.y);
        canvas.dashes(plot.across(y), 7, 5, FADED)?;
        let words = Words::new(14, FADED, HPos::Right, VPos::Bottom);
        canvas.text(&level.label, words, (plot.high.0 - 6, y - 3))?;
    }
    for curve in &panel.curves {
        paint_curve(curve, plot, canvas)?;
    }
    // Above all marks.
    for curve in &panel.curves {
        paint_words(curve, plot, canvas)?;
    }
    Ok(())
}

fn paint_words<B: DrawingBackend<ErrorType: 'static>>(
    curve: &Curve,
    plot: &Plot,
    canvas: &Canvas<B>,
) -> Outcome {
    if let (Line::Bar, [start, .., end]) = (curve.look.line, &curve.points[..]) {
        let at = plot.at(0.5 * (start.x + end.x), 0.5 * (start.y + end.y));
        let look = Words::new(
            13,
            readable_on(curve.look.color),
            HPos::Center,
            VPos::Center,
        );
        return canvas.text(start.label.as_deref().unwrap_or_default(), look, at);
    }
    for point in &curve.points {
        let Some(words) = &point.label else {
            continue;
        };
        let (x, y) = plot.at(point.x, point.y);
        // On the outer side, where fewer curves are, if there is room.
        let room = 9 + 8 * words.chars().count() as i32;
        let is_left = 2 * x < plot.low.0 + plot.high.0 && x - room > plot.low.0;
        let (side, offset) = match is_left || x + room > plot.high.0 {
            true => (HPos::Right, -9),
            false => (HPos::Left, 9),
        };
        let look = Words::new(13, curve.look.color, side, VPos::Bottom);
        canvas.text(words, look, (x + offset, y - 3))?;
    }
    Ok(())
}

/// Dark on light colours, white on dark ones.
fn readable_on([r, g, b]: Color) -> Color {
    let light = 0.3 * f64::from(r) + 0.6 * f64::from(g) + 0.1 * f64::from(b);
    if light > 140.0 { DARK } else { [255; 3] }
}

fn paint_axes<B: DrawingBackend<ErrorType: 'static>>(
    panel: &Panel,
    plot: &Plot,
    canvas: &Canvas<B>,
) -> Outcome {
    let middle = (plot.low.0 + plot.high.0) / 2;
    let title = Words::new(17, DARK, HPos::Left, VPos::Bottom);
    canvas.text(&panel.title, title, (plot.low.0, plot.low.1 - 6))?;
    for (value, words) in ticks(plot.x) {
        let x = plot.x(value);
        canvas.path(&[(x, plot.low.1), (x, plot.high.1)], GRID, 1.0, 1)?;
        let look = Words::new(14, DARK, HPos::Center, VPos::Top);
        canvas.text(&words, look, (x, plot.high.1 + 5))?;
    }
    for (value, words) in ticks(plot.y) {
        let y = plot.y(value);
        canvas.path(&plot.across(y), GRID, 1.0, 1)?;
        let look = Words::new(14, DARK, HPos::Right, VPos::Center);
        canvas.text(&words, look, (plot.low.0 - 7, y))?;
    }
    if plot.y.has_zero {
        // Below here nothing is to scale.
        let share = (ZERO_SHARE * f64::from(plot.high.1 - plot.low.1)) as i32;
        canvas.dashes(plot.across(plot.high.1 - share), 2, 5, [170; 3])?;
    }
    canvas.frame(plot.low, plot.high, [150; 3])?;
    let look = Words::new(15, DARK, HPos::Center, VPos::Top);
    canvas.text(&panel.x.label, look, (middle, plot.high.1 + 26))?;
    let upright = Words {
        is_upright: true,
        ..look
    };
    let height = (plot.low.1 + plot.high.1) / 2;
    canvas.text(&panel.y.label, upright, (plot.low.0 - FRAME[0] + 6, height))
}

fn paint_curve<B: DrawingBackend<ErrorType: 'static>>(
    curve: &Curve,
    plot: &Plot,
    canvas: &Canvas<B>,
) -> Outcome {
    let at: Vec<At> = curve.points.iter().map(|p| plot.at(p.x, p.y)).collect();
    canvas.line(&at, &curve.look)?;
    for (point, at) in curve.points.iter().zip(at) {
        let ends_x = point.x_spread.map(|ends| ends.map(|x| plot.at(x, point.y)));
        let ends_y = point.y_spread.map(|ends| ends.map(|y| plot.at(point.x, y)));
        for ends in ends_x.into_iter().chain(ends_y) {
            canvas.path(&ends, curve.look.color, 0.4, 1)?;
        }
        canvas.mark(at, &curve.look)?;
    }
    Ok(())
}
