//! Panels side by side on one sheet, with captions and a legend.

use crate::Picture;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// Space between panels and around the sheet in picture pixels.
const SPACE: u32 = 10;
const PAPER: [u8; 3] = [250, 250, 250];
const INK: [u8; 3] = [40, 44, 52];
const WEIGHT: FontWeight = FontWeight::Regular;
const TEXT_SIZE: RasterHeight = RasterHeight::Size16;
/// Height of a line of text, and width and height of a sample of colour in the legend.
const LINE: u32 = 20;
const SAMPLE: u32 = 12;

/// A picture with what it is.
pub struct Panel {
    /// What is seen.
    pub picture: Picture,
    /// The line above it, in ASCII.
    pub caption: String,
}

/// A colour and what it means.
pub struct Key {
    /// Red, green, blue.
    pub color: [u8; 3],
    /// In ASCII.
    pub meaning: String,
}

impl Key {
    /// A row of the legend.
    pub fn new(color: [u8; 3], meaning: impl Into<String>) -> Self {
        Self {
            color,
            meaning: meaning.into(),
        }
    }
}

/// Rows of panels under their captions, and below them the legend. Text is ASCII.
pub fn sheet(rows: &[Vec<Panel>], legend: &[Key]) -> Picture {
    let panel_width = |panel: &Panel| panel.picture.size[0].max(text_width(&panel.caption));
    let row_width = |row: &Vec<Panel>| row.iter().map(|p| panel_width(p) + SPACE).sum::<u32>();
    let row_height = |row: &Vec<Panel>| {
        let tallest = row.iter().map(|panel| panel.picture.size[1]).max();
        LINE + tallest.unwrap_or(0) + SPACE
    };
    let key_width = |key: &Key| SAMPLE + SPACE + text_width(&key.meaning) + SPACE;
    let widest_row = rows.iter().map(row_width).max().unwrap_or(0);
    let width = SPACE + widest_row.max(legend.iter().map(key_width).max().unwrap_or(0));
    let height = 2 * SPACE + rows.iter().map(row_height).sum::<u32>() + LINE * legend.len() as u32;
    let mut sheet = Picture {
        size: [width, height],
        rgb: vec![PAPER; (width * height) as usize],
    };
    let mut top = SPACE;
    for row in rows {
        let mut left = SPACE;
        for panel in row {
            write(&mut sheet, [left, top], &panel.caption);
            paste(&mut sheet, [left, top + LINE], &panel.picture);
            left += panel_width(panel) + SPACE;
        }
        top += row_height(row);
    }
    for key in legend {
        let sample = Picture {
            size: [SAMPLE; 2],
            rgb: vec![key.color; (SAMPLE * SAMPLE) as usize],
        };
        paste(&mut sheet, [SPACE, top + 2], &sample);
        write(&mut sheet, [SPACE + SAMPLE + SPACE, top], &key.meaning);
        top += LINE;
    }
    sheet
}

fn text_width(text: &str) -> u32 {
    (text.chars().count() * get_raster_width(WEIGHT, TEXT_SIZE)) as u32
}

/// Writes a line of text whose upper left corner is at `corner`; there must be room for it.
fn write(sheet: &mut Picture, [left, top]: [u32; 2], text: &str) {
    let glyphs = text
        .chars()
        .filter_map(|c| get_raster(c, WEIGHT, TEXT_SIZE));
    for (k, glyph) in glyphs.enumerate() {
        let left = left + (k * glyph.width()) as u32;
        for (y, row) in (top..).zip(glyph.rows()) {
            for (x, strength) in (left..).zip(row) {
                let pixel = &mut sheet.rgb[(y * sheet.size[0] + x) as usize];
                let strength = f32::from(*strength) / 255.0;
                *pixel = [0, 1, 2].map(|c| {
                    let [from, to] = [pixel[c], INK[c]].map(f32::from);
                    (from + strength * (to - from)) as u8
                });
            }
        }
    }
}

/// Copies a picture to where its upper left corner is at `corner`; there must be room for it.
fn paste(sheet: &mut Picture, [left, top]: [u32; 2], picture: &Picture) {
    let columns = picture.size[0] as usize;
    for (y, row) in (top..).zip(picture.rgb.chunks(columns.max(1))) {
        let start = (y * sheet.size[0] + left) as usize;
        sheet.rgb[start..start + row.len()].copy_from_slice(row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Panels lie whole and apart on the sheet, each under its caption, and the legend below them.
    #[test]
    fn panels_captions_and_legend_have_their_places() {
        let panel = |color: [u8; 3], size: [u32; 2], caption: &str| Panel {
            picture: Picture {
                size,
                rgb: vec![color; (size[0] * size[1]) as usize],
            },
            caption: caption.to_owned(),
        };
        let [red, blue, green] = [[255, 0, 0], [0, 0, 255], [0, 255, 0]];
        let rows = [
            vec![
                panel(red, [30, 20], "a long caption"),
                panel(blue, [25, 40], ""),
            ],
            vec![panel(green, [5, 7], "x")],
        ];
        let legend = [Key::new([255, 255, 0], "yellow")];
        let sheet = sheet(&rows, &legend);
        let places = |wanted: [u8; 3]| -> Vec<[u32; 2]> {
            let at = |k: usize| [k as u32 % sheet.size[0], k as u32 / sheet.size[0]];
            let found = sheet.rgb.iter().enumerate();
            found
                .filter(|(_, c)| **c == wanted)
                .map(|(k, _)| at(k))
                .collect()
        };
        for (color, count) in [(red, 600), (blue, 1000), (green, 35), ([255, 255, 0], 144)] {
            assert_eq!(places(color).len(), count, "{color:?}");
        }
        // The caption is wider than its panel: the next panel begins after it.
        let left = |color| places(color).iter().map(|p| p[0]).min().unwrap();
        assert_eq!(left(blue) - left(red), 14 * 7 + SPACE);
        let dark = |from: u32, to: u32| {
            let rows = sheet.rgb.chunks(sheet.size[0] as usize).enumerate();
            let rows = rows.filter(|(y, _)| (from..to).contains(&(*y as u32)));
            rows.flat_map(|(_, row)| row)
                .filter(|c| c.iter().all(|c| *c < 90))
                .count()
        };
        let top = |color| places(color).iter().map(|p| p[1]).min().unwrap();
        // Ink above the first row, none in it, ink beside the sample.
        assert!(dark(0, top(red)) > 50 && dark(top(red), top(red) + 40) == 0);
        assert!(dark(top([255, 255, 0]) - 2, sheet.size[1]) > 30);
    }
}
