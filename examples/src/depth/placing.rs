//! Bodies of a size that the frames of a depth camera resolve, and places for them.

use super::generated::GeneratedCamera;
use super::source::FrameSource;
use crate::bodies::NamedCloud;
use crate::numbers::median;
use crate::scene::BodyShape;
use crate::spots::{Demand, NoSpot, Spot, find_spots_where};
use tldi::PointCloud;
use tldi::glamx::{Pose3, Vec3};
use tldi_sources::depth::DepthCamera;

/// Width in metres of a body of the generated sequence, for which there is room on its spots.
const GENERATED_SIZE: f32 = 0.14;
/// Width of a body that is not given one: a share of the median distance, smaller by a factor until there is
/// place, and at least this many mean radii of a frame.
const SIZE_SHARE: f32 = 0.08;
const SHRINKING: f32 = 0.8;
const LEAST_RADII: f32 = 8.0;
/// Room around a place that must be in view in the last frame, in body radii.
const ROOM_IN_VIEW: f32 = 2.5;
/// Distance of the points of a body, as a share of its width.
const SPACING: f32 = 0.03;

/// Bodies that are wanted.
#[derive(Clone, Copy, Debug)]
pub struct WantedBodies {
    /// How many.
    pub count: usize,
    /// Their width in metres. If left out, it is as large as the distance of what is seen suggests, or smaller until each
    /// has a place of its own.
    pub size: Option<f32>,
    /// Seed of their points and places.
    pub seed: u64,
}

impl WantedBodies {
    /// The bodies, and where they are dropped on the surface that the `first` frame shows.
    ///
    /// # Errors
    /// Where there is no place, a body cannot be made, or the last frame cannot be read.
    pub fn placed(
        &self,
        source: &FrameSource,
        mut camera: DepthCamera,
        first: &PointCloud<'_>,
        up: Vec3,
    ) -> anyhow::Result<(Vec<NamedCloud>, Vec<Spot>)> {
        if self.count == 0 {
            return Ok((Vec::new(), Vec::new()));
        }
        let of_size = |size: f32| {
            NamedCloud::generated(&BodyShape::WHOLE, self.count, SPACING, size, self.seed)
        };
        let least = LEAST_RADII * first.mean_radius();
        if matches!(source, FrameSource::Generated(_)) {
            let size = self.size.unwrap_or(GENERATED_SIZE.max(least));
            let spots = GeneratedCamera::spots();
            if self.count <= spots.len() && size <= GENERATED_SIZE {
                return Ok((of_size(size)?, spots));
            }
        }
        let frame = source.frame(source.count() - 1)?;
        camera.points(&frame.depths, &frame.world_from_camera)?;
        let view = LastView {
            camera: &camera,
            camera_from_world: frame.world_from_camera.inverse(),
        };
        let depths = first.points().iter().map(|&point| view.depth(point));
        let distance = median(depths).unwrap_or_default();
        let mut size = self.size.unwrap_or(least.max(SIZE_SHARE * distance));
        loop {
            let bodies = of_size(size)?;
            let spots = view.spots(first, up, &Demand::of(&bodies, self.seed), distance);
            let smaller = SHRINKING * size;
            if self.size.is_some() || smaller < least || spots.as_deref().is_ok_and(are_single) {
                return Ok((bodies, spots?));
            }
            size = smaller;
        }
    }
}

/// Whether each spot is for one body.
fn are_single(spots: &[Spot]) -> bool {
    spots.iter().all(|spot| spot.level == 0)
}

/// Where the camera is in the last frame: what it does not see there cannot hold a body.
struct LastView<'a> {
    camera: &'a DepthCamera,
    camera_from_world: Pose3,
}

impl LastView<'_> {
    fn depth(&self, point: Vec3) -> f32 {
        (self.camera_from_world * point).z
    }

    /// Places in view, with the room around them; nearer than `distance` metres if there are enough,
    /// where depths are sharper, and anywhere if there are none.
    fn spots(
        &self,
        first: &PointCloud<'_>,
        up: Vec3,
        demand: &Demand,
        distance: f32,
    ) -> Result<Vec<Spot>, NoSpot> {
        let is_in_view = |place: Vec3| self.is_in_view(place, up, demand.body_radius);
        let near = find_spots_where(first, up, demand, |place| {
            is_in_view(place) && self.depth(place) <= distance
        });
        match near {
            Ok(spots) if are_single(&spots) => Ok(spots),
            // What holds bodies now may all be gone in the end.
            _ => find_spots_where(first, up, demand, is_in_view)
                .or_else(|_| find_spots_where(first, up, demand, |_| true)),
        }
    }

    /// Whether the room around a place is in view. Some pixels are empty: half of those on the way to the sides must show
    /// the surface.
    fn is_in_view(&self, place: Vec3, up: Vec3, body_radius: f32) -> bool {
        let (u, v) = up.any_orthonormal_pair();
        let around = |distance: f32| [u, -u, v, -v].map(|side| place + distance * side);
        let is_inside = |p: &Vec3| self.camera.is_in_view(*p, &self.camera_from_world);
        let disc: Vec<Vec3> = (1..=4)
            .flat_map(|k| around(0.25 * k as f32 * body_radius))
            .collect();
        let is_seen = |p: &&Vec3| self.camera.sees(**p, &self.camera_from_world);
        around(ROOM_IN_VIEW * body_radius).iter().all(is_inside)
            && 2 * disc.iter().filter(is_seen).count() >= disc.len()
    }
}
