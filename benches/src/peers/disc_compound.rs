//! A disc for each point, as rapier's own primitives.

use super::ball_compound::MOST_POINTS;
use super::{Found, Frame, Peer, compare_shapes, vector};
use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::parry::shape::{Compound, SharedShape};
use tldi::PointCloud;
use tldi::glamx::Vec3;

/// A compound of flat cylinders for each body, along normals estimated from neighbours; all built anew, with
/// rapier's contact manifolds.
pub struct DiscCompound;

/// Half the thickness of a disc, in its radii: flat, but a solid.
const HALF_THICKNESS: f32 = 0.05;

/// Neighbours that tell the normal of a point.
const NEIGHBORS: usize = 13;

impl Peer for DiscCompound {
    fn name(&self) -> String {
        "compound of discs".to_owned()
    }

    fn takes(&self, frame: &Frame) -> bool {
        frame.a.len().max(frame.b.len()) <= MOST_POINTS
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let disc = SharedShape::cylinder(HALF_THICKNESS * frame.radius, frame.radius);
        compare_shapes(frame, |points| {
            let cloud = PointCloud::builder(points)
                .radius(frame.radius)
                .pca_normals(NEIGHBORS)
                .build();
            let normals = cloud.as_ref().ok().and_then(PointCloud::normals);
            let placed = points.iter().enumerate().map(|(k, p)| {
                // Of too few points nothing tells where they face.
                let normal = normals.map_or(Vec3::Y, |normals| normals[k]);
                let turn = Rotation::from_rotation_arc(Vector::Y, vector(&normal));
                (Pose::from_parts(vector(p), turn), disc.clone())
            });
            Compound::new(placed.collect())
        })
    }
}
