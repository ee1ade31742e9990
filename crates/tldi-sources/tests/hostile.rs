//! Hostile files, and the beginnings of files: errors, never a panic. `hostile_generated.rs` has other damage.

mod common;

use common::*;
use tldi_sources::{Format, RawCloud, SourceError, SourceErrorKind};

/// Whatever was read must hold together.
fn check(name: &str, outcome: &Result<RawCloud, SourceError>) {
    match outcome {
        Ok(cloud) => {
            let count = cloud.points.len();
            assert!(count > 0, "{name}");
            let lengths = [
                cloud.normals.as_ref().map(Vec::len),
                cloud.colors.as_ref().map(Vec::len),
                cloud.radii.as_ref().map(Vec::len),
            ];
            assert!(lengths.iter().flatten().all(|l| *l == count), "{name}");
            let corners = cloud.faces.iter().flatten();
            assert!(corners.copied().all(|c| (c as usize) < count), "{name}");
        }
        // Must be printable.
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

#[test]
fn every_truncation_is_an_error_or_plain_text_that_ends_early() {
    for (name, format, bytes) in all_files() {
        let is_gzip = bytes.starts_with(&[0x1f, 0x8b]);
        let is_text = !is_gzip && (name.ends_with("ascii") || name == "text");
        for length in 0..bytes.len() {
            let outcome = parse(&bytes[..length], format);
            check(name, &outcome);
            // Text that ends within its last number or line cannot be told from whole text.
            let is_last_line = !bytes[length..bytes.len() - 1].contains(&b'\n');
            if !is_text || name != "text" && !is_last_line {
                assert!(outcome.is_err(), "{name} at {length}");
            }
        }
        assert!(parse(&bytes, format).is_ok(), "{name}");
    }
}

fn kind(bytes: &[u8], format: Format) -> SourceErrorKind {
    parse(bytes, format).expect_err("damaged").kind
}

/// Fails unless what was found is of this kind.
macro_rules! assert_kind {
    ($kind:ident, $found:expr $(, $of:expr)?) => {{
        let found = $found;
        assert!(matches!(found, SourceErrorKind::$kind { .. }), "{found}: {:?}", ($($of)?));
    }};
}

fn ply(body: &str) -> Vec<u8> {
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                  property float z\nelement face 1\nproperty list char int vertex_index\n\
                  end_header\n0 0 0\n1 0 0\n0 1 0\n";
    [header, body].concat().into_bytes()
}

#[test]
fn ply_faces_that_are_wrong() {
    assert!(parse(&ply("3 0 1 2\n"), Format::Ply).is_ok());
    for (body, index) in [("3 0 1 3\n", 3), ("3 -1 1 2\n", -1)] {
        let found = kind(&ply(body), Format::Ply);
        let expected = |k: &SourceErrorKind| matches!(k, SourceErrorKind::FaceIndex { index: i, points: 3 } if *i == index);
        assert!(expected(&found), "{found}");
    }
    for body in [
        "-3 0 1 2\n",
        "3 0 1\n",
        "3 0 1 2 3\n",
        "3 0 1 2.5\n",
        "99999999999999999999 0\n",
    ] {
        assert_kind!(Value, kind(&ply(body), Format::Ply), body);
    }
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty char x\n\
                  property char y\nproperty char z\nelement face 1\n\
                  property list char char vertex_index\nend_header\n";
    let negative = [header.as_bytes(), &[0, 0, 0, 0xff, 0]].concat();
    assert_kind!(Value, kind(&negative, Format::Ply));
}

#[test]
fn bad_headers_are_told_apart() {
    let vertex = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    let headers = [
        "ply\nformat ascii 2.0\nend_header\n".to_owned(),
        "ply\nend_header\n".to_owned(),
        "ply\nformat ascii 1.0\nend_header\n".to_owned(),
        "ply\nformat ascii 1.0\nformat ascii 1.0\nend_header\n".to_owned(),
        format!("ply\nformat ascii 1.0\n{vertex}{vertex}end_header\n0 0 0\n"),
        "ply\nformat ascii 1.0\nproperty float x\nend_header\n".to_owned(),
        "ply\nformat ascii 1.0\nelement vertex -1\nend_header\n".to_owned(),
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n".to_owned(),
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\nend_header\n".to_owned(),
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n"
            .to_owned(),
    ];
    for header in headers {
        assert_kind!(Header, kind(header.as_bytes(), Format::Ply), header);
    }
    let not_text = b"ply\nformat ascii 1.0\nelement v\xff 1\nend_header\n";
    assert_kind!(Header, kind(not_text, Format::Ply));

    let good = common::pcd_header("ascii");
    for (from, to) in [
        ("SIZE 8 1", "SIZE 8"),
        ("SIZE 8", "SIZE 3"),
        ("TYPE F U", "TYPE X U"),
        ("COUNT 1 3", "COUNT 1 -3"),
        ("COUNT 1 3", "COUNT 1 9999999"),
        ("WIDTH 5", "WIDTH 6"),
        ("HEIGHT 1", "HEIGHT 99999999999999999999"),
        ("HEIGHT 1", "HEIGHT 9999999999999999999"),
        ("DATA ascii", "DATA morse"),
        ("VERSION 0.7", "NOTHING 0.7"),
        ("VIEWPOINT 1", "VIEWPOINT"),
        (" x y ", " x x "),
    ] {
        let bad = good.replace(from, to);
        assert_ne!(bad, good);
        assert_kind!(Header, kind(bad.as_bytes(), Format::Pcd), to);
    }
    for bad in ["hello world\n", "x y\n1 2\n", "x y z\nx y z\n"] {
        assert_kind!(Header, kind(bad.as_bytes(), Format::Text), bad);
    }
    for bad in ["1 2\n", "1 2 3 4 5\n"] {
        assert_kind!(UnnamedColumns, kind(bad.as_bytes(), Format::Text), bad);
    }
    for bad in [
        "1 2 3\n1 2\n",
        "1 2 3\n1 2 3 4\n",
        "x y z\n1 2\n",
        "1 2 3\n1 2 word\n",
    ] {
        assert_kind!(Value, kind(bad.as_bytes(), Format::Text), bad);
    }
}

#[test]
fn lzf_that_is_wrong() {
    let columns = pcd_columns();
    let length = columns.len() as u32;
    let literals = lzf_literals(&columns);
    let cases: [(&str, Vec<u8>, u32); 7] = [
        ("wrong size", literals.clone(), length + 1),
        ("too little", literals[..33].to_vec(), length),
        ("too much", [&literals[..], &[0, 0]].concat(), length),
        ("before the start", vec![1 << 5, 0, 0, 0, 0, 0], length),
        (
            "cut reference",
            [&literals[..33], &[1 << 5]].concat(),
            length,
        ),
        (
            "cut long reference",
            [&literals[..33], &[7 << 5]].concat(),
            length,
        ),
        ("cut run", [&literals[..33], &[31, 0]].concat(), length),
    ];
    for (name, packed, unpacked) in cases {
        assert_kind!(
            Compression,
            kind(&pcd_compressed(&packed, unpacked), Format::Pcd),
            name
        );
    }
}

#[test]
fn files_without_points_are_errors() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n\
               property float z\nend_header\n";
    let pcd = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 0\nHEIGHT 1\nDATA binary\n";
    for (bytes, format) in [
        (ply, Format::Ply),
        (pcd, Format::Pcd),
        ("", Format::Text),
        ("x y z\n", Format::Text),
    ] {
        assert_kind!(NoPoints, kind(bytes.as_bytes(), format));
    }
}

/// gzip's checksum is looked at, though the last point may come long before it.
#[test]
fn damaged_gzip_checksum_is_found() {
    // More than is fetched at once, so that the end is not met by chance.
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 50000\nproperty char x\n\
                  property char y\nproperty char z\nend_header\n";
    let mut file = header.as_bytes().to_vec();
    file.extend((0..150_000_u32).map(|i| (i.wrapping_mul(i) >> 3) as u8));
    file.resize(file.len() + 200_000, 0);
    let sound = gzip(&file);
    assert!(parse(&sound, Format::Ply).is_ok());
    let mut damaged = sound;
    let checksum = damaged.len() - 8;
    damaged[checksum] ^= 1;
    assert_kind!(Compression, kind(&damaged, Format::Ply));
}
