//! Sweeps of laser scanners as little-endian `f32` without a header: x, y, z, intensity, and whatever
//! else a point has.

use crate::collector::{Collector, Layout, Sample};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Endian, Scalar};
use crate::{RawCloud, ReadOptions, SourceError};

const LAYOUT: Layout = Layout {
    normals: false,
    colors: None,
    radii: false,
    splats: None,
    wide: false,
};

/// Reads points of `numbers` numbers, at least three.
pub(crate) fn parse(
    input: &mut Input<'_>,
    options: &ReadOptions,
    numbers: usize,
) -> Result<RawCloud> {
    let record_size = 4 * numbers;
    let mut collector = Collector::new(LAYOUT, 0, options);
    while !input.peek(1)?.is_empty() {
        let position = input.byte_position();
        let records = input.records(record_size, u64::MAX, "a point")?;
        for record in records.chunks_exact(record_size) {
            let mut sample = Sample::EMPTY;
            for (axis, bytes) in record[..12].chunks_exact(4).enumerate() {
                sample.position[axis] = Scalar::F32.decode(bytes, Endian::Little);
            }
            collector
                .push(&sample)
                .map_err(|kind| SourceError::new(kind, position))?;
        }
        input.points_read = collector.count();
    }
    let mut cloud = collector.finish()?;
    // The frame of the points is the scanner's.
    cloud.viewpoint = Some(-cloud.origin.as_vec3());
    Ok(cloud)
}
