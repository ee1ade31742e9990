//! Where a look takes its points: from the cloud, or from those that an earlier look holds.

use super::cull;
use super::side::Side;
use crate::PointCloud;
use crate::pair::plan::SidePlan;

impl Side {
    /// Forgets the held points. Their memory stays.
    pub(super) fn release(&mut self) {
        self.is_held = false;
    }

    /// Fills `points` with every `stride`-th of the cloud in a region.
    pub(super) fn cull(&mut self, cloud: &PointCloud, plan: &SidePlan, stride: usize) {
        match self.is_held {
            true => self.points.thin_out(&self.held, stride),
            false => self.cull_cloud(cloud, plan, stride),
        }
    }

    /// The same, and holds all points of the region, if they are few, for the looks that follow.
    pub(super) fn cull_and_hold(&mut self, cloud: &PointCloud, plan: &SidePlan, stride: usize) {
        let (frame, region) = (&plan.frame_from_surface, &plan.region);
        if stride > 1 && !self.is_held && cull::are_few(cloud, frame, region) {
            self.cull_cloud(cloud, plan, 1);
            std::mem::swap(&mut self.points, &mut self.held);
            self.is_held = true;
        }
        self.cull(cloud, plan, stride);
    }

    /// Fills `points` with those in a window, part of the region of the look before, whose points are in `window`.
    pub(super) fn cull_window(&mut self, cloud: &PointCloud, plan: &SidePlan, stride: usize) {
        let all = match self.is_held {
            true => &self.held,
            false => &self.window,
        };
        match all.are_all() && stride == 1 {
            true => self.points.select(all, &plan.region),
            false => self.cull_cloud(cloud, plan, stride),
        }
    }

    fn cull_cloud(&mut self, cloud: &PointCloud, plan: &SidePlan, stride: usize) {
        let Self { cull, points, .. } = self;
        let (frame, region) = (&plan.frame_from_surface, &plan.region);
        cull::cull(cloud, frame, region, stride, cull, points);
    }
}
