//! Runs the binary `depth_camera` as a user would.

mod common;

use common::{
    PICTURES, TIMES, assert_keys, assert_pictures, assert_refused, data, folder, list, number,
    report, report_with_pictures, seeded_report, vector,
};
use serde_json::Value;
use std::fs;
use std::path::Path;

const BINARY: &str = env!("CARGO_BIN_EXE_depth_camera");

/// Frames of a camera 1.5 m over a floor, straight down, 160 × 120 pixels; where `plate` says so, a
/// plate of 50 cm across is 30 cm over the floor. The camera's y is the world's −y: z is up.
fn write_frames(folder: &Path, plates: &[bool]) {
    fs::create_dir_all(folder).unwrap();
    write_intrinsics(folder, 0.001);
    let mut poses = String::new();
    for (k, plate) in plates.iter().enumerate() {
        let name = format!("{k:03}.png");
        poses += &format!("{name} 1 0 0 0 0 -1 0 0 0 0 -1 1.5 0 0 0 1\n");
        write_image(&folder.join(name), |u, v| {
            let on_plate = *plate && (12..148).contains(&u) && (12..108).contains(&v);
            if on_plate { 1200 } else { 1500 }
        });
    }
    fs::write(folder.join("poses.txt"), poses).unwrap();
}

/// Writes the geometry of the camera, with this unit of depth in metres.
fn write_intrinsics(folder: &Path, unit: f32) {
    let text = format!("160 120 140 140 79.5 59.5 {unit}\n");
    fs::write(folder.join("intrinsics.txt"), text).unwrap();
}

/// Writes the depths of the columns and rows of an image.
fn write_image(path: &Path, depth: impl Fn(usize, usize) -> u16) {
    let places = (0..120).flat_map(|v| (0..160).map(move |u| (u, v)));
    let bytes: Vec<u8> = places
        .flat_map(|(u, v)| depth(u, v).to_be_bytes())
        .collect();
    let file = fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, 160, 120);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&bytes)
        .unwrap();
}

/// One body of 20 cm: a box that is 10 cm high. Its middle rests 5 cm over what carries it, with half a centimetre for
/// the sensor's radii.
const ONE_BODY: &str = "--up 0,0,1 --count 1 --size 0.2 --hold 1 --frames";

fn assert_height(report: &Value, expected: f64) {
    let height = number(&report["bodies"][0]["translation"][2]);
    assert!((height - expected).abs() < 0.005, "{report}");
}

/// A frame in which nothing was measured is passed over: what lies on the surface of the frame before stays.
#[test]
fn a_frame_without_points_is_passed_over() {
    let folder = folder("depth_empty");
    write_frames(&folder.join("frames"), &[true; 30]);
    for name in ["007.png", "029.png"] {
        write_image(&folder.join("frames").join(name), |_, _| 0);
    }
    let report = report(BINARY, &folder, &format!("{ONE_BODY} frames"));
    let frames = list(&report["frames"]);
    assert_eq!(frames.len(), 60);
    // The second for which the first frame is held counts in no median.
    let is_new = |frame: &&Value| frame["held"] == false;
    let mut latencies: Vec<f64> = (frames.iter().filter(is_new))
        .map(|frame| number(&frame["latency_ms"]))
        .collect();
    assert_eq!(latencies.len(), 30);
    latencies.sort_by(f64::total_cmp);
    assert_eq!(number(&report["median_latency_ms"]), latencies[14]);
    // The surface below is the one that stayed.
    assert!(!report["bodies"][0]["displacement"].is_null(), "{report}");
    let empty = frames.iter().filter(|frame| frame["points"] == 0);
    assert!(empty.eq([&frames[37], &frames[59]]));
    assert_height(&report, 0.35);
}

/// The run starts with the first frame in which something was measured, and those before it are named.
#[test]
fn a_run_starts_with_the_first_frame_that_has_points() {
    let folder = folder("depth_starts_empty");
    write_frames(&folder.join("frames"), &[true; 10]);
    for name in ["000.png", "001.png"] {
        write_image(&folder.join("frames").join(name), |_, _| 0);
    }
    let report = report(BINARY, &folder, &format!("{ONE_BODY} frames"));
    let frames = list(&report["frames"]);
    assert_eq!(
        (frames.len(), &frames[0]["name"]),
        (38, &frames[30]["name"])
    );
    assert_eq!(frames[30]["name"], "002.png");
    let missing = serde_json::json!(["000.png", "001.png"]);
    assert_eq!(report["missing_frames"], missing);
    assert_height(&report, 0.35);
}

/// A body lies on the plate; the plate leaves the view, and the body falls to the floor.
#[test]
fn what_is_gone_from_the_frame_does_not_hold() {
    let folder = folder("depth_gone");
    let plates: Vec<bool> = (0..60).map(|k| k < 30).collect();
    write_frames(&folder.join("frames"), &plates);
    write_frames(&folder.join("still"), &[true; 30]);
    let [still, gone] =
        ["still", "frames"].map(|name| report(BINARY, &folder, &format!("{ONE_BODY} {name}")));
    assert_height(&still, 0.35);
    assert_height(&gone, 0.05);
    for frame in list(&gone["frames"]) {
        // Rims of the plate fly; nothing is remembered.
        assert_eq!(frame["remembered_points"], 0);
        let flying = number(&frame["flying_pixels"]);
        assert!(
            flying == 0.0 || (800.0..1000.0).contains(&flying),
            "{frame}"
        );
        let latency = ["unproject_ms", "update_ms", "step_ms"].map(|key| number(&frame[key]));
        let sum: f64 = latency.iter().sum();
        assert!((number(&frame["latency_ms"]) - sum).abs() < 1e-6, "{frame}");
    }
    // With a memory, the floor under the plate is known once it was seen, the plate is not kept.
    let plates: Vec<bool> = (0..20).map(|k| k >= 10).collect();
    write_frames(&folder.join("covered"), &plates);
    let options = "--frames covered --up 0,0,1 --count 0 --hold 0 --memory 30";
    let covered = report(BINARY, &folder, options);
    let frames = list(&covered["frames"]);
    assert_eq!(frames[9]["remembered_points"], 0);
    // 136 × 96 pixels of the floor, and those beside the plate, which fly, once: what a frame sees again is not kept twice.
    let under_plate = 136 * 96 + 2 * (136 + 96);
    assert_eq!(frames[19]["remembered_points"], under_plate);
}

#[test]
fn the_generated_ball_pushes_and_equal_seeds_give_equal_reports() {
    let folder = folder("depth_generated");
    let times = format!("{TIMES} median_latency_ms max_latency_ms");
    let frame_times = "unproject_ms update_ms step_ms latency_ms";
    let first = seeded_report(BINARY, &folder, "--hold 0", &times, frame_times);
    assert_keys(
        &first,
        "backend adapter steps frames bodies contact_steps pairs_missed",
    );
    assert_eq!(first["pairs_missed"], 0);
    let bodies = list(&first["bodies"]);
    // They rest on the table, the pebble after some rolling, and the ball, 22 cm wide, moves what is
    // in its way by more than a frame's noise.
    let has_rested = |body: &Value| !body["first_rested_at_seconds"].is_null();
    assert!(bodies.iter().all(has_rested), "{bodies:?}");
    let is_pushed = |body: &Value| number(&body["displacement"]) > 0.05;
    assert!(bodies.iter().any(is_pushed), "{bodies:?}");
    assert_pictures(&folder.join("out/depth_camera"), PICTURES);
}

#[test]
fn what_is_wrong_is_said() {
    let folder = folder("depth_errors");
    write_frames(&folder.join("frames"), &[false; 3]);
    fs::create_dir_all(folder.join("empty")).unwrap();
    let cases = [
        // The floor is straight ahead: nothing in view tells how the camera is held.
        ("--frames frames", 1, "pass it by hand (--up X,Y,Z"),
        ("--frames empty", 1, "holds intrinsics.txt"),
        ("--frames missing", 1, "missing"),
        ("--backend fast", 2, "is no backend"),
        ("--sensor-noise -1", 2, "greater than 0"),
        ("--frames frames --size 9 --up 0,0,1", 1, "no level surface"),
        ("--hold -1", 2, "from 0 to 3600"),
    ];
    assert_refused(BINARY, &folder, &cases);
    // A frame that is missing is named, and passed over.
    fs::remove_file(folder.join("frames/001.png")).unwrap();
    let options = "--frames frames --count 0 --hold 0 --animate --up 0,0,1";
    let report = report_with_pictures(BINARY, &folder, options);
    assert_eq!(report["missing_frames"][0], "001.png");
    assert_eq!(list(&report["frames"]).len(), 2);
    // In metres, as a unit of millimetres makes them: nothing is in range.
    write_intrinsics(&folder.join("frames"), 1.0);
    let case = ("--frames frames", 1, "is the depth unit right?");
    assert_refused(BINARY, &folder, &[case]);
}

/// Without bodies the pictures show the surface, wherever it is.
#[test]
fn pictures_without_bodies_show_the_surface() {
    let folder = folder("depth_bare");
    write_frames(&folder.join("frames"), &[false; 2]);
    let poses = fs::read_to_string(folder.join("frames/poses.txt")).unwrap();
    let poses = poses.replace("1 0 0 0 0 -1", "1 0 0 50 0 -1");
    fs::write(folder.join("frames/poses.txt"), poses).unwrap();
    let options = "--frames frames --count 0 --hold 0 --up 0,0,1";
    report_with_pictures(BINARY, &folder, options);
    let file = fs::File::open(folder.join("out/depth_camera/final.png")).unwrap();
    let mut reader = (png::Decoder::new(std::io::BufReader::new(file)).read_info()).unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    // The surface is in the middle, and lighter than what is around it.
    let row = &bytes[info.line_size * (info.height as usize / 2)..][..info.line_size];
    assert_ne!(row[..3], row[info.line_size / 2..][..3]);
}

/// A floor at 15 m counts where it is said to.
#[test]
fn the_range_can_be_set() {
    let folder = folder("depth_range");
    write_frames(&folder.join("frames"), &[false; 2]);
    write_intrinsics(&folder.join("frames"), 0.01);
    let options = "--frames frames --count 0 --hold 0 --up 0,0,1";
    let ranged = |range| format!("{options} --range {range}");
    let cases = [
        (
            options,
            1,
            "none of the 2 frames has a point between 0.3 and 8 m",
        ),
        (&ranged("1,14"), 1, "between 1 and 14 m"),
        (&ranged("14,1"), 2, "the nearest and the farthest"),
    ];
    assert_refused(BINARY, &folder, &cases);
    let report = report(BINARY, &folder, &ranged("1,16"));
    let points = number(&report["frames"][0]["points"]);
    assert!(points > 10_000.0, "{points}");
}

#[test]
fn bodies_rest_on_real_frames() {
    if data("kitchen_depth").is_none() {
        return;
    }
    let folder = folder("depth_kitchen");
    let report = report(BINARY, &folder, "--frames $TLDI_DATA/kitchen_depth");
    assert!(list(&report["missing_frames"]).is_empty());
    // The data's notes give gravity as (-0.009, 0.904, 0.427); one frame tells it within 8°.
    let [x, y, z] = vector(&report["up"]);
    let cos = -(-0.009 * x + 0.904 * y + 0.427 * z);
    assert!(cos > 0.99, "{x} {y} {z}");
    let has_rested = |body: &&Value| !body["first_rested_at_seconds"].is_null();
    let rested = list(&report["bodies"]).iter().filter(has_rested);
    assert!(rested.count() >= 2, "{report}");
    eprintln!("median latency {} ms", report["median_latency_ms"]);
}
