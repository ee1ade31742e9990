//! Shapes and words of a picture, at any scale.

use super::figure::{Color, Line, Look, Mark};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::Color as _;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;

pub(super) const FONT: &str = "sans-serif";

pub(super) type Outcome = Result<(), Box<dyn Error>>;
/// Right and down, in units of which the picture's own are multiples.
pub(super) type At = (i32, i32);

/// An area that is drawn on in units of its own.
pub(super) struct Canvas<'a, B: DrawingBackend> {
    pub(super) area: &'a DrawingArea<B, Shift>,
    /// Pixels to a unit.
    pub(super) scale: i32,
}

/// How words are set.
#[derive(Clone, Copy)]
pub(super) struct Words {
    pub(super) size: i32,
    pub(super) color: Color,
    pub(super) horizontal: HPos,
    pub(super) vertical: VPos,
    pub(super) is_upright: bool,
}

impl Words {
    pub(super) fn new(size: i32, color: Color, horizontal: HPos, vertical: VPos) -> Self {
        Self {
            size,
            color,
            horizontal,
            vertical,
            is_upright: false,
        }
    }
}

impl<B: DrawingBackend<ErrorType: 'static>> Canvas<'_, B> {
    fn pixel(&self, at: At) -> At {
        (self.scale * at.0, self.scale * at.1)
    }

    fn style(&self, color: Color, opacity: f64, width: i32) -> ShapeStyle {
        let [r, g, b] = color;
        let color = RGBColor(r, g, b).mix(opacity);
        color.stroke_width((self.scale * width) as u32)
    }

    pub(super) fn text(&self, words: &str, look: Words, at: At) -> Outcome {
        let [r, g, b] = look.color;
        let font = (FONT, self.scale * look.size).into_font();
        let font = match look.is_upright {
            true => font.transform(FontTransform::Rotate270),
            false => font,
        };
        let style = font
            .color(&RGBColor(r, g, b))
            .pos(Pos::new(look.horizontal, look.vertical));
        self.area.draw_text(words, &style, self.pixel(at))?;
        Ok(())
    }

    /// A line through points; `opacity` from 0 to 1. Segment by segment: a sharp bend of one path has its
    /// outer corner far away.
    pub(super) fn path(&self, points: &[At], color: Color, opacity: f64, width: i32) -> Outcome {
        let style = self.style(color, opacity, width);
        for segment in points.windows(2) {
            let pixels: Vec<At> = segment.iter().map(|at| self.pixel(*at)).collect();
            self.area.draw(&PathElement::new(pixels, style))?;
        }
        Ok(())
    }

    pub(super) fn dashes(&self, [from, to]: [At; 2], dash: i32, gap: i32, color: Color) -> Outcome {
        let (dx, dy) = (f64::from(to.0 - from.0), f64::from(to.1 - from.1));
        let length = dx.hypot(dy);
        let along = |distance: f64| {
            let share = distance.min(length) / length.max(1.0);
            let step = |start: i32, way: f64| start + (way * share).round() as i32;
            (step(from.0, dx), step(from.1, dy))
        };
        let mut start = 0.0;
        while start < length {
            let ends = [along(start), along(start + f64::from(dash))];
            self.path(&ends, color, 1.0, 2)?;
            start += f64::from(dash + gap);
        }
        Ok(())
    }

    pub(super) fn frame(&self, low: At, high: At, color: Color) -> Outcome {
        let corners = [self.pixel(low), self.pixel(high)];
        let rectangle = Rectangle::new(corners, self.style(color, 1.0, 1));
        self.area.draw(&rectangle)?;
        Ok(())
    }

    pub(super) fn line(&self, points: &[At], look: &Look) -> Outcome {
        let width = match look.line {
            Line::None => return Ok(()),
            Line::Thin => 2,
            Line::Thick => 4,
            Line::Bar => 26,
            Line::Dashed => {
                for ends in points.windows(2) {
                    self.dashes([ends[0], ends[1]], 6, 4, look.color)?;
                }
                return Ok(());
            }
        };
        self.path(points, look.color, 1.0, width)
    }

    pub(super) fn mark(&self, (x, y): At, look: &Look) -> Outcome {
        match look.mark {
            Mark::None => Ok(()),
            Mark::Disc => self.circle((x, y), 9, look.color),
            Mark::Ring => {
                self.circle((x, y), 9, look.color)?;
                self.circle((x, y), 5, [255; 3])
            }
            Mark::Square => self.polygon((x, y), &[(-4, -4), (4, -4), (4, 4), (-4, 4)], look.color),
            Mark::Triangle => self.polygon((x, y), &[(-5, 4), (5, 4), (0, -5)], look.color),
            Mark::Diamond => self.polygon((x, y), &[(-5, 0), (0, -5), (5, 0), (0, 5)], look.color),
            Mark::Cross => {
                for [(u, v), (s, t)] in [[(-4, -4), (4, 4)], [(-4, 4), (4, -4)]] {
                    self.path(&[(x + u, y + v), (x + s, y + t)], look.color, 1.0, 2)?;
                }
                Ok(())
            }
            Mark::Star => {
                let corner = |k: usize| {
                    let (turn, radius) = (k as f64 * std::f64::consts::PI / 5.0, [9.0, 3.8][k % 2]);
                    let (s, c) = turn.sin_cos();
                    ((radius * s).round() as i32, (-radius * c).round() as i32)
                };
                let corners: Vec<At> = (0..10).map(corner).collect();
                self.polygon((x, y), &corners, look.color)
            }
        }
    }

    fn circle(&self, at: At, diameter: i32, [r, g, b]: Color) -> Outcome {
        let style = RGBColor(r, g, b).filled();
        let circle = Circle::new(self.pixel(at), diameter * self.scale / 2, style);
        self.area.draw(&circle)?;
        Ok(())
    }

    fn polygon(&self, (x, y): At, corners: &[At], [r, g, b]: Color) -> Outcome {
        let pixels: Vec<At> = corners
            .iter()
            .map(|(u, v)| self.pixel((x + u, y + v)))
            .collect();
        let polygon = Polygon::new(pixels, RGBColor(r, g, b).filled());
        self.area.draw(&polygon)?;
        Ok(())
    }
}
