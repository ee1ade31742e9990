//! Pictures from the layers of clouds.
//!
//! One image is built per cloud and merged by depth, front layer by front layer, as in the paper
//! (Radwan, Ohrhallinger and Wimmer 2014, section 6): the same images that find collisions carry
//! the colours. Shadows come from images seen from the sun.

use crate::shading::Frame;
use rayon::prelude::*;
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

/// An image of 8-bit colours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Red, green and blue of each pixel, row by row.
    pub rgb: Vec<[u8; 3]>,
}

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

/// The front layer of every pixel over all clouds.
pub(crate) struct FrontLayers {
    pub(crate) size: [u32; 2],
    /// Index of the item and its layer, row by row.
    pub(crate) pixels: Vec<Option<(u16, Layer)>>,
}

const CONTACT_COLOR: [u8; 3] = [255, 230, 40];
const CONTACT_RIM: [u8; 3] = [40, 20, 20];

impl Scene<'_> {
    /// Draws the scene as `camera` sees it, with a mark at each of `contacts` (in the scene's
    /// frame, metres). The camera must have a fixed size.
    ///
    /// # Panics
    /// If the camera has no fixed size.
    pub fn draw(&self, camera: &VirtualCamera, contacts: &[Vec3]) -> Picture {
        let front = self.front_layers(camera);
        let frame = Frame::new(self, camera, &front);
        let [width, height] = front.size;
        let rgb = (0..width * height)
            .into_par_iter()
            .map(|k| frame.pixel(k % width, k / width))
            .collect();
        let mut picture = Picture {
            size: front.size,
            rgb,
        };
        for contact in contacts {
            picture.mark(camera, *contact);
        }
        picture
    }

    fn front_layers(&self, camera: &VirtualCamera) -> FrontLayers {
        let size = camera.size.expect("a picture's camera has a fixed size");
        let mut pixels: Vec<Option<(u16, Layer)>> = vec![None; (size[0] * size[1]) as usize];
        for (index, item) in self.items.iter().enumerate() {
            let image = item.image(camera);
            for (k, layers) in pixels_of(&image, size) {
                let Some(layer) = layers.first() else {
                    continue;
                };
                if pixels[k].is_none_or(|(_, other)| layer.depth < other.depth) {
                    pixels[k] = Some((index as u16, *layer));
                }
            }
        }
        let mut front = FrontLayers { size, pixels };
        front.close_pinholes();
        front
    }
}

impl FrontLayers {
    /// Gives pixels without a layer, but with one on opposite sides, that of a neighbour: gaps a
    /// pixel or two wide, where a sparse scan does not quite cover the image. Real holes stay.
    fn close_pinholes(&mut self) {
        let width = self.size[0] as usize;
        for _ in 0..2 {
            let before = self.pixels.clone();
            for k in width + 1..before.len().saturating_sub(width + 1) {
                if before[k].is_some() {
                    continue;
                }
                let opposite = [1, width, width + 1, width - 1].into_iter();
                let closed = opposite.filter_map(|step| before[k - step].zip(before[k + step]));
                self.pixels[k] = closed
                    .map(|(a, b)| if a.1.depth > b.1.depth { a } else { b })
                    .max_by(|a, b| a.1.depth.total_cmp(&b.1.depth));
            }
        }
    }
}

impl Item<'_> {
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

impl Picture {
    /// Draws a dot with a dark rim over a point of the scene, if it is in view.
    fn mark(&mut self, camera: &VirtualCamera, point: Vec3) {
        const RADIUS: f32 = 2.8;
        const RIM: f32 = 1.3;
        let view = camera.view_from_point(point);
        if view.z <= 0.0 {
            return;
        }
        let [u, v] = camera.pixel_from_view(view);
        let reach = (RADIUS + RIM).ceil() as i32;
        for y in v.floor() as i32 - reach..=v.floor() as i32 + reach {
            for x in u.floor() as i32 - reach..=u.floor() as i32 + reach {
                let distance = (x as f32 + 0.5 - u).hypot(y as f32 + 0.5 - v);
                let inside =
                    (0..self.size[0] as i32).contains(&x) && (0..self.size[1] as i32).contains(&y);
                if inside && distance < RADIUS + RIM {
                    let k = (y as u32 * self.size[0] + x as u32) as usize;
                    self.rgb[k] = if distance < RADIUS {
                        CONTACT_COLOR
                    } else {
                        CONTACT_RIM
                    };
                }
            }
        }
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// Those of the encoder.
    pub fn to_png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.size[0], self.size[1]);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        encoder
            .write_header()?
            .write_image_data(self.rgb.as_flattened())?;
        Ok(bytes)
    }
}
