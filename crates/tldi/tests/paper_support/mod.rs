//! Images of the paper's variant, and seeded random clouds and cameras for them.

#![allow(dead_code, reason = "each test binary uses a part")]

pub(crate) mod oracle;

use oracle::Scene;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{Params, PointCloud, Tldi, VirtualCamera, paper};

/// Blended depths, metres: depths up to 8 m carry f32 errors of about 1e-6, weights relative ones
/// of 1e-5 (pixel coordinates good to 1e-5 over a disc of a few pixels), which act on extents of
/// at most a few radii of 0.3 m.
pub(crate) const DEPTH_TOLERANCE: f64 = 2e-5;

pub(crate) fn unit(rng: &mut fastrand::Rng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| 2.0 * rng.f32() - 1.0))
}

pub(crate) fn pose(rng: &mut fastrand::Rng, reach: f32) -> Pose3 {
    let rotation = Quat::from_scaled_axis(3.0 * unit(rng));
    Pose3::from_parts(reach * unit(rng), rotation)
}

/// A camera at about 4 m from the origin, of either kind, with 40 × 40 pixels over about 2 m.
pub(crate) fn camera(rng: &mut fastrand::Rng) -> VirtualCamera {
    let eye = 4.0 * unit(rng).normalize_or(Vec3::Z);
    let size = [40, 40];
    let perspective =
        VirtualCamera::perspective(eye, 0.3 * unit(rng), Vec3::Y, 0.5, size, 2.8, 5.2);
    if rng.bool() {
        return perspective;
    }
    let corner = Pose3::translation(1.0, 1.0, 0.0);
    VirtualCamera {
        view_from_frame: corner * perspective.view_from_frame,
        size: Some(size),
        ..VirtualCamera::along(Vec3::Z, 0.05)
    }
}

pub(crate) struct RandomCloud {
    pub(crate) points: Vec<Vec3>,
    radii: Vec<f32>,
    colors: Vec<[u8; 4]>,
}

impl RandomCloud {
    pub(crate) fn new(rng: &mut fastrand::Rng, count: usize, radii: [f32; 2]) -> Self {
        Self {
            points: (0..count).map(|_| unit(rng)).collect(),
            radii: (0..count)
                .map(|_| radii[0] + (radii[1] - radii[0]) * rng.f32())
                .collect(),
            colors: (0..count)
                .map(|_| std::array::from_fn(|_| rng.u8(..)))
                .collect(),
        }
    }

    pub(crate) fn cloud(&self) -> PointCloud<'_> {
        PointCloud::builder(&self.points)
            .radii(&self.radii[..])
            .colors(&self.colors[..])
            .build()
            .unwrap()
    }

    pub(crate) fn scene(&self, frame_from_cloud: Pose3, camera: VirtualCamera) -> Scene<'_> {
        Scene {
            points: &self.points,
            radii: &self.radii,
            colors: &self.colors,
            frame_from_cloud,
            camera,
        }
    }
}

pub(crate) fn build(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    camera: &VirtualCamera,
    params: &Params,
) -> Tldi {
    let mut image = Tldi::default();
    let mut scratch = paper::Scratch::default();
    paper::build(
        cloud,
        frame_from_cloud,
        camera,
        params,
        &mut scratch,
        &mut image,
    );
    image
}

/// Pixels of an image in the camera's grid.
pub(crate) fn pixels(image: &Tldi) -> impl Iterator<Item = (i32, i32, &[tldi::Layer])> {
    (0..image.size[1]).flat_map(move |j| {
        (0..image.size[0]).map(move |i| {
            let [x, y] = [image.origin[0] + i as i32, image.origin[1] + j as i32];
            (x, y, image.layers_at(i, j))
        })
    })
}
