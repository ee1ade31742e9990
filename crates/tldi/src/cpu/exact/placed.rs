//! An exact surface where a pair has it, and whether columns come near it.

use crate::cpu::columns::rect_of;
use crate::cpu::exact::cell_distances::CellDistances;
use crate::cpu::rect::Rect;
use crate::{RaySurface, VirtualCamera};
use glamx::{Pose3, Vec3};

/// A march ends where the surface is beyond its reach by less than this share of it. Without this, it would take ever
/// smaller steps. Half or twice: no test of queries fails.
const LEAST_FREE: f32 = 0.05;

/// Steps of a march along a column, after which a surface counts as near. Spheres that grow past a surface leave it in
/// about ten; a march along a plane that is hardly farther than the reach would take as many as the column is long.
/// Half as many draw a few columns more in which nothing meets; twice as many cost as much again.
const MOST_STEPS: usize = 64;

/// Least step that a march takes by a bound, as a share of what the bound leaves open: shorter ones would be many. Half
/// or twice: no test of columns fails.
const LEAST_STEP: f32 = 0.25;

/// An exact surface where a pair has it.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'a> {
    pub(crate) surface: &'a dyn RaySurface,
    pub(crate) frame_from_surface: &'a Pose3,
}

impl Placed<'_> {
    /// Signed distance, and the normal at the nearest point, in the frame of the pair.
    pub(crate) fn project(&self, point: Vec3) -> (f32, Vec3) {
        let own = self.frame_from_surface.inverse_transform_point(point);
        let (distance, normal) = self.surface.project(own);
        (distance, self.frame_from_surface.rotation * normal)
    }

    /// The pixels that it covers and `border` more on all sides; `None` where its bounds are infinite.
    pub(crate) fn covers(&self, camera: &VirtualCamera, border: i32) -> Option<Rect> {
        let view_from_surface = camera.view_from_frame * *self.frame_from_surface;
        let bounds = self.surface.bounds().transformed(&view_from_surface);
        let corners = [bounds.min, bounds.max];
        if !corners.iter().all(|corner| corner.is_finite()) {
            return None;
        }
        let [first, last] = corners.map(|corner| camera.pixel_from_view(corner));
        Some(rect_of(first, last)?.grown(border))
    }

    /// Whether it comes within `reach` metres of a column of pixels: of one through `[u, v]`, between two depths.
    /// Marches along it, each time as far as nothing can be near; where that does not end, it may come so near.
    pub(crate) fn meets(
        &self,
        cells: &CellDistances,
        camera: &VirtualCamera,
        [u, v]: [f32; 2],
        [mut depth, end]: [f32; 2],
        reach: f32,
    ) -> bool {
        let near = (1.0 + LEAST_FREE) * reach;
        for _ in 0..MOST_STEPS {
            if depth > end {
                return false;
            }
            let place = camera.point_at(u, v, depth);
            let [mut distance, most] = cells.known_bounds(place);
            if most > near && distance - near < LEAST_STEP * (most - distance) {
                (distance, _) = self.project(place);
            }
            let free = distance - reach;
            // A depth so great that it does not grow is no reason to march for ever.
            if distance.is_nan() || distance <= near || depth + free == depth {
                return true;
            }
            depth += free;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::exact::test_surface::TestSurface;
    use fastrand::Rng;

    const REACH: f32 = 0.02;

    fn random(rng: &mut Rng) -> Vec3 {
        Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5)
    }

    /// Where a step is less than a depth can tell.
    #[test]
    fn columns_far_away_end() {
        let pose = Pose3::from_translation(1e7 * Vec3::Z);
        let ball = Placed {
            surface: &TestSurface::ball(),
            frame_from_surface: &pose,
        };
        let camera = VirtualCamera::along(Vec3::Z, 0.1);
        let [.., depth] = camera.view_from_point(pose.translation).to_array();
        let cells = &CellDistances::default();
        assert!(ball.meets(cells, &camera, [12.0, 0.0], [depth, depth + 1e6], 0.01));
    }

    /// Along a plane that is hardly farther than the reach.
    #[test]
    fn marches_along_a_plane_end() {
        let wall = TestSurface::wall();
        let (exact, cells) = (wall.here(), &CellDistances::default());
        let camera = VirtualCamera::along(Vec3::Z, 0.1);
        let across = |x: f32| {
            let view = camera.view_from_point(x * Vec3::X);
            camera.pixel_from_view(view)
        };
        assert!(exact.meets(cells, &camera, across(1.06 * REACH), [0.0, 1e4], REACH));
        assert!(wall.asked() <= MOST_STEPS);
        // What is far enough is passed within them.
        assert!(!exact.meets(cells, &camera, across(3.0 * REACH), [0.0, REACH], REACH));
    }

    /// By the least distance of a line to the ball's middle.
    #[test]
    fn columns_that_a_ball_is_near_are_found() {
        let mut rng = Rng::with_seed(21);
        let (mut near, mut far) = (0, 0);
        let mut cells = CellDistances::default();
        for k in 0..2000 {
            // Every other time with cells over a part of the view, some of which are asked.
            let places: Vec<Vec3> = (0..k % 2 * 50).map(|_| 3.0 * random(&mut rng)).collect();
            cells.begin(places.iter().copied(), 0.2);
            let pose = Pose3::from_translation(2.0 * random(&mut rng));
            let ball = Placed {
                surface: &TestSurface::ball(),
                frame_from_surface: &pose,
            };
            let camera = VirtualCamera::along(random(&mut rng), 0.1);
            let pixel = [40.0 * (rng.f32() - 0.5), 40.0 * (rng.f32() - 0.5)];
            let depths = [-2.0 * rng.f32(), 2.0 * rng.f32()];
            let reach = 0.05 + 0.3 * rng.f32();
            for place in places {
                cells.bounds(&ball, place, reach);
            }
            let [from, to] = depths.map(|depth| camera.point_at(pixel[0], pixel[1], depth));
            let along = (pose.translation - from).dot(to - from) / (to - from).length_squared();
            let nearest = from.lerp(to, along.clamp(0.0, 1.0));
            let distance = nearest.distance(pose.translation) - 1.0;
            let found = ball.meets(&cells, &camera, pixel, depths, reach);
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
