//! Any peer after the points outside of the overlap of the bounds have been dropped.

use super::{Found, Frame, Peer};
use std::time::Instant;
use tldi::Aabb;
use tldi::glamx::Vec3;

/// The peer's best form: what cannot touch is dropped before anything is built.
pub struct Culled<P> {
    inner: P,
    a: Vec<Vec3>,
    b: Vec<Vec3>,
}

impl<P: Peer> Culled<P> {
    /// `inner` behind a cull.
    pub fn new(inner: P) -> Self {
        Self {
            inner,
            a: Vec::new(),
            b: Vec::new(),
        }
    }
}

fn bounds(points: &[Vec3]) -> Aabb {
    points.iter().fold(Aabb::EMPTY, |all, p| all.including(*p))
}

impl<P: Peer> Peer for Culled<P> {
    fn name(&self) -> String {
        format!("{}, culled", self.inner.name())
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let start = Instant::now();
        let margin = 2.0 * frame.radius;
        let overlap = bounds(frame.a)
            .loosened(margin)
            .intersection(bounds(frame.b).loosened(margin));
        for (kept, all) in [(&mut self.a, frame.a), (&mut self.b, frame.b)] {
            kept.clear();
            kept.extend(all.iter().filter(|p| overlap.contains(**p)));
        }
        let cull_seconds = start.elapsed().as_secs_f64();
        let mut found = Found::default();
        if !self.a.is_empty() && !self.b.is_empty() {
            found = self.inner.compare(&Frame {
                a: &self.a,
                b: &self.b,
                radius: frame.radius,
            });
        }
        found.build_seconds += cull_seconds;
        found
    }
}
