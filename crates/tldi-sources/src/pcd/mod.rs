//! PCD: point cloud data of the Point Cloud Library (format version 0.7).
//!
//! The parser is our own because the crate at hand, pcd-rs 0.13, allocates whatever the two sizes
//! before `binary_compressed` data say, panics if they do not fit the number of points, and reads
//! lines of any length into memory.

mod ascii;
mod compressed;
mod header;
mod lzf;

use crate::collector::{Collector, Layout, check_count};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::Endian;
use crate::{Format, RawCloud, ReadOptions, SourceErrorKind};
use header::{Encoding, Header};

pub(crate) fn parse(input: &mut Input<'_>, options: &ReadOptions) -> Result<RawCloud> {
    let header = Header::read(input)?;
    let columns = header.columns();
    if !columns.has_position() {
        let reason = "it lacks one of the fields x, y, z";
        return Err(input.error_at_line(SourceErrorKind::header(Format::Pcd, reason)));
    }
    check_count(header.points, options).map_err(|kind| input.error_at_line(kind))?;
    let mut collector = Collector::new(Layout::of(&columns, options), header.points, options);
    match header.encoding {
        Encoding::Ascii => ascii::read(input, &header, &columns, &mut collector)?,
        Encoding::Binary => {
            // Little endian, as the machines that write it are.
            let sample = |record: &[u8]| columns.sample(record, Endian::Little);
            let size = header.record_size();
            collector.read_records(input, size, Some(header.points), "the points", sample)?;
        }
        Encoding::BinaryCompressed => compressed::read(input, &header, &columns, &mut collector)?,
    }
    let mut cloud = collector.finish()?;
    cloud.viewpoint = header.viewpoint.map(|v| (v - cloud.origin).as_vec3());
    cloud.size = header.size;
    Ok(cloud)
}
