//! Ours, and what a user would pick instead, each in its own file behind one small trait.
//!
//! All get points that are new in every frame, and build what they need anew. Peers that take points
//! for balls answer whether balls overlap, and how many pairs of them do.

mod ball_compound;
mod bit_grid;
mod bvh;
mod culled;
mod disc_compound;
mod grid;
mod kd_tree;
mod refit;
mod tldi;
mod tri_mesh;
mod voxels;

pub use ball_compound::BallCompound;
pub use bit_grid::BitGrid;
pub use bvh::BvhRebuild;
pub use culled::Culled;
pub use disc_compound::DiscCompound;
pub use grid::Grid;
pub use kd_tree::KdTreeRebuild;
pub use refit::BvhRefit;
pub use tldi::{Method, TldiPeer};
pub use tri_mesh::TriMeshPeer;
pub use voxels::VoxelsRebuild;

use crate::stages::StageTimes;
use crate::stopwatch::Stopwatch;
use ::tldi::glamx::Vec3;
use ::tldi::{Backend, Work};
use rapier3d::geometry::ContactManifold;
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::partitioning::BvhBuildStrategy;
use rapier3d::parry::query::{DefaultQueryDispatcher, PersistentQueryDispatcher};
use rapier3d::parry::shape::Shape;

/// Points of both bodies in one frame, metres, in one frame of reference.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Of the first body.
    pub a: &'a [Vec3],
    /// Of the second body.
    pub b: &'a [Vec3],
    /// Radius of all balls, metres.
    pub radius: f32,
    /// Radii of the points of both, for methods that take one a point, metres.
    pub radii: Option<[&'a [f32]; 2]>,
    /// Faces over the points of both, as indices, where the points are those of meshes.
    pub faces: Option<[&'a [[u32; 3]]; 2]>,
    /// Of the second body relative to the first over a step, for methods that can make use of it, metres;
    /// zero: not known.
    pub motion: Vec3,
}

impl<'a> Frame<'a> {
    /// Points alone, with one radius for all.
    pub fn new(a: &'a [Vec3], b: &'a [Vec3], radius: f32) -> Self {
        Self {
            a,
            b,
            radius,
            radii: None,
            faces: None,
            motion: Vec3::ZERO,
        }
    }
}

/// What a peer found, and how long it took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// Seconds until queries could begin.
    pub build_seconds: f64,
    /// Seconds of the queries.
    pub query_seconds: f64,
    /// Whether anything touches.
    pub collides: bool,
    /// Pairs of balls, or contact points, that were found.
    pub contacts: usize,
    /// The deepest of them, of methods that tell it.
    pub deepest: Option<Deepest>,
    /// How much was modelled, of methods that tell it.
    pub work: Option<Work>,
}

/// The deepest contact of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deepest {
    /// From the first body towards the second, unit length, in the frame of reference of both.
    pub normal: Vec3,
    /// Metres; negative: a gap.
    pub depth: f32,
}

impl Found {
    /// Of a peer that touches where it has contacts; `start` began with the frame, and after `built`
    /// seconds of it the queries began.
    fn new(start: &Stopwatch, built: f64, contacts: usize) -> Self {
        Self {
            build_seconds: built,
            query_seconds: start.seconds() - built,
            collides: contacts > 0,
            contacts,
            deepest: None,
            work: None,
        }
    }
}

/// A method that a user would pick.
pub trait Peer {
    /// Name in tables.
    fn name(&self) -> String;

    /// Whether it works on meshes, not on points.
    fn needs_faces(&self) -> bool {
        false
    }

    /// What compared the last frame, of methods that have a backend.
    fn backend(&self) -> Option<&dyn Backend> {
        None
    }

    /// Whether the method is measured with such a frame.
    fn takes(&self, frame: &Frame) -> bool {
        frame.faces.is_some() || !self.needs_faces()
    }

    /// One frame, which the method [takes](Self::takes).
    fn compare(&mut self, frame: &Frame) -> Found;

    /// The stages of such a frame, which is compared once more, of methods that tell them. Telling them takes time, so
    /// that this is no frame to be timed.
    fn stages(&mut self, _frame: &Frame) -> Option<StageTimes> {
        None
    }
}

/// All peers, each as it is and in its best form: after a cull to the overlap of the bounds, where
/// that can be done.
pub fn all_peers() -> Vec<Box<dyn Peer>> {
    let bvh = |strategy| BvhRebuild { strategy };
    let (binned, ploc) = (BvhBuildStrategy::Binned, BvhBuildStrategy::Ploc);
    vec![
        Box::new(bvh(binned)),
        Box::new(Culled::new(bvh(binned))),
        Box::new(bvh(ploc)),
        Box::new(Culled::new(bvh(ploc))),
        Box::new(BvhRefit::default()),
        Box::new(VoxelsRebuild::default()),
        Box::new(Culled::new(VoxelsRebuild::default())),
        Box::new(KdTreeRebuild::default()),
        Box::new(Culled::new(KdTreeRebuild::default())),
        Box::new(Grid::default()),
        Box::new(Culled::new(Grid::default())),
        Box::new(BitGrid::default()),
        Box::new(Culled::new(BitGrid::default())),
        Box::new(BallCompound),
        Box::new(Culled::new(BallCompound)),
        Box::new(DiscCompound),
        Box::new(Culled::new(DiscCompound)),
        Box::new(TriMeshPeer::rebuilt()),
        Box::new(Culled::new(TriMeshPeer::rebuilt())),
        Box::new(TriMeshPeer::updated()),
    ]
}

/// Name of the GPU on which the first of these that has one compared its last frame.
pub fn adapter<'a>(peers: impl IntoIterator<Item = &'a dyn Peer>) -> Option<String> {
    let mut backends = peers.into_iter().filter_map(|peer| peer.backend());
    backends.find_map(|backend| backend.adapter().map(str::to_owned))
}

#[cfg(test)]
mod tests;

/// As parry has it.
fn vector(p: &Vec3) -> Vector {
    Vector::new(p.x, p.y, p.z)
}

/// One frame of a peer that builds a shape of each body anew.
fn compare_shapes<S: Shape>(frame: &Frame, mut build: impl FnMut(&[Vec3]) -> S) -> Found {
    let start = Stopwatch::of_thread();
    let (a, b) = (build(frame.a), build(frame.b));
    let built = start.seconds();
    touching(&a, &b, &start, built)
}

/// Contacts of two shapes in one frame of reference that touch, by rapier's manifolds, which must know
/// the shapes. The frame began with `start`, the queries `built` seconds later.
fn touching(a: &dyn Shape, b: &dyn Shape, start: &Stopwatch, built: f64) -> Found {
    let mut manifolds: Vec<ContactManifold> = Vec::new();
    DefaultQueryDispatcher
        .contact_manifolds(&Pose::IDENTITY, a, b, 0.0, &mut manifolds, &mut None)
        .expect("rapier has manifolds of these shapes");
    let mut contacts = 0;
    let mut deepest: Option<(f32, &ContactManifold)> = None;
    for manifold in &manifolds {
        for point in manifold.points.iter().filter(|point| point.dist <= 0.0) {
            contacts += 1;
            if deepest.is_none_or(|(dist, _)| point.dist < dist) {
                deepest = Some((point.dist, manifold));
            }
        }
    }
    let deepest = deepest.map(|(dist, manifold)| {
        let part = manifold.subshape_pos1().copied().unwrap_or(Pose::IDENTITY);
        let normal = part.rotation * manifold.local_n1;
        Deepest {
            normal: Vec3::new(normal.x, normal.y, normal.z),
            depth: -dist,
        }
    });
    Found {
        deepest,
        ..Found::new(start, built, contacts)
    }
}
