//! Gathers points, whatever the format, into a [`RawCloud`].

use crate::input::Input;
use crate::scalar::{Endian, Scalar};
use crate::slot::{Column, Columns, Slot};
use crate::{RawCloud, ReadOptions, SourceError, SourceErrorKind, origin, splat};
use tldi::glamx::{DVec3, Vec3};

/// Points seen before the origin is chosen.
const ORIGIN_SAMPLE: usize = 1024;

/// Points reserved for at most before any has been read.
const MAX_RESERVED: u64 = 1 << 16;

/// How colour channels are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ColorScale {
    /// 0 to 255.
    Bytes,
    /// Integers of more than 8 bits: 0 to 255, or to 65535 if any of the file is above 255.
    Integers,
    /// Reals: 0 to 1, or as integers if any of the file is above 1.
    Reals,
}

/// What each point of a file has, beside its place.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Layout {
    pub(crate) normals: bool,
    pub(crate) colors: Option<ColorScale>,
    pub(crate) radii: bool,
    /// If the points are splats, how they become points.
    pub(crate) splats: Option<Splats>,
    /// Whether coordinates may not fit into `f32`.
    pub(crate) wide: bool,
}

/// How splats become points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Splats {
    /// Of what is less opaque no point is made.
    least_opacity: f32,
    /// Whether their colour is that of their harmonics.
    color: bool,
}

impl Layout {
    pub(crate) fn of(columns: &Columns, options: &ReadOptions) -> Self {
        let splats = columns.has_splat().then(|| Splats {
            least_opacity: options.least_opacity,
            color: columns.has_splat_color(),
        });
        let colors = if splats.is_some_and(|splats| splats.color) || columns.has_packed_color() {
            Some(ColorScale::Bytes)
        } else if !columns.has(Slot::Color(0)) {
            None
        } else if columns.color_scalars().all(|s| s == Scalar::U8) {
            Some(ColorScale::Bytes)
        } else if columns.color_scalars().all(Scalar::is_integer) {
            Some(ColorScale::Integers)
        } else {
            Some(ColorScale::Reals)
        };
        Self {
            normals: splats.is_some() || columns.has_normal(),
            colors,
            radii: splats.is_some() || columns.has(Slot::Radius),
            splats,
            wide: columns.has_wide_position(),
        }
    }
}

/// One point as it is in the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) position: [f64; 3],
    pub(crate) normal: [f32; 3],
    /// Red, green, blue, alpha on the scale of the file; alpha NaN where there is none.
    pub(crate) color: [f32; 4],
    pub(crate) radius: f32,
    /// Of a Gaussian splat, as in the file.
    pub(crate) splat: [f32; splat::PARTS],
}

impl Sample {
    pub(crate) const EMPTY: Self = Self {
        position: [f64::NAN; 3],
        normal: [0.0; 3],
        color: [0.0, 0.0, 0.0, f32::NAN],
        radius: 0.0,
        splat: splat::EMPTY,
    };

    /// Sets the column from its bytes.
    #[inline]
    pub(crate) fn decode(&mut self, column: &Column, bytes: &[u8], endian: Endian) {
        if column.slot.is_packed() {
            // Exact: 32 bits fit into f64.
            self.set_packed(column.slot, Scalar::U32.decode(bytes, endian) as u32);
        } else {
            self.set(column.slot, column.scalar.decode(bytes, endian));
        }
    }

    /// Sets what `slot` stands for, for all but packed colours.
    #[inline]
    pub(crate) fn set(&mut self, slot: Slot, value: f64) {
        match slot {
            Slot::Position(axis) => self.position[axis] = value,
            Slot::Normal(axis) => self.normal[axis] = value as f32,
            Slot::Color(channel) => self.color[channel] = value as f32,
            Slot::Radius => self.radius = value as f32,
            Slot::Splat(part) => self.splat[part] = value as f32,
            Slot::PackedRgb | Slot::PackedRgba => {}
        }
    }

    /// Sets the colour from bits 0xAARRGGBB.
    #[inline]
    pub(crate) fn set_packed(&mut self, slot: Slot, bits: u32) {
        let [blue, green, red, alpha] = bits.to_le_bytes().map(f32::from);
        let alpha = if slot == Slot::PackedRgba {
            alpha
        } else {
            f32::NAN
        };
        self.color = [red, green, blue, alpha];
    }
}

/// Colours so far.
enum Colors {
    None,
    Bytes(Vec<[u8; 4]>),
    Unscaled {
        channels: Vec<[f32; 4]>,
        scale: ColorScale,
    },
}

/// Gathers the points of one file.
pub(crate) struct Collector {
    max_points: u64,
    points: Vec<Vec3>,
    normals: Option<Vec<Vec3>>,
    colors: Colors,
    radii: Option<Vec<f32>>,
    splats: Option<Splats>,
    left_out: u64,
    origin: DVec3,
    /// Positions kept back until the origin is chosen; `None` once it is.
    pending: Option<Vec<DVec3>>,
}

impl Collector {
    /// For about `expected` points.
    pub(crate) fn new(layout: Layout, expected: u64, options: &ReadOptions) -> Self {
        // Fits: small.
        let reserve = expected.min(MAX_RESERVED).min(options.max_points) as usize;
        Self {
            max_points: options.max_points,
            points: Vec::with_capacity(reserve),
            normals: layout.normals.then(|| Vec::with_capacity(reserve)),
            colors: match layout.colors {
                None => Colors::None,
                Some(ColorScale::Bytes) => Colors::Bytes(Vec::with_capacity(reserve)),
                Some(scale) => Colors::Unscaled {
                    channels: Vec::with_capacity(reserve),
                    scale,
                },
            },
            radii: layout.radii.then(|| Vec::with_capacity(reserve)),
            splats: layout.splats,
            left_out: 0,
            origin: options.origin.unwrap_or(DVec3::ZERO),
            pending: (layout.wide && options.origin.is_none()).then(Vec::new),
        }
    }

    /// Number of points so far.
    pub(crate) fn count(&self) -> u64 {
        (self.points.len() + self.pending.as_ref().map_or(0, Vec::len)) as u64
    }

    #[inline]
    pub(crate) fn push(&mut self, sample: &Sample) -> Result<(), SourceErrorKind> {
        if self.count() >= self.max_points {
            return Err(too_many(self.max_points));
        }
        let mut sample = *sample;
        if let Some(splats) = self.splats {
            let Some(point) = splat::point(&sample.splat, splats.least_opacity) else {
                self.left_out += 1;
                return Ok(());
            };
            (sample.normal, sample.radius) = (point.normal, point.radius);
            if splats.color {
                sample.color = point.color;
            }
        }
        let position = DVec3::from_array(sample.position);
        match &mut self.pending {
            None => self.points.push((position - self.origin).as_vec3()),
            Some(pending) => {
                pending.push(position);
                if pending.len() == ORIGIN_SAMPLE {
                    self.choose_origin();
                }
            }
        }
        if let Some(normals) = &mut self.normals {
            normals.push(Vec3::from_array(sample.normal));
        }
        match &mut self.colors {
            Colors::None => {}
            Colors::Bytes(colors) => colors.push(color_bytes(sample.color, 1.0)),
            Colors::Unscaled { channels, .. } => channels.push(sample.color),
        }
        if let Some(radii) = &mut self.radii {
            radii.push(sample.radius);
        }
        Ok(())
    }

    /// Reads the points of `count` records of `size` bytes, or of all records up to the end of the input; the errors call
    /// them `what`.
    pub(crate) fn read_records(
        &mut self,
        input: &mut Input<'_>,
        size: usize,
        count: Option<u64>,
        what: &str,
        sample: impl Fn(&[u8]) -> Sample,
    ) -> Result<(), SourceError> {
        let mut left = count.unwrap_or(u64::MAX);
        while left > 0 && (count.is_some() || !input.peek(1)?.is_empty()) {
            let position = input.byte_position();
            let records = input.records(size, left, what)?;
            left -= (records.len() / size) as u64;
            for record in records.chunks_exact(size) {
                self.push(&sample(record))
                    .map_err(|kind| kind.at(position))?;
            }
            input.points_read = self.count();
        }
        Ok(())
    }

    /// Chooses the origin from the points kept back, and passes them on.
    fn choose_origin(&mut self) {
        let Some(pending) = self.pending.take() else {
            return;
        };
        self.origin = origin::near(&pending);
        let origin = self.origin;
        self.points
            .extend(pending.iter().map(|p| (*p - origin).as_vec3()));
    }

    /// The cloud, without faces.
    pub(crate) fn finish(mut self) -> Result<RawCloud, SourceErrorKind> {
        self.choose_origin();
        if self.points.is_empty() {
            return Err(match self.left_out {
                0 => SourceErrorKind::NoPoints,
                count => SourceErrorKind::TooFaint { count },
            });
        }
        let colors = match self.colors {
            Colors::None => None,
            Colors::Bytes(colors) => Some(colors),
            Colors::Unscaled { channels, scale } => {
                let factor = color_factor(&channels, scale);
                Some(channels.iter().map(|c| color_bytes(*c, factor)).collect())
            }
        };
        Ok(RawCloud {
            points: self.points,
            normals: self.normals,
            colors,
            radii: self.radii,
            has_unsigned_normals: self.splats.is_some(),
            left_out: self.left_out,
            faces: Vec::new(),
            origin: self.origin,
            viewpoint: None,
            size: None,
        })
    }
}

/// Fails if a header promises more points than are allowed.
pub(crate) fn check_count(count: u64, options: &ReadOptions) -> Result<(), SourceErrorKind> {
    if count > options.max_points {
        return Err(too_many(options.max_points));
    }
    Ok(())
}

fn too_many(limit: u64) -> SourceErrorKind {
    SourceErrorKind::TooManyPoints { limit }
}

/// What takes the channels of a file to 0 to 255.
fn color_factor(channels: &[[f32; 4]], scale: ColorScale) -> f32 {
    let most = channels
        .iter()
        .flat_map(|c| &c[..3])
        .fold(0.0_f32, |most, c| most.max(*c));
    if scale == ColorScale::Reals && most <= 1.0 {
        255.0
    } else if most <= 255.0 {
        1.0
    } else {
        1.0 / 257.0
    }
}

/// Rounded and limited to 0 to 255; NaN becomes 0, but a missing alpha opaque.
#[inline]
fn color_bytes(color: [f32; 4], factor: f32) -> [u8; 4] {
    // `as` saturates, and takes NaN to 0.
    let byte = |channel: f32| (channel * factor).round() as u8;
    let [red, green, blue, alpha] = color;
    let alpha = if alpha.is_nan() { 255 } else { byte(alpha) };
    [byte(red), byte(green), byte(blue), alpha]
}
