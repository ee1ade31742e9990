//! Takes the robot out of what its own camera sees.

use super::links::LinkCloud;
use rapier3d_tldi::{CloudError, PointCloudShape, points_on};
use tldi::glamx::{Pose3, Vec3};

/// Finds points that lie on or in a robot, wherever its links are.
pub(super) struct SelfFilter {
    links: Vec<(usize, PointCloudShape)>,
    margin: f32,
}

impl SelfFilter {
    /// A filter for links whose surface is seen up to `margin` metres off; see [`points_on`].
    pub(super) fn new(links: &[LinkCloud], margin: f32) -> Self {
        let shape = |link: &LinkCloud| (link.link, PointCloudShape::new(link.cloud.clone()));
        Self {
            links: links.iter().map(shape).collect(),
            margin,
        }
    }

    /// Whether each point lies on the robot, whose links are at `world_from_link` (by index of the
    /// URDF).
    pub(super) fn on_robot(
        &self,
        points: &[Vec3],
        world_from_link: &[Pose3],
    ) -> Result<Vec<bool>, CloudError> {
        let shapes: Vec<_> = (self.links.iter())
            .map(|(link, shape)| (world_from_link[*link], shape as _))
            .collect();
        points_on(points, &shapes, self.margin)
    }
}
