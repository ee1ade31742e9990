//! Moving points from arrays and folders, sound and broken.

use flate2::{Compression, write::GzEncoder};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use tldi::glamx::Vec3;
use tldi_sources::MovingPoints;

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder).unwrap();
    }
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// A NumPy file with this description and these bytes.
fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn floats(count: usize) -> Vec<u8> {
    (0..count).flat_map(|k| (k as f32).to_le_bytes()).collect()
}

#[test]
fn arrays_are_read_packed_and_not() {
    let folder = folder("moving_arrays");
    let bytes = npy("<f4", "(2, 4, 3)", &floats(24));
    fs::write(folder.join("a.npy"), &bytes).unwrap();
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(&bytes).unwrap();
    let packed = packed.finish().unwrap();
    // The content tells, not the name.
    for name in ["b.npy.gz", "d.npy"] {
        fs::write(folder.join(name), &packed).unwrap();
    }
    let doubles: Vec<u8> = (0..24).flat_map(|k| f64::from(k).to_le_bytes()).collect();
    fs::write(folder.join("c.npy"), npy("<f8", "(2, 4, 3)", &doubles)).unwrap();
    for name in ["a.npy", "b.npy.gz", "c.npy", "d.npy"] {
        let moving = MovingPoints::read(folder.join(name)).unwrap();
        assert_eq!((moving.frames().len(), moving.points()), (2, 4), "{name}");
        assert_eq!(moving.frames()[1][2], Vec3::new(18.0, 19.0, 20.0), "{name}");
    }
}

/// Doubles of a map, where a step of `f32` is half a metre, keep their millimetres.
#[test]
fn doubles_of_a_map_count_from_an_origin() {
    let folder = folder("moving_map");
    let place = |k: i32| 5_336_000.0 + 0.001 * f64::from(k);
    let doubles: Vec<u8> = (0..24).flat_map(|k| place(k).to_le_bytes()).collect();
    fs::write(folder.join("a.npy"), npy("<f8", "(2, 4, 3)", &doubles)).unwrap();
    let moving = MovingPoints::read(folder.join("a.npy")).unwrap();
    let way = moving.frames()[1][2] - moving.frames()[0][1];
    // From numbers 3 to 5 to numbers 18 to 20; steps of f64 are 1e-9 there.
    assert!(way.distance(Vec3::splat(0.015)) < 1e-6, "{way}");
}

#[test]
fn folders_are_read_in_order() {
    let folder = folder("moving_folder");
    let files = [("f2.xyz", 2.0), ("f1.xyz", 1.0), ("f10.xyz", 10.0)];
    for (name, x) in files {
        fs::write(folder.join(name), format!("{x} 0 0\n{x} 1 0\n")).unwrap();
    }
    fs::write(folder.join("notes.md"), "not a cloud").unwrap();
    let moving = MovingPoints::read(&folder).unwrap();
    let first: Vec<f32> = moving.frames().iter().map(|frame| frame[0].x).collect();
    assert_eq!(first, [1.0, 2.0, 10.0]);
}

/// Frames are met, steady motion stays steady, and the end leads into the beginning.
#[test]
fn time_is_interpolated_smoothly() {
    let circle = |k: usize| {
        let (sin, cos) = (k as f32 / 24.0 * std::f32::consts::TAU).sin_cos();
        vec![Vec3::new(cos, sin, 0.0)]
    };
    let moving = MovingPoints::new((0..24).map(circle).collect()).unwrap();
    let mut last = moving.at(-0.002)[0];
    for k in 0..=1000 {
        let phase = k as f32 * 0.002;
        let at = moving.at(phase)[0];
        let (sin, cos) = (phase * std::f32::consts::TAU).sin_cos();
        // A chord of 15° is off the circle by 0.9 %; the spline by a hundredth of that.
        assert!(at.distance(Vec3::new(cos, sin, 0.0)) < 2e-3, "{phase}");
        // TAU × 0.002 a step.
        assert!((at.distance(last) - 0.01257).abs() < 2e-4, "{phase}");
        last = at;
    }
    let single = MovingPoints::new(vec![vec![Vec3::X]]).unwrap();
    assert_eq!(single.at(0.7)[0], Vec3::X);
}

#[test]
fn what_is_wrong_is_said() {
    let folder = folder("moving_broken");
    for (bytes, message) in [
        (
            npy("<f4", "(2, 4, 3)", &floats(20)),
            "frame 1 of 2 ends early",
        ),
        (npy("<f4", "(2, 4, 3)", b""), "frame 0 of 2 ends early"),
        (npy("<f4", "(8, 3)", &floats(24)), "its shape is (8, 3)"),
        (
            npy("<f4", "(2, 3, 4)", &floats(24)),
            "its shape is (2, 3, 4)",
        ),
        (npy("<i4", "(2, 4, 3)", &floats(24)), "its numbers are <i4"),
        (npy("<f4", "(0, 4, 3)", b""), "no frames"),
        (npy("<f4", "(4, 0, 3)", b""), "no points"),
        (npy("<f4", "(99999999, 99999999, 3)", b""), "too large"),
        // Frames without bytes: they end no earlier than memory does.
        (npy("<f4", "(9223372036854775807, 0, 3)", b""), "no points"),
        (npy("<f4", "(0, 9223372036854775807, 3)", b""), "no frames"),
        // 4 GiB by its header.
        (
            npy("<f8", "(1, 178956970, 3)", b""),
            "after 0 of 4294967280 bytes",
        ),
        (
            npy("<f4", "(1, 1, 3)", &f32::NAN.to_le_bytes().repeat(3)),
            "point 0 of frame 0",
        ),
        (b"PK\x03\x04, a zip file".to_vec(), "no NumPy file"),
        (b"\x93NUM".to_vec(), "header ends early"),
    ] {
        let path = folder.join("broken.npy");
        fs::write(&path, bytes).unwrap();
        let error = MovingPoints::read(&path).unwrap_err().to_string();
        assert!(error.contains(message), "{message}: {error}");
    }
    let empty = folder.join("empty");
    fs::create_dir_all(&empty).unwrap();
    let error = MovingPoints::read(&empty).unwrap_err().to_string();
    assert!(error.contains("no cloud in"), "{error}");
    fs::write(empty.join("a.xyz"), "0 0 0\n1 0 0\n").unwrap();
    fs::write(empty.join("b.xyz"), "0 0 0\n").unwrap();
    let error = MovingPoints::read(&empty).unwrap_err().to_string();
    assert!(
        error.contains("frame 1 has 1 points, the first one 2"),
        "{error}"
    );
    let error = MovingPoints::read(folder.join("lost.npy"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("lost.npy"), "{error}");
}
