//! Messages of type `sensor_msgs/PointCloud2`, without ROS.

use crate::collector::{Collector, Layout, check_count};
use crate::scalar::{Endian, Scalar, excerpt};
use crate::slot::{Column, Columns, Slot};
use crate::{Position, RawCloud, ReadOptions, SourceError, SourceErrorKind};

/// A `sensor_msgs/PointField`: where in a point a value is, and of which type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PointField {
    /// Name; see [`PointCloud2::read`] for those that are kept.
    pub name: String,
    /// Bytes from the start of the point.
    pub offset: u32,
    /// Type by ROS's number, of 1 to 8: `INT8`, `UINT8`, `INT16`, `UINT16`, `INT32`, `UINT32`, `FLOAT32`, `FLOAT64`.
    pub datatype: u8,
    /// Number of values; 0 counts as 1.
    pub count: u32,
}

impl PointField {
    /// A field with one value of type `FLOAT32`.
    pub fn f32(name: &str, offset: u32) -> Self {
        Self {
            name: name.to_owned(),
            offset,
            datatype: 7,
            count: 1,
        }
    }

    fn scalar(&self) -> Option<Scalar> {
        Some(match self.datatype {
            1 => Scalar::I8,
            2 => Scalar::U8,
            3 => Scalar::I16,
            4 => Scalar::U16,
            5 => Scalar::I32,
            6 => Scalar::U32,
            7 => Scalar::F32,
            8 => Scalar::F64,
            _ => return None,
        })
    }
}

/// What of a `sensor_msgs/PointCloud2` tells its points, as the message has it, in ROS 1 and 2.
///
/// ```
/// use tldi_sources::{PointCloud2, PointField, ReadOptions};
/// use tldi::glamx::Vec3;
/// let mut data = Vec::new();
/// for value in [1.0f32, 2.0, 3.0, 0.5] {
///     data.extend(value.to_le_bytes());
/// }
/// let message = PointCloud2 {
///     height: 1,
///     width: 1,
///     fields: vec![
///         PointField::f32("x", 0),
///         PointField::f32("y", 4),
///         PointField::f32("z", 8),
///         PointField::f32("intensity", 12),
///     ],
///     is_bigendian: false,
///     point_step: 16,
///     row_step: 16,
///     data: &data,
/// };
/// let cloud = message.read(&ReadOptions::default())?;
/// assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)]);
/// # Ok::<(), tldi_sources::SourceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PointCloud2<'a> {
    /// Rows; 1 if the points are in no order.
    pub height: u32,
    /// Points of a row.
    pub width: u32,
    /// What a point has.
    pub fields: Vec<PointField>,
    /// Whether the first byte of a value is its highest.
    pub is_bigendian: bool,
    /// Bytes from a point to the next.
    pub point_step: u32,
    /// Bytes from a row to the next; what is left of them behind its points is padding.
    pub row_step: u32,
    /// The rows: `height` × `row_step` bytes.
    pub data: &'a [u8],
}

impl PointCloud2<'_> {
    /// The points, row by row, in the frame of the message (that of its header) and in metres, as ROS has
    /// it. A message without points gives a cloud without points.
    ///
    /// The fields have the same names as those of PCD files: `x`, `y`, `z`, which must be there, and
    /// `normal_x`, `normal_y`, `normal_z`, packed `rgb` or `rgba` of four bytes of any type, or `r`, `g`, `b`,
    /// `a`, and `radius`, with one value each; all others are passed over. Points that are NaN stay, as in
    /// files: whoever builds a cloud drops and counts them. Messages of several rows have a
    /// [size](RawCloud::size).
    ///
    /// Where coordinates are `FLOAT64`, give [`ReadOptions::origin`], so that it is the same one in all
    /// messages.
    ///
    /// # Errors
    /// [`SourceErrorKind::Message`] where fields, steps and data do not fit each other, and
    /// [`SourceErrorKind::TooManyPoints`]; nothing is allocated before.
    pub fn read(&self, options: &ReadOptions) -> Result<RawCloud, SourceError> {
        let columns = self.columns().map_err(message)?;
        // Both fit: products of 32 bits.
        let points = u64::from(self.width) * u64::from(self.height);
        check_count(points, options)?;
        self.check_sizes().map_err(message)?;
        if points == 0 {
            return Ok(RawCloud::default());
        }
        let endian = if self.is_bigendian {
            Endian::Big
        } else {
            Endian::Little
        };
        let mut collector = Collector::new(Layout::of(&columns, options), points, options);
        let row_length = self.width as usize * self.point_step as usize;
        for row in self.data.chunks_exact(self.row_step as usize) {
            for point in row[..row_length].chunks_exact(self.point_step as usize) {
                let index = collector.count();
                collector
                    .push(&columns.sample(point, endian))
                    .map_err(|kind| kind.at(Position::Point(index)))?;
            }
        }
        let mut cloud = collector.finish()?;
        cloud.size = (self.height > 1).then_some([self.width as usize, self.height as usize]);
        Ok(cloud)
    }

    /// The fields that are kept.
    fn columns(&self) -> Result<Columns, String> {
        let mut kept = Vec::new();
        for field in &self.fields {
            let name = excerpt(field.name.as_bytes());
            let slot = Slot::from_name(&field.name);
            let Some(scalar) = field.scalar() else {
                // PCL has numbers of its own for types that ROS lacks, such as stamps of 64 bits.
                if slot.is_none() {
                    continue;
                }
                let datatype = field.datatype;
                return Err(format!(
                    "the field `{name}` has the unknown datatype {datatype}"
                ));
            };
            let count = field.count.max(1);
            let end = u64::from(field.offset) + u64::from(count) * scalar.size() as u64;
            if end > u64::from(self.point_step) {
                let step = self.point_step;
                return Err(format!(
                    "the field `{name}` ends at byte {end}, but point_step is {step}"
                ));
            }
            if count == 1
                && let Some(slot) = slot
                && (scalar.size() == 4 || !slot.is_packed())
            {
                kept.push(Column {
                    slot,
                    scalar,
                    place: field.offset as usize,
                });
            }
        }
        let columns = Columns::new(kept);
        if !columns.has_position() {
            return Err("it lacks one of the fields x, y, z".to_owned());
        }
        Ok(columns)
    }

    fn check_sizes(&self) -> Result<(), String> {
        let (width, height) = (u64::from(self.width), u64::from(self.height));
        let (point_step, row_step) = (u64::from(self.point_step), u64::from(self.row_step));
        // A product of 32 bits each fits.
        if width * point_step > row_step {
            return Err(format!(
                "width {width} × point_step {point_step} is more than row_step {row_step}"
            ));
        }
        if height * row_step != self.data.len() as u64 {
            return Err(format!(
                "height {height} × row_step {row_step} bytes are expected, but data has {}",
                self.data.len()
            ));
        }
        Ok(())
    }
}

fn message(reason: String) -> SourceError {
    SourceErrorKind::Message { reason }.into()
}
