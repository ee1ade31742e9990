//! Surfaces for tests, which count how often they are asked for a distance. They tell nothing else.

use crate::cpu::exact::placed::Placed;
use crate::{Aabb, RayHit, RaySurface};
use glamx::{Pose3, Vec3};
use std::sync::atomic::{AtomicUsize, Ordering};

pub(super) struct TestSurface {
    project: fn(Vec3) -> (f32, Vec3),
    asked: AtomicUsize,
}

impl TestSurface {
    /// A ball of one metre.
    pub(super) fn ball() -> Self {
        Self {
            project: |point| (point.length() - 1.0, point.normalize_or(Vec3::Y)),
            asked: AtomicUsize::new(0),
        }
    }

    /// The plane x = 0.
    pub(super) fn wall() -> Self {
        Self {
            project: |point| (point.x, Vec3::X),
            asked: AtomicUsize::new(0),
        }
    }

    pub(super) fn asked(&self) -> usize {
        self.asked.load(Ordering::Relaxed)
    }

    pub(super) fn here(&self) -> Placed<'_> {
        Placed {
            surface: self,
            frame_from_surface: &Pose3::IDENTITY,
        }
    }
}

impl RaySurface for TestSurface {
    fn bounds(&self) -> Aabb {
        Aabb::EMPTY
    }

    fn crossings(&self, _: Vec3, _: Vec3, _: f32, _: &mut Vec<RayHit>) {}

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        self.asked.fetch_add(1, Ordering::Relaxed);
        (self.project)(point)
    }

    fn is_closed(&self) -> bool {
        true
    }
}
