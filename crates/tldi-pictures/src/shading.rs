//! Lights the front layers of a picture.

use crate::camera::toward_camera;
use crate::front_layers::FrontLayers;
use crate::scene::{Paint, Scene};
use tldi::glamx::{Pose3, Vec3};
use tldi::{Layer, Tldi, VirtualCamera};

/// Direction from the scene to the sun: this much of up, the rest towards the camera's left.
const SUN_HEIGHT: f32 = 0.85;
/// Pixels of the sun's image over which the rim of a shadow is soft, each way.
const SHADOW_SOFTNESS: i32 = 2;
/// Distance at which a shadow has faded, in sizes of detail. Scans throw and stop no shadows: this
/// keeps that of a body on a table from the floor below it.
const SHADOW_REACH: f32 = 6.0;
/// Colours behind the scene, at the top and at the bottom.
const BACKGROUND: [[f32; 3]; 2] = [[0.93, 0.94, 0.96], [0.80, 0.83, 0.87]];
/// Samples of a pixel's surroundings.
const OPENNESS_SAMPLES: usize = 16;
/// Radius in pixels of a pixel's surroundings, at most: samples farther apart show as a pattern.
const MOST_OPENNESS_PIXELS: f32 = 160.0;
/// Spirals of samples, each turned differently: one for each pixel of a block of 4 × 4.
const SPIRALS: usize = 16;

/// What the pixels of a picture are computed from.
pub(crate) struct Frame<'a> {
    scene: &'a Scene<'a>,
    camera: VirtualCamera,
    front: &'a FrontLayers,
    /// Depth of each pixel's front layer in metres, row by row; infinite where there is none.
    depth: Vec<f32>,
    /// Sample positions around a pixel, within a disc of radius 1.
    spirals: Vec<[[f32; 2]; OPENNESS_SAMPLES]>,
    /// Directions in the view frame.
    up: Vec3,
    sun: Vec3,
    /// Into the view from the sun.
    sun_from_scene: Pose3,
    /// Image of each body from the sun, with its index.
    shadows: Vec<(u16, Tldi)>,
    /// Heights along up, in metres, below which given shares of the scan's points lie: one for
    /// each of [`HEIGHT_COLORS`].
    heights: [f32; 4],
}

impl<'a> Frame<'a> {
    pub(crate) fn new(
        scene: &'a Scene<'a>,
        camera: &VirtualCamera,
        front: &'a FrontLayers,
    ) -> Self {
        let view_from_scene = camera.view_from_frame.rotation;
        let up = view_from_scene * scene.up;
        // Left of the camera and a little behind it, as in a studio.
        let aside = Vec3::new(-0.8, 0.0, -0.6)
            .reject_from(up)
            .normalize_or(Vec3::X);
        let sun = SUN_HEIGHT * up + (1.0 - SUN_HEIGHT * SUN_HEIGHT).sqrt() * aside;
        let from_sun =
            |pixel_size| VirtualCamera::along(view_from_scene.inverse() * -sun, pixel_size);
        let shadows = (0u16..)
            .zip(&scene.items)
            .filter(|(_, item)| matches!(item.paint, Paint::Body(_)))
            .map(|(index, item)| {
                let pixel_size = 1.5 * item.cloud.mean_radius();
                (index, item.image(&from_sun(pixel_size)))
            })
            .collect();
        let mut heights: Vec<f32> = scene
            .items
            .iter()
            .filter(|item| item.paint == Paint::Scan)
            .flat_map(|item| {
                item.cloud
                    .points()
                    .iter()
                    .step_by(16)
                    .map(|p| (item.scene_from_cloud * p).dot(scene.up))
            })
            .collect();
        heights.sort_unstable_by(f32::total_cmp);
        let quantile = |q: f32| {
            let index = (q * heights.len() as f32) as usize;
            heights.get(index).copied().unwrap_or(0.0)
        };
        let heights = HEIGHT_COLORS.map(|(share, _)| quantile(share));
        Self {
            scene,
            camera: *camera,
            front,
            depth: (front.pixels.iter())
                .map(|pixel| pixel.map_or(f32::INFINITY, |(_, layer)| layer.depth))
                .collect(),
            spirals: (0..SPIRALS).map(spiral).collect(),
            up,
            sun,
            sun_from_scene: from_sun(1.0).view_from_frame,
            shadows,
            heights,
        }
    }

    /// Red, green and blue of `samples` × `samples` pixels that make one of a picture.
    pub(crate) fn mean(&self, x: u32, y: u32, samples: u32) -> [u8; 3] {
        let mut sum = [0.0; 3];
        for (j, i) in (0..samples).flat_map(|j| (0..samples).map(move |i| (j, i))) {
            let color = self.pixel(samples * x + i, samples * y + j);
            sum = [0, 1, 2].map(|c| sum[c] + color[c].clamp(0.0, 1.0));
        }
        sum.map(|c| (255.0 * c / (samples * samples) as f32).round() as u8)
    }

    /// Red, green and blue of a pixel, 0 to 1 where nothing is overexposed.
    fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        match self.layer(x as i32, y as i32) {
            None => {
                let t = y as f32 / self.front.size[1] as f32;
                mix(BACKGROUND[0], BACKGROUND[1], t)
            }
            Some((item, layer)) => self.shaded(x, y, item, &layer),
        }
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
        let to_camera = toward_camera(&self.camera, view);
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
            Paint::Scan => height_color(&self.heights, scene_point.dot(self.scene.up)),
        }
    }

    /// Share of the hemisphere over a pixel that its surroundings leave open, 0 to 1: ambient
    /// obscurance of neighbouring front layers (McGuire et al. 2011, "The Alchemy Screen-Space
    /// Ambient Obscurance Algorithm").
    fn openness(&self, x: u32, y: u32, view: Vec3, normal: Vec3) -> f32 {
        let reach = 0.5 * self.scene.detail;
        let reach_px = (reach / self.camera.pixel_size_at(view.z)).min(MOST_OPENNESS_PIXELS);
        let [width, height] = self.front.size.map(|n| n as i32);
        let mut obscured = 0.0;
        for [dx, dy] in self.spirals[((x % 4) * 4 + y % 4) as usize] {
            let sx = x as i32 + (dx * reach_px) as i32;
            let sy = y as i32 + (dy * reach_px) as i32;
            if sx < 0 || sy < 0 || sx >= width || sy >= height {
                continue;
            }
            let depth = self.depth[(sy * width + sx) as usize];
            // Nothing there, or farther away than the reach: it obscures nothing.
            if (depth - view.z).abs() > reach {
                continue;
            }
            let other = self.camera.view_at(sx as f32 + 0.5, sy as f32 + 0.5, depth);
            let to_other = other - view;
            let distance = to_other.length();
            if distance < reach && distance > 0.0 {
                let rise = normal.dot(to_other) / distance - 0.15;
                obscured += rise.max(0.0) * (1.0 - distance / reach);
            }
        }
        (1.0 - 3.0 * obscured / OPENNESS_SAMPLES as f32).clamp(0.2, 1.0)
    }

    /// Share of the sun that bodies leave to a point, 0 to 1, with soft rims.
    fn sunlight(&self, item: u16, scene_point: Vec3) -> f32 {
        let mut light: f32 = 1.0;
        let seen = self.sun_from_scene * scene_point;
        for (body, image) in &self.shadows {
            if *body == item {
                continue;
            }
            let [u, v] = image.camera.pixel_from_view(seen);
            let [i, j] = [u - image.origin[0] as f32, v - image.origin[1] as f32];
            let [columns, rows] = image.size.map(|n| n as f32);
            let [rim, reach] = [SHADOW_SOFTNESS as f32, SHADOW_REACH * self.scene.detail];
            if i < -rim || j < -rim || i >= columns + rim || j >= rows + rim {
                continue;
            }
            // Casts round towards zero: no pixel may be negative before them.
            let [i, j] = [(i + rim) as i32, (j + rim) as i32].map(|k| k - SHADOW_SOFTNESS);
            let taps = -SHADOW_SOFTNESS..=SHADOW_SOFTNESS;
            let mut shadow = 0.0;
            for (x, y) in taps
                .clone()
                .flat_map(|dy| taps.clone().map(move |dx| (i + dx, j + dy)))
            {
                let inside = (0..image.size[0] as i32).contains(&x)
                    && (0..image.size[1] as i32).contains(&y);
                let layers = if inside {
                    image.layers_at(x as u32, y as u32)
                } else {
                    &[]
                };
                if let Some(layer) = layers.iter().rfind(|layer| layer.depth < seen.z) {
                    shadow += (2.0 - 2.0 * (seen.z - layer.depth) / reach).clamp(0.0, 1.0);
                }
            }
            light = light.min(1.0 - shadow / taps.count().pow(2) as f32);
        }
        light
    }
}

/// The `turn`-th spiral of samples.
fn spiral(turn: usize) -> [[f32; 2]; OPENNESS_SAMPLES] {
    // The golden angle spreads neighbours on the spiral in all directions.
    const GOLDEN_ANGLE: f32 = 2.4;
    std::array::from_fn(|k| {
        let t = (k as f32 + 0.5) / OPENNESS_SAMPLES as f32;
        let (sin, cos) = (0.4 * turn as f32 + GOLDEN_ANGLE * k as f32).sin_cos();
        [t * cos, t * sin]
    })
}

/// Colours of a scan without colours, and the share of its points that lie below each: cool
/// ground, then neutral, then warm.
const HEIGHT_COLORS: [(f32, [f32; 3]); 4] = [
    (0.02, [0.44, 0.50, 0.60]),
    (0.40, [0.66, 0.67, 0.66]),
    (0.75, [0.80, 0.75, 0.66]),
    (0.98, [0.90, 0.86, 0.80]),
];

/// Colour of a scan without colours at a height, between those of `heights`.
fn height_color(heights: &[f32; 4], height: f32) -> [f32; 3] {
    let mut color = HEIGHT_COLORS[0].1;
    for k in 1..heights.len() {
        let span = f32::max(heights[k] - heights[k - 1], 1e-6);
        let t = ((height - heights[k - 1]) / span).clamp(0.0, 1.0);
        color = mix(color, HEIGHT_COLORS[k].1, t);
    }
    color
}

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)
}
