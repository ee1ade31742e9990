//! What is to be drawn.

use tldi::glamx::{Pose3, Vec3};
use tldi::{Layer, Params, PointCloud, Tldi, VirtualCamera};

/// A cloud to be seen.
#[derive(Clone, Copy, Debug)]
pub struct Item<'a> {
    /// The cloud.
    pub cloud: &'a PointCloud<'a>,
    /// From the cloud's frame into that of the scene.
    pub scene_from_cloud: Pose3,
    /// How it is coloured.
    pub paint: Paint,
}

/// How a cloud is coloured and lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Paint {
    /// Its own colours, or else by height; it throws no shadow (a room's walls would shade all).
    Scan,
    /// Its own colours, or else this one (red, green, blue, 0 to 1); throws a shadow.
    Body([f32; 3]),
}

/// Colours of bodies that bring none, easily told from each other and from furniture.
pub const BODY_COLORS: [[f32; 3]; 6] = [
    [0.90, 0.42, 0.20],
    [0.22, 0.55, 0.85],
    [0.55, 0.72, 0.25],
    [0.86, 0.70, 0.22],
    [0.68, 0.38, 0.74],
    [0.20, 0.68, 0.66],
];

/// A scene to be drawn. `up` is a unit vector in its frame.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// What is in it.
    pub items: Vec<Item<'a>>,
    /// Against gravity.
    pub up: Vec3,
    /// Size in metres of what the picture is about; sets the reach of ambient shade.
    pub detail: f32,
}

impl<'a> Item<'a> {
    /// A scan whose frame is that of the scene.
    pub fn scan(cloud: &'a PointCloud<'a>) -> Self {
        Self {
            cloud,
            scene_from_cloud: Pose3::IDENTITY,
            paint: Paint::Scan,
        }
    }

    /// A body.
    pub fn body(cloud: &'a PointCloud<'a>, scene_from_cloud: Pose3, color: [f32; 3]) -> Self {
        Self {
            cloud,
            scene_from_cloud,
            paint: Paint::Body(color),
        }
    }

    /// The image of the item as `camera` sees it.
    pub fn image(&self, camera: &VirtualCamera) -> Tldi {
        let params = Params::for_radius(self.cloud.mean_radius());
        tldi::build(self.cloud, &self.scene_from_cloud, camera, &params)
    }
}

/// The layers of every pixel of `image`, by the pixel's index in a picture of `size`.
pub fn pixels_of(image: &Tldi, size: [u32; 2]) -> impl Iterator<Item = (usize, &[Layer])> {
    let [columns, rows] = image.size;
    let [left, top] = image.origin;
    (0..rows).flat_map(move |j| {
        (0..columns).filter_map(move |i| {
            let (x, y) = (left + i as i32, top + j as i32);
            let inside = (0..size[0] as i32).contains(&x) && (0..size[1] as i32).contains(&y);
            inside.then(|| {
                (
                    (y as u32 * size[0] + x as u32) as usize,
                    image.layers_at(i, j),
                )
            })
        })
    })
}
