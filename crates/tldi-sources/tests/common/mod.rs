//! Files built by hand, byte by byte, for the tests.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::io::Write;
use tldi_sources::{Format, RawCloud, ReadOptions, SourceError, read_from};

/// Reads bytes that have no name.
pub(crate) fn parse(bytes: &[u8], format: Format) -> Result<RawCloud, SourceError> {
    read_from(bytes, format, &ReadOptions::default(), &mut |_| {})
}

/// Packs with gzip.
pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).expect("a vector takes all");
    encoder.finish().expect("a vector takes all")
}

/// Order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    Little,
    Big,
}

/// Appends numbers of many types.
pub(crate) struct Bytes {
    pub(crate) bytes: Vec<u8>,
    order: Order,
}

macro_rules! put {
    ($($name:ident: $type:ty),*) => {$(
        pub(crate) fn $name(&mut self, value: $type) -> &mut Self {
            self.bytes.extend(match self.order {
                Order::Little => value.to_le_bytes(),
                Order::Big => value.to_be_bytes(),
            });
            self
        }
    )*};
}

impl Bytes {
    pub(crate) fn after(header: &str, order: Order) -> Self {
        Self {
            bytes: header.as_bytes().to_vec(),
            order,
        }
    }
    put!(u8: u8, i8: i8, u16: u16, i16: i16, u32: u32, i32: i32, u64: u64, f32: f32, f64: f64);
}

/// Positions, normals, colours and radii of the five points that `ply` and `pcd` write.
pub(crate) const POINTS: [[f32; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [1.5, 0.0, -0.25],
    [1.0, 2.0, 0.0],
    [0.0, 1.0, 8.125],
    [-3.0, 0.5, 1.0],
];
pub(crate) const NORMALS: [[f32; 3]; 5] = [
    [0.0, 0.0, 1.0],
    [0.0, 1.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.6, 0.8],
];
pub(crate) const COLORS: [[u8; 4]; 5] = [
    [255, 0, 0, 255],
    [0, 255, 0, 128],
    [0, 0, 255, 0],
    [1, 2, 3, 4],
    [200, 100, 50, 25],
];
/// A quadrilateral as a fan, and a triangle; the two-cornered face between them is left out.
pub(crate) const FACES: [[u32; 3]; 3] = [[0, 1, 2], [0, 2, 3], [4, 3, 2]];

/// Properties in an odd order and of odd types, elements before, between and behind.
fn ply_header(format: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made by hand, caf\u{e9}\nobj_info none\n\
         element camera 1\nproperty list uchar float view\nproperty int64 stamp\n\
         element nothing 99999999999\n\
         element vertex 5\nproperty uchar blue\nproperty double z\nproperty short quality\n\
         property float x\nproperty float ny\nproperty float32 y\nproperty uint8 red\n\
         property float nx\nproperty uchar green\nproperty double nz\nproperty uchar alpha\n\
         property float radius\n\
         element face 3\nproperty uchar flags\nproperty list uint8 int vertex_indices\n\
         property list ushort double texture\n\
         element edge 2\nproperty int a\nproperty int b\nend_header\n"
    )
}

/// A PLY file of the five points, binary.
pub(crate) fn ply_binary(order: Order) -> Vec<u8> {
    let format = match order {
        Order::Little => "binary_little_endian",
        Order::Big => "binary_big_endian",
    };
    let mut file = Bytes::after(&ply_header(format), order);
    file.u8(2).f32(1.0).f32(2.0).u64(7);
    for i in 0..5 {
        let [x, y, z] = POINTS[i];
        let [nx, ny, nz] = NORMALS[i];
        let [r, g, b, a] = COLORS[i];
        file.u8(b).f64(z.into()).i16(-7).f32(x).f32(ny).f32(y).u8(r);
        file.f32(nx).u8(g).f64(nz.into()).u8(a).f32(0.5 + i as f32);
    }
    file.u8(9).u8(4).i32(0).i32(1).i32(2).i32(3).u16(1).f64(0.5);
    file.u8(9).u8(2).i32(0).i32(1).u16(0);
    file.u8(9)
        .u8(3)
        .i32(4)
        .i32(3)
        .i32(2)
        .u16(2)
        .f64(0.5)
        .f64(1.0);
    file.i32(0).i32(1).i32(1).i32(2);
    file.bytes
}

/// A PLY file of the five points, as text.
pub(crate) fn ply_ascii() -> Vec<u8> {
    let mut file = ply_header("ascii") + "2 1.0 2 7\n";
    for i in 0..5 {
        let [x, y, z] = POINTS[i];
        let [nx, ny, nz] = NORMALS[i];
        let [r, g, b, a] = COLORS[i];
        let radius = 0.5 + i as f32;
        file += &format!("{b} {z:e} -7 {x} {ny}\t{y} {r} {nx} {g} {nz} {a} {radius}\r\n");
    }
    file += "9 4 0 1 2 3 1 .5\n\n9 2 0 1 0\n9 3 4 3 2 2 0.5 1.\n0 1\n1 2\n";
    file.into_bytes()
}

/// The fields of the PCD files: padding, a histogram, and a packed colour.
pub(crate) fn pcd_header(data: &str) -> String {
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n\
         FIELDS z _ x y histogram rgba normal_x normal_y normal_z\n\
         SIZE 8 1 4 4 2 4 4 4 4\nTYPE F U F F I U F F F\nCOUNT 1 3 1 1 2 1 1 1 1\n\
         WIDTH 5\nHEIGHT 1\nVIEWPOINT 1 2 3 0.6 0 0 0.8\nPOINTS 5\nDATA {data}\n"
    )
}

fn packed(color: [u8; 4]) -> u32 {
    let [r, g, b, a] = color.map(u32::from);
    a << 24 | r << 16 | g << 8 | b
}

/// A PCD file of the five points, as text.
pub(crate) fn pcd_ascii() -> Vec<u8> {
    let mut file = pcd_header("ascii");
    for i in 0..5 {
        let [x, y, z] = POINTS[i];
        let [nx, ny, nz] = NORMALS[i];
        let rgba = packed(COLORS[i]);
        file += &format!("{z} 0 0 0 {x} {y} 5 6 {rgba} {nx} {ny} {nz}\n");
    }
    file.into_bytes()
}

/// A PCD file of the five points, binary.
pub(crate) fn pcd_binary() -> Vec<u8> {
    let mut file = Bytes::after(&pcd_header("binary"), Order::Little);
    for i in 0..5 {
        let [x, y, z] = POINTS[i];
        file.f64(z.into()).u8(0).u8(0).u8(0).f32(x).f32(y);
        file.i16(5).i16(6).u32(packed(COLORS[i]));
        for n in NORMALS[i] {
            file.f32(n);
        }
    }
    file.bytes
}

/// The data of a compressed PCD file before compression: field by field.
pub(crate) fn pcd_columns() -> Vec<u8> {
    let mut file = Bytes::after("", Order::Little);
    for p in POINTS {
        file.f64(p[2].into());
    }
    file.bytes.extend([0; 15]);
    for p in POINTS {
        file.f32(p[0]);
    }
    for p in POINTS {
        file.f32(p[1]);
    }
    for _ in POINTS {
        file.i16(5).i16(6);
    }
    for c in COLORS {
        file.u32(packed(c));
    }
    for axis in 0..3 {
        for n in NORMALS {
            file.f32(n[axis]);
        }
    }
    file.bytes
}

/// LZF of nothing but literal runs.
pub(crate) fn lzf_literals(data: &[u8]) -> Vec<u8> {
    let run = |run: &[u8]| [&[run.len() as u8 - 1], run].concat();
    data.chunks(32).flat_map(run).collect()
}

/// A compressed PCD file of the five points.
pub(crate) fn pcd_compressed(packed: &[u8], unpacked_length: u32) -> Vec<u8> {
    let mut file = Bytes::after(&pcd_header("binary_compressed"), Order::Little);
    file.u32(packed.len() as u32).u32(unpacked_length);
    file.bytes.extend(packed);
    file.bytes
}

/// A text file with a header, colours and normals.
pub(crate) fn text_named() -> Vec<u8> {
    let mut file = String::from("\"X\",\"Y\",\"Z\",time,R,G,B,A,nx,ny,nz,Radius\n");
    for i in 0..5 {
        let [x, y, z] = POINTS[i];
        let [nx, ny, nz] = NORMALS[i];
        let [r, g, b, a] = COLORS[i];
        let radius = 0.5 + i as f32;
        file += &format!("{x},{y} , {z},12:30,{r},{g},{b},{a},{nx},{ny},{nz},{radius}\n");
    }
    file.into_bytes()
}

/// One sound file of each kind that is always compiled in.
pub(crate) fn all_files() -> Vec<(&'static str, Format, Vec<u8>)> {
    let columns = pcd_columns();
    let compressed = pcd_compressed(&lzf_literals(&columns), columns.len() as u32);
    let plain = vec![
        ("ply ascii", Format::Ply, ply_ascii()),
        ("ply little", Format::Ply, ply_binary(Order::Little)),
        ("ply big", Format::Ply, ply_binary(Order::Big)),
        ("pcd ascii", Format::Pcd, pcd_ascii()),
        ("pcd binary", Format::Pcd, pcd_binary()),
        ("pcd compressed", Format::Pcd, compressed),
        ("text", Format::Text, text_named()),
    ];
    let packed = plain
        .iter()
        .map(|(name, format, bytes)| (*name, *format, gzip(bytes)))
        .collect();
    [plain, packed].concat()
}

/// Fails unless `cloud` is the five points with the attributes that the format keeps.
pub(crate) fn assert_is_sample(name: &str, cloud: &RawCloud, format: Format) {
    use tldi::glamx::{DVec3, Vec3};
    let vectors = |v: [[f32; 3]; 5]| v.map(Vec3::from_array).to_vec();
    assert_eq!(cloud.points, vectors(POINTS), "{name}");
    assert_eq!(cloud.origin, DVec3::ZERO, "{name}");
    assert_eq!(cloud.colors.as_deref(), Some(&COLORS[..]), "{name}");
    assert_eq!(cloud.normals, Some(vectors(NORMALS)), "{name}");
    let radii = [0.5, 1.5, 2.5, 3.5, 4.5];
    match format {
        Format::Ply => {
            assert_eq!(cloud.faces, FACES, "{name}");
            assert_eq!(cloud.radii.as_deref(), Some(&radii[..]), "{name}");
        }
        Format::Pcd => assert_eq!(cloud.viewpoint, Some(Vec3::new(1.0, 2.0, 3.0)), "{name}"),
        _ => assert_eq!(cloud.radii.as_deref(), Some(&radii[..]), "{name}"),
    }
}
