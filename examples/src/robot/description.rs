//! Reads a URDF: links, joints, and where its meshes lie.

use super::completed::completed;
use super::geometry::{Problem, mesh_of};
use super::inertia::{align_inertia, fill_inertia};
use super::kinematics::{JointKind, JointModel, Kinematics};
use super::mimic::{Mimic, follows_itself, resolved};
use super::packages::MeshFolders;
use crate::mesh::Mesh;
use rapier3d_urdf::urdf_rs;
use roxmltree::Document;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use thiserror::Error;
use tldi::glamx::{EulerRot, Pose3, Quat, Vec3};

/// The robot that is used where none is given: an arm with a gripper, of boxes, cylinders and
/// spheres.
pub const BUILT_IN: &str = include_str!("built_in.urdf");

/// A robot that was read.
pub struct Description {
    /// As in the file, but for limits that were swapped, and inertias, which are about the axes of their links.
    pub urdf: urdf_rs::Robot,
    /// Its joints.
    pub kinematics: Kinematics,
    /// The surface of each link in the link's frame, metres; empty where it has none.
    pub meshes: Vec<Mesh>,
    /// What could not be used, for people.
    pub warnings: Vec<String>,
}

/// Why a URDF cannot be used.
#[derive(Debug, Error)]
pub enum DescriptionError {
    /// The file cannot be read.
    #[error("the URDF {path} cannot be read: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// It is not URDF.
    #[error("this is not a URDF that can be used: {0}")]
    Syntax(String),
    /// It is made by xacro.
    #[error(
        "this is a xacro file, not a URDF: expand it first, as with `xacro FILE > robot.urdf` ({0})"
    )]
    Xacro(String),
    /// Two links or two joints have one name.
    #[error("the name {0} is given twice: names of links and of joints must be unique")]
    Twice(String),
    /// A joint connects links that do not exist.
    #[error("joint {joint} connects to link {link}, which does not exist")]
    NoSuchLink {
        /// The joint.
        joint: String,
        /// The link that is missing.
        link: String,
    },
    /// The links do not form one tree.
    #[error("the links do not form one tree: {0}")]
    NotATree(String),
    /// A number is not finite.
    #[error("{0} has a number that is not finite")]
    NotFinite(String),
    /// Not one link has a surface.
    #[error("no link has a geometry that could be used: {}", .0.join("; "))]
    NoGeometry(Vec<String>),
}

impl Description {
    /// Reads the file at `path`; meshes are looked for beside it and in `packages`, see [`MeshFolders::new`].
    ///
    /// # Errors
    /// [`DescriptionError`].
    pub fn from_file(path: &Path, packages: &[PathBuf]) -> Result<Self, DescriptionError> {
        let text = std::fs::read_to_string(path).map_err(|source| DescriptionError::Io {
            path: path.to_owned(),
            source,
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::from_text(&text, &MeshFolders::new(folder, packages))
    }

    /// Reads a URDF. A link's collision geometry is used or, where it has none, its visual one. What is missing is named
    /// in the warnings.
    ///
    /// # Errors
    /// [`DescriptionError`].
    pub fn from_text(text: &str, folders: &MeshFolders) -> Result<Self, DescriptionError> {
        let mut urdf = urdf_rs::read_from_string(&completed(&document(text)?))
            .map_err(|error| DescriptionError::Syntax(error.to_string()))?;
        urdf.links.iter().try_for_each(check_numbers)?;
        let mut warnings = Vec::new();
        check_limits(&mut urdf, &mut warnings);
        let kinematics = kinematics_of(&urdf, &mut warnings)?;
        let mut missing = Vec::new();
        let meshes: Vec<Mesh> = (urdf.links.iter())
            .map(|link| link_mesh(link, folders, &mut missing, &mut warnings))
            .collect();
        warnings.extend(folders.missing(&missing));
        align_inertia(&mut urdf);
        fill_inertia(&mut urdf, &meshes, &mut warnings);
        if meshes.iter().all(|mesh| mesh.faces.is_empty()) {
            return Err(DescriptionError::NoGeometry(warnings));
        }
        Ok(Self {
            urdf,
            kinematics,
            meshes,
            warnings,
        })
    }
}

/// The pose that an `<origin>` stands for: roll, pitch and yaw about fixed axes.
pub(super) fn pose_of(origin: &urdf_rs::Pose) -> Pose3 {
    let [x, y, z] = origin.xyz.0.map(|c| c as f32);
    let [roll, pitch, yaw] = origin.rpy.0.map(|c| c as f32);
    Pose3::from_parts(
        Vec3::new(x, y, z),
        Quat::from_euler(EulerRot::ZYX, yaw, pitch, roll),
    )
}

/// Lower limits above upper ones are swapped, and joints without room between them are told.
fn check_limits(urdf: &mut urdf_rs::Robot, warnings: &mut Vec<String>) {
    use urdf_rs::JointType::{Prismatic, Revolute};
    for joint in &mut urdf.joints {
        let limit = &mut joint.limit;
        if ![Prismatic, Revolute].contains(&joint.joint_type) {
            continue;
        }
        if limit.lower > limit.upper {
            warnings.push(format!("joint {}: its limits are swapped", joint.name));
            std::mem::swap(&mut limit.lower, &mut limit.upper);
        } else if limit.lower == limit.upper {
            warnings.push(format!(
                "joint {} cannot move: its <limit> is missing, or `lower` and `upper` are equal",
                joint.name
            ));
        }
    }
}

fn link_mesh(
    link: &urdf_rs::Link,
    folders: &MeshFolders,
    missing: &mut Vec<String>,
    warnings: &mut Vec<String>,
) -> Mesh {
    let collision = link.collision.iter().map(|c| (&c.geometry, &c.origin));
    let visual = link.visual.iter().map(|v| (&v.geometry, &v.origin));
    for parts in [collision.collect::<Vec<_>>(), visual.collect()] {
        let mut whole = Mesh::default();
        for (geometry, origin) in parts {
            match mesh_of(geometry, folders) {
                Ok(mesh) => whole.append(&mesh, &pose_of(origin)),
                Err(Problem::Missing(name)) if missing.contains(&name) => {}
                Err(Problem::Missing(name)) => missing.push(name),
                Err(Problem::Unusable(problem)) => {
                    warnings.push(format!("link {}: {problem}", link.name));
                }
            }
        }
        if !whole.faces.is_empty() {
            return whole;
        }
    }
    Mesh::default()
}

fn kinematics_of(
    urdf: &urdf_rs::Robot,
    warnings: &mut Vec<String>,
) -> Result<Kinematics, DescriptionError> {
    let link_of = indices(urdf.links.iter().map(|link| &link.name))?;
    let joint_of = indices(urdf.joints.iter().map(|joint| &joint.name))?;
    let mut joints = Vec::new();
    for joint in &urdf.joints {
        let link = |name: &String| {
            let found = link_of.get(name).copied();
            found.ok_or_else(|| DescriptionError::NoSuchLink {
                joint: joint.name.clone(),
                link: name.clone(),
            })
        };
        let (parent, child) = (link(&joint.parent.link)?, link(&joint.child.link)?);
        joints.push(joint_model(joint, parent, child, warnings)?);
    }
    set_mimics(urdf, &joint_of, &mut joints, warnings)?;
    check_root(urdf, &joints)?;
    let kinematics = Kinematics::new(urdf.links.len(), joints);
    if !kinematics.is_connected() {
        let loops = "some links form a loop".to_owned();
        return Err(DescriptionError::NotATree(loops));
    }
    Ok(kinematics)
}

/// Tells joints which one they follow, all through chains of mimics. Those that cannot are named.
fn set_mimics(
    urdf: &urdf_rs::Robot,
    joint_of: &HashMap<&String, usize>,
    joints: &mut [JointModel],
    warnings: &mut Vec<String>,
) -> Result<(), DescriptionError> {
    let told = |(k, joint): (usize, &urdf_rs::Joint)| {
        let mimic = joint.mimic.as_ref()?;
        let leader = *joint_of.get(&mimic.joint)?;
        let is_driven = [k, leader].iter().all(|&k| joints[k].kind.is_driven());
        let numbers = (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
        is_driven.then_some((leader, numbers.0, numbers.1))
    };
    let told: Vec<Option<Mimic>> = urdf.joints.iter().enumerate().map(told).collect();
    let mimics = resolved(&told);
    for (k, joint) in urdf.joints.iter().enumerate() {
        let Some(mimic) = &joint.mimic else { continue };
        joints[k].mimic = mimics[k].map(|(root, by, offset)| (root, by as f32, offset as f32));
        let own = [mimic.multiplier, mimic.offset].into_iter().flatten();
        let composed = (joints[k].mimic.iter()).flat_map(|(_, by, offset)| [*by, *offset]);
        let mut numbers = own.map(|number| number as f32).chain(composed);
        if !numbers.all(f32::is_finite) {
            return Err(DescriptionError::NotFinite(format!("joint {}", joint.name)));
        }
        if mimics[k].is_none() {
            let reason = match follows_itself(&told, k) {
                true => ", which follows it",
                false => "",
            };
            warnings.push(format!(
                "joint {} cannot mimic {}{reason}: it is driven by itself",
                joint.name, mimic.joint
            ));
        }
    }
    Ok(())
}

/// The index of each name.
fn indices<'a>(
    names: impl Iterator<Item = &'a String>,
) -> Result<HashMap<&'a String, usize>, DescriptionError> {
    let mut indices = HashMap::new();
    for (k, name) in names.enumerate() {
        if indices.insert(name, k).is_some() {
            return Err(DescriptionError::Twice(name.clone()));
        }
    }
    Ok(indices)
}

/// The XML of a URDF. Fails for what is XML, but of another kind.
fn document(text: &str) -> Result<Document<'_>, DescriptionError> {
    let document = Document::parse(text).map_err(|error| {
        let kind = match text.contains("xacro:") {
            true => DescriptionError::Xacro,
            false => DescriptionError::Syntax,
        };
        kind(error.to_string())
    })?;
    let root = document.root_element().tag_name().name();
    if root != "robot" {
        let reason = format!("its root element is <{root}>, not <robot>");
        return Err(DescriptionError::Syntax(reason));
    }
    let of_xacro = document.descendants().find_map(|node| {
        let is_tag = (node.tag_name().namespace()).is_some_and(|space| space.contains("xacro"));
        let attribute =
            (node.attributes()).find(|a| ["${", "$("].iter().any(|s| a.value().contains(s)));
        match attribute {
            _ if is_tag => Some(format!("xacro:{}", node.tag_name().name())),
            Some(attribute) => Some(attribute.value().to_owned()),
            None => None,
        }
    });
    of_xacro.map_or(Ok(document), |found| Err(DescriptionError::Xacro(found)))
}

/// Fails for a link with a number that is not finite.
fn check_numbers(link: &urdf_rs::Link) -> Result<(), DescriptionError> {
    use urdf_rs::Geometry;
    let of_pose = |pose: &urdf_rs::Pose| [pose.xyz.0, pose.rpy.0].concat();
    let of_geometry = |geometry: &Geometry| match geometry {
        Geometry::Box { size } => size.0.to_vec(),
        Geometry::Cylinder { radius, length } | Geometry::Capsule { radius, length } => {
            vec![*radius, *length]
        }
        Geometry::Sphere { radius } => vec![*radius],
        Geometry::Mesh { scale, .. } => scale.map_or(vec![], |scale| scale.0.to_vec()),
    };
    let urdf_rs::Inertial {
        origin,
        mass,
        inertia: i,
    } = &link.inertial;
    let of_mass = [mass.value, i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz];
    let visual = (link.visual.iter()).map(|v| (&v.origin, &v.geometry));
    let collision = (link.collision.iter()).map(|c| (&c.origin, &c.geometry));
    let of_shapes =
        (visual.chain(collision)).flat_map(|(pose, of)| [of_pose(pose), of_geometry(of)].concat());
    let mut numbers = of_mass.into_iter().chain(of_pose(origin)).chain(of_shapes);
    match numbers.all(f64::is_finite) {
        true => Ok(()),
        false => Err(DescriptionError::NotFinite(format!("link {}", link.name))),
    }
}

fn joint_model(
    joint: &urdf_rs::Joint,
    parent: usize,
    child: usize,
    warnings: &mut Vec<String>,
) -> Result<JointModel, DescriptionError> {
    use urdf_rs::JointType;
    let axis = Vec3::from(joint.axis.xyz.0.map(|c| c as f32)).normalize_or(Vec3::X);
    let mut limits = [joint.limit.lower as f32, joint.limit.upper as f32];
    let kind = match joint.joint_type {
        JointType::Revolute => JointKind::Revolute,
        JointType::Continuous => JointKind::Continuous,
        JointType::Prismatic => JointKind::Prismatic,
        JointType::Fixed => JointKind::Fixed,
        JointType::Floating | JointType::Planar | JointType::Spherical => {
            warnings.push(format!(
                "joint {} is {:?}: it moves freely, without a motor",
                joint.name, joint.joint_type
            ));
            JointKind::Free
        }
    };
    if kind == JointKind::Continuous {
        limits = [f32::NEG_INFINITY, f32::INFINITY];
    }
    let origin = pose_of(&joint.origin);
    let numbers = [joint.limit.effort, joint.limit.velocity].map(|n| n as f32);
    let finite = origin.translation.is_finite()
        && origin.rotation.is_finite()
        && numbers.iter().all(|n| n.is_finite())
        && !limits.iter().any(|limit| limit.is_nan());
    if !finite {
        return Err(DescriptionError::NotFinite(format!("joint {}", joint.name)));
    }
    Ok(JointModel {
        name: joint.name.clone(),
        kind,
        parent,
        child,
        parent_from_joint: origin,
        axis,
        limits,
        max_effort: Some(numbers[0]).filter(|effort| *effort > 0.0),
        max_speed: Some(numbers[1]).filter(|speed| *speed > 0.0),
        mimic: None,
    })
}

/// Fails unless one link, and no other, has no parent, and no link has two.
fn check_root(urdf: &urdf_rs::Robot, joints: &[JointModel]) -> Result<(), DescriptionError> {
    let not_a_tree = |text: String| Err(DescriptionError::NotATree(text));
    let mut children = HashSet::new();
    for joint in joints {
        if !children.insert(joint.child) {
            let name = &urdf.links[joint.child].name;
            return not_a_tree(format!("link {name} has two parents"));
        }
    }
    let links = urdf.links.iter().enumerate();
    let roots: Vec<&str> = (links.filter(|(k, _)| !children.contains(k)))
        .map(|(_, link)| link.name.as_str())
        .collect();
    match roots.len() {
        0 => not_a_tree("there is no link without a parent".to_owned()),
        1 => Ok(()),
        _ => not_a_tree(format!("no joint leads to {}", roots.join(", "))),
    }
}
