//! Every format, byte order and packing, against bytes built by hand.

mod common;

use common::*;
use std::path::PathBuf;
use tldi::glamx::{DVec3, Vec3};
use tldi_sources::{
    Format, Position, Progress, RawCloud, ReadOptions, SourceErrorKind, read, read_from,
    read_with_progress,
};

fn text(bytes: &str) -> RawCloud {
    parse(bytes.as_bytes(), Format::Text).expect(bytes)
}

#[test]
fn all_formats_give_the_same_points() {
    for (name, format, bytes) in all_files() {
        let cloud = parse(&bytes, format).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_is_sample(name, &cloud, format);
    }
}

#[test]
fn content_wins_over_the_named_format_and_the_extension() {
    let cloud = parse(&ply_ascii(), Format::Text).expect("content says PLY");
    assert_is_sample("as text", &cloud, Format::Ply);
    let file = TemporaryFile::new("named.xyz", &gzip(&pcd_binary()));
    let cloud = read(&file.0, &ReadOptions::default()).expect("content says PCD");
    assert_is_sample("named .xyz", &cloud, Format::Pcd);
    let file = TemporaryFile::new("columns.xyz.gz", b"1 2 3\n");
    let cloud = read(&file.0, &ReadOptions::default()).expect("not packed, whatever its name");
    assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)]);
    let file = TemporaryFile::new("columns.unknown", b"1 2 3\n");
    let error = read(&file.0, &ReadOptions::default()).expect_err("nothing tells its format");
    assert!(matches!(error.kind, SourceErrorKind::UnknownFormat));
    assert_eq!(error.file.as_deref(), Some(file.0.as_path()));
}

/// LZF with references back: short, long, overlapping.
#[test]
fn compressed_pcd_with_references() {
    let columns = pcd_columns();
    let mut packed = Vec::new();
    // z of the first point: eight zeros, as one literal and an overlapping reference of seven
    // (control: length − 2 in the upper three bits; offset − 1 = 0).
    packed.extend([0, 0, 5 << 5, 0]);
    packed.extend(lzf_literals(&columns[8..40]));
    // 15 bytes of padding are zero, as are the first four bytes of x: one literal, and a long
    // reference of 18 = 2 + 7 + 9.
    packed.extend([0, 0, 7 << 5, 9, 0]);
    assert_eq!(columns[40..59], [0; 19]);
    packed.extend(lzf_literals(&columns[59..80]));
    // (5, 6) of the first point literally; of the other four by a reference of 16, 4 back.
    let histogram = 8 * 5 + 15 + 4 * 5 + 4 * 5;
    packed.extend(lzf_literals(&columns[80..histogram + 4]));
    packed.extend([7 << 5, 16 - 9, 3]);
    packed.extend(lzf_literals(&columns[histogram + 20..]));
    let file = pcd_compressed(&packed, columns.len() as u32);
    let cloud = parse(&file, Format::Pcd).expect("a sound file");
    assert_is_sample("lzf", &cloud, Format::Pcd);
}

#[test]
fn packed_rgb_as_float_bits_and_as_old_integers() {
    let header = "VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n\
                  WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ";
    let bits = f32::from_bits(0x00_12_34_56);
    let ascii = format!("{header}ascii\n0 0 0 {bits:e}\nnan 0 0 4.210752e+06\n");
    let cloud = parse(ascii.as_bytes(), Format::Pcd).expect("a sound file");
    // 4210752 = 0x404040: the example of PCL's documentation.
    let expected = [[0x12, 0x34, 0x56, 255], [0x40, 0x40, 0x40, 255]];
    assert_eq!(cloud.colors.as_deref(), Some(&expected[..]));
    assert!(cloud.points[1].x.is_nan());
    assert_eq!(cloud.viewpoint, None);

    let mut binary = Bytes::after(&format!("{header}binary\n"), Order::Little);
    for color in [0xff_12_34_56_u32, 0x40_40_40] {
        binary.f32(0.0).f32(1.0).f32(2.0).u32(color);
    }
    let cloud = parse(&binary.bytes, Format::Pcd).expect("a sound file");
    assert_eq!(cloud.colors.as_deref(), Some(&expected[..]));
}

#[test]
fn ply_vertices_with_lists_and_other_colors() {
    let header = "ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty int x\n\
                  property list ushort int neighbours\nproperty short y\nproperty char z\n\
                  property ushort r\nproperty ushort g\nproperty ushort b\nend_header\n";
    let mut file = Bytes::after(header, Order::Big);
    file.i32(-70_000).u16(2).i32(1).i32(2).i16(-2).i8(-3);
    file.u16(0).u16(257).u16(65535);
    file.i32(5).u16(0).i16(300).i8(7).u16(514).u16(0).u16(0);
    let options = ReadOptions {
        origin: Some(DVec3::ZERO),
        ..Default::default()
    };
    let cloud = read_from(&file.bytes[..], Format::Ply, &options, &mut |_| {}).expect("sound");
    let expected = [Vec3::new(-70_000.0, -2.0, -3.0), Vec3::new(5.0, 300.0, 7.0)];
    assert_eq!(cloud.points, expected);
    let colors = [[0, 1, 255, 255], [2, 0, 0, 255]];
    assert_eq!(cloud.colors.as_deref(), Some(&colors[..]));
}

#[test]
fn real_colors_are_scaled_by_the_largest_of_the_file() {
    let colors = |text_colors: &str| {
        let cloud = text(&format!("x y z red green blue\n{text_colors}"));
        cloud.colors.expect("there are colours")
    };
    assert_eq!(colors("0 0 0 0 0.2 1\n"), [[0, 51, 255, 255]]);
    assert_eq!(colors("0 0 0 0 51 255\n"), [[0, 51, 255, 255]]);
    let wide = colors("0 0 0 0 13107 65535\n0 0 0 nan -1 257");
    assert_eq!(wide, [[0, 51, 255, 255], [0, 0, 1, 255]]);
}

#[test]
fn columns_of_text_without_names() {
    let cloud = text("\u{feff}# comment\n1 2 3\n\n4\t5   6\n// end\n");
    assert_eq!(
        cloud.points,
        [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]
    );
    assert!(cloud.normals.is_none() && cloud.colors.is_none());

    let cloud = text("1,5;2;3;\n-0,5;1e3;nan\n");
    assert_eq!(cloud.points[0], Vec3::new(1.5, 2.0, 3.0));
    assert_eq!(cloud.points[1].truncate().to_array(), [-0.5, 1000.0]);

    let cloud = text("1, 2, 3, 10, 20, 30\n1,2,3,0,255,0\n");
    let colors = [[10, 20, 30, 255], [0, 255, 0, 255]];
    assert_eq!(cloud.colors.as_deref(), Some(&colors[..]));

    let cloud = text("1 2 3 0 0 1\n1 2 3 0 -1 0\n");
    assert_eq!(cloud.normals, Some(vec![Vec3::Z, -Vec3::Y]));
    assert!(cloud.colors.is_none());

    let cloud = text("1 2 3 0.77\n");
    assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)]);

    let cloud = text("2\n1 2 3 -700 9 8 7\n1 2 3 -701 6 5 4\n");
    let colors = [[9, 8, 7, 255], [6, 5, 4, 255]];
    assert_eq!(cloud.colors.as_deref(), Some(&colors[..]));

    let color_first = text("1 2 3 9 8 7 0 .6 -.8\n");
    let normal_first = text("1 2 3 0 .6 -.8 9 8 7\n");
    assert_eq!(color_first, normal_first);
    assert_eq!(color_first.normals, Some(vec![Vec3::new(0.0, 0.6, -0.8)]));
    assert_eq!(color_first.colors, Some(vec![[9, 8, 7, 255]]));
}

#[test]
fn columns_of_text_with_names() {
    let cloud = text("//X Y Z Intensity Nx Ny Nz Label\n1 2 3 word 0 1 0 extra\n");
    assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(cloud.normals, Some(vec![Vec3::Y]));
    let cloud = text("x y z nx ny r g a\n1 2 3 0 1 0 5 5\n");
    assert!(cloud.normals.is_none() && cloud.colors.is_none());
    let cloud = text("z;y;name;x\n3;2;'a b';1\n");
    assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn every_spelling_of_nan_and_infinity_is_a_number() {
    let cloud = text("nan -nan NaN\n-nan(ind) 1.#QNAN -1.#IND\ninf -inf 1.#INF\n");
    assert!(cloud.points[0].is_nan_mask().all());
    assert!(cloud.points[1].is_nan_mask().all());
    let infinity = f32::INFINITY;
    assert_eq!(cloud.points[2], Vec3::new(infinity, -infinity, infinity));
}

/// Coordinates of a national grid: millimetres must survive, in `f32`, relative to the origin.
#[test]
fn far_coordinates_are_moved_in_f64() {
    let far =
        "500000.123 4649776.001 12.5\n500001.124 4649776.002 13.5\n0 0 nan\n500001 4649777 9\n";
    let cloud = text(far);
    assert_eq!(cloud.origin, DVec3::new(500_001.0, 4_649_776.0, 0.0));
    let back = cloud.points[0].as_dvec3() + cloud.origin;
    let error = (back - DVec3::new(500_000.123, 4_649_776.001, 12.5)).length();
    // Half a step of f32 at 1 is 6e-8; without the origin the error would be 0.25.
    assert!(error < 1e-7, "{error}");

    let near = text("4000 -4000 4096\n");
    assert_eq!(near.origin, DVec3::ZERO);

    let options = ReadOptions {
        origin: Some(DVec3::new(1.0, 2.0, 3.0)),
        ..Default::default()
    };
    for (name, format, bytes) in all_files() {
        let moved = read_from(&bytes[..], format, &options, &mut |_| {}).expect(name);
        assert_eq!(moved.origin, DVec3::new(1.0, 2.0, 3.0), "{name}");
        assert_eq!(moved.points[1], Vec3::new(0.5, -2.0, -3.25), "{name}");
        if format == Format::Pcd {
            assert_eq!(moved.viewpoint, Some(Vec3::ZERO), "{name}");
        }
    }

    // Binary f32 gains nothing: it is left where it is.
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\n\
                  property float y\nproperty float z\nend_header\n";
    let mut file = Bytes::after(header, Order::Little);
    file.f32(500_000.0).f32(1.0).f32(2.0);
    let cloud = parse(&file.bytes, Format::Ply).expect("sound");
    assert_eq!(cloud.points, [Vec3::new(500_000.0, 1.0, 2.0)]);
}

/// The origin is chosen after 1,024 points: those before and after it must agree.
#[test]
fn origin_is_the_same_before_and_after_it_is_chosen() {
    let lines: String = (0..3000)
        .map(|i| format!("{} 0 {i}\n", 1_000_000 + i))
        .collect();
    let cloud = text(&lines);
    assert_eq!(cloud.points.len(), 3000);
    for (i, point) in cloud.points.iter().enumerate() {
        let back = point.as_dvec3() + cloud.origin;
        assert_eq!(back, DVec3::new(1e6 + i as f64, 0.0, i as f64));
    }
}

#[test]
fn progress_counts_packed_bytes_and_points() {
    let lines: String = (0..100_000)
        .map(|i| format!("{i} 0 {}\n", i * 7 % 1000))
        .collect();
    let packed = gzip(lines.as_bytes());
    let file = TemporaryFile::new("progress.xyz.gz", &packed);
    let mut reports: Vec<Progress> = Vec::new();
    let mut push = |progress| reports.push(progress);
    read_with_progress(&file.0, &ReadOptions::default(), &mut push).expect("sound");
    assert!(reports.len() > 3);
    assert!(reports.is_sorted_by_key(|r| (r.bytes_read, r.points_read)));
    let total = packed.len() as u64;
    assert!(reports.iter().all(|r| r.total_bytes == Some(total)));
    let last = reports[reports.len() - 1];
    assert_eq!((last.bytes_read, last.points_read), (total, 100_000));
}

#[test]
fn max_points_is_a_limit_for_all() {
    for (name, format, bytes) in all_files() {
        for (max_points, is_ok) in [(5, true), (4, false)] {
            let options = ReadOptions {
                max_points,
                ..Default::default()
            };
            let outcome = read_from(&bytes[..], format, &options, &mut |_| {});
            assert_eq!(outcome.is_ok(), is_ok, "{name}");
            if let Err(error) = outcome {
                let limited = matches!(error.kind, SourceErrorKind::TooManyPoints { limit: 4 });
                assert!(limited, "{name}: {error}");
            }
        }
    }
}

#[test]
fn vertex_normals_are_weighted_by_area_and_follow_the_winding() {
    // A wedge: a large face up, a small one to +x, sharing the edge 0–1.
    let cloud = RawCloud {
        points: vec![
            Vec3::ZERO,
            Vec3::Y,
            Vec3::new(-3.0, 0.0, 0.0),
            Vec3::new(0.0, 0.0, -1.0),
            Vec3::ONE,
        ],
        faces: vec![[0, 1, 2], [1, 0, 3]],
        ..Default::default()
    };
    let normals = cloud.vertex_normals().expect("there are faces");
    let shared = Vec3::new(1.0, 0.0, 3.0).normalize();
    for (normal, expected) in normals.iter().zip([shared, shared, Vec3::Z, Vec3::X]) {
        assert!(normal.distance(expected) < 1e-6, "{normal} {expected}");
    }
    assert_eq!(normals[4], Vec3::ZERO);
}

#[test]
fn builder_takes_all_attributes() {
    let raw = parse(&ply_ascii(), Format::Ply).expect("sound");
    let cloud = raw.into_builder().build().expect("a sound cloud");
    assert_eq!(cloud.len(), 5);
    assert_eq!(cloud.colors(), Some(&COLORS[..]));
    assert_eq!(cloud.radius(1), 1.5);
    assert!(cloud.normals_oriented());

    let mut raw = parse(&ply_ascii(), Format::Ply).expect("sound");
    raw.normals = None;
    let from_faces = raw.vertex_normals().expect("there are faces");
    let cloud = raw.into_builder().radius(1.0).build().expect("a cloud");
    assert_eq!(cloud.normals(), Some(&from_faces[..]));

    // Nothing usable: no normals, no radii, rather than an error.
    let raw = text("x y z nx ny nz radius\n0 0 0 0 0 0 0\n1 0 0 nan 0 0 1\n");
    let cloud = raw.into_builder().build().expect("a cloud");
    assert!(cloud.normals().is_none());
}

/// Programs estimate normals and leave their signs to chance: such a cloud does not know its inside.
#[test]
fn normals_that_disagree_tell_no_inside() {
    for (sign, is_oriented) in [(1, true), (-1, false)] {
        let mut file = String::from("x y z nx ny nz\n");
        for k in 0..400 {
            let ny = if k % 3 == 0 { sign } else { 1 };
            file += &format!("{} 0 {} 0 {ny} 0\n", k % 20, k / 20);
        }
        let raw = text(&file);
        assert_eq!(raw.has_unsigned_normals, !is_oriented);
        let cloud = raw.into_builder().build().expect("a sound cloud");
        assert!(cloud.normals().is_some());
        assert_eq!(cloud.normals_oriented(), is_oriented);
    }
}

#[test]
fn errors_say_where() {
    let position = |bytes: &[u8], format| parse(bytes, format).expect_err("damaged").position;
    let bad_number = b"x,y,z\n1,2,3\n1,,3\n";
    assert_eq!(position(bad_number, Format::Text), Position::Line(3));
    let mut cut = ply_binary(Order::Little);
    cut.truncate(cut.len() - 40);
    let end = cut.len() as u64;
    assert_eq!(position(&cut, Format::Ply), Position::Byte(end));
    let file = TemporaryFile::new("bad.csv", bad_number);
    let error = read(&file.0, &ReadOptions::default()).expect_err("damaged");
    let message = error.to_string();
    assert!(message.contains("bad.csv: line 3: bad value"), "{message}");
}

/// Whoever has a mesh of another format learns what to do with it.
#[test]
fn meshes_are_told_from_unknown_files() {
    for name in [
        "gripper.stl",
        "Room.OBJ",
        "a.gltf",
        "a.glb",
        "arm.dae",
        "packed.stl.gz",
    ] {
        let file = TemporaryFile::new(name, b"solid gripper");
        let error = read(&file.0, &ReadOptions::default()).expect_err("a mesh");
        assert!(
            matches!(error.kind, SourceErrorKind::Mesh { .. }),
            "{error}"
        );
        let message = error.to_string();
        assert!(message.contains(name), "{message}");
        assert!(message.contains("convert it to PLY"), "{message}");
    }
}

/// The default limit is that of clouds, and the advice beyond it leads to a cloud.
#[test]
fn the_limit_is_that_of_clouds() {
    let max_points = ReadOptions::default().max_points;
    // The limit that the crate tldi refuses points beyond, in its test `too_many_points_are_refused_unread`.
    let limit = u32::MAX / 64;
    assert_eq!(max_points, u64::from(limit));
    // One more than that, refused by the header.
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nend_header\n",
        limit + 1
    );
    let message = |max_points| {
        let options = ReadOptions {
            max_points,
            ..Default::default()
        };
        let outcome = read_from(header.as_bytes(), Format::Ply, &options, &mut |_| {});
        outcome.expect_err("too many").to_string()
    };
    assert!(message(max_points).contains("a cloud can have 67108863"));
    assert!(message(max_points).contains("thin what is read"));
    assert!(
        message(1000)
            .ends_with("more than 1000 points: thin the cloud, or raise ReadOptions::max_points")
    );
}

/// Headers that PCL reads: without sizes and types as in its first files, types in lower case, and bools.
#[test]
fn headers_of_pcd_as_pcl_takes_them() {
    let rows = "1 2 3\n4 5 6\n";
    let points = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
    for lines in [
        "",
        "SIZE 4 4 4\nTYPE f f f\n",
        "SIZE 8 4 2\nTYPE f F i\nCOUNT 1 1 1\n",
    ] {
        let file = format!("FIELDS x y z\n{lines}WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n{rows}");
        let cloud = parse(file.as_bytes(), Format::Pcd).expect(lines);
        assert_eq!(cloud.points, points, "{lines}");
    }
    let mut binary = Bytes::after(
        "COLUMNS x y z\nPOINTS 2\nWIDTH 2\nDATA binary\n",
        Order::Little,
    );
    binary.f32(1.0).f32(2.0).f32(3.0).f32(4.0).f32(5.0).f32(6.0);
    let cloud = parse(&binary.bytes, Format::Pcd).expect("no sizes");
    assert_eq!(cloud.points, points);
    let header = "FIELDS valid x y z\nSIZE 1 4 4 4\nTYPE B F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\n";
    let mut binary = Bytes::after(header, Order::Little);
    binary.u8(1).f32(1.0).f32(2.0).f32(3.0);
    binary.u8(0).f32(4.0).f32(5.0).f32(6.0);
    let cloud = parse(&binary.bytes, Format::Pcd).expect("bools");
    assert_eq!(cloud.points, points);
    let half = "FIELDS x y z\nSIZE 4 4 4\nWIDTH 2\nHEIGHT 1\nDATA ascii\n1 2 3\n4 5 6\n";
    let error = parse(half.as_bytes(), Format::Pcd).expect_err("sizes without types");
    assert!(
        matches!(error.kind, SourceErrorKind::Header { .. }),
        "{error}"
    );
}

/// CloudCompare writes its global shift as a viewpoint that is not turned. Real sensors turn, or have rows.
#[test]
fn shifts_are_no_viewpoints() {
    for (pose, height, expected) in [
        ("500000 4649776 0 1 0 0 0", 1, None),
        ("500000 4649776 0 -1 0 0 0", 1, None),
        ("0 0 0 1 0 0 0", 2, None),
        ("4 5 6 1 0 0 0", 2, Some(Vec3::new(4.0, 5.0, 6.0))),
        ("4 5 6 0.8 0 0.6 0", 1, Some(Vec3::new(4.0, 5.0, 6.0))),
        ("0 0 0 0.8 0 0.6 0", 1, Some(Vec3::ZERO)),
        ("nan 0 0 0.8 0 0.6 0", 1, None),
    ] {
        let width = 2 / height;
        let file = format!(
            "FIELDS x y z\nWIDTH {width}\nHEIGHT {height}\nVIEWPOINT {pose}\nDATA ascii\n1 2 3\n4 5 6\n"
        );
        let cloud = parse(file.as_bytes(), Format::Pcd).expect(pose);
        assert_eq!(cloud.viewpoint, expected, "{pose}");
    }
}

#[test]
fn formats_that_are_not_compiled_in_say_so() {
    #[cfg(not(feature = "las"))]
    {
        let error = parse(b"LASF and so on", Format::Text).expect_err("not compiled in");
        assert!(error.to_string().contains("feature `las`"), "{error}");
    }
    #[cfg(not(feature = "e57"))]
    {
        let error = parse(b"ASTM-E57", Format::Text).expect_err("not compiled in");
        assert!(error.to_string().contains("feature `e57`"), "{error}");
    }
}

/// A file that goes with the value.
struct TemporaryFile(PathBuf);

impl TemporaryFile {
    fn new(name: &str, bytes: &[u8]) -> Self {
        let folder = std::env::temp_dir().join(format!("tldi-sources-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for temporary files");
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("room for a small file");
        Self(path)
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        // What stays behind does no harm.
        std::fs::remove_file(&self.0).ok();
    }
}
