//! What passes through clouds, and that a pipeline says so once for each collider.

use crate::TldiError;
use crate::narrow_phase::parts::{has_cloud, has_surface, part, part_count};
use crate::step::candidates::Candidate;
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet};

/// Why a collider passes through clouds.
///
/// ```
/// # use rapier3d::prelude::*;
/// # use rapier3d_tldi::prelude::*;
/// # let points: Vec<Vector> = (0..400)
/// #     .map(|i| 0.1 * Vector::new((i % 20) as f32, 0.0, (i / 20) as f32))
/// #     .collect();
/// # let scan = PointCloud::builder(&points).radius(0.1).build()?.into_owned();
/// # let mut world = PhysicsWorld::default();
/// # let mut tldi = TldiPipeline::new(TldiConfig::default())?;
/// # tldi.attach(&mut world);
/// # let (_, scan) = world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan));
/// # let ball = RigidBodyBuilder::dynamic().translation(Vector::new(1.0, 0.19, 1.0));
/// # let (ball, _) = world.insert(ball, ColliderBuilder::ball(0.2));
/// // A segment has no surface: `step` says so once.
/// use rapier3d_tldi::Passes;
/// let body = RigidBodyBuilder::dynamic().translation(Vector::new(1.0, 0.01, 0.5));
/// world.insert(body, ColliderBuilder::segment(-Vector::X, Vector::X));
/// let error = tldi.step(&mut world).unwrap_err();
/// assert!(matches!(error, TldiError::PassesThrough { reason: Passes::Line, .. }));
/// # let _ = (scan, ball);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Passes {
    /// Its shape, or a part of its compound, is a line or a point: a segment, a polyline, or a shape without width.
    Line,
    /// It is the skin of one of rapier's soft bodies, whose particles rapier holds up by its own tests.
    SoftBody,
}

impl std::fmt::Display for Passes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Line => {
                "its shape has a part without a surface (a segment, a polyline or what has no width): \
                 give it a width, as a capsule has"
            }
            Self::SoftBody => {
                "rapier's soft bodies do not collide with clouds: take a rigid body, or give the cloud's \
                 ground a shape of rapier's for it to rest on"
            }
        })
    }
}

/// Why the collider passes through clouds, if it does.
fn passes(collider: &Collider) -> Option<Passes> {
    let shape = collider.shape();
    let mut parts = (0..part_count(shape)).map(|i| part(shape, i).1);
    if collider.deformable_mesh_ref().is_some() {
        return Some(Passes::SoftBody);
    }
    (!parts.all(has_surface)).then_some(Passes::Line)
}

/// The colliders that were already reported to pass.
#[derive(Default)]
pub(crate) struct Told {
    colliders: Vec<ColliderHandle>,
    /// Not returned yet.
    next: Option<TldiError>,
}

impl Told {
    /// Looks for the first candidate that passes and was not reported so far.
    pub(crate) fn look_for_passing(&mut self, candidates: &[Candidate], colliders: &ColliderSet) {
        let passing = |[collider, other]: [ColliderHandle; 2]| {
            let reason = passes(colliders.get(collider)?)?;
            let is_new =
                has_cloud(colliders.get(other)?.shape()) && !self.colliders.contains(&collider);
            is_new.then_some(TldiError::PassesThrough {
                collider,
                cloud: other,
                reason,
            })
        };
        self.next = candidates.iter().find_map(|candidate| {
            let Candidate {
                collider1: c1,
                collider2: c2,
                ..
            } = *candidate;
            passing([c1, c2]).or_else(|| passing([c2, c1]))
        });
    }

    /// The report, once for each collider.
    pub(crate) fn take(&mut self) -> Result<(), TldiError> {
        let Some(error) = self.next.take() else {
            return Ok(());
        };
        if let TldiError::PassesThrough { collider, .. } = error {
            self.colliders.push(collider);
        }
        Err(error)
    }
}
