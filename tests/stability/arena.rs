//! A world of one method: what differs between methods ends here.

use super::case::{Setup, Stop};
use super::method::Method;
use super::surface::Surface;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::fmt::Display;

/// Length of a step in seconds.
pub(crate) const DT: f32 = 1.0 / 60.0;
/// Standard gravity in m/s².
pub(crate) const GRAVITY: f32 = 9.81;

/// How surfaces rub and rebound; the same on both sides of every contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Material {
    /// Coefficient of friction.
    pub(crate) friction: f32,
    /// Coefficient of restitution.
    pub(crate) restitution: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            friction: 0.5,
            restitution: 0.0,
        }
    }
}

/// Whether new points are the old ones, moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SamePoints {
    /// The surface deforms.
    Yes,
    /// The surface is sampled anew.
    No,
}

/// A body in an [`Arena`].
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// The rigid body.
    pub(crate) body: RigidBodyHandle,
    /// Its collider, or the first of several (primitives may need more than one).
    pub(crate) collider: ColliderHandle,
}

/// A world in which one method detects the collisions.
pub(crate) struct Arena {
    /// The world; everything but collision detection is rapier's.
    pub(crate) world: PhysicsWorld,
    tldi: Option<TldiPipeline>,
    method: Method,
    trace: bool,
    steps: usize,
}

fn failed(error: impl Display) -> Stop {
    Stop::Failed(error.to_string())
}

impl Arena {
    /// An empty world with gravity along -y.
    pub(crate) fn new(setup: &Setup) -> Result<Self, Stop> {
        let mut world = PhysicsWorld {
            gravity: -GRAVITY * Vector::Y,
            ..PhysicsWorld::default()
        };
        world.integration_parameters.dt = DT;
        let tldi = match setup.method {
            Method::Tldi => {
                let backend = setup.backend.open().map_err(failed)?;
                let pipeline = TldiPipeline::with_backend(setup.config, backend).map_err(failed)?;
                pipeline.attach(&mut world);
                Some(pipeline)
            }
            _ => None,
        };
        Ok(Self {
            world,
            tldi,
            method: setup.method,
            trace: setup.trace,
            steps: 0,
        })
    }

    /// How often the solver goes over all contacts in a step: rapier's default is 4.
    pub(crate) fn set_solver_iterations(&mut self, count: usize) {
        self.world.integration_parameters.num_solver_iterations = count;
    }

    /// Declares that lengths are about `unit` metres, as rapier asks for worlds that are not of
    /// human size. The cap on speeds stays where it is.
    pub(crate) fn set_length_unit(&mut self, unit: f32) {
        let parameters = &mut self.world.integration_parameters;
        parameters.length_unit = unit;
        parameters.normalized_max_linear_velocity =
            IntegrationParameters::default().normalized_max_linear_velocity * (1.0 / unit).max(1.0);
    }

    /// Adds a body with this surface and the surface's mass properties.
    pub(crate) fn insert(
        &mut self,
        body: RigidBodyBuilder,
        surface: &Surface,
        material: Material,
    ) -> Result<Placed, Stop> {
        let parts = surface.parts(self.method)?;
        let body = match surface.mass {
            Some(mass) => body.additional_mass_properties(mass),
            None => body,
        };
        let body = self.world.insert_body(body);
        let mut first = None;
        for (pose, shape) in parts {
            let builder = match shape.as_shape::<PointCloudShape>() {
                Some(cloud) => cloud_collider(cloud.clone()),
                None => ColliderBuilder::new(shape),
            };
            let collider = builder
                .position(pose)
                .density(0.0)
                .friction(material.friction)
                .restitution(material.restitution);
            let handle = self.world.insert_collider(collider, Some(body));
            first.get_or_insert(handle);
        }
        let collider = first.ok_or_else(|| failed("the surface has no parts"))?;
        Ok(Placed { body, collider })
    }

    /// Gives a body another surface, as a deforming or streaming one has in every frame: new
    /// points for a cloud, a new shape for the other methods. Where the points are the `same`,
    /// moved, a cloud is told so ([`TldiPipeline::deform`]).
    pub(crate) fn reshape(
        &mut self,
        placed: &Placed,
        surface: &Surface,
        same: SamePoints,
    ) -> Result<(), Stop> {
        if let Some(tldi) = &mut self.tldi {
            let (world, points) = (&mut self.world, &surface.samples.points);
            let normals = surface.given_normals();
            return match same {
                SamePoints::Yes => tldi.deform(world, placed.collider, points, normals),
                SamePoints::No => tldi.set_points(world, placed.collider, points, normals),
            }
            .map_err(failed);
        }
        let collider = &mut self.world.colliders[placed.collider];
        if let (Method::Trimesh, Ok(mesh)) = (self.method, &surface.mesh) {
            // A mesh that keeps its triangles is refitted, which is how rapier deforms meshes.
            let old = collider.shape().as_trimesh();
            if old.is_some_and(|old| old.vertices().len() == mesh.vertices.len())
                && let Some(old) = collider.shape_mut().as_trimesh_mut()
            {
                old.set_vertices(&mesh.vertices);
                return Ok(());
            }
        }
        let mut parts = surface.parts(self.method)?;
        let (Some((pose, shape)), true) = (parts.pop(), parts.is_empty()) else {
            return Err(Stop::Unfit("a shape of several parts cannot be replaced"));
        };
        collider.set_shape(shape);
        collider.set_position_wrt_parent(pose);
        Ok(())
    }

    /// Takes one step.
    pub(crate) fn step(&mut self) -> Result<(), Stop> {
        match &mut self.tldi {
            Some(tldi) => {
                tldi.step(&mut self.world).map_err(failed)?;
            }
            None => self.world.step(),
        }
        self.steps += 1;
        if let Some((_, body)) = self
            .world
            .bodies
            .iter()
            .find(|(_, b)| !b.position().is_finite())
        {
            let at = body.translation();
            return Err(failed(format!("a pose is not finite: {at}")));
        }
        if self.trace {
            self.write_trace();
        }
        Ok(())
    }

    /// Takes `count` steps.
    pub(crate) fn steps(&mut self, count: usize) -> Result<(), Stop> {
        (0..count).try_for_each(|_| self.step())
    }

    /// The body.
    pub(crate) fn body(&self, placed: &Placed) -> &RigidBody {
        &self.world.bodies[placed.body]
    }

    /// Where the body's origin is, metres.
    pub(crate) fn position(&self, placed: &Placed) -> Vector {
        self.body(placed).translation()
    }

    /// The body's speed in m/s.
    pub(crate) fn speed(&self, placed: &Placed) -> f32 {
        self.body(placed).linvel().length()
    }

    /// Contacts of a body: unit normal towards it, and signed distance in metres, of every point
    /// of every manifold.
    pub(crate) fn contacts(&self, placed: &Placed) -> Vec<(Vector, f32)> {
        let mut contacts = Vec::new();
        for pair in self.world.narrow_phase.contact_pairs_with(placed.collider) {
            let is_first = pair.collider1 == placed.collider;
            let frame = self.world.colliders[pair.collider1].rotation();
            for manifold in pair.manifolds() {
                let normal = frame * manifold.local_n1;
                let towards = if is_first { -normal } else { normal };
                contacts.extend(manifold.points.iter().map(|p| (towards, p.dist)));
            }
        }
        contacts
    }

    #[allow(clippy::print_stderr, reason = "a trace was asked for")]
    fn write_trace(&self) {
        for (handle, body) in self.world.bodies.iter().filter(|(_, b)| b.is_dynamic()) {
            let mut contacts = 0;
            let mut deepest = (Vector::ZERO, f32::INFINITY);
            for collider in body.colliders() {
                let of_body = Placed {
                    body: handle,
                    collider: *collider,
                };
                for (normal, distance) in self.contacts(&of_body) {
                    contacts += 1;
                    if distance < deepest.1 {
                        deepest = (normal, distance);
                    }
                }
            }
            let (index, _) = handle.into_raw_parts();
            let [p, v, w] = [body.translation(), body.linvel(), body.angvel()];
            let up = *body.rotation() * Vector::Y;
            eprintln!(
                "step {:4} body {index}: at {p:.5} up {up:.4} v {v:.4} w {w:.3} contacts {contacts} deepest {:.5} n {:.2}{}",
                self.steps,
                deepest.1,
                deepest.0,
                if body.is_sleeping() { " asleep" } else { "" },
            );
        }
    }
}
