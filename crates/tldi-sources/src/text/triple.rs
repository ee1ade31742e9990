//! Three columns without names, whose meaning their values show at the end.

use std::ops::Range;
use tldi::glamx::Vec3;

/// How far the length of a normal may be from 1: each component may be rounded to two decimals. With half of it such normals
/// are refused; twice of it takes more colours from 0 to 1 for normals.
const LENGTH_TOLERANCE: f64 = 0.01;

/// Colours, normals, or neither.
pub(super) struct Triple {
    places: Range<usize>,
    values: Vec<[f32; 3]>,
    /// Rows of length 1.
    unit: usize,
    /// Rows that are zero or not finite: normals that are not known.
    missing: usize,
    /// Whether all values are whole numbers from 0 to 255.
    is_bytes: bool,
}

impl Triple {
    pub(super) fn new(places: Range<usize>) -> Self {
        Self {
            places,
            values: Vec::new(),
            unit: 0,
            missing: 0,
            is_bytes: true,
        }
    }

    pub(super) fn contains(&self, place: usize) -> bool {
        self.places.contains(&place)
    }

    /// Takes its columns of a row.
    pub(super) fn push(&mut self, fields: &[f64]) {
        let values = &fields[self.places.clone()];
        let is_byte = |v: &f64| (0.0..=255.0).contains(v) && v.fract() == 0.0;
        self.is_bytes &= values.iter().all(is_byte);
        let length = values.iter().map(|v| v * v).sum::<f64>().sqrt();
        if (length - 1.0).abs() <= LENGTH_TOLERANCE {
            self.unit += 1;
        } else if length == 0.0 || !length.is_finite() {
            self.missing += 1;
        }
        self.values.push([0, 1, 2].map(|i| values[i] as f32));
    }

    /// Whether most rows are known, and at least 19 of 20 of these have the length 1.
    pub(super) fn is_normal(&self) -> bool {
        let known = self.values.len() - self.missing;
        self.unit > self.missing && self.unit * 20 >= known * 19
    }

    /// Whether no row is known.
    pub(super) fn is_missing(&self) -> bool {
        self.missing == self.values.len()
    }

    /// Whether all are whole numbers from 0 to 255, and not the normals of axes.
    pub(super) fn is_color(&self) -> bool {
        self.is_bytes && !self.is_normal()
    }

    pub(super) fn into_colors(self) -> Vec<[u8; 4]> {
        // Exact: whole numbers from 0 to 255.
        let color = |[r, g, b]: [f32; 3]| [r as u8, g as u8, b as u8, 255];
        self.values.into_iter().map(color).collect()
    }

    pub(super) fn into_normals(self) -> Vec<Vec3> {
        self.values.into_iter().map(Vec3::from_array).collect()
    }
}
