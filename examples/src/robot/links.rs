//! Links as point clouds, and which of them must not collide with each other.

use super::description::Description;
use super::kinematics::Kinematics;
use anyhow::ensure;
use rapier3d::geometry::{Group, InteractionGroups, InteractionTestMode};
use rapier3d::parry::shape::TriMesh;
use rapier3d_tldi::sample_shape;
use tldi::glamx::{Pose3, Vec3};
use tldi::{KdTree, PointCloud};

/// The surface of one link.
#[derive(Clone, Debug)]
pub struct LinkCloud {
    /// Index of the link in the URDF.
    pub link: usize,
    /// Name of the link.
    pub name: String,
    /// Points in the frame of the link, normals outward.
    pub cloud: PointCloud<'static>,
}

/// Points that a link is at least across, in its second longest extent: less has no shape.
const LEAST_ACROSS: f32 = 10.0;
/// Points that a link is at most long: more would be finer than any contact needs.
const MOST_ALONG: f32 = 120.0;
/// Links that have a collision group of their own; the others share one.
const OWN_GROUPS: usize = 30;

/// Distance of neighbouring points in metres for a link with these extents: as fine as the scan, of this mean point
/// radius, which sets the pixels of their comparison, but fine enough for the link's own shape.
///
/// ```
/// use tldi::glamx::Vec3;
/// use tldi_examples::robot::link_spacing;
/// assert_eq!(link_spacing(Vec3::new(0.5, 0.2, 0.2), 0.01), 0.01);
/// let of_finger = link_spacing(Vec3::new(0.02, 0.05, 0.02), 0.01);
/// assert!((of_finger - 0.002).abs() < 1e-6);
/// ```
pub fn link_spacing(extents: Vec3, scan_radius: f32) -> f32 {
    let mut extents = extents.to_array();
    extents.sort_by(f32::total_cmp);
    let finest = extents[2] / MOST_ALONG;
    scan_radius.min(extents[1] / LEAST_ACROSS).max(finest)
}

/// The clouds of the links that have a surface, for a scan of this mean point radius in metres, and what is wrong with
/// those whose mesh cannot be sampled.
///
/// # Errors
/// If not even one can.
pub fn clouds_of_links(
    robot: &Description,
    scan_radius: f32,
) -> anyhow::Result<(Vec<LinkCloud>, Vec<String>)> {
    let mut clouds = Vec::new();
    let mut warnings = Vec::new();
    for (link, mesh) in robot.meshes.iter().enumerate() {
        if mesh.faces.is_empty() {
            continue;
        }
        let name = robot.urdf.links[link].name.clone();
        let spacing = link_spacing(mesh.bounds().extents(), scan_radius);
        let cloud = TriMesh::new(mesh.points.clone(), mesh.faces.clone())
            .map_err(anyhow::Error::from)
            .and_then(|mesh| Ok(sample_shape(&mesh, spacing)?));
        match cloud {
            Ok(cloud) => clouds.push(LinkCloud { link, name, cloud }),
            Err(error) => warnings.push(format!("link {name} cannot be made a cloud: {error}")),
        }
    }
    ensure!(!clouds.is_empty(), "{}", warnings.join("; "));
    Ok((clouds, warnings))
}

/// The pairs of clouds that must not collide with each other: neighbours along the joints, and
/// those that touch in the pose that `root_from_link` says.
pub(super) fn silent_pairs(
    kinematics: &Kinematics,
    clouds: &[LinkCloud],
    root_from_link: &[Pose3],
) -> Vec<[usize; 2]> {
    let trees: Vec<KdTree> = clouds.iter().map(|link| KdTree::new(&link.cloud)).collect();
    let touch = |i: usize, j: usize| {
        let (a, b) = (&clouds[i], &clouds[j]);
        let b_from_a = root_from_link[b.link].inverse() * root_from_link[a.link];
        let reach = a.cloud.mean_radius() + b.cloud.mean_radius();
        let b_bounds = b.cloud.bounds().loosened(reach);
        let near = |p| {
            let p = b_from_a * p;
            if !b_bounds.contains(p) {
                return false;
            }
            // Near the surface, or behind the nearest piece of it.
            trees[j].nearest(p, f32::INFINITY).is_some_and(|neighbor| {
                let k = neighbor.index;
                let normal = b.cloud.normals().map_or(p, |normals| normals[k]);
                neighbor.distance() < reach || (p - b.cloud.point(k)).dot(normal) < 0.0
            })
        };
        a.cloud.points().iter().copied().any(near)
    };
    let mut pairs = Vec::new();
    for i in 0..clouds.len() {
        for j in 0..i {
            let [a, b] = [clouds[i].link, clouds[j].link];
            if kinematics.are_adjacent(a, b) || touch(i, j) || touch(j, i) {
                pairs.push([j, i]);
            }
        }
    }
    pairs
}

/// Collision groups of `count` links of which `silent` pairs pass through each other. The world has
/// the last group.
pub(super) fn collision_groups(count: usize, silent: &[[usize; 2]]) -> Vec<InteractionGroups> {
    let group = |k: usize| Group::from_bits_retain(1 << k.min(OWN_GROUPS));
    (0..count)
        .map(|k| {
            let mut filter = Group::ALL;
            for &[i, j] in silent {
                if i == k {
                    filter.remove(group(j));
                } else if j == k {
                    filter.remove(group(i));
                }
            }
            // Links that share a group cannot be told apart.
            if k >= OWN_GROUPS {
                filter.remove(group(k));
            }
            InteractionGroups::new(group(k), filter, InteractionTestMode::And)
        })
        .collect()
}

/// Groups of all that is not the robot.
pub(super) fn world_groups() -> InteractionGroups {
    InteractionGroups::new(Group::GROUP_32, Group::ALL, InteractionTestMode::And)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load;
    use crate::robot::kinematics::JointModel;
    use crate::scene::BodyShape;

    /// A chain of pebbles: the third lies within the first, the fourth across it, the last far away.
    #[test]
    fn neighbours_and_what_overlaps_at_the_start_are_silent() {
        let joint = |parent| JointModel::in_chain(parent, Vec3::Z, Vec3::ZERO);
        let kinematics = Kinematics::new(5, (0..4).map(joint).collect());
        let sample = load::body_from_surface(BodyShape::Pebble.sample(0.05, 1)).unwrap();
        // Widths and places along x, metres.
        let links = [(1.0, 0.0), (0.3, 2.0), (0.2, 0.0), (0.3, 0.5), (0.3, 5.0)];
        let clouds: Vec<LinkCloud> = (links.iter().enumerate())
            .map(|(link, (size, _))| LinkCloud {
                link,
                name: format!("link {link}"),
                cloud: load::resized(&sample, *size).unwrap(),
            })
            .collect();
        let poses = links.map(|(_, x)| Pose3::from_translation(x * Vec3::X));
        let silent = silent_pairs(&kinematics, &clouds, &poses);
        assert_eq!(silent, [[0, 1], [0, 2], [1, 2], [0, 3], [2, 3], [3, 4]]);
    }

    #[test]
    fn groups_silence_pairs_and_nothing_else() {
        let silent = [[0, 1], [1, 4], [2, 40], [31, 5]];
        let groups = collision_groups(50, &silent);
        let world = world_groups();
        for i in 0..50 {
            assert!(groups[i].test(world), "{i}");
            for j in 0..i {
                let is_silent = silent.contains(&[j, i]) || silent.contains(&[i, j]);
                let collide = groups[i].test(groups[j]);
                if is_silent {
                    assert!(!collide, "{i} {j}");
                } else if i < OWN_GROUPS {
                    assert!(collide, "{i} {j}");
                }
            }
        }
    }
}
