//! Which pairs the device compares, and which ones the CPU.

use tldi::plan::{self, DepthScale};
use tldi::{PairQuery, Projection, Surface, Variant, View};

/// Whether only the device has the points of a cloud of the pair.
pub(crate) fn lives_on_device(query: &PairQuery) -> bool {
    let is_resident = |surface| matches!(surface, Surface::Device(_));
    is_resident(query.a) || is_resident(query.b)
}

/// Largest radius of a splat in pixels. One invocation draws a splat, pixel by pixel in up to three views: software
/// adapters give up after 65,535 turns of a loop. Half or twice: the test
/// below fails; with twice of it, splats of 140 pixels have false gaps there.
const MOST_REACH_PX: f32 = 70.0;

/// Most points in the square of a mean radius: 64 times those of radii that come from neighbours. For each point an
/// invocation reads all others around it. Half or twice: the test below fails; what is more crowded only takes longer.
const MOST_DENSITY: f32 = 60.0;

/// Whether an invocation of each stage has little to do for a cloud.
fn is_light(surface: Surface<'_>, pixel_size: f32) -> bool {
    let Surface::Cloud(cloud) = surface else {
        return true;
    };
    let radius = cloud.mean_radius();
    let [x, y, z] = cloud.bounds().loosened(radius).extents().to_array();
    // Half the surface of the bounds' box.
    let area = x * y + y * z + z * x;
    let reach = cloud.max_radius() * (plan::stride(radius, pixel_size) as f32).sqrt();
    reach <= MOST_REACH_PX * pixel_size
        && cloud.len() as f32 * radius * radius <= MOST_DENSITY * area
}

/// Whether an image of the device has depths enough for all in which both clouds can be in reach. It counts them from the
/// nearest of these; the CPU leaves out what is too far from the middle.
fn is_within_depths(query: &PairQuery) -> bool {
    let across = |surface| match surface {
        Surface::Cloud(cloud) => (cloud.bounds().loosened(cloud.max_radius()).extents()).length(),
        _ => f32::INFINITY,
    };
    let most = across(query.a).min(across(query.b)) + query.params.prediction;
    most <= 2.0 * DepthScale::reach(&query.params)
}

/// Whether the device takes a pair: two clouds, oriented splats and an orthographic view. All else
/// is compared by the CPU backend. Unless the device alone has the points of one of them, so are uneven clouds, since the
/// device goes by their mean radii, clouds with large or crowded splats, which take it long, and those too large for its depths.
pub(crate) fn is_for_device(query: &PairQuery) -> bool {
    let is_orthographic = match query.view {
        View::Fixed(camera) => matches!(
            camera.projection,
            Projection::Orthographic { pixel_size } if pixel_size == query.params.pixel_size
        ),
        View::Aim { .. } => true,
    };
    let is_cloud = |surface| !matches!(surface, Surface::Exact(_));
    let is_light = |surface| is_light(surface, query.params.pixel_size);
    let is_even = |surface| !matches!(surface, Surface::Cloud(cloud) if cloud.is_uneven());
    let is_suited = |surface| is_even(surface) && is_light(surface);
    query.params.check().is_ok()
        && is_orthographic
        && is_cloud(query.a)
        && is_cloud(query.b)
        && (lives_on_device(query)
            || is_suited(query.a) && is_suited(query.b) && is_within_depths(query))
        && query.params.variant() == Variant::Oriented
}

#[cfg(test)]
mod tests {
    use super::*;
    use tldi::glamx::{Pose3, Vec3};
    use tldi::{Params, PointCloud};

    /// 80 × 80 points, 1 m apart. With radii of 8 m there are 34 in the square of a radius, with 16 m 84. With radii of 0.2 mm,
    /// and thicknesses of 0.4 mm, depths reach over 105 m, and the diagonal is 112 m.
    #[test]
    fn what_takes_the_device_long_or_has_no_depths_is_the_cpus() {
        let at = |i: usize| Vec3::new((i % 80) as f32, 0.0, (i / 80) as f32);
        let points: Vec<Vec3> = (0..6400).map(at).collect();
        for (radius, radius_px, is_the_devices) in [
            (0.0002, 1.0, false),
            (0.0003, 1.0, true),
            (1.0, 1.0, true),
            (1.0, 60.0, true),
            (1.0, 80.0, false),
            (8.0, 1.0, true),
            (16.0, 1.0, false),
        ] {
            let cloud = PointCloud::builder(&points).radius(radius).build();
            let cloud = cloud.expect("the points are valid");
            let query = PairQuery {
                a: Surface::Cloud(&cloud),
                b: Surface::Cloud(&cloud),
                a_from_b: Pose3::translation(0.0, 0.5, 0.0),
                view: View::aimed(),
                params: Params::for_radius(radius).with_pixel_size(radius / radius_px),
            };
            assert_eq!(
                is_for_device(&query),
                is_the_devices,
                "{radius} m, {radius_px} pixels"
            );
        }
    }
}
