//! E57 (ASTM E2807): all scans of a file, in its common frame.
//!
//! Read with the crate e57, which checks the checksum of each page and all lengths. Checked here
//! in addition: what would make it fill memory or panic. Points that are marked invalid
//! are left out. Normals (an extension) are not read.

use crate::collector::{Collector, ColorScale, Layout, Sample, check_count};
use crate::error::Result;
use crate::input::Input;
use crate::seekable::{self, ReadSeek, guarded};
use crate::{Format, Position, RawCloud, ReadOptions, SourceError, SourceErrorKind};
use ::e57::{
    CartesianCoordinate, ColorLimits, E57Reader, Error, PointCloud, Quaternion, RecordDataType,
    RecordName, RecordValue,
};
use std::path::Path;
use tldi::glamx::DVec3;

/// Points between two reports of progress.
const REPORT_INTERVAL: u64 = 1 << 14;

pub(crate) fn parse(
    input: &mut Input<'_>,
    path: Option<&Path>,
    options: &ReadOptions,
) -> Result<RawCloud> {
    let (source, _) = seekable::open(input, path, Format::E57)?;
    guarded(Format::E57, || read(input, source, options))
}

fn read(
    input: &mut Input<'_>,
    source: Box<dyn ReadSeek>,
    options: &ReadOptions,
) -> Result<RawCloud> {
    let mut reader = E57Reader::new(source).map_err(|e| error(e, Position::Unknown))?;
    let scans = reader.pointclouds();
    let mut count = 0_u64;
    for scan in &scans {
        check_scan(scan)?;
        count = count.saturating_add(scan.records);
    }
    check_count(count, options)?;

    let has_color = scans.iter().any(|s| color_ranges(s).is_some());
    let layout = Layout {
        colors: has_color.then_some(ColorScale::Bytes),
        wide: true,
        ..Layout::default()
    };
    let mut collector = Collector::new(layout, count, options);
    let mut done = 0;
    for scan in &scans {
        let ranges = color_ranges(scan);
        let mut points = reader
            .pointcloud_simple(scan)
            .map_err(|e| error(e, Position::Unknown))?;
        // Its own way to scale colours panics if the limits in the file are NaN.
        points.normalize_color(false);
        points.normalize_intensity(false);
        points.intensity_to_color(false);
        for point in points {
            let position = Position::Point(done);
            let point = point.map_err(|e| error(e, position))?;
            done += 1;
            if done.is_multiple_of(REPORT_INTERVAL) {
                input.points_read = collector.count();
                input.report_share(done, count);
            }
            let CartesianCoordinate::Valid { x, y, z } = point.cartesian else {
                continue;
            };
            let mut sample = Sample::EMPTY;
            sample.position = [x, y, z];
            if let (Some(color), Some(ranges)) = (point.color, ranges) {
                let channels = [color.red, color.green, color.blue];
                for (k, range) in ranges.into_iter().enumerate() {
                    sample.color[k] = range.scaled(channels[k]);
                }
            }
            collector.push(&sample).map_err(|kind| kind.at(position))?;
        }
    }
    input.report_share(done, count);
    let mut cloud = collector.finish()?;
    if let [scan] = &scans[..]
        && let Some(pose) = &scan.transform
        && is_scanner(scan, &pose.rotation)
    {
        let t = &pose.translation;
        let sensor = DVec3::new(t.x, t.y, t.z);
        cloud.viewpoint = Some((sensor - cloud.origin).as_vec3()).filter(|v| v.is_finite());
    }
    Ok(cloud)
}

/// Whether the pose of a scan is that of a scanner. That of a merged cloud is a mere shift: CloudCompare
/// writes its global shift so.
fn is_scanner(scan: &PointCloud, rotation: &Quaternion) -> bool {
    let has = |name| scan.prototype.iter().any(|record| record.name == name);
    let is_turned = [rotation.x, rotation.y, rotation.z] != [0.0; 3];
    let is_organised = has(RecordName::RowIndex) && has(RecordName::ColumnIndex);
    is_turned || is_organised || has(RecordName::SphericalRange)
}

/// Checks what the crate trusts: it fills memory if no value of a point takes any bit.
fn check_scan(scan: &PointCloud) -> Result<()> {
    let takes_bits = scan.prototype.iter().any(|record| match record.data_type {
        RecordDataType::Single { .. } | RecordDataType::Double { .. } => true,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => {
            max > min
        }
    });
    if scan.records > 0 && !takes_bits {
        let reason = "the points of a scan have no values that vary";
        return Err(SourceErrorKind::header(Format::E57, reason).into());
    }
    Ok(())
}

fn error(error: Error, position: Position) -> SourceError {
    let reason = error.to_string();
    let kind = match error {
        Error::Read { .. } => SourceErrorKind::truncated(format!("an E57 section ({reason})")),
        Error::NotImplemented { .. } => SourceErrorKind::Unsupported { what: reason },
        _ => SourceErrorKind::header(Format::E57, reason),
    };
    kind.at(position)
}

/// Values of a colour channel from black to full.
#[derive(Clone, Copy, Debug)]
struct ColorRange {
    min: f64,
    max: f64,
}

impl ColorRange {
    /// On the scale from 0 to 255.
    fn scaled(self, value: f32) -> f32 {
        ((f64::from(value) - self.min) / (self.max - self.min) * 255.0) as f32
    }
}

/// The ranges of red, green and blue, if the scan has colours.
fn color_ranges(scan: &PointCloud) -> Option<[ColorRange; 3]> {
    let range = |name, limits: fn(&ColorLimits) -> [&Option<RecordValue>; 2]| {
        let record = scan.prototype.iter().find(|r| r.name == name)?;
        let given = scan.color_limits.as_ref().and_then(|given| {
            let [min, max] = limits(given).map(|value| number(value.as_ref()?, &record.data_type));
            let (min, max) = min.zip(max).filter(|(min, max)| max > min)?;
            Some(ColorRange { min, max })
        });
        Some(given.unwrap_or_else(|| default_range(&record.data_type)))
    };
    Some([
        range(RecordName::ColorRed, |l| [&l.red_min, &l.red_max])?,
        range(RecordName::ColorGreen, |l| [&l.green_min, &l.green_max])?,
        range(RecordName::ColorBlue, |l| [&l.blue_min, &l.blue_max])?,
    ])
}

fn number(value: &RecordValue, data_type: &RecordDataType) -> Option<f64> {
    match value {
        RecordValue::Single(v) => Some(f64::from(*v)),
        RecordValue::Double(v) => Some(*v),
        RecordValue::Integer(v) => Some(*v as f64),
        RecordValue::ScaledInteger(_) => value.to_f64(data_type).ok(),
    }
}

/// The range of the type; 0 to 1 for reals without limits.
fn default_range(data_type: &RecordDataType) -> ColorRange {
    let (min, max) = match *data_type {
        RecordDataType::Single { min, max } => (min.map(f64::from), max.map(f64::from)),
        RecordDataType::Double { min, max } => (min, max),
        RecordDataType::Integer { min, max } => (Some(min as f64), Some(max as f64)),
        RecordDataType::ScaledInteger {
            min,
            max,
            scale,
            offset,
        } => (
            Some(min as f64 * scale + offset),
            Some(max as f64 * scale + offset),
        ),
    };
    ColorRange {
        min: min.unwrap_or(0.0),
        max: max.unwrap_or(1.0),
    }
}
