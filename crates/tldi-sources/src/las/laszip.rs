//! Checks the sizes in LASzip data before the crate laz takes memory for them: the items of a
//! record, the number of chunks, and the layers of each chunk.

use super::preview::{Preview, bad_header, bytes, truncated};
use crate::error::Result;
use crate::scalar::unsigned;
use crate::seekable::ReadSeek;
use ::las::Header;
use ::las::laz::is_laszip_vlr;
use std::ops::Range;

/// Bytes that tell, before the chunks, where their table is.
const TABLE_OFFSET_SIZE: u64 = 8;

/// Chunk size that stands for chunks of varying size.
const VARIABLE: u64 = u32::MAX as u64;

/// What the record of LASzip says.
struct Packing {
    is_chunked: bool,
    /// Points in each chunk but the last.
    chunk_size: u64,
    /// Number of layers that hold a chunk, if it is cut into layers.
    layers: Option<u64>,
}

pub(super) fn check(source: &mut dyn ReadSeek, header: &Header, preview: &Preview) -> Result<()> {
    let vlr = header.vlrs().iter().find(|vlr| is_laszip_vlr(vlr));
    let Some(vlr) = vlr else {
        return Err(bad_header("the record of LASzip is missing"));
    };
    let packing = Packing::parse(&vlr.data, preview.record_length)?;
    if packing.is_chunked {
        check_table(source, preview)?;
    }
    match packing.layers {
        Some(layers) => check_layers(source, preview, &packing, layers),
        None => Ok(()),
    }
}

impl Packing {
    fn parse(record: &[u8], record_length: u64) -> Result<Self> {
        const ITEMS: usize = 34;
        const ITEM_SIZE: usize = 6;
        let too_short = || bad_header("the record of LASzip is too short");
        let number = |at: Range<usize>| record.get(at).map(unsigned).ok_or_else(too_short);
        let chunk_size = number(12..16)?;
        let compressor = number(0..2)?;
        let count = number(ITEMS - 2..ITEMS)? as usize;
        let items = record.get(ITEMS..ITEMS + count * ITEM_SIZE);
        let mut length = 0;
        let mut layers = 0;
        let mut versions = Vec::new();
        for item in items.ok_or_else(too_short)?.chunks_exact(ITEM_SIZE) {
            let [kind, size, version] = [0, 2, 4].map(|field| unsigned(&item[field..field + 2]));
            let (natural_size, item_layers) = match kind {
                0 => (size, 0),
                6 => (20, 0),
                7 => (8, 0),
                8 => (6, 0),
                9 | 13 => (29, 1),
                10 => (30, 9),
                11 => (6, 1),
                12 => (8, 2),
                14 => (size, size),
                _ => return Err(bad_header(format!("unknown LASzip item {kind}"))),
            };
            if size != natural_size {
                return Err(bad_header(format!("LASzip item {kind} has {size} bytes")));
            }
            length += size;
            layers += item_layers;
            versions.push(version);
        }
        if length != record_length {
            return Err(bad_header(format!(
                "the items of LASzip have {length} bytes, a point {record_length}"
            )));
        }
        let is_layered = versions.iter().any(|v| *v >= 3);
        if is_layered != (compressor == 3) {
            return Err(bad_header(
                "the compressor of LASzip does not fit its items",
            ));
        }
        Ok(Self {
            is_chunked: compressor >= 2,
            chunk_size: if chunk_size == 0 {
                VARIABLE
            } else {
                chunk_size
            },
            layers: is_layered.then_some(layers),
        })
    }
}

/// Checks that the table of chunks is in the file, and not longer than chunks there can be.
fn check_table(source: &mut dyn ReadSeek, preview: &Preview) -> Result<()> {
    let start = preview.offset_to_points;
    let size = TABLE_OFFSET_SIZE as usize;
    let mut table = unsigned(&bytes(source, start, size, preview.length)?);
    // Writers that cannot go back put −1 there, and the offset at the end.
    if table <= start || table > i64::MAX as u64 {
        let end = preview.length.saturating_sub(TABLE_OFFSET_SIZE);
        table = unsigned(&bytes(source, end, size, preview.length)?);
    }
    if table <= start {
        return Err(bad_header("the table of LASzip chunks is missing"));
    }
    let head = bytes(source, table, 8, preview.length)?;
    let chunks = unsigned(&head[4..]);
    // Each starts with one point that is not packed.
    if chunks.saturating_mul(preview.record_length) > preview.length {
        let reason = format!("there are {chunks} LASzip chunks, more than fit into the file");
        return Err(bad_header(reason));
    }
    Ok(())
}

/// Goes from chunk to chunk: a point that is not packed, the number of points, the size of each
/// layer, the layers.
fn check_layers(
    source: &mut dyn ReadSeek,
    preview: &Preview,
    packing: &Packing,
    layers: u64,
) -> Result<()> {
    let mut start = preview.offset_to_points + TABLE_OFFSET_SIZE;
    let mut left = preview.points;
    while left > 0 {
        let head_size = 4 + 4 * layers;
        // Fits: at most 65,535 layers, and a few.
        let head = bytes(
            source,
            start + preview.record_length,
            head_size as usize,
            preview.length,
        )?;
        let mut sizes = head.chunks_exact(4).map(unsigned);
        let points = sizes.next().unwrap_or(0);
        let expected = if packing.chunk_size == VARIABLE {
            points.min(left)
        } else {
            packing.chunk_size.min(left)
        };
        if points == 0 || points != expected {
            return Err(bad_header(format!(
                "a LASzip chunk has {points} points, expected {expected}"
            )));
        }
        left -= points;
        start += preview.record_length + head_size + sizes.sum::<u64>();
        if start > preview.length {
            return Err(truncated("the points", preview.length));
        }
    }
    Ok(())
}
