//! What a named column or property of a file means.

use crate::collector::Sample;
use crate::scalar::{Endian, Scalar};
use crate::splat;

/// The value of a point that a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    /// Coordinate 0 to 2.
    Position(usize),
    /// Component 0 to 2 of the normal.
    Normal(usize),
    /// Red, green, blue, alpha: 0 to 3.
    Color(usize),
    /// Bits 0x00RRGGBB in one value.
    PackedRgb,
    /// Bits 0xAARRGGBB in one value.
    PackedRgba,
    /// Radius of the point's ball.
    Radius,
    /// Part of a Gaussian splat.
    Splat(usize),
}

impl Slot {
    /// The slot that a name, in any case, stands for.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "x" => Self::Position(0),
            "y" => Self::Position(1),
            "z" => Self::Position(2),
            "nx" | "normal_x" | "normalx" => Self::Normal(0),
            "ny" | "normal_y" | "normaly" => Self::Normal(1),
            "nz" | "normal_z" | "normalz" => Self::Normal(2),
            // CloudCompare calls colours from 0 to 1 `Rf`, `Gf`, `Bf`, `Af`.
            "r" | "rf" | "red" | "diffuse_red" => Self::Color(0),
            "g" | "gf" | "green" | "diffuse_green" => Self::Color(1),
            "b" | "bf" | "blue" | "diffuse_blue" => Self::Color(2),
            "a" | "af" | "alpha" | "diffuse_alpha" => Self::Color(3),
            "rgb" => Self::PackedRgb,
            "rgba" => Self::PackedRgba,
            "radius" => Self::Radius,
            other => Self::Splat(splat::part_from_name(other)?),
        })
    }

    /// Whether it is a colour in one value.
    pub(crate) fn is_packed(self) -> bool {
        matches!(self, Self::PackedRgb | Self::PackedRgba)
    }
}

/// One column that is kept.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    /// Where it goes.
    pub(crate) slot: Slot,
    /// Its type; [`Scalar::F64`] in text.
    pub(crate) scalar: Scalar,
    /// Its place in the record: a byte offset, or an index in a line.
    pub(crate) place: usize,
}

/// The columns of a file that are kept: each slot once, vectors only if complete.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns(pub(crate) Vec<Column>);

impl Columns {
    /// The first column of each slot, without incomplete normals, colours and splats.
    pub(crate) fn new(all: impl IntoIterator<Item = Column>) -> Self {
        let mut kept: Vec<Column> = Vec::new();
        for column in all {
            if !kept.iter().any(|k| k.slot == column.slot) {
                kept.push(column);
            }
        }
        let mut columns = Self(kept);
        if !(0..3).all(|axis| columns.has(Slot::Normal(axis))) {
            columns.0.retain(|c| !matches!(c.slot, Slot::Normal(_)));
        }
        if !(0..3).all(|channel| columns.has(Slot::Color(channel))) {
            columns.0.retain(|c| !matches!(c.slot, Slot::Color(_)));
        } else {
            columns.0.retain(|c| !c.slot.is_packed());
        }
        let has_all = |are_asked: fn(usize) -> bool| {
            (0..splat::PARTS)
                .filter(|part| are_asked(*part))
                .all(|part| columns.has(Slot::Splat(part)))
        };
        let (is_splat, has_color) = (has_all(splat::is_needed), has_all(splat::is_color));
        columns.0.retain(|c| match c.slot {
            Slot::Splat(part) => is_splat && (!splat::is_color(part) || has_color),
            // A splat's come from its axes; files have zeros there.
            Slot::Normal(_) | Slot::Radius => !is_splat,
            _ => true,
        });
        columns
    }

    /// What the bytes of a record say.
    #[inline]
    pub(crate) fn sample(&self, record: &[u8], endian: Endian) -> Sample {
        let mut sample = Sample::EMPTY;
        for column in &self.0 {
            sample.decode(column, &record[column.place..], endian);
        }
        sample
    }

    pub(crate) fn has(&self, slot: Slot) -> bool {
        self.0.iter().any(|c| c.slot == slot)
    }

    /// Whether all three coordinates are there.
    pub(crate) fn has_position(&self) -> bool {
        (0..3).all(|axis| self.has(Slot::Position(axis)))
    }

    pub(crate) fn has_normal(&self) -> bool {
        self.has(Slot::Normal(0))
    }

    /// Whether the points are Gaussian splats.
    pub(crate) fn has_splat(&self) -> bool {
        self.has(Slot::Splat(0))
    }

    /// Whether splats have a colour, and only one.
    pub(crate) fn has_splat_color(&self) -> bool {
        self.has(Slot::Splat(splat::PARTS - 1))
            && !self.has(Slot::Color(0))
            && !self.has_packed_color()
    }

    pub(crate) fn has_packed_color(&self) -> bool {
        self.has(Slot::PackedRgb) || self.has(Slot::PackedRgba)
    }

    /// Whether a coordinate may not fit into `f32`.
    pub(crate) fn has_wide_position(&self) -> bool {
        self.0
            .iter()
            .any(|c| matches!(c.slot, Slot::Position(_)) && c.scalar.is_wider_than_f32())
    }

    /// Types of the colour channels.
    pub(crate) fn color_scalars(&self) -> impl Iterator<Item = Scalar> + '_ {
        self.0
            .iter()
            .filter(|c| matches!(c.slot, Slot::Color(_)))
            .map(|c| c.scalar)
    }
}
