//! Whether two meshes intersect, exactly: the truth that methods on their points are held against.
//!
//! Triangles are taken through parry's bounding volume hierarchy and tested by the signs of exact
//! determinants (Shewchuk 1997, doi:10.1007/PL00009321), so that no tolerance decides.

use rapier3d::math::{Pose, Vector};
use rapier3d::parry::bounding_volume::{Aabb, BoundingVolume};
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy};
use robust::{Coord3D, orient3d};
use tldi::glamx::{DPose3, DVec3, Pose3, Vec3};

/// By how much boxes are loosened, so that the rounding of their poses loses no triangle, in metres:
/// models are of the size of a few metres.
const LOOSE: f32 = 1e-5;

/// Triangles that are ready to be tested.
pub struct ExactMesh {
    triangles: Vec<[DVec3; 3]>,
    bvh: Bvh,
}

impl ExactMesh {
    /// The faces over these points, metres. Faces must be indices into the points.
    pub fn new(points: &[Vec3], faces: &[[u32; 3]]) -> Self {
        let corner = |i: u32| points[i as usize];
        let leaves = faces.iter().map(|face| {
            let [a, b, c] = face.map(corner);
            let vector = |v: Vec3| Vector::new(v.x, v.y, v.z);
            let bounds = Aabb::new(vector(a.min(b).min(c)), vector(a.max(b).max(c)));
            bounds.loosened(LOOSE)
        });
        let leaves: Vec<Aabb> = leaves.collect();
        Self {
            triangles: faces
                .iter()
                .map(|f| f.map(|i| corner(i).as_dvec3()))
                .collect(),
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves),
        }
    }

    /// Whether the surface meets the other one, which `pose` brings into the frame of this one.
    pub fn intersects(&self, other: &Self, pose: &Pose3) -> bool {
        let exact = DPose3::from_parts(
            pose.translation.as_dvec3(),
            pose.rotation.as_dquat().normalize(),
        );
        let rough: Pose = *pose;
        let near = self.bvh.leaf_pairs(&other.bvh, |a, b| {
            a.aabb().intersects(&b.aabb().transform_by(&rough))
        });
        for (a, b) in near {
            let moved = other.triangles[b as usize].map(|p| exact * p);
            if triangles_intersect(&self.triangles[a as usize], &moved) {
                return true;
            }
        }
        false
    }
}

/// Sign of the volume of the tetrahedron, exactly.
fn side([a, b, c, d]: [DVec3; 4]) -> i8 {
    let coordinate = |p: DVec3| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    };
    let volume = orient3d(coordinate(a), coordinate(b), coordinate(c), coordinate(d));
    i8::from(volume > 0.0) - i8::from(volume < 0.0)
}

/// Whether two triangles have a point in common. Of triangles in one plane that is said only where
/// an edge of one passes through the border of the other.
pub fn triangles_intersect(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    let edges = |t: &[DVec3; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    edges(a).into_iter().any(|edge| edge_meets(edge, b))
        || edges(b).into_iter().any(|edge| edge_meets(edge, a))
}

fn edge_meets([p, q]: [DVec3; 2], [a, b, c]: &[DVec3; 3]) -> bool {
    let (a, b, c) = (*a, *b, *c);
    let (at_p, at_q) = (side([a, b, c, p]), side([a, b, c, q]));
    if at_p * at_q > 0 || (at_p == 0 && at_q == 0) {
        return false;
    }
    let around = [side([p, q, a, b]), side([p, q, b, c]), side([p, q, c, a])];
    around.iter().all(|s| *s >= 0) || around.iter().all(|s| *s <= 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::cases;

    /// A regular tetrahedron.
    fn tetrahedron() -> ExactMesh {
        let points = [
            Vec3::new(1.0, 1.0, 1.0),
            Vec3::new(1.0, -1.0, -1.0),
            Vec3::new(-1.0, 1.0, -1.0),
            Vec3::new(-1.0, -1.0, 1.0),
        ];
        ExactMesh::new(&points, &[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    }

    #[test]
    fn a_vertex_through_a_face_and_edges_across_each_other() {
        let t = |p: [[f64; 3]; 3]| p.map(DVec3::from_array);
        let floor = t([[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]]);
        let spike = |y: f64| t([[0.0, y, 0.0], [0.1, y + 1.0, 0.0], [-0.1, y + 1.0, 0.0]]);
        assert!(triangles_intersect(&floor, &spike(-1e-12)));
        assert!(triangles_intersect(&floor, &spike(0.0)));
        assert!(!triangles_intersect(&floor, &spike(1e-12)));
        let beside = t([[2.0, -1.0, 0.0], [3.0, 1.0, 0.0], [2.0, 1.0, 1.0]]);
        assert!(!triangles_intersect(&floor, &beside));
    }

    /// No pair of triangles is lost that all pairs, one by one, find.
    #[test]
    fn no_near_pair_is_lost() {
        let (points, faces) = crate::bumpy_ball(100);
        let mesh = ExactMesh::new(&points, &faces);
        let mut met = [0; 2];
        for case in cases(310) {
            let exact = DPose3::from_parts(
                case.a_from_b.translation.as_dvec3(),
                case.a_from_b.rotation.as_dquat().normalize(),
            );
            let mut moved = mesh.triangles.iter().map(|t| t.map(|p| exact * p));
            let meets = moved.any(|b| mesh.triangles.iter().any(|a| triangles_intersect(a, &b)));
            assert_eq!(mesh.intersects(&mesh, &case.a_from_b), meets, "{case:?}");
            met[usize::from(meets)] += 1;
        }
        assert!(met.iter().all(|count| *count > 50), "{met:?}");
    }

    /// Whether they touch is known to the last bit, and does not depend on the order of corners.
    #[test]
    fn meshes_meet_where_they_do() {
        let mesh = tetrahedron();
        let flipped = {
            let points: Vec<Vec3> = vec![
                Vec3::new(-1.0, -1.0, 1.0),
                Vec3::new(-1.0, 1.0, -1.0),
                Vec3::new(1.0, -1.0, -1.0),
                Vec3::new(1.0, 1.0, 1.0),
            ];
            ExactMesh::new(&points, &[[2, 1, 3], [0, 2, 3], [1, 0, 3], [0, 1, 2]])
        };
        for (x, meets) in [
            (0.5, true),
            (1.99, true),
            (2.0, true),
            (2.01, false),
            (9.0, false),
        ] {
            let pose = Pose3::translation(x, 0.0, 0.0);
            // Edges at x = 1 and x = -1 cross at right angles when 2 apart.
            assert_eq!(mesh.intersects(&mesh, &pose), meets, "{x}");
            assert_eq!(mesh.intersects(&flipped, &pose), meets, "{x}");
            assert_eq!(flipped.intersects(&mesh, &pose), meets, "{x}");
        }
    }
}
