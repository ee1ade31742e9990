//! Folders of depth frames, sound and broken.

use std::fs;
use std::path::{Path, PathBuf};
use tldi::glamx::Vec3;
use tldi_sources::depth::{DepthError, DepthSequence};

const INTRINSICS: &str = "# comment\n4 3 2.5 2.5 2 1.5 0.001\n";
const POSE: &str = "0 -1 0 5  1 0 0 6  0 0 1 7  0 0 0 1";

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder).unwrap();
    }
    fs::create_dir_all(&folder).unwrap();
    // With the mark that some editors put in front.
    let intrinsics = format!("\u{feff}{INTRINSICS}");
    fs::write(folder.join("intrinsics.txt"), intrinsics).unwrap();
    fs::write(
        folder.join("poses.txt"),
        format!("# file, pose\na.png {POSE}\nlost.png {POSE}\n"),
    )
    .unwrap();
    write_png(&folder.join("a.png"), [4, 3], png::BitDepth::Sixteen);
    folder
}

/// Values 0, 257, 514, … of a 16-bit image.
fn write_png(path: &Path, [width, height]: [u32; 2], depth: png::BitDepth) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    let bytes = if depth == png::BitDepth::Sixteen {
        2
    } else {
        1
    };
    let data: Vec<u8> = (0..width * height * bytes)
        .map(|k| (k / bytes) as u8)
        .collect();
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&data)
        .unwrap();
}

#[test]
fn a_folder_is_read() {
    let sequence = DepthSequence::open(folder("depth_sound")).unwrap();
    assert_eq!(sequence.intrinsics.size, [4, 3]);
    assert_eq!(sequence.missing, ["lost.png"]);
    let frame = &sequence.frames[0];
    let depths: Vec<u16> = (0..12).map(|k| k * 257).collect();
    assert_eq!(sequence.read(frame).unwrap(), depths);
    // A quarter turn about z, then moved.
    let p = frame.world_from_camera * Vec3::new(1.0, 2.0, 3.0);
    assert!((p - Vec3::new(3.0, 7.0, 10.0)).length() < 1e-5, "{p}");
}

/// Where the camera's track was lost, the frame counts as missing.
#[test]
fn frames_without_a_pose_are_missing() {
    let folder = folder("depth_lost");
    let lost = ["-inf ", "nan "].map(|word| format!("a.png {}\n", word.repeat(16)));
    let poses = [&lost[0][..], &format!("a.png {POSE}\n"), &lost[1]].concat();
    fs::write(folder.join("poses.txt"), poses).unwrap();
    let sequence = DepthSequence::open(folder).unwrap();
    assert_eq!((sequence.frames.len(), sequence.missing.len()), (1, 2));
}

/// Poses on a map, where a step of `f32` is half a metre, keep their millimetres: they count from an origin.
#[test]
fn poses_may_be_those_of_a_map() {
    let folder = folder("depth_map");
    let pose = |x: f64| format!("a.png 1 0 0 {x}  0 1 0 5336000.002  0 0 1 1.5  0 0 0 1\n");
    let poses = [691_000.001, 691_000.251, 691_000.501].map(pose);
    fs::write(folder.join("poses.txt"), poses.concat()).unwrap();
    let sequence = DepthSequence::open(folder).unwrap();
    assert_eq!(sequence.origin.to_array(), [691_000.0, 5_336_000.0, 0.0]);
    for (frame, x) in sequence.frames.iter().zip([0.001, 0.251, 0.501]) {
        let place = frame.world_from_camera.translation;
        // Steps of f64 are 1e-9 there.
        assert!(place.distance(Vec3::new(x, 0.002, 1.5)) < 1e-6, "{place}");
    }
}

#[test]
fn what_is_wrong_is_said() {
    let error_of = |name: &str, change: &dyn Fn(&Path)| -> String {
        let folder = folder(name);
        change(&folder);
        let opened = DepthSequence::open(&folder);
        let result = opened.and_then(|sequence| sequence.read(&sequence.frames[0]));
        result.unwrap_err().to_string()
    };
    let write = |file: &'static str, text: &'static str| {
        move |folder: &Path| fs::write(folder.join(file), text).unwrap()
    };
    for (change, message) in [
        (
            &write("intrinsics.txt", "640 480 585") as &dyn Fn(&Path),
            "line 1: 3 numbers where 7 belong",
        ),
        (
            &write("intrinsics.txt", "4 3 0 2.5 2 1.5 0.001"),
            "must be above 0",
        ),
        (&write("intrinsics.txt", ""), "nothing in it"),
        (
            &write("poses.txt", "a.png 1 0 0"),
            "line 1: 3 numbers where 12 or 16 belong",
        ),
        (
            &write("poses.txt", "a.png 2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"),
            "no pose",
        ),
        (
            &write("poses.txt", "a.png 1 0 x 0 0 1 0 0 0 0 1 0 0 0 0 1"),
            "`x` is not a number",
        ),
        (&write("poses.txt", ""), "none of the 0 frames"),
        (&write("a.png", "no image"), "a.png"),
        (
            &|f: &Path| write_png(&f.join("a.png"), [4, 3], png::BitDepth::Eight),
            "Grayscale with 8 bits",
        ),
        (
            &|f: &Path| write_png(&f.join("a.png"), [3, 4], png::BitDepth::Sixteen),
            "3 × 4 pixels in size, not 4 × 3",
        ),
        (
            &|f: &Path| {
                let bytes = fs::read(f.join("a.png")).unwrap();
                fs::write(f.join("a.png"), &bytes[..bytes.len() / 2]).unwrap();
            },
            "a.png",
        ),
        (
            &|f: &Path| fs::remove_file(f.join("a.png")).unwrap(),
            "none of the 2 frames",
        ),
        (
            &|f: &Path| fs::remove_file(f.join("poses.txt")).unwrap(),
            "holds intrinsics.txt",
        ),
    ] {
        let error = error_of("depth_broken", change);
        assert!(error.contains(message), "{message}: {error}");
    }
    let missing = DepthSequence::open("no such folder").unwrap_err();
    assert!(matches!(missing, DepthError::Io { .. }), "{missing}");
}
