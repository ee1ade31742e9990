//! KITTI's sweeps, Gaussian splats and organised PCD files, against bytes built by hand.

mod common;

use common::{Bytes, Order, gzip, parse};
use fastrand::Rng;
use std::io::{self, Read};
use tldi::glamx::{Mat3, Vec3};
use tldi_sources::{Format, RawCloud, ReadOptions, SourceErrorKind, read_from};

#[test]
fn sweeps_are_records_of_four_numbers() {
    let mut rng = Rng::with_seed(1);
    let mut number = || 100.0 * (rng.f32() - 0.5);
    // More than a buffer of the reader, so that records straddle its end.
    let points: Vec<Vec3> = (0..20_000)
        .map(|_| Vec3::new(number(), number(), number()))
        .collect();
    let mut file = Bytes::after("", Order::Little);
    for (i, p) in points.iter().enumerate() {
        let x = if i == 7 { f32::NAN } else { p.x };
        file.f32(x).f32(p.y).f32(p.z).f32(0.5);
    }
    for bytes in [file.bytes.clone(), gzip(&file.bytes)] {
        let cloud = parse(&bytes, Format::Kitti).expect("sound");
        assert!(cloud.points[7].x.is_nan());
        let same = cloud
            .points
            .iter()
            .zip(&points)
            .filter(|(a, b)| a == b)
            .count();
        assert_eq!((same, cloud.points.len()), (19_999, 20_000));
        assert_eq!(cloud.viewpoint, Some(Vec3::ZERO));
        let built = cloud.into_builder().radius(0.1).build().expect("valid");
        assert_eq!((built.len(), built.dropped()), (19_999, 1));
    }
    for cut in 1..16 {
        let bytes = &file.bytes[..16 * 100 + cut];
        let error = parse(bytes, Format::Kitti).expect_err("cut");
        assert!(
            matches!(error.kind, SourceErrorKind::Truncated { .. }),
            "{error}"
        );
    }
    let error = parse(&[], Format::Kitti).expect_err("empty");
    assert!(matches!(error.kind, SourceErrorKind::NoPoints), "{error}");
    let few = ReadOptions {
        max_points: 100,
        ..Default::default()
    };
    let error = read_from(&file.bytes[..], Format::Kitti, &few, &mut |_| {}).expect_err("many");
    assert!(
        matches!(error.kind, SourceErrorKind::TooManyPoints { limit: 100 }),
        "{error}"
    );
    assert_eq!(
        Format::from_extension("sweeps/000000.bin.gz"),
        Some(Format::Kitti)
    );
}

/// The first coordinate has bytes of gzip's mark.
#[test]
fn a_sweep_may_start_as_gzip_does() {
    for [method, flags] in [
        [0x08, 0x3f],
        [0x08, 0xbf],
        [0x42, 0x40],
        [0x2c, 0x00],
        [0x08, 0x20],
    ] {
        let x = f32::from_le_bytes([0x1f, 0x8b, method, flags]);
        let mut file = Bytes::after("", Order::Little);
        file.f32(x).f32(2.0).f32(3.0).f32(0.5);
        for bytes in [file.bytes.clone(), gzip(&file.bytes)] {
            let cloud = parse(&bytes, Format::Kitti).expect("sound");
            assert_eq!(cloud.points, [Vec3::new(x, 2.0, 3.0)]);
        }
    }
}

/// A pipe that gives a byte at a time.
struct Trickle<'a>(&'a [u8]);

impl Read for Trickle<'_> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        let one = target.len().min(1);
        self.0.read(&mut target[..one])
    }
}

#[test]
fn a_packed_stream_may_come_byte_by_byte() {
    let mut file = Bytes::after("", Order::Little);
    file.f32(1.0).f32(2.0).f32(3.0).f32(0.5);
    let packed = gzip(&file.bytes);
    let stream = Trickle(&packed);
    let options = ReadOptions::default();
    let cloud = read_from(stream, Format::Kitti, &options, &mut |_| {}).expect("sound");
    assert_eq!(cloud.points, [Vec3::new(1.0, 2.0, 3.0)]);
}

/// nuScenes: five numbers a point, the last of which is the ring.
#[test]
fn sweeps_of_nuscenes_have_five_numbers() {
    let mut rng = Rng::with_seed(3);
    let mut number = || 100.0 * (rng.f32() - 0.5);
    let points: Vec<Vec3> = (0..10_000)
        .map(|_| Vec3::new(number(), number(), number()))
        .collect();
    let mut file = Bytes::after("", Order::Little);
    for (i, p) in points.iter().enumerate() {
        file.f32(p.x).f32(p.y).f32(p.z).f32(17.0);
        file.f32((i % 32) as f32);
    }
    for name in ["sweeps/LIDAR_TOP__1532402927647951.pcd.bin", "0.PCD.BIN.gz"] {
        let format = Format::from_extension(name).expect("known");
        let cloud = parse(&file.bytes, format).expect("sound");
        assert_eq!(cloud.points, points);
        assert_eq!(cloud.viewpoint, Some(Vec3::ZERO));
    }
    let error = parse(&file.bytes[..16 * 101], Format::NuScenes).expect_err("cut");
    assert!(
        matches!(error.kind, SourceErrorKind::Truncated { .. }),
        "{error}"
    );
}

/// The properties in the order in which trainers write them, with normals of zero.
const SPLAT_PROPERTIES: [&str; 17] = [
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
];

/// A splat by its geometry.
struct Splat {
    center: Vec3,
    sigmas: Vec3,
    /// A turn by `angle` radians about the unit vector `axis`.
    axis: Vec3,
    angle: f32,
    opacity: f32,
    color: [u8; 3],
}

impl Splat {
    fn random(rng: &mut Rng) -> Self {
        let mut unit = |low: f32| low + (1.0 - low) * rng.f32();
        let axis = Vec3::new(unit(-1.0), unit(-1.0), unit(-1.0)).normalize();
        let mut sigmas = [0.02 + 0.01 * unit(0.0), 0.04 + 0.02 * unit(0.0), 0.002];
        let (center, angle) = (
            Vec3::new(unit(-1.0), unit(-1.0), unit(-1.0)),
            3.0 * unit(-1.0),
        );
        rng.shuffle(&mut sigmas);
        Self {
            center,
            sigmas: sigmas.into(),
            axis,
            angle,
            opacity: [0.01, 0.3, 0.49, 0.51, 0.99][rng.usize(..5)],
            color: [rng.u8(..), rng.u8(..), rng.u8(..)],
        }
    }

    /// Values in the order of the properties, and a quaternion that is not of unit length.
    fn values(&self) -> [f32; 17] {
        let (sin, cos) = (0.5 * self.angle).sin_cos();
        let rotation = [cos, sin * self.axis.x, sin * self.axis.y, sin * self.axis.z];
        let [r0, r1, r2, r3] = rotation.map(|value| 1.7 * value);
        let [s0, s1, s2] = self.sigmas.to_array().map(f32::ln);
        let harmonic = 0.5 / std::f32::consts::PI.sqrt();
        let [c0, c1, c2] = self.color.map(|c| (f32::from(c) / 255.0 - 0.5) / harmonic);
        let logit = (self.opacity / (1.0 - self.opacity)).ln();
        let [x, y, z] = self.center.to_array();
        [
            x, y, z, 0.0, 0.0, 0.0, c0, c1, c2, logit, s0, s1, s2, r0, r1, r2, r3,
        ]
    }

    /// The shortest axis by Rodrigues' formula, which uses no quaternion.
    fn normal(&self) -> Vec3 {
        let k = self.axis;
        let cross = Mat3::from_cols(
            Vec3::new(0.0, k.z, -k.y),
            Vec3::new(-k.z, 0.0, k.x),
            Vec3::new(k.y, -k.x, 0.0),
        );
        let (sin, cos) = self.angle.sin_cos();
        let turn = Mat3::IDENTITY + cross * sin + cross * cross * (1.0 - cos);
        turn * Vec3::AXES[self.sigmas.min_position()]
    }
}

fn splat_header(format: &str, count: usize, properties: &[&str]) -> String {
    let lines: String = properties
        .iter()
        .map(|p| format!("property float {p}\n"))
        .collect();
    format!("ply\nformat {format} 1.0\nelement vertex {count}\n{lines}end_header\n")
}

fn assert_is_splats(cloud: &RawCloud, splats: &[Splat]) {
    let kept: Vec<&Splat> = splats.iter().filter(|splat| splat.opacity > 0.5).collect();
    assert_eq!(cloud.points.len(), kept.len());
    assert_eq!(cloud.left_out as usize, splats.len() - kept.len());
    assert!(cloud.has_unsigned_normals);
    let normals = cloud.normals.as_ref().expect("normals");
    let radii = cloud.radii.as_ref().expect("radii");
    let colors = cloud.colors.as_ref().expect("colours");
    for (i, splat) in kept.iter().enumerate() {
        assert_eq!(cloud.points[i], splat.center);
        assert!(normals[i].dot(splat.normal()).abs() > 1.0 - 1e-5, "{i}");
        // The area of the ellipse of the two longer axes is π r².
        let ellipse = splat.sigmas.element_product() / splat.sigmas.min_element();
        assert!((radii[i] * radii[i] / ellipse - 1.0).abs() < 1e-4, "{i}");
        for (found, told) in colors[i].iter().zip(splat.color) {
            assert!(found.abs_diff(told) <= 1, "{i}");
        }
        let alpha = (255.0 * splat.opacity).round() as u8;
        assert!(colors[i][3].abs_diff(alpha) <= 1, "{i}");
    }
}

#[test]
fn splats_become_discs() {
    let mut rng = Rng::with_seed(2);
    let splats: Vec<Splat> = (0..500).map(|_| Splat::random(&mut rng)).collect();
    let header = splat_header("binary_little_endian", 500, &SPLAT_PROPERTIES);
    let mut binary = Bytes::after(&header, Order::Little);
    let mut ascii = splat_header("ascii", 500, &SPLAT_PROPERTIES);
    for splat in &splats {
        let values = splat.values();
        values.iter().for_each(|value| _ = binary.f32(*value));
        ascii += &(values.map(|value| format!("{value:e}")).join(" ") + "\n");
    }
    for bytes in [&binary.bytes[..], ascii.as_bytes()] {
        let cloud = parse(bytes, Format::Ply).expect("sound");
        assert_is_splats(&cloud, &splats);
        // Their normals have no side, unless a viewpoint is known.
        let built = |builder: tldi::CloudBuilder<'_>| {
            let cloud = builder.build().expect("valid");
            (cloud.normals().is_some(), cloud.normals_oriented())
        };
        assert_eq!(built(cloud.clone().into_builder()), (true, false));
        assert_eq!(built(cloud.into_builder().viewpoint(Vec3::Z)), (true, true));
    }
    let all = ReadOptions {
        least_opacity: 0.0,
        ..Default::default()
    };
    let cloud = read_from(&binary.bytes[..], Format::Ply, &all, &mut |_| {}).expect("sound");
    assert_eq!((cloud.points.len(), cloud.left_out), (500, 0));
    let none = ReadOptions {
        least_opacity: 0.999,
        ..Default::default()
    };
    let error = read_from(&binary.bytes[..], Format::Ply, &none, &mut |_| {}).expect_err("faint");
    assert!(
        matches!(error.kind, SourceErrorKind::TooFaint { count: 500 }),
        "{error}"
    );
}

/// Files of 2D Gaussian splatting have two sizes only; the normal is the third axis.
#[test]
fn flat_splats_become_discs() {
    let mut rng = Rng::with_seed(6);
    let splats: Vec<Splat> = (0..300)
        .map(|_| Splat {
            sigmas: Vec3::new(0.02 + 0.02 * rng.f32(), 0.02 + 0.02 * rng.f32(), 1e-9),
            ..Splat::random(&mut rng)
        })
        .collect();
    let properties: Vec<&str> = (SPLAT_PROPERTIES.into_iter())
        .filter(|name| *name != "scale_2")
        .collect();
    let header = splat_header("binary_little_endian", 300, &properties);
    let mut file = Bytes::after(&header, Order::Little);
    for splat in &splats {
        for (name, value) in SPLAT_PROPERTIES.into_iter().zip(splat.values()) {
            if name != "scale_2" {
                file.f32(value);
            }
        }
    }
    assert_is_splats(&parse(&file.bytes, Format::Ply).expect("sound"), &splats);
}

/// Splats without extent, direction or opacity are left out and counted; half a splat is none.
#[test]
fn broken_splats_are_left_out() {
    let sound = Splat {
        center: Vec3::ONE,
        sigmas: Vec3::new(0.1, 0.2, 0.01),
        axis: Vec3::X,
        angle: 1.0,
        opacity: 0.9,
        color: [1, 2, 3],
    };
    let broken = |at: usize, value: f32| {
        let mut values = sound.values();
        values[at] = value;
        values
    };
    let mut no_turn = sound.values();
    no_turn[13..].fill(0.0);
    let mut no_extent = sound.values();
    no_extent[10..13].fill(-500.0);
    let records = [
        broken(9, f32::NAN),
        broken(10, f32::NAN),
        broken(11, f32::INFINITY),
        no_extent,
        broken(14, f32::NAN),
        no_turn,
        sound.values(),
    ];
    let header = splat_header("binary_big_endian", records.len(), &SPLAT_PROPERTIES);
    let mut file = Bytes::after(&header, Order::Big);
    records
        .iter()
        .flatten()
        .for_each(|value| _ = file.f32(*value));
    let cloud = parse(&file.bytes, Format::Ply).expect("sound");
    assert_eq!((cloud.points.len(), cloud.left_out), (1, 6));

    // Without the last component of the rotation it is a PLY file like any other.
    let header = splat_header("binary_big_endian", 1, &SPLAT_PROPERTIES[..16]);
    let mut file = Bytes::after(&header, Order::Big);
    sound.values()[..16]
        .iter()
        .for_each(|value| _ = file.f32(*value));
    let cloud = parse(&file.bytes, Format::Ply).expect("sound");
    assert!(!cloud.has_unsigned_normals && cloud.radii.is_none() && cloud.colors.is_none());
    assert_eq!(cloud.normals, Some(vec![Vec3::ZERO]));
}

/// Rows and columns of an organised file are read row by row, holes included.
#[test]
fn organised_pcd_keeps_its_order_and_its_holes() {
    let header = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n\
                  WIDTH 4\nHEIGHT 3\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 12\nDATA ";
    let point = |i: usize| {
        let depth = if i % 5 == 3 { f32::NAN } else { 1.0 + i as f32 };
        [(i % 4) as f32, (i / 4) as f32, depth]
    };
    let mut binary = Bytes::after(&format!("{header}binary\n"), Order::Little);
    let mut ascii = format!("{header}ascii\n");
    for i in 0..12 {
        let [x, y, z] = point(i);
        binary.f32(x).f32(y).f32(z);
        ascii += &format!("{x} {y} {z}\n");
    }
    for bytes in [&binary.bytes[..], ascii.as_bytes()] {
        let cloud = parse(bytes, Format::Pcd).expect("sound");
        assert_eq!(cloud.points.len(), 12);
        assert_eq!(cloud.size, Some([4, 3]));
        for (i, p) in cloud.points.iter().enumerate() {
            let [x, y, z] = point(i);
            assert_eq!((p.x, p.y, p.z.is_nan()), (x, y, z.is_nan()));
            assert!(z.is_nan() || p.z == z);
        }
        let built = cloud.into_builder().radius(1.0).build().expect("valid");
        assert_eq!((built.len(), built.dropped()), (10, 2));
    }
    let wrong = ascii.replace("POINTS 12", "POINTS 11");
    let error = parse(wrong.as_bytes(), Format::Pcd).expect_err("4 × 3 are not 11");
    assert!(
        matches!(error.kind, SourceErrorKind::Header { .. }),
        "{error}"
    );
}
