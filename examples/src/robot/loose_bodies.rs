//! Loose bodies in the reach of a robot.

use super::links::world_groups;
use super::placing::Placement;
use super::report::LooseBodyReport;
use crate::bodies::{Body, Material, NamedCloud};
use crate::scene::BodyShape;
use crate::world::Stage;
use rapier3d_tldi::CloudError;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Cardboard boxes with something in them.
const MATERIAL: Material = Material {
    density: 150.0,
    rolling_resistance: 1.0,
};
/// Width of a loose body in metres, and at least this many mean radii of the scan.
const SIZE: f32 = 0.12;
const SIZE_IN_RADII: f32 = 10.0;
/// Distance of the points of a loose body, as a share of its width.
const SPACING: f32 = 0.04;
/// Height of a loose body over its surface at the start, metres.
const DROP: f32 = 0.01;

pub(super) struct LooseBody {
    pub(super) body: Body,
    /// Whether the robot touched it.
    pub(super) touched: bool,
}

/// Width of the bodies in metres for a scan with points of `scan_radius`.
pub(super) fn loose_size(scan_radius: f32) -> f32 {
    SIZE.max(SIZE_IN_RADII * scan_radius)
}

impl LooseBody {
    pub(super) fn report(&self, stage: &Stage) -> LooseBodyReport {
        LooseBodyReport {
            placed: self.body.report(stage),
            displacement: self.body.displacement(stage),
            touched: self.touched,
            sleeping: stage.world.bodies[self.body.handle].is_sleeping(),
        }
    }
}

/// Bodies stand where the placement has them, their y axis up.
pub(super) fn lay_bodies(
    stage: &mut Stage,
    up: Vec3,
    size: f32,
    placement: &Placement,
    seed: u64,
) -> Result<Vec<LooseBody>, CloudError> {
    let count = placement.bodies.len();
    let clouds = NamedCloud::generated(&BodyShape::WHOLE, count, SPACING, size, seed)?;
    let upright = Quat::from_rotation_arc(Vec3::Y, up);
    let lay = |(named, surface): (NamedCloud, &Vec3)| {
        let lift = 0.5 * named.cloud.bounds().extents().y + DROP;
        let pose = Pose3::from_parts(*surface + lift * up, upright);
        let body = Body::insert(stage, named, pose, MATERIAL);
        stage.world.colliders[body.collider].set_collision_groups(world_groups());
        LooseBody {
            body,
            touched: false,
        }
    };
    Ok(clouds.into_iter().zip(&placement.bodies).map(lay).collect())
}
