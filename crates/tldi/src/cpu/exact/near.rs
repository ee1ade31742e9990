//! Stage `zone` for a cloud and an exact surface: which of the culled points are near it.
//!
//! The distance to a surface is expensive, and few points are near. So it is computed once for each cell of a coarse
//! grid that holds points. A point can be nearer than the middle of its cell by half the cell's diagonal, not by more.
//! The camera is aimed by an even selection of the points in cells that may be near. If that finds few near points,
//! all points are asked: no contact is too small to be found.

use crate::cpu::exact::placed::{CellDistances, Placed};
use crate::cpu::fold::is_coarse;
use crate::cpu::normals;
use crate::cpu::side::{NearSamples, Side};
use crate::cpu::zone::ZoneGrid;
use crate::pair::sampling::{AIM_SAMPLES, is_aim_sample};
use crate::stage::stage;
use crate::{Aabb, PointCloud};
use glamx::{Pose3, Vec3};

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
        if cloud.normals().is_some() {
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

    /// Fills `kept` with the points in cells that reach within `reach` metres of the surface, and `support`
    /// with those within `beyond` metres more; with coarser ones of cells farther away.
    fn in_near_cells(&mut self, exact: &Placed, reach: f32, beyond: f32) {
        let points = self.points.points();
        let CellDistances {
            least,
            fold,
            middles,
        } = &mut self.cell_distances;
        fold.clear();
        let count = points.len() as f32;
        let mut bounds = points.clone().fold(Aabb::EMPTY, Aabb::including);
        let mut grid = ZoneGrid::with_cells(&bounds, reach, count);
        if is_coarse(grid.inv_cell, reach) {
            fold.find(reach, points.clone());
            let folded = points.map(|point| fold.folded(point));
            bounds = folded.fold(Aabb::EMPTY, Aabb::including);
            grid = ZoneGrid::with_cells(&bounds, reach, count);
        }
        let half_diagonal = 0.5 * 3.0f32.sqrt() / grid.inv_cell;
        least.clear();
        least.resize(grid.dims.iter().product(), f32::NAN);
        middles.clear();
        if !fold.is_identity() {
            middles.resize(least.len(), Vec3::INFINITY);
        }
        self.support.clear();
        self.kept.clear();
        for i in 0..self.points.len() {
            let point = self.points.point(i);
            let folded = fold.folded(point);
            let at = ((folded - bounds.min) * grid.inv_cell).floor();
            let cell = [at.x, at.y, at.z];
            let [x, y, z] = [0, 1, 2].map(|k| (cell[k] as usize).min(grid.dims[k] - 1));
            let cell = (z * grid.dims[1] + y) * grid.dims[0] + x;
            let least = &mut least[cell];
            // After folding, one cell may hold points from both sides of a gap. The stored distance then holds for one side
            // only and is computed again for the other.
            let is_beyond_gap =
                (middles.get(cell)).is_some_and(|middle| middle.distance(point) > half_diagonal);
            if least.is_nan() || is_beyond_gap {
                let middle = Vec3::new(x as f32, y as f32, z as f32) + 0.5;
                let mut middle = bounds.min + middle / grid.inv_cell;
                if let Some(unfolded) = middles.get_mut(cell) {
                    middle += point - folded;
                    *unfolded = middle;
                }
                *least = exact.project(middle).0 - half_diagonal;
            }
            let further = self.points.further(i);
            if *least <= reach + beyond + (1.0 + normals::SUPPORT) * further {
                self.support.push(i as u32);
                if *least <= reach + further {
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
    use crate::cpu::exact::placed::MOST_STEPS;
    use crate::{RayHit, RaySurface, VirtualCamera};
    use fastrand::Rng;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A ball of one metre.
    struct Ball;

    impl RaySurface for Ball {
        fn bounds(&self) -> Aabb {
            Aabb {
                min: Vec3::NEG_ONE,
                max: Vec3::ONE,
            }
        }

        fn crossings(&self, _: Vec3, _: Vec3, _: f32, _: &mut Vec<RayHit>) {}

        fn project(&self, point: Vec3) -> (f32, Vec3) {
            (point.length() - 1.0, point.normalize_or(Vec3::Y))
        }

        fn is_closed(&self) -> bool {
            true
        }
    }

    fn random(rng: &mut Rng) -> Vec3 {
        Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5)
    }

    const REACH: f32 = 0.02;

    fn here(surface: &dyn RaySurface) -> Placed<'_> {
        Placed {
            surface,
            frame_from_surface: &Pose3::IDENTITY,
        }
    }

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
        side.in_near_cells(&here(&Ball), REACH, 0.5 * REACH);
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
        let (exact, frame) = (here(&Ball), Pose3::IDENTITY);
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

    /// Where a step is less than a depth can tell.
    #[test]
    fn columns_far_away_end() {
        let pose = Pose3::from_translation(1e7 * Vec3::Z);
        let ball = Placed {
            surface: &Ball,
            frame_from_surface: &pose,
        };
        let camera = VirtualCamera::along(Vec3::Z, 0.1);
        let [.., depth] = camera.view_from_point(pose.translation).to_array();
        assert!(ball.meets(&camera, [12.0, 0.0], [depth, depth + 1e6], 0.01));
    }

    /// The plane x = 0, which counts what it is asked.
    #[derive(Default)]
    struct Wall(AtomicUsize);

    impl RaySurface for Wall {
        fn bounds(&self) -> Aabb {
            Aabb {
                min: Vec3::NEG_INFINITY,
                max: Vec3::INFINITY,
            }
        }

        fn crossings(&self, _: Vec3, _: Vec3, _: f32, _: &mut Vec<RayHit>) {}

        fn project(&self, point: Vec3) -> (f32, Vec3) {
            self.0.fetch_add(1, Ordering::Relaxed);
            (point.x, Vec3::X)
        }

        fn is_closed(&self) -> bool {
            false
        }
    }

    /// Along a plane that is hardly farther than the reach.
    #[test]
    fn marches_along_a_plane_end() {
        let wall = Wall::default();
        let exact = here(&wall);
        let camera = VirtualCamera::along(Vec3::Z, 0.1);
        let across = |x: f32| {
            let view = camera.view_from_point(x * Vec3::X);
            camera.pixel_from_view(view)
        };
        assert!(exact.meets(&camera, across(1.06 * REACH), [0.0, 1e4], REACH));
        assert!(wall.0.load(Ordering::Relaxed) <= MOST_STEPS);
        // What is far enough is passed within them.
        assert!(!exact.meets(&camera, across(3.0 * REACH), [0.0, REACH], REACH));
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
        let exact = here(&Ball);
        assert!(side.near_exact(&cloud, &Pose3::IDENTITY, &exact, REACH, &mut samples));
        assert_eq!(side.near, near.map(|i| i as u32));
        for (k, i) in near.into_iter().enumerate() {
            let outward = points[i].normalize();
            assert!(samples.normals[k].dot(outward) > 0.999);
            assert!(samples.points[k].distance(outward) < 1e-5);
        }
    }

    /// By the least distance of a line to the ball's middle.
    #[test]
    fn columns_that_a_ball_is_near_are_found() {
        let mut rng = Rng::with_seed(21);
        let (mut near, mut far) = (0, 0);
        for _ in 0..2000 {
            let pose = Pose3::from_translation(2.0 * random(&mut rng));
            let ball = Placed {
                surface: &Ball,
                frame_from_surface: &pose,
            };
            let camera = VirtualCamera::along(random(&mut rng), 0.1);
            let pixel = [40.0 * (rng.f32() - 0.5), 40.0 * (rng.f32() - 0.5)];
            let depths = [-2.0 * rng.f32(), 2.0 * rng.f32()];
            let reach = 0.05 + 0.3 * rng.f32();
            let [from, to] = depths.map(|depth| camera.point_at(pixel[0], pixel[1], depth));
            let along = (pose.translation - from).dot(to - from) / (to - from).length_squared();
            let nearest = from.lerp(to, along.clamp(0.0, 1.0));
            let distance = nearest.distance(pose.translation) - 1.0;
            let found = ball.meets(&camera, pixel, depths, reach);
            if distance <= reach {
                assert!(found, "{distance} of {reach}");
                near += 1;
            } else if distance > 1.1 * reach {
                assert!(!found, "{distance} of {reach}");
                far += 1;
            }
        }
        assert!(near > 300 && far > 300, "{near} {far}");
    }
}
