//! Pictures from the layers of clouds.
//!
//! One image is built per cloud and merged by depth, front layer by front layer, as in the paper
//! (Radwan, Ohrhallinger and Wimmer 2014, section 6): the same images that find collisions carry
//! the colours. Shadows come from images seen from the sun.

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
struct FrontLayers {
    size: [u32; 2],
    /// Index of the item and its layer, row by row.
    pixels: Vec<Option<(u16, Layer)>>,
}

/// Direction from the scene to the sun: this much of up, the rest towards the camera's left.
const SUN_HEIGHT: f32 = 0.85;
/// Distance at which a shadow has faded, in sizes of detail. Scans throw and stop no shadows: this
/// keeps that of a body on a table from the floor below it.
const SHADOW_REACH: f32 = 6.0;
const BACKGROUND: [[f32; 3]; 2] = [[0.93, 0.94, 0.96], [0.80, 0.83, 0.87]];
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

/// What the pixels of a picture are computed from.
struct Frame<'a> {
    scene: &'a Scene<'a>,
    camera: VirtualCamera,
    front: &'a FrontLayers,
    /// Directions in the view frame.
    up: Vec3,
    sun: Vec3,
    /// Image of each body from the sun, with its index.
    shadows: Vec<(u16, Tldi)>,
    /// Lowest and highest point of the scan along up, outliers aside, in metres.
    heights: [f32; 2],
}

impl<'a> Frame<'a> {
    fn new(scene: &'a Scene<'a>, camera: &VirtualCamera, front: &'a FrontLayers) -> Self {
        let view_from_scene = camera.view_from_frame.rotation;
        let up = view_from_scene * scene.up;
        // Left of the camera and a little behind it, as in a studio.
        let aside = Vec3::new(-0.8, 0.0, -0.6)
            .reject_from(up)
            .normalize_or(Vec3::X);
        let sun = SUN_HEIGHT * up + (1.0 - SUN_HEIGHT * SUN_HEIGHT).sqrt() * aside;
        let sun_in_scene = view_from_scene.inverse() * sun;
        let shadows = (0u16..)
            .zip(&scene.items)
            .filter(|(_, item)| matches!(item.paint, Paint::Body(_)))
            .map(|(index, item)| {
                let pixel_size = 1.5 * item.cloud.mean_radius();
                (
                    index,
                    item.image(&VirtualCamera::along(-sun_in_scene, pixel_size)),
                )
            })
            .collect();
        let mut heights: Vec<f32> = scene
            .items
            .iter()
            .filter(|item| item.paint == Paint::Scan)
            .flat_map(|item| {
                item.cloud
                    .points()
                    .step_by(16)
                    .map(|p| (item.scene_from_cloud * p).dot(scene.up))
            })
            .collect();
        heights.sort_unstable_by(f32::total_cmp);
        let quantile = |q: f32| {
            heights
                .get((q * heights.len() as f32) as usize)
                .copied()
                .unwrap_or(0.0)
        };
        let heights = [quantile(0.01), quantile(0.99)];
        Self {
            scene,
            camera: *camera,
            front,
            up,
            sun,
            shadows,
            heights,
        }
    }

    fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        let linear = match self.layer(x as i32, y as i32) {
            None => {
                let t = y as f32 / self.front.size[1] as f32;
                mix(BACKGROUND[0], BACKGROUND[1], t)
            }
            Some((item, layer)) => self.shaded(x, y, item, &layer),
        };
        linear.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8)
    }

    fn layer(&self, x: i32, y: i32) -> Option<(u16, Layer)> {
        let [width, height] = self.front.size.map(|n| n as i32);
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        inside
            .then(|| self.front.pixels[(y * width + x) as usize])
            .flatten()
    }

    fn shaded(&self, x: u32, y: u32, item: u16, layer: &Layer) -> [f32; 3] {
        let view = self
            .camera
            .view_at(x as f32 + 0.5, y as f32 + 0.5, layer.depth);
        let to_camera = -view.normalize_or(Vec3::Z);
        let normal = layer.normal.normalize_or(to_camera);
        let normal = if normal.dot(to_camera) < 0.0 {
            -normal
        } else {
            normal
        };
        let scene_point = self.camera.view_from_frame.inverse_transform_point(view);
        let albedo = self.albedo(item, layer, scene_point);
        let sky = 0.5 + 0.5 * normal.dot(self.up);
        let ambient = (0.30 + 0.22 * sky) * self.openness(x, y, view, normal);
        let head = 0.16 * normal.dot(to_camera).max(0.0);
        let sun = 0.50 * normal.dot(self.sun).max(0.0) * self.sunlight(item, scene_point);
        albedo.map(|c| c * (ambient + head + sun))
    }

    fn albedo(&self, item: u16, layer: &Layer, scene_point: Vec3) -> [f32; 3] {
        if layer.color[3] > 0 {
            let [r, g, b, _] = layer.color;
            return [r, g, b].map(|c| 1.15 * f32::from(c) / 255.0);
        }
        match self.scene.items[item as usize].paint {
            Paint::Body(color) => color.map(|c| 1.15 * c),
            Paint::Scan => {
                let [low, high] = self.heights;
                let height = scene_point.dot(self.scene.up);
                height_color((height - low) / (high - low).max(1e-6))
            }
        }
    }

    /// Share of the hemisphere over a pixel that its surroundings leave open, 0 to 1: ambient
    /// obscurance of neighbouring front layers (McGuire et al. 2011, "The Alchemy Screen-Space
    /// Ambient Obscurance Algorithm").
    fn openness(&self, x: u32, y: u32, view: Vec3, normal: Vec3) -> f32 {
        const SAMPLES: u32 = 20;
        let reach = 0.5 * self.scene.detail;
        let reach_px = (reach / self.camera.pixel_size_at(view.z)).min(80.0);
        // Turns the spiral of samples differently in each pixel of a block of 4 × 4.
        let turn = ((x % 4) * 4 + y % 4) as f32 * 0.4;
        let mut obscured = 0.0;
        for k in 0..SAMPLES {
            let t = (k as f32 + 0.5) / SAMPLES as f32;
            let (sin, cos) = (turn + 2.4 * k as f32).sin_cos();
            let at =
                |start: u32, offset: f32| start as i32 + (offset * t * reach_px).round() as i32;
            let (sx, sy) = (at(x, cos), at(y, sin));
            let Some((_, layer)) = self.layer(sx, sy) else {
                continue;
            };
            let other = self
                .camera
                .view_at(sx as f32 + 0.5, sy as f32 + 0.5, layer.depth);
            let to_other = other - view;
            let distance = to_other.length();
            if distance < reach && distance > 0.0 {
                let rise = normal.dot(to_other) / distance - 0.15;
                obscured += rise.max(0.0) * (1.0 - distance / reach);
            }
        }
        (1.0 - 3.0 * obscured / SAMPLES as f32).clamp(0.2, 1.0)
    }

    /// Share of the sun that bodies leave to a point, 0 to 1, with soft rims.
    fn sunlight(&self, item: u16, scene_point: Vec3) -> f32 {
        let mut light: f32 = 1.0;
        for (body, image) in &self.shadows {
            if *body == item {
                continue;
            }
            let seen = image.camera.view_from_point(scene_point);
            let [u, v] = image.camera.pixel_from_view(seen);
            let reach = SHADOW_REACH * self.scene.detail;
            let shade = |du: i16, dv: i16| {
                let i = (u + f32::from(du)).floor() as i32 - image.origin[0];
                let j = (v + f32::from(dv)).floor() as i32 - image.origin[1];
                let inside = (0..image.size[0] as i32).contains(&i)
                    && (0..image.size[1] as i32).contains(&j);
                let layers = if inside {
                    image.layers_at(i as u32, j as u32)
                } else {
                    &[]
                };
                let last = layers.iter().rfind(|layer| layer.depth < seen.z);
                last.map_or(0.0, |layer| {
                    (2.0 - 2.0 * (seen.z - layer.depth) / reach).clamp(0.0, 1.0)
                })
            };
            let taps = (-2..=2).flat_map(|dv| (-2..=2).map(move |du| (du, dv)));
            let shadow = taps.map(|(du, dv)| shade(du, dv)).sum::<f32>() / 25.0;
            light = light.min(1.0 - shadow);
        }
        light
    }
}

/// Colour of a scan without colours at a share of its height: dark and cool below, light and warm
/// above, with a change of tone about every tenth.
fn height_color(share: f32) -> [f32; 3] {
    const STOPS: [[f32; 3]; 4] = [
        [0.42, 0.47, 0.55],
        [0.62, 0.64, 0.64],
        [0.78, 0.74, 0.66],
        [0.90, 0.88, 0.84],
    ];
    let at = share.clamp(0.0, 1.0) * 2.999;
    let k = at as usize;
    mix(STOPS[k], STOPS[k + 1], at - k as f32)
}

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)
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
        encoder
            .write_header()?
            .write_image_data(self.rgb.as_flattened())?;
        Ok(bytes)
    }
}
