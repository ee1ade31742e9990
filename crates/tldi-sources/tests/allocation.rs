//! Counts in headers never decide how much memory is taken: a counting allocator sees the peak.
//!
//! One test, so that nothing else allocates meanwhile.

mod common;

use common::*;
use std::io::{self, Read};
use tldi_memory::{Counting, most_held};
use tldi_sources::{Format, ReadOptions, SourceErrorKind, read_from};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// The bytes taken at most by reading, beyond those in use before, and what came of it.
fn peak(
    source: impl Read,
    format: Format,
    max_points: u64,
) -> (usize, Result<(), SourceErrorKind>) {
    let options = ReadOptions {
        max_points,
        ..Default::default()
    };
    let (peak, outcome) = most_held(|| read_from(source, format, &options, &mut |_| {}));
    (peak, outcome.map(drop).map_err(|e| e.kind))
}

/// Repeats a piece for a number of bytes.
struct Endless {
    piece: &'static [u8],
    at: usize,
    left: usize,
}

impl Read for Endless {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        let count = target.len().min(self.left);
        for byte in &mut target[..count] {
            *byte = self.piece[self.at];
            self.at = (self.at + 1) % self.piece.len();
        }
        self.left -= count;
        Ok(count)
    }
}

fn endless(start: &[u8], piece: &'static [u8], bytes: usize) -> impl Read {
    io::Cursor::new(start.to_vec()).chain(Endless {
        piece,
        at: 0,
        left: bytes,
    })
}

#[test]
fn memory_follows_the_data_not_the_header() {
    const MEBIBYTE: usize = 1 << 20;
    /// All limits lifted: nothing but the data may hold the reader back.
    const ALL: u64 = u64::MAX;

    let huge = "9223372036854775807";
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let ply = |encoding: &str, rest: &str| {
        format!("ply\nformat {encoding} 1.0\n{rest}end_header\n").into_bytes()
    };
    let pcd = |count: &str, data: &str| {
        format!(
            "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS {count}\nDATA {data}\n"
        )
        .into_bytes()
    };
    let mut compressed = pcd("357913941", "binary_compressed");
    // 4 GiB, the most that fits.
    compressed.extend(u32::MAX.to_le_bytes());
    compressed.extend((357_913_941_u32 * 12).to_le_bytes());
    compressed.extend([0; 1000]);
    let mut expanding = compressed.clone();
    let size = expanding.len() - 1008;
    expanding[size..size + 4].copy_from_slice(&1000_u32.to_le_bytes());

    let mut small: Vec<(&str, Format, Vec<u8>)> = Vec::new();
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let vertices = format!("element vertex {huge}\n{xyz}");
        let mut few = ply(encoding, &vertices);
        few.extend([b'0', b' '].repeat(60));
        small.push(("vertices", Format::Ply, few));
        let list = "property list uint int vertex_indices\n";
        let faces = format!("element vertex 1\n{xyz}element face {huge}\n{list}");
        let mut one_vertex = ply(encoding, &faces);
        one_vertex.extend(if encoding == "ascii" {
            b"0 0 0\n4294967295 0 0 0\n".to_vec()
        } else {
            [&[0; 12][..], &[0xff; 4], &[0; 60]].concat()
        });
        small.push(("faces", Format::Ply, one_vertex));
        let skipped = format!("element other {huge}\nproperty list uint64 double x\n{vertices}");
        let mut list_first = ply(encoding, &skipped);
        list_first.extend([b'8'; 64]);
        small.push(("skipped list", Format::Ply, list_first));
        let fixed = format!("element other {huge}\nproperty double x\n{vertices}");
        small.push(("skipped records", Format::Ply, ply(encoding, &fixed)));
    }
    for data in ["ascii", "binary"] {
        small.push(("points", Format::Pcd, pcd(huge, data)));
    }
    small.push(("compressed size", Format::Pcd, compressed));
    small.push(("uncompressed size", Format::Pcd, expanding));
    let many = ["_"; 1000].join(" ");
    let product = format!(
        "VERSION .7\nFIELDS {many}\nSIZE {}\nTYPE {}\nCOUNT {}\nPOINTS 1\nDATA ascii\n",
        ["8"; 1000].join(" "),
        ["F"; 1000].join(" "),
        [huge; 1000].join(" ")
    );
    small.push(("counts", Format::Pcd, product.into_bytes()));
    for (name, format, bytes) in &small {
        for packed in [bytes.clone(), gzip(bytes)] {
            let (peak, outcome) = peak(&packed[..], *format, ALL);
            // Room for 65,536 points or triangles at once, and buffers.
            assert!(peak < 8 * MEBIBYTE, "{name}: {peak} bytes");
            assert!(outcome.is_err(), "{name}");
        }
    }

    // Lines without an end, headers without an end.
    let bytes = 64 * MEBIBYTE;
    let no_line = endless(b"", b"1 ", bytes);
    let (taken, outcome) = peak(no_line, Format::Text, ALL);
    assert!(taken < MEBIBYTE, "{taken}");
    assert!(matches!(outcome, Err(SourceErrorKind::LineTooLong { .. })));
    let comments = endless(b"ply\nformat ascii 1.0\n", b"comment more\n", bytes);
    let (taken, outcome) = peak(comments, Format::Ply, ALL);
    assert!(taken < MEBIBYTE, "{taken}");
    assert!(matches!(outcome, Err(SourceErrorKind::Header { .. })));
    let comments = endless(b"VERSION .7\n", b"# more\n", bytes);
    let (taken, _) = peak(comments, Format::Pcd, ALL);
    assert!(taken < MEBIBYTE, "{taken}");

    // More points and triangles than allowed: memory for those that are, doubled by growth.
    let points = endless(b"", b"1 2 3\n", bytes);
    let (taken, outcome) = peak(points, Format::Text, 100_000);
    assert!(taken < 16 * MEBIBYTE, "{taken}");
    assert!(matches!(
        outcome,
        Err(SourceErrorKind::TooManyPoints { limit: 100_000 })
    ));
    let faces = format!(
        "element vertex 1\n{xyz}element face {huge}\nproperty list uchar uchar vertex_index\n"
    );
    let start = [ply("binary_little_endian", &faces), vec![0; 12]].concat();
    let triangles = endless(&start, &[3, 0, 0, 0], bytes);
    let (taken, outcome) = peak(triangles, Format::Ply, 1000);
    assert!(taken < MEBIBYTE, "{taken}");
    assert!(matches!(
        outcome,
        Err(SourceErrorKind::TooManyTriangles { limit: 4000 })
    ));

    // A bomb: gzip of 64 MiB of points in 64 KiB or so.
    let mut bomb = Vec::new();
    endless(b"", b"1 2 3\n", bytes)
        .read_to_end(&mut bomb)
        .expect("memory");
    let bomb = gzip(&bomb);
    assert!(bomb.len() < MEBIBYTE / 4);
    let (taken, outcome) = peak(&bomb[..], Format::Text, 100_000);
    assert!(taken < 16 * MEBIBYTE, "{taken}");
    assert!(matches!(
        outcome,
        Err(SourceErrorKind::TooManyPoints { limit: 100_000 })
    ));
}
