//! Runs the binary `two_clouds` as a user would.

mod common;

use common::{
    assert_keys, assert_pictures, assert_refused, ball, folder, json, list, number, report,
    report_with_pictures, run, seeded_report, stderr, vector, write_ply,
};
use serde_json::Value;
use std::fs;
use std::path::Path;

const BINARY: &str = env!("CARGO_BIN_EXE_two_clouds");

/// Two spheres of radius 0.1 around the origin, their points some 4 mm apart.
fn write_spheres(folder: &Path) {
    let sphere: Vec<[f32; 3]> = (ball(8000).into_iter())
        .map(|p| p.map(|c| (0.1 * c) as f32))
        .collect();
    for name in ["a.ply", "b.ply"] {
        write_ply(&folder.join(name), &sphere);
    }
}

/// Spheres whose surfaces are 2 mm deep in each other, 3 mm apart, and far apart. 0.4 mm: the
/// spheres' points are 4 mm apart, and depths scatter by a tenth of that.
#[test]
fn spheres_answer_as_geometry_says() {
    let folder = folder("two_clouds_spheres");
    write_spheres(&folder);
    for (distance, depth, pictures) in [
        (0.198, 0.002, "--out pictures"),
        (0.203, -0.003, "--no-pictures"),
        (0.7, -0.5, "--no-pictures"),
    ] {
        let options = format!("a.ply b.ply --pose 0,{distance},0 {pictures}");
        let answer = report_with_pictures(BINARY, &folder, &options);
        assert_eq!(answer["collides"], depth > 0.0, "{answer}");
        let gap = number(&answer["gap"]);
        assert!((gap + depth).abs() < 4e-4, "{distance}: {gap}");
        let contacts = list(&answer["contacts"]);
        for contact in contacts {
            assert!(
                (number(&contact["depth"]) - depth).abs() < 4e-4,
                "{contact}"
            );
            let [x, y, z] = vector(&contact["point"]);
            assert!(
                (y - 0.5 * distance).abs() < 4e-4 && x.hypot(z) < 0.005,
                "{contact}"
            );
            assert!(vector(&contact["normal"])[1] > 0.995, "{contact}");
        }
        assert_eq!(!contacts.is_empty(), depth > -0.01, "{answer}");
    }
    let names = "scene.png zone.png layers.png section.png pixels.png";
    assert_pictures(&folder.join("pictures"), names);
}

/// B comes from 0.7 m above at 2 m/s and meets A after 0.5 m.
#[test]
fn a_velocity_tells_when_they_meet() {
    let folder = folder("two_clouds_velocity");
    write_spheres(&folder);
    let thrown = "a.ply b.ply --pose 0,0.7,0 --velocity";
    let options = format!("{thrown} 0,-2,0 --animate --out pictures");
    let impact = &report_with_pictures(BINARY, &folder, &options)["impact"];
    for (key, expected) in [("time_seconds", 0.25), ("distance", 0.5)] {
        assert!((number(&impact[key]) - expected).abs() < 4e-4, "{impact}");
    }
    assert!(folder.join("pictures/motion.png").exists());
    let away = report(BINARY, &folder, &format!("{thrown} 0,2,0"));
    assert_eq!(away["impact"], Value::Null);
}

/// The surface of a box of 200 mm with its middle at `[x, y, z]`, in steps of 10 mm, as columns of text.
fn write_box(path: &Path, [x, y, z]: [f64; 3]) {
    let mut text = String::new();
    let steps = || (-10..=10).map(|k| 10 * k);
    for (i, j, k) in
        steps().flat_map(|i| steps().flat_map(move |j| steps().map(move |k| (i, j, k))))
    {
        if [i, j, k].iter().any(|c: &i32| c.abs() == 100) {
            let [i, j, k] = [i, j, k].map(f64::from);
            text += &format!("{} {} {}\n", x + i, y + j, z + k);
        }
    }
    fs::write(path, text).unwrap();
}

/// Two files have one zero, however far away it is: boxes around 5000 and 5300 are 100 apart, turned about zero by a
/// quarter, too; and one near zero is set beside one on a map.
#[test]
fn coordinates_of_two_files_count_from_one_zero() {
    let folder = folder("two_clouds_origins");
    let along = |axis: usize, way: f64| [0, 1, 2].map(|k| if k == axis { way } else { 0.0 });
    let map = [500_123.25, 4_649_000.0, 120.0];
    for (a, b, pose, origin) in [
        (along(0, 5e3), along(0, 5.3e3), "0,0,0", along(0, 5e3)),
        (
            along(1, 5e3),
            along(0, 5.3e3),
            "0,0,0,0,0,90",
            along(1, 5e3),
        ),
        (
            map,
            [0.0; 3],
            "500123.25,4649300,120",
            [500_123.0, 4_649_000.0, 0.0],
        ),
    ] {
        write_box(&folder.join("a.xyz"), a);
        write_box(&folder.join("b.xyz"), b);
        let options = format!("a.xyz b.xyz --no-pictures --json answer.json --pose {pose}");
        let output = run(BINARY, &folder, &options);
        assert!(output.status.success(), "{}", stderr(&output));
        let answer = json(folder.join("answer.json"));
        assert_eq!(answer["collides"], false, "{pose}: {answer}");
        // A tenth of the points' spacing.
        let gap = number(&answer["gap"]);
        assert!((gap - 100.0).abs() < 1.0, "{pose}: {gap}");
        // What was subtracted is the median, which is a coordinate near the middle of A.
        for (said, middle) in vector(&answer["origin"]).iter().zip(origin) {
            assert!((said - middle).abs() <= 100.0, "{pose}: {answer}");
        }
        let table = String::from_utf8_lossy(&output.stdout);
        assert!(table.contains("places are relative to"), "{table}");
    }
}

#[test]
fn results_are_not_lost() {
    let folder = folder("two_clouds_results");
    write_spheres(&folder);
    let ask = |options: &str| run(BINARY, &folder, &format!("a.ply b.ply {options}"));
    let output = ask("--no-pictures --json not/there/answer.json");
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(folder.join("not/there/answer.json"))["collides"], true);
    // Pictures that cannot be written leave the results.
    let output = ask("--out a.ply/pictures --json second.json");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(String::from_utf8_lossy(&output.stdout).contains("contact pixels"));
    assert_eq!(json(folder.join("second.json"))["collides"], true);
    // What cannot be written is refused before anything is read.
    for name in [".", "a.ply/answer.json"] {
        let output = ask(&format!("--no-pictures --json {name}"));
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{name}: {said}");
        assert!(
            said.contains("cannot") && !said.contains("reading"),
            "{name}: {said}"
        );
    }
}

#[test]
fn without_files_there_is_something_to_see_and_it_is_the_same_twice() {
    let folder = folder("two_clouds_generated");
    let first = seeded_report(BINARY, &folder, "", "wall_seconds", "");
    assert_eq!(first["collides"], true);
    assert!(list(&first["contacts"]).len() >= 3);
    assert_keys(&first, "collides gap contacts backend adapter");
}

#[test]
fn what_is_wrong_is_said() {
    let folder = folder("two_clouds_errors");
    write_spheres(&folder);
    write_ply(&folder.join("point.ply"), &[[1.0, 2.0, 3.0]; 4]);
    let cases = [
        ("a.ply b.ply --pose 1,2", 2, "three of degrees"),
        ("a.ply b.ply --velocity fast", 2, "three numbers"),
        ("a.ply b.ply --backend fast", 2, "is no backend"),
        ("a.ply b.ply --animate", 2, "--velocity <X,Y,Z>"),
        ("--animate --velocity 0,0,0", 2, "give a --velocity"),
        ("a.ply", 2, "<B>"),
        ("a.ply missing.ply", 1, "missing.ply"),
        ("a.ply point.ply", 1, "at one position"),
    ];
    assert_refused(BINARY, &folder, &cases);
}
