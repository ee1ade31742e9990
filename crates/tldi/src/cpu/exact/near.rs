//! Stage `zone` for a cloud and an exact surface: which of the culled points are near it.
//!
//! The distance to a surface is expensive, and few points are near. [Cells](super::cell_distances) tell which may be
//! near. The camera is aimed by an even selection of these. If that finds few near points, all of them are asked: no
//! contact is too small to be found.

use crate::PointCloud;
use crate::cpu::exact::placed::Placed;
use crate::cpu::normals;
use crate::cpu::side::{NearSamples, Side};
use crate::pair::sampling::{AIM_SAMPLES, is_aim_sample};
use crate::stage::stage;
use glamx::Pose3;

/// Fewest near points of a selection that stand for all. Half: no test of queries or contacts fails.
const ENOUGH: usize = 32;

impl Side {
    /// Finds the culled points within `reach` metres of an exact surface or inside it, coarser ones farther away, or
    /// an even selection of them; its points nearest to them go to `of_surface`. `false` where none is
    /// near.
    pub(crate) fn near_exact(
        &mut self,
        cloud: &PointCloud,
        frame_from_cloud: &Pose3,
        exact: &Placed,
        reach: f32,
        of_surface: &mut NearSamples,
    ) -> bool {
        let _stage = stage!("zone");
        self.near.clear();
        let support = self.support_radius(cloud);
        self.in_near_cells(exact, reach, support);
        let step = self.kept.len().div_ceil(AIM_SAMPLES) as u32;
        self.select_near(exact, reach, step, of_surface);
        if step > 1 && self.near.len() < ENOUGH {
            self.select_near(exact, reach, 1, of_surface);
        }
        if self.near.is_empty() {
            return false;
        }
        if cloud.known_normals(false).is_some() {
            self.sample_normals(cloud, frame_from_cloud);
        } else {
            let _stage = stage!("aim");
            self.near_samples.clear();
            // Neighbours are not among the samples.
            let around = self.neighborhood(cloud);
            let of_support = &self.support;
            normals::estimate(
                of_support,
                |i| self.points.point(i as usize),
                |k| self.near.binary_search(&of_support[k]).is_ok(),
                &around,
                &mut self.normals,
                &mut self.kept,
                &mut self.near_samples.normals,
            );
            self.place_samples();
        }
        true
    }

    /// Fills `kept` with the points that may be within `reach` metres of the surface, and `support` with those within
    /// `beyond` metres more; with coarser ones farther away.
    pub(crate) fn in_near_cells(&mut self, exact: &Placed, reach: f32, beyond: f32) {
        let cells = &mut self.cell_distances;
        cells.begin(self.points.points(), reach);
        self.support.clear();
        self.kept.clear();
        for i in 0..self.points.len() {
            let further = self.points.further(i);
            let within = reach + beyond + (1.0 + normals::SUPPORT) * further;
            let [least, _] = cells.bounds(exact, self.points.point(i), within);
            if least <= within {
                self.support.push(i as u32);
                if least <= reach + further {
                    self.kept.push(i as u32);
                }
            }
        }
    }

    /// Fills `near` with those of about every `step`-th of the points in `kept` that are near.
    fn select_near(&mut self, exact: &Placed, reach: f32, step: u32, of_surface: &mut NearSamples) {
        self.near.clear();
        of_surface.clear();
        self.deepest = 0.0;
        for &i in &self.kept {
            if !is_aim_sample(self.points.index[i as usize], step) {
                continue;
            }
            let point = self.points.point(i as usize);
            let (distance, normal) = exact.project(point);
            self.deepest = self.deepest.max(-distance);
            if distance <= reach + self.points.further(i as usize) {
                self.near.push(i);
                of_surface.normals.push(normal);
                of_surface.points.push(point - distance * normal);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::reach::Ring;
    use crate::cpu::cull::{self, Region};
    use crate::cpu::exact::test_surface::TestSurface;
    use fastrand::Rng;
    use glamx::Vec3;

    fn random(rng: &mut Rng) -> Vec3 {
        Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5)
    }

    const REACH: f32 = 0.02;

    fn side_of(cloud: &PointCloud) -> Side {
        let everything = Region {
            overlap: cloud.bounds(),
            other_from_frame: Pose3::IDENTITY,
            other_bounds: cloud.bounds(),
            ring: Ring::default(),
            included: 0.0,
        };
        let mut side = Side::default();
        let Side { cull, points, .. } = &mut side;
        cull::cull(cloud, &Pose3::IDENTITY, &everything, 1, cull, points);
        assert_eq!(points.len(), cloud.len());
        side
    }

    fn cloud_of(points: &[Vec3]) -> PointCloud<'_> {
        let builder = PointCloud::builder(points).radius(REACH);
        builder.build().expect("a valid cloud")
    }

    /// By brute force: points at up to three reaches from the ball.
    #[test]
    fn cells_hold_all_that_is_near() {
        let mut rng = Rng::with_seed(22);
        let heights = (0..20_000).map(|_| 3.0 * REACH * (2.0 * rng.f32() - 0.5));
        let heights: Vec<f32> = heights.collect();
        let at = |height: &f32| (1.0 + height) * random(&mut rng).normalize();
        let points: Vec<Vec3> = heights.iter().map(at).collect();
        let mut side = side_of(&cloud_of(&points));
        side.in_near_cells(&TestSurface::ball().here(), REACH, 0.5 * REACH);
        for (found, within) in [(&side.kept, REACH), (&side.support, 1.5 * REACH)] {
            for (i, height) in heights.iter().enumerate() {
                if *height < 0.999 * within {
                    let is_found = found.binary_search(&(i as u32)).is_ok();
                    assert!(is_found, "{height} of {within}");
                }
            }
            assert!(found.len() < points.len(), "all are near");
        }
    }

    /// Of points at up to three reaches from the ball those that a radius of their own brings near are found.
    #[test]
    fn coarse_points_are_near_farther_away() {
        let mut rng = Rng::with_seed(25);
        let at = |height: f32| (1.0 + height) * random(&mut rng).normalize();
        let heights: Vec<f32> = (0..400).map(|k| 3.0 * REACH * k as f32 / 400.0).collect();
        let points: Vec<Vec3> = heights.iter().copied().map(at).collect();
        // Every tenth five times as coarse.
        let radius = |k: usize| {
            if k.is_multiple_of(10) {
                REACH
            } else {
                0.2 * REACH
            }
        };
        let radii: Vec<f32> = (0..points.len()).map(radius).collect();
        let cloud = PointCloud::builder(&points).radii(radii);
        let cloud = cloud.build().expect("a valid cloud");
        let mut side = side_of(&cloud);
        let mut samples = NearSamples::default();
        let ball = TestSurface::ball();
        let (exact, frame) = (ball.here(), Pose3::IDENTITY);
        let mean = cloud.mean_radius();
        assert!(side.near_exact(&cloud, &frame, &exact, mean, &mut samples));
        for (k, &height) in heights.iter().enumerate() {
            let reach = radius(k).max(mean);
            if (height - reach).abs() > 1e-3 * reach {
                let is_near = side.near.binary_search(&(k as u32)).is_ok();
                assert_eq!(is_near, height < reach, "{height} of {reach}");
            }
        }
    }

    /// Three of 5,000 that are all in cells that can be near.
    #[test]
    fn a_few_of_many_are_found() {
        let mut rng = Rng::with_seed(23);
        let mut points: Vec<Vec3> = (0..5000)
            .map(|_| (1.0 + 1.2 * REACH) * random(&mut rng).normalize())
            .collect();
        let near = [700, 1500, 4900];
        for i in near {
            points[i] = (1.0 + 0.5 * REACH) * points[i].normalize();
        }
        let cloud = cloud_of(&points);
        let mut side = side_of(&cloud);
        let mut samples = NearSamples::default();
        let ball = TestSurface::ball();
        let exact = ball.here();
        assert!(side.near_exact(&cloud, &Pose3::IDENTITY, &exact, REACH, &mut samples));
        assert_eq!(side.near, near.map(|i| i as u32));
        for (k, i) in near.into_iter().enumerate() {
            let outward = points[i].normalize();
            assert!(samples.normals[k].dot(outward) > 0.999);
            assert!(samples.points[k].distance(outward) < 1e-5);
        }
    }
}
