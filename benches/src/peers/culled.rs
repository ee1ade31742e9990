//! Any peer after the points outside of the overlap of the bounds have been dropped.

use super::{Found, Frame, Peer};
use crate::placements::bounds;
use crate::stopwatch::Stopwatch;
use tldi::Aabb;
use tldi::glamx::Vec3;

/// The peer's best form: what cannot touch is dropped before anything is built.
pub struct Culled<P> {
    inner: P,
    kept: [Kept; 2],
}

/// What is left of a body.
#[derive(Default)]
struct Kept {
    points: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
    /// New number of every vertex of a mesh, or [`DROPPED`].
    numbers: Vec<u32>,
}

const DROPPED: u32 = u32::MAX;

impl<P: Peer> Culled<P> {
    /// `inner` behind a cull.
    pub fn new(inner: P) -> Self {
        Self {
            inner,
            kept: Default::default(),
        }
    }
}

impl Kept {
    fn keep_points(&mut self, points: &[Vec3], overlap: &Aabb) {
        self.points.clear();
        self.points
            .extend(points.iter().filter(|p| overlap.contains(**p)));
    }

    /// Faces whose bounds reach into the overlap, with their vertices.
    fn keep_faces(&mut self, points: &[Vec3], faces: &[[u32; 3]], overlap: &Aabb) {
        self.points.clear();
        self.faces.clear();
        self.numbers.clear();
        self.numbers.resize(points.len(), DROPPED);
        for face in faces {
            let corners = face.map(|i| points[i as usize]);
            if bounds(&corners).intersection(*overlap).is_empty() {
                continue;
            }
            let numbered = face.map(|i| {
                let number = &mut self.numbers[i as usize];
                if *number == DROPPED {
                    *number = self.points.len() as u32;
                    self.points.push(points[i as usize]);
                }
                *number
            });
            self.faces.push(numbered);
        }
    }
}

impl<P: Peer> Peer for Culled<P> {
    fn name(&self) -> String {
        format!("{}, culled", self.inner.name())
    }

    fn needs_faces(&self) -> bool {
        self.inner.needs_faces()
    }

    fn takes(&self, frame: &Frame) -> bool {
        self.inner.takes(frame)
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let start = Stopwatch::of_thread();
        let margin = 2.0 * frame.radius;
        let overlap = bounds(frame.a)
            .loosened(margin)
            .intersection(bounds(frame.b).loosened(margin));
        let all_faces = frame.faces.filter(|_| self.needs_faces());
        for (side, points) in [frame.a, frame.b].into_iter().enumerate() {
            match all_faces {
                Some(faces) => self.kept[side].keep_faces(points, faces[side], &overlap),
                None => self.kept[side].keep_points(points, &overlap),
            }
        }
        let cull_seconds = start.seconds();
        let mut found = Found::default();
        let [a, b] = &self.kept;
        if !a.points.is_empty() && !b.points.is_empty() {
            found = self.inner.compare(&Frame {
                faces: all_faces.map(|_| [&a.faces[..], &b.faces[..]]),
                ..Frame::new(&a.points, &b.points, frame.radius)
            });
        }
        found.build_seconds += cull_seconds;
        found
    }
}
