//! Sweeps of laser scanners as little-endian `f32` without a header: x, y, z, intensity, and whatever
//! else a point has.

use crate::collector::{Collector, Layout};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Endian, Scalar};
use crate::slot::{Column, Columns, Slot};
use crate::{RawCloud, ReadOptions};

/// Reads points of `numbers` numbers, at least three.
pub(crate) fn parse(
    input: &mut Input<'_>,
    options: &ReadOptions,
    numbers: usize,
) -> Result<RawCloud> {
    let columns = Columns::new((0..3).map(|axis| Column {
        slot: Slot::Position(axis),
        scalar: Scalar::F32,
        place: 4 * axis,
    }));
    let mut collector = Collector::new(Layout::default(), 0, options);
    let sample = |record: &[u8]| columns.sample(record, Endian::Little);
    collector.read_records(input, 4 * numbers, None, "a point", sample)?;
    let mut cloud = collector.finish()?;
    // The frame of the points is the scanner's.
    cloud.viewpoint = Some(-cloud.origin.as_vec3());
    Ok(cloud)
}
