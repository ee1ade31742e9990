//! Loose bodies in the reach of a robot.

use super::links::world_groups;
use super::placing::Placement;
use super::report::LooseBodyReport;
use crate::scene::BodyShape;
use crate::simulation::NamedCloud;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Mass per volume of the loose bodies in kg/m³: cardboard boxes with something in them.
const LOOSE_DENSITY: f32 = 150.0;
/// Width of a loose body in metres, and at least this many mean radii of the scan.
const LOOSE_SIZE: f32 = 0.12;
const LOOSE_RADII: f32 = 10.0;
/// Distance of the points of a loose body, as a share of its width.
const LOOSE_SPACING: f32 = 0.04;
/// Height of a loose body over its surface at the start, metres.
const LOOSE_DROP: f32 = 0.01;

pub(super) struct LooseBody {
    pub(super) name: String,
    pub(super) cloud: PointCloud<'static>,
    pub(super) handle: RigidBodyHandle,
    pub(super) collider: ColliderHandle,
    start: Vec3,
    pub(super) touched: bool,
}

/// Width of the bodies in metres for a scan with points of `scan_radius`.
pub(super) fn loose_size(scan_radius: f32) -> f32 {
    LOOSE_SIZE.max(LOOSE_RADII * scan_radius)
}

impl LooseBody {
    pub(super) fn report(&self, bodies: &RigidBodySet) -> LooseBodyReport {
        let body = &bodies[self.handle];
        LooseBodyReport {
            name: self.name.clone(),
            points: self.cloud.len(),
            translation: body.translation().to_array(),
            displacement: body.translation().distance(self.start),
            touched: self.touched,
            sleeping: body.is_sleeping(),
        }
    }
}

/// Bodies stand where the placement has them, their y axis up.
pub(super) fn lay_bodies(
    world: &mut PhysicsWorld,
    tldi: &TldiPipeline,
    up: Vec3,
    size: f32,
    placement: &Placement,
    seed: u64,
) -> Result<Vec<LooseBody>, CloudError> {
    let count = placement.bodies.len();
    let clouds = NamedCloud::generated(&BodyShape::WHOLE, count, LOOSE_SPACING, size, seed)?;
    let mut bodies = Vec::new();
    for (NamedCloud { name, cloud }, surface) in clouds.into_iter().zip(&placement.bodies) {
        let half_height = 0.5 * cloud.bounds().extents().y;
        let pose = Pose3::from_parts(
            *surface + (half_height + LOOSE_DROP) * up,
            Quat::from_rotation_arc(Vec3::Y, up),
        );
        let (handle, collider) = world.insert(
            RigidBodyBuilder::dynamic().pose(pose).angular_damping(1.0),
            tldi.collider(cloud.clone())
                .density(LOOSE_DENSITY)
                .collision_groups(world_groups()),
        );
        bodies.push(LooseBody {
            name,
            cloud,
            handle,
            collider,
            start: pose.translation,
            touched: false,
        });
    }
    Ok(bodies)
}
