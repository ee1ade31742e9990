//! Bodies that lie, fall or are pushed.

use crate::load;
use crate::scene::BodyShape;
use crate::world::Stage;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use serde::Serialize;
use tldi::glamx::{Pose3, Vec3};

/// A cloud and a name for it.
#[derive(Clone, Debug)]
pub struct NamedCloud {
    /// Name for reports.
    pub name: String,
    /// The cloud, centred on its origin.
    pub cloud: PointCloud<'static>,
}

impl NamedCloud {
    /// Generated bodies, one shape after the other, numbered from 1. Their largest extent is `size` metres, and the
    /// distance of their points the part `spacing` of a width.
    ///
    /// # Errors
    /// [`CloudError`] if a cloud cannot have that size.
    pub fn generated(
        shapes: &[BodyShape],
        count: usize,
        spacing: f32,
        size: f32,
        seed: u64,
    ) -> Result<Vec<Self>, CloudError> {
        (shapes.iter().cycle().take(count).enumerate())
            .map(|(k, shape)| {
                let cloud = load::body_from_surface(shape.sample(spacing, seed))?;
                Ok(Self {
                    name: format!("{} {}", shape.name(), k + 1),
                    cloud: load::resized(&cloud, size)?,
                })
            })
            .collect()
    }

    /// Radius in metres of a ball around the origin that holds each of these bodies.
    pub(crate) fn largest_radius<'a>(bodies: impl IntoIterator<Item = &'a Self>) -> f32 {
        let radii = bodies
            .into_iter()
            .map(|body| load::ball_radius(&body.cloud));
        radii.fold(0.0, f32::max)
    }
}

/// What a body is made of.
#[derive(Clone, Copy)]
pub(crate) struct Material {
    /// Mass per volume in kg/m³.
    pub(crate) density: f32,
    /// Angular damping, per second: what rolling costs on a real surface, which rapier does not model.
    pub(crate) rolling_resistance: f32,
}

/// A body in a world.
pub(crate) struct Body {
    pub(crate) name: String,
    pub(crate) handle: RigidBodyHandle,
    pub(crate) collider: ColliderHandle,
    /// Where it was put.
    start: Vec3,
}

impl Body {
    /// Puts a body into the world.
    pub(crate) fn insert(
        stage: &mut Stage,
        named: NamedCloud,
        world_from_body: Pose3,
        material: Material,
    ) -> Self {
        let NamedCloud { name, cloud } = named;
        let collider = stage.tldi.collider(cloud);
        let (handle, collider) = stage.world.insert(
            RigidBodyBuilder::dynamic()
                .pose(world_from_body)
                .angular_damping(material.rolling_resistance),
            collider.density(material.density),
        );
        Self {
            name,
            handle,
            collider,
            start: world_from_body.translation,
        }
    }

    /// Its points, in its own frame.
    pub(crate) fn cloud<'a>(&self, stage: &'a Stage) -> &'a PointCloud<'static> {
        let cloud = stage.cloud(self.collider);
        cloud.expect("it was made of a cloud")
    }

    /// How far it is from where it was put, metres.
    pub(crate) fn displacement(&self, stage: &Stage) -> f32 {
        stage.pose(self.handle).translation.distance(self.start)
    }

    /// What every report says of it.
    pub(crate) fn report(&self, stage: &Stage) -> PlacedBody {
        PlacedBody {
            name: self.name.clone(),
            points: self.cloud(stage).len(),
            translation: stage.pose(self.handle).translation.to_array(),
        }
    }
}

/// What every report says of a body.
#[derive(Clone, Debug, Serialize)]
pub struct PlacedBody {
    /// What it is, and its number.
    pub name: String,
    /// Number of points.
    pub points: usize,
    /// Position of the middle of its bounds after the last step, in the frame of the scan or the world, metres.
    pub translation: [f32; 3],
}
