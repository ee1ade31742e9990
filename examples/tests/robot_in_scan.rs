//! Runs the binary `robot_in_scan` as a user would.

mod common;

use common::{
    PICTURES, TIMES, assert_keys, assert_pictures, assert_refused, cube_as_stl, data, folder, json,
    list, number, report, report_with_pictures, run, seeded_report, stderr, vector, write_ply,
};
use serde_json::Value;
use std::fs;
use std::path::Path;

const BINARY: &str = env!("CARGO_BIN_EXE_robot_in_scan");

/// A level floor of 3 × 3 m, z up, its points 2.5 cm apart, with a block of 30 × 30 × 20 cm in a
/// corner.
fn write_floor(folder: &Path) {
    let mut points = Vec::new();
    for i in 0..120 {
        for j in 0..120 {
            let on_block = i < 12 && j < 12;
            let height = if on_block { 0.2 } else { 0.0 };
            points.push([i as f32 * 0.025, j as f32 * 0.025, height]);
        }
    }
    write_ply(&folder.join("floor.ply"), &points);
}

/// A robot in the middle of that floor.
const ON_FLOOR: &str = "--scan floor.ply --up 0,0,1 --place 1.5,1.5,0";

/// A box on four wheels of 8 cm radius, axles along y.
fn car() -> String {
    let wheel = |(name, x, y): (&str, f32, f32)| {
        format!(
            r#"<link name="{name}">
              <collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.08" length="0.05"/></geometry></collision>
              <inertial><mass value="0.5"/><inertia ixx="0.001" iyy="0.0016" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
            </link>
            <joint name="{name}_axle" type="continuous"><parent link="chassis"/><child link="{name}"/>
              <origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/></joint>"#
        )
    };
    let wheels = [
        ("front_left", 0.18, 0.17),
        ("front_right", 0.18, -0.17),
        ("rear_left", -0.18, 0.17),
        ("rear_right", -0.18, -0.17),
    ];
    let wheels = wheels.map(wheel).concat();
    format!(
        r#"<robot name="car"><link name="chassis">
          <collision><origin xyz="0 0 0.05"/><geometry><box size="0.5 0.26 0.1"/></geometry></collision>
          <inertial><mass value="5"/><origin xyz="0 0 0.05"/><inertia ixx="0.04" iyy="0.1" izz="0.12" ixy="0" ixz="0" iyz="0"/></inertial>
        </link>{wheels}</robot>"#
    )
}

/// A torso on four legs of two links each, which overlap at hips and knees, without any inertials.
fn walker() -> String {
    let mut legs = String::new();
    for (name, x, y) in [
        ("fl", 0.2, 0.12),
        ("fr", 0.2, -0.12),
        ("rl", -0.2, 0.12),
        ("rr", -0.2, -0.12),
    ] {
        legs += &format!(
            r#"<link name="{name}_thigh"><collision><origin xyz="0 0 -0.1"/><geometry><box size="0.06 0.06 0.26"/></geometry></collision></link>
            <joint name="{name}_hip" type="revolute"><parent link="torso"/><child link="{name}_thigh"/>
              <origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="60" velocity="8"/></joint>
            <link name="{name}_shin"><collision><origin xyz="0 0 -0.1"/><geometry><capsule radius="0.03" length="0.2"/></geometry></collision></link>
            <joint name="{name}_knee" type="revolute"><parent link="{name}_thigh"/><child link="{name}_shin"/>
              <origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="60" velocity="8"/></joint>"#
        );
    }
    format!(
        r#"<robot name="walker"><link name="torso">
          <collision><geometry><box size="0.5 0.24 0.12"/></geometry></collision></link>{legs}</robot>"#
    )
}

#[test]
fn the_built_in_arm_touches_and_equal_seeds_give_equal_reports() {
    let folder = folder("robot_built_in");
    let first = seeded_report(BINARY, &folder, "--steps 300", TIMES, "");
    assert_keys(
        &first,
        "backend adapter steps dt wall_seconds real_time_factor scan_points links contact_steps max_penetration \
         pairs_batched pairs_missed",
    );
    assert_eq!(first["base_fixed"], true);
    // Six joints; the seventh mimics the sixth.
    assert_eq!(first["driven_joints"], 6);
    assert_eq!(first["link_count"], 8);
    assert_eq!(first["pairs_missed"], 0);
    assert!(number(&first["contact_steps"]) > 20.0);
    let is_pushed = |b: &Value| b["touched"] == true && number(&b["displacement"]) > 0.05;
    assert!(list(&first["bodies"]).iter().any(is_pushed), "{first}");
    for link in list(&first["links"]) {
        // Its strongest motor has 80 N·m; at 20 cm that is 400 N. Contacts of a light body that is
        // pinned to the floor, and blows, may double it.
        assert!(number(&link["max_force"]) < 1000.0, "{link}");
        assert!(number(&link["points"]) > 100.0, "{link}");
        // What pushed most is in the step that is named, and only of links that were touched.
        let hardest = &link["hardest"];
        assert_eq!(hardest.is_null(), link["contact_steps"] == 0, "{link}");
        if !hardest.is_null() {
            assert!((1.0..=300.0).contains(&number(&hardest["step"])), "{link}");
        }
    }
    let pictures = folder.join("out/robot_in_scan");
    assert_pictures(&pictures, &format!("{PICTURES} hardest.png"));
    let by_body = |link: &Value| link["hardest"]["against"] == "rounded box 1";
    assert!(list(&first["links"]).iter().any(by_body));
}

/// Wheels of 8 cm that roll at 0.25 m/s over ground: 1.5 m in 6 s, less the start. They stand on
/// the floor, not in it.
#[test]
fn a_car_drives() {
    let folder = folder("robot_car");
    write_floor(&folder);
    fs::write(folder.join("car.urdf"), car()).unwrap();
    let drive = |steps: usize| {
        let options = format!("{ON_FLOOR} --urdf car.urdf --steps {steps}");
        report(BINARY, &folder, &options)
    };
    let (start, end) = (drive(30), drive(150));
    assert_eq!(end["base_fixed"], false);
    assert_eq!(end["driven_joints"], 4);
    let [a, b] = [start, end].map(|report| vector(&report["base"]));
    let way = (a[0] - b[0]).hypot(a[1] - b[1]);
    assert!((way - 0.5).abs() < 0.15, "{a:?} {b:?}");
    // The chassis' origin is at the axles.
    assert!((b[2] - 0.08).abs() < 0.01, "{b:?}");
    assert!(!folder.join("out").exists(), "it was told to draw nothing");
}

/// An arm whose base has no surface stands on the floor by its origin; the first link begins above, and touches nothing.
#[test]
fn an_arm_without_a_base_stands_on_the_floor() {
    let folder = folder("robot_without_base");
    write_floor(&folder);
    let link = |name: &str| {
        format!(
            r#"<link name="{name}"><collision><origin xyz="0 0 0.1"/><geometry><box size="0.1 0.1 0.2"/></geometry></collision></link>"#
        )
    };
    let joint = |parent: &str, child: &str| {
        format!(
            r#"<joint name="to_{child}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
              <origin xyz="0 0 0.2"/><axis xyz="0 1 0"/><limit lower="-0.2" upper="0.2" effort="50" velocity="1"/></joint>"#
        )
    };
    let parts = [link("a"), link("b"), joint("base", "a"), joint("a", "b")].concat();
    let arm = format!(r#"<robot name="arm"><link name="base"/>{parts}</robot>"#);
    fs::write(folder.join("arm.urdf"), arm).unwrap();
    let options = format!("{ON_FLOOR} --urdf arm.urdf --steps 60");
    let report = report(BINARY, &folder, &options);
    assert_eq!(report["base_fixed"], true);
    assert!(number(&report["base"][2]).abs() < 0.01, "{report}");
    for link in list(&report["links"]) {
        assert_eq!(link["contact_steps"], 0, "{link}");
    }
}

/// A place on a map is one of the file: the robot stands there, to what a grid of 2.5 cm tells.
#[test]
fn a_place_counts_from_the_zero_of_the_file() {
    let folder = folder("robot_map");
    let [east, north, height] = [500_123.0, 4_649_000.0, 120.0];
    let rows = (0..80).flat_map(|i| (0..80).map(move |j| [i, j].map(|k| 0.025 * f64::from(k))));
    let lines = rows.map(|[x, y]| format!("{} {} {height}\n", east + x, north + y));
    fs::write(folder.join("map.xyz"), lines.collect::<String>()).unwrap();
    fs::write(folder.join("car.urdf"), car()).unwrap();
    let options = "--urdf car.urdf --scan map.xyz --up 0,0,1 --steps 1 --place 500124,4649001,120";
    let report = report(BINARY, &folder, options);
    let base = |k: usize| number(&report["origin"][k]) + number(&report["base"][k]);
    assert!((base(0) - east - 1.0).abs() < 0.05, "{report}");
    assert!((base(1) - north - 1.0).abs() < 0.05, "{report}");
    // The axles of the wheels are 8 cm above it.
    assert!((base(2) - height - 0.08).abs() < 0.02, "{report}");
}

/// Links that overlap at their joints, at rest and stepping, without inertials: it stays on its feet.
#[test]
fn a_walker_does_not_explode() {
    let folder = folder("robot_walker");
    write_floor(&folder);
    fs::write(folder.join("walker.urdf"), walker()).unwrap();
    let options = "--urdf walker.urdf --scan floor.ply --steps 120";
    let report = report(BINARY, &folder, options);
    assert_eq!(report["base_fixed"], false);
    assert_eq!(report["driven_joints"], 8);
    let base = vector(&report["base"]);
    // The torso stands 0.43 m over the floor; the legs bend by up to 0.3 rad.
    assert!((0.3..0.46).contains(&base[2]), "{base:?}");
    assert!(number(&report["max_penetration"]) < 0.03, "{report}");
}

/// The robot's own image holds it where it is, unless it is taken out.
#[test]
fn the_self_filter_frees_the_robot_from_its_own_image() {
    let folder = folder("robot_own_camera");
    write_floor(&folder);
    let options = "--scan floor.ply --place 1.5,1.5,0 --bodies 0 --own-camera --steps 60";
    let with = report(BINARY, &folder, options);
    let robot_points: f64 = (list(&with["links"]).iter())
        .map(|link| number(&link["points"]))
        .sum();
    let filtered = number(&with["self_filtered_points"]);
    // All of the robot's points, and those of the floor under it.
    assert!(
        (0.995..1.1).contains(&(filtered / robot_points)),
        "{filtered} of {robot_points}"
    );
    assert_eq!(with["contact_steps"], 0, "{with}");
    // In the middle of its own image, it is held or thrown out.
    let unfiltered = format!("{options} --no-self-filter --json without.json --no-pictures");
    let output = run(BINARY, &folder, &unfiltered);
    let without = json(folder.join("without.json"));
    if output.status.success() {
        assert!(number(&without["contact_steps"]) > 30.0, "{without}");
    } else {
        assert!(stderr(&output).contains("own image"), "{}", stderr(&output));
    }
}

#[test]
fn what_is_missing_is_named_and_the_rest_is_used() {
    let folder = folder("robot_missing");
    write_floor(&folder);
    let arm = |mesh: &str| {
        format!(
            r#"<robot name="arm">
              <link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
              <link name="boom"><visual><origin xyz="0 0 0.3"/><geometry><mesh filename="{mesh}" scale="0.05 0.05 0.25"/></geometry></visual></link>
              <link name="frame"/>
              <joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><origin xyz="0 0 0.1"/>
                <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="50" velocity="1"/></joint>
              <joint name="tool" type="fixed"><parent link="boom"/><child link="frame"/></joint>
              <joint name="odd" type="revolute"><parent link="boom"/><child link="lamp"/>
                <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="5" velocity="1"/><mimic joint="none"/></joint>
              <link name="lamp"/>
            </robot>"#
        )
    };
    fs::create_dir_all(folder.join("my_robot/meshes")).unwrap();
    fs::create_dir_all(folder.join("my_robot/urdf")).unwrap();
    fs::write(folder.join("my_robot/meshes/cube.stl"), cube_as_stl()).unwrap();
    let options = "--urdf my_robot/urdf/arm.urdf --scan floor.ply --steps 30";
    for (mesh, links) in [
        ("package://my_robot/meshes/cube.stl", 2),
        ("../meshes/cube.stl", 2),
        ("package://my_robot/meshes/lost.dae", 1),
    ] {
        fs::write(folder.join("my_robot/urdf/arm.urdf"), arm(mesh)).unwrap();
        let report = report(BINARY, &folder, options);
        assert_eq!(report["link_count"], links, "{mesh}");
        let warnings = report["warnings"].to_string();
        assert!(warnings.contains("odd cannot mimic none"), "{warnings}");
        assert_eq!(
            warnings.contains("not found (1): package://my_robot/meshes/lost.dae;"),
            links == 1,
            "{warnings}"
        );
    }
}

#[test]
fn what_is_wrong_is_said() {
    let folder = folder("robot_errors");
    write_floor(&folder);
    fs::write(folder.join("robot.urdf"), "<robot").unwrap();
    let case = ("--urdf robot.urdf --scan floor.ply", 1, "not a URDF");
    assert_refused(BINARY, &folder, &[case]);
    // A single link without joints just stands there.
    let robot = r#"<robot name="r"><link name="a"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>"#;
    fs::write(folder.join("robot.urdf"), robot).unwrap();
    let options = "--urdf robot.urdf --scan floor.ply --steps 10 --animate";
    let report = report_with_pictures(BINARY, &folder, options);
    assert_eq!(report["driven_joints"], 0);
    assert_pictures(&folder.join("out/robot_in_scan"), "motion.png");
    let cases = [
        ("--backend fast", 2, "is no backend"),
        ("--terrain ramp --up 0,1,0", 2, "cannot be used with"),
        ("--scan-scale 0", 2, "greater than 0"),
        ("--scan-scale 0.001", 2, "--scan <FILE>"),
        ("--packages .", 2, "--urdf <FILE>"),
        ("--urdf missing.urdf", 1, "missing.urdf"),
        ("--scan floor.ply --scan-scale 0.001", 1, "--scan-scale"),
    ];
    assert_refused(BINARY, &folder, &cases);
}

#[test]
fn the_panda_reaches_into_the_kitchen() {
    let (urdf, scan) = ("robot_panda/panda.urdf", "kitchen_scan_300k.ply.gz");
    if [urdf, scan].map(data).contains(&None) {
        return;
    }
    let folder = folder("robot_panda");
    let options = format!("--urdf $TLDI_DATA/{urdf} --scan $TLDI_DATA/{scan} --steps 400");
    let report = report(BINARY, &folder, &options);
    // Seven joints and one finger; the other finger mimics it.
    assert_eq!(report["driven_joints"], 8);
    assert_eq!(report["link_count"], 11);
    assert!(number(&report["contact_steps"]) > 0.0);
    assert_eq!(report["pairs_missed"], 0);
    for link in list(&report["links"]) {
        // Its strongest motors have 87 N·m: 1450 N at 6 cm, half of its thinnest arm, where a wedge between
        // two walls may hold it; and a blow may double it.
        assert!(number(&link["max_force"]) < 2900.0, "{link}");
    }
    // Half of its thinnest arm, of 12 cm: no link is half through.
    assert!(number(&report["max_penetration"]) < 0.06, "{report}");
    eprintln!("real-time factor {}", report["real_time_factor"]);
}
