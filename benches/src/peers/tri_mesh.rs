//! parry's triangle meshes, where a mesh is at hand: surfaces that the other peers know as points.

use super::{Found, Frame, Peer, touching, vector};
use crate::stopwatch::Stopwatch;
use rapier3d::math::Vector;
use rapier3d::parry::shape::{TriMesh, TriMeshFlags};
use tldi::glamx::Vec3;

/// A mesh of each body with rapier's contact manifolds.
pub struct TriMeshPeer {
    /// Of the frame before, where vertices are only moved.
    kept: Option<[TriMesh; 2]>,
    is_kept: bool,
    /// Of meshes that are built.
    flags: TriMeshFlags,
}

impl TriMeshPeer {
    /// Both meshes are built anew.
    pub fn rebuilt() -> Self {
        Self {
            kept: None,
            is_kept: false,
            flags: TriMeshFlags::empty(),
        }
    }

    /// The same for faces that wind outwards: normals at inner edges are corrected, and contacts from inside dropped.
    pub fn outward() -> Self {
        Self {
            flags: TriMeshFlags::FIX_INTERNAL_EDGES,
            ..Self::rebuilt()
        }
    }

    /// The meshes of the first frame get new vertices (`set_vertices`); its own build is not counted.
    pub fn updated() -> Self {
        Self {
            kept: None,
            is_kept: true,
            flags: TriMeshFlags::DEFORMABLE,
        }
    }
}

fn vertices(points: &[Vec3]) -> Vec<Vector> {
    points.iter().map(vector).collect()
}

/// `None` where a body has no face.
fn meshes(frame: &Frame, flags: TriMeshFlags) -> Option<[TriMesh; 2]> {
    let [faces_a, faces_b] = frame.faces?;
    let build = |points, faces: &[[u32; 3]]| {
        TriMesh::with_flags(vertices(points), faces.to_vec(), flags).ok()
    };
    Some([build(frame.a, faces_a)?, build(frame.b, faces_b)?])
}

impl Peer for TriMeshPeer {
    fn name(&self) -> String {
        let name = match (self.is_kept, self.flags.is_empty()) {
            (true, _) => "mesh set_vertices (TriMesh)",
            (false, true) => "mesh rebuild (TriMesh)",
            (false, false) => "mesh rebuild, outward (TriMesh)",
        };
        name.to_owned()
    }

    fn needs_faces(&self) -> bool {
        true
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        if self.is_kept {
            let fits = |kept: &[TriMesh; 2]| {
                kept[0].vertices().len() == frame.a.len()
                    && kept[1].vertices().len() == frame.b.len()
            };
            self.kept = self
                .kept
                .take()
                .filter(fits)
                .or_else(|| meshes(frame, self.flags));
        }
        let start = Stopwatch::of_thread();
        if self.is_kept {
            if let Some([a, b]) = &mut self.kept {
                a.set_vertices(&vertices(frame.a));
                b.set_vertices(&vertices(frame.b));
            }
        } else {
            self.kept = meshes(frame, self.flags);
        }
        let built = start.seconds();
        match &self.kept {
            Some([a, b]) => touching(a, b, &start, built),
            None => Found::new(&start, built, 0),
        }
    }
}
