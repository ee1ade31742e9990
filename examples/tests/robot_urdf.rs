//! URDF files as they are found: packages elsewhere, parts left out, meshes that are broken.

mod common;

use common::{folder, lines, ply, stderr};
use rapier3d::prelude::ColliderSet;
use rapier3d_urdf::{UrdfLoaderOptions, UrdfRobot};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tldi::glamx::Vec3;
use tldi_examples::robot::{Description, MeshFolders, clouds_of_links};

const BASE: &str = r#"<link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>"#;

/// A base, and a link on it for each mesh.
fn robot(meshes: &[&str]) -> String {
    let link = |(k, mesh): (usize, &&str)| {
        format!(
            r#"<link name="l{k}"><visual><geometry><mesh filename="{mesh}"/></geometry></visual></link>
            <joint name="j{k}" type="fixed"><parent link="base"/><child link="l{k}"/></joint>"#
        )
    };
    let links: String = meshes.iter().enumerate().map(link).collect();
    format!(r#"<robot name="r">{BASE}{links}</robot>"#)
}

/// Writes a PLY file of one triangle.
fn write_triangle(path: &Path, corners: [[f32; 3]; 3]) {
    fs::write(path, ply("x y z", &lines(corners), "3 0 1 2\n")).unwrap();
}

/// Reads a URDF; its meshes lie in a folder.
fn read(text: &str, folder: &Path) -> Result<Description, String> {
    let robot = Description::from_text(text, &MeshFolders::new(folder, &[]));
    robot.map_err(|error| error.to_string())
}

const CORNERS: [[f32; 3]; 3] = [[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]];

/// A robot in `robots`, and its package below `ws/share`.
fn write_package(folder: &Path, mesh: &str) -> PathBuf {
    let package = folder.join("ws/share/my_arm");
    fs::create_dir_all(package.join("meshes")).unwrap();
    fs::create_dir_all(folder.join("robots")).unwrap();
    write_triangle(&package.join("meshes/part.ply"), CORNERS);
    let urdf = folder.join("robots/arm.urdf");
    fs::write(&urdf, robot(&[mesh])).unwrap();
    urdf
}

#[test]
fn packages_are_found_where_they_are_said_to_be() {
    let folder = folder("urdf_packages");
    let urdf = write_package(&folder, "package://my_arm/meshes/part.ply");
    let faces = |packages: &[&str]| {
        let packages: Vec<PathBuf> = packages.iter().map(|name| folder.join(name)).collect();
        let robot = Description::from_file(&urdf, &packages).unwrap();
        robot.meshes[1].faces.len()
    };
    assert_eq!(faces(&[]), 0);
    assert_eq!(faces(&["ws"]), 0);
    assert_eq!(faces(&["nowhere", "ws/share"]), 1);
    assert_eq!(faces(&["ws/share/my_arm"]), 1);
    // What is wrong with the robot is said before the scan is read.
    let said = |variable: &str, value: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_robot_in_scan"))
            .args(["--urdf", "arm.urdf", "--scan", "missing.ply"])
            .current_dir(folder.join("robots"))
            .env(variable, value)
            .output()
            .unwrap();
        stderr(&output)
    };
    let lost = said("ROS_PACKAGE_PATH", "");
    let place = folder.join("robots").canonicalize().unwrap();
    let place = place.to_str().unwrap();
    assert!(
        lost.contains("not found (1)") && lost.contains(place),
        "{lost}"
    );
    assert!(lost.contains("--packages"), "{lost}");
    for (variable, value) in [
        ("ROS_PACKAGE_PATH", "../nowhere:../ws/share"),
        ("AMENT_PREFIX_PATH", "../ws"),
    ] {
        let said = said(variable, value);
        assert!(!said.contains("not found (1)"), "{variable}: {said}");
    }
}

#[test]
fn three_of_many_missing_meshes_are_named() {
    let names = ["a.stl", "b.stl", "c.stl", "d.stl", "a.stl"];
    let robot = read(&robot(&names), Path::new("")).unwrap();
    assert_eq!(robot.warnings.len(), 1, "{:?}", robot.warnings);
    let warning = &robot.warnings[0];
    assert!(
        warning.contains("(4): a.stl, b.stl, c.stl, …;"),
        "{warning}"
    );
}

/// An empty geometry, limits without a velocity and the wrong way round, and a mass without inertia.
#[test]
fn what_a_urdf_leaves_out_does_not_end_it() {
    let text = format!(
        r#"<robot name="r">{BASE}
          <link name="arm">
            <inertial><mass value="1.2"/></inertial>
            <visual><geometry></geometry></visual>
            <visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual>
          </link>
          <joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
            <limit lower="1" upper="-2" effort="5"/></joint>
        </robot>"#
    );
    let robot = read(&text, Path::new("")).unwrap();
    let joint = &robot.kinematics.joints[0];
    assert_eq!((joint.limits, joint.max_speed), ([-2.0, 1.0], None));
    // What the engine reads, too.
    let limit = &robot.urdf.joints[0].limit;
    assert_eq!((limit.lower, limit.upper), (-2.0, 1.0));
    // Of a solid box: m / 12 (a² + b²).
    let inertia = &robot.urdf.links[1].inertial.inertia;
    for (found, expected) in [
        (inertia.ixx, 0.013),
        (inertia.iyy, 0.01),
        (inertia.izz, 0.005),
    ] {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
    let warnings = robot.warnings.join("\n");
    assert!(
        warnings.contains("swapped") && warnings.contains("no inertia"),
        "{warnings}"
    );
    assert_eq!(robot.warnings.len(), 2, "{warnings}");
}

/// A thick rod whose inertia is told about axes of its own: in the world's engine it lies where these say. The mass of a
/// box has no inertia, and gets that about the axes of its link.
#[test]
fn inertias_are_about_the_axes_that_their_origin_tells() {
    let [roll, pitch, yaw] = [0.7_f32, -0.4, 1.9];
    let origin = format!(r#"<origin xyz="0.1 0 0" rpy="{roll} {pitch} {yaw}"/>"#);
    let link = |name: &str, inertial: &str| {
        let joint = format!(
            r#"<joint name="to_{name}" type="fixed"><parent link="base"/><child link="{name}"/></joint>"#
        );
        format!(
            r#"<link name="{name}"><inertial>{origin}<mass value="12"/>{inertial}</inertial>
               <visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>{joint}"#
        )
    };
    // Along z.
    let rod = r#"<inertia ixx="0.3" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.1"/>"#;
    let [rod, cuboid] = [link("rod", rod), link("cuboid", "")];
    let robot = read(
        &format!(r#"<robot name="r">{BASE}{rod}{cuboid}</robot>"#),
        Path::new(""),
    );
    let urdf = &robot.unwrap().urdf;
    let engine = UrdfRobot::from_robot(urdf, UrdfLoaderOptions::default(), Path::new(""));
    // The z axis after a turn by `roll` about x, then by `pitch` about y, then by `yaw` about z.
    let [(sr, cr), (sp, cp), (sy, cy)] = [roll, pitch, yaw].map(f32::sin_cos);
    let along = Vec3::new(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr);
    let of_rod = |a: Vec3| a.length_squared() * 0.3 - 0.2 * a.dot(along).powi(2);
    // m / 12 (a² + b²).
    let of_box = |a: Vec3| (a * a).dot(Vec3::new(0.13, 0.1, 0.05));
    let along_it: [(usize, &dyn Fn(Vec3) -> f32); 2] = [(1, &of_rod), (2, &of_box)];
    for (link, expected) in along_it {
        let mut body = engine.links[link].body.clone();
        body.recompute_mass_properties_from_colliders(&ColliderSet::new());
        let found = body.mass_properties().local_mprops;
        assert!(found.local_com.distance(0.1 * Vec3::X) < 1e-6);
        let found = found.reconstruct_inertia_matrix();
        for axis in [
            Vec3::X,
            Vec3::Y,
            Vec3::Z,
            Vec3::ONE,
            Vec3::new(1.0, -2.0, 0.5),
        ] {
            let moment = axis.dot(found * axis);
            // The engine keeps the square roots of inverses, and a turn, as `f32`.
            assert!(
                (moment - expected(axis)).abs() < 1e-4,
                "{link} {axis}: {moment}"
            );
        }
    }
}

/// The first joint follows the second, which follows the third; two more follow each other. A follower's numbers are
/// finite, alone and along its chain.
#[test]
fn mimics_of_mimics_follow_the_joint_at_the_end() {
    let joint = |k: usize, mimic: &str| {
        format!(
            r#"<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="base"/><child link="l{k}"/>
              <axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="5" velocity="1"/>{mimic}</joint>"#
        )
    };
    let read_with = |mimics: [&str; 5]| {
        let joints: String = (mimics.iter().enumerate())
            .map(|(k, mimic)| joint(k, mimic))
            .collect();
        read(
            &format!(r#"<robot name="r">{BASE}{joints}</robot>"#),
            Path::new(""),
        )
    };
    let second = r#"<mimic joint="j2" multiplier="-0.5" offset="1"/>"#;
    let robot = read_with([
        r#"<mimic joint="j1" multiplier="2" offset="0.25"/>"#,
        second,
        "",
        r#"<mimic joint="j4"/>"#,
        r#"<mimic joint="j3" multiplier="3"/>"#,
    ])
    .unwrap();
    let mut positions = [7.0, 7.0, 0.8, 0.1, 0.2];
    robot.kinematics.follow(&mut positions);
    // -0.5 · 0.8 + 1, and twice that and a quarter.
    for (found, expected) in positions.iter().zip([1.45, 0.6, 0.8, 0.1, 0.2]) {
        assert!((found - expected).abs() < 1e-5, "{positions:?}");
    }
    assert_eq!(robot.warnings.len(), 2, "{:?}", robot.warnings);
    let expected = "joint j3 cannot mimic j4, which follows it: it is driven by itself";
    assert_eq!(robot.warnings[0], expected);
    for bad in [
        r#"<mimic joint="j1" multiplier="NaN"/>"#,
        r#"<mimic joint="j1" offset="inf"/>"#,
        r#"<mimic joint="none" offset="NaN"/>"#,
        r#"<mimic joint="j1" multiplier="1e300"/>"#,
    ] {
        let error = read_with([bad, second, "", "", ""]).err().unwrap();
        assert_eq!(error, "joint j0 has a number that is not finite", "{bad}");
    }
    let [far, farther] = ["j1", "j2"]
        .map(|leader| format!(r#"<mimic joint="{leader}" multiplier="1e30" offset="0"/>"#));
    let error = read_with([&far, &farther, "", "", ""]).err().unwrap();
    assert_eq!(error, "joint j0 has a number that is not finite");
}

/// A joint that turns or slides needs limits; without them it stands still, which is said.
#[test]
fn joints_without_room_are_told() {
    let joint = |kind: &str, limit: &str| {
        let text = format!(
            r#"<robot name="r">{BASE}<link name="arm"/><joint name="elbow" type="{kind}"><parent link="base"/>
               <child link="arm"/><axis xyz="0 0 1"/>{limit}</joint></robot>"#
        );
        read(&text, Path::new("")).unwrap().warnings
    };
    for kind in ["revolute", "prismatic"] {
        for limit in ["", r#"<limit effort="5" velocity="1"/>"#] {
            let warnings = joint(kind, limit);
            assert_eq!(warnings.len(), 1, "{warnings:?}");
            assert!(warnings[0].contains("elbow cannot move"), "{warnings:?}");
        }
        let warnings = joint(kind, r#"<limit lower="-1" upper="0" effort="5"/>"#);
        assert!(warnings.is_empty(), "{warnings:?}");
    }
    for kind in ["continuous", "fixed"] {
        let warnings = joint(kind, "");
        assert!(warnings.is_empty(), "{warnings:?}");
    }
}

#[test]
fn xacro_is_named_only_where_it_is() {
    let error = |text: &str| read(text, Path::new("")).err().expect("it is no URDF");
    let sized = |size: &str| {
        format!(
            r#"<robot name="r"><link name="a"><visual><geometry><box size="{size}"/></geometry></visual></link></robot>"#
        )
    };
    assert!(error(&sized("${w} 1 1")).contains("xacro FILE"));
    assert!(error("<robot><xacro:arm/>").contains("xacro FILE"));
    // Well-formed, with a robot in it.
    let space = r#"<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:leg/>"#;
    let macros = sized("1 1 1").replace(r#"<robot name="r">"#, space);
    assert!(error(&macros).contains("xacro FILE"));
    assert!(error("<sdf version='1.6'><model name='r'/></sdf>").contains("<sdf>, not <robot>"));
    assert!(error(&sized("1 nan 1")).contains("link a has a number that is not finite"));
    let inertia = r#"<link name="a"><inertial><mass value="1"/><inertia ixx="nan" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;
    let heavy = sized("1 1 1").replace(r#"<link name="a">"#, inertia);
    assert!(error(&heavy).contains("link a has a number that is not finite"));
    let commented = sized("1 1 1").replace("<link", "<!-- ${w} <xacro:leg/> --><link");
    assert!(read(&commented, Path::new("")).is_ok());
    for plain in [sized("1 1"), "<robot".to_owned()] {
        let said = error(&plain);
        assert!(
            said.contains("not a URDF") && !said.contains("xacro"),
            "{said}"
        );
    }
}

/// Links are to be one tree, and names are to tell them apart.
#[test]
fn what_is_no_tree_is_named() {
    let link = |name: &str| format!(r#"<link name="{name}"/>"#);
    let joint = |[parent, child]: [&str; 2]| {
        format!(
            r#"<joint name="{parent}{child}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>"#
        )
    };
    let (to_a, a_to_b, b_to_a) = (["base", "a"], ["a", "b"], ["b", "a"]);
    for (links, joints, message) in [
        (&["a"][..], &[a_to_b][..], "link b, which does not exist"),
        (&["b"], &[], "no joint leads to base, b"),
        (&["base"], &[], "the name base is given twice"),
        (&["a"], &[to_a, to_a], "the name basea is given twice"),
        (&["a", "b"], &[to_a, b_to_a], "link a has two parents"),
        (&["a", "b"], &[a_to_b, b_to_a], "some links form a loop"),
        (&["a"], &[to_a, ["a", "base"]], "no link without a parent"),
    ] {
        let links: String = links.iter().copied().map(link).collect();
        let joints: String = joints.iter().copied().map(joint).collect();
        let text = format!(r#"<robot name="r">{BASE}{links}{joints}</robot>"#);
        let error = read(&text, Path::new("")).err().expect("it is no tree");
        assert!(error.contains(message), "{message}: {error}");
    }
    let bare = r#"<robot name="r"><link name="a"/></robot>"#;
    let error = read(bare, Path::new("")).err().expect("it has no surface");
    assert!(error.contains("no link has a geometry"), "{error}");
}

/// A mesh without area cannot be sampled: the other links are.
#[test]
fn a_link_that_cannot_be_sampled_is_left_out() {
    let folder = folder("urdf_flat");
    write_triangle(&folder.join("good.ply"), CORNERS);
    write_triangle(&folder.join("flat.ply"), [[0.1; 3]; 3]);
    let robot = read(&robot(&["flat.ply", "good.ply"]), &folder).unwrap();
    let (clouds, warnings) = clouds_of_links(&robot, 0.01).unwrap();
    let names: Vec<&str> = clouds.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names, ["base", "l1"]);
    let extents = clouds[1].cloud.bounds().extents();
    assert!(extents.distance(Vec3::new(0.1, 0.1, 0.0)) < 0.01);
    assert!(
        warnings[0].contains("link l0 cannot be made a cloud"),
        "{warnings:?}"
    );
    assert_eq!(warnings.len(), 1);
}
