//! What is seen first in every pixel of a picture.

use crate::scene::{Scene, pixels_of};
use tldi::glamx::Vec3;
use tldi::{Layer, VirtualCamera};

/// Rounds of closing gaps, each by a pixel from both sides. Half as many leave specks in a scan that is as dense as
/// the picture; twice as many close real holes.
const PINHOLE_ROUNDS: u32 = 4;

/// The front layer of every pixel over all clouds.
pub(crate) struct FrontLayers {
    pub(crate) size: [u32; 2],
    /// Index of the item and its layer, row by row.
    pub(crate) pixels: Vec<Option<(u16, Layer)>>,
}

impl FrontLayers {
    /// What `camera` sees.
    pub(crate) fn of(scene: &Scene<'_>, camera: &VirtualCamera) -> Self {
        let size = camera.size.unwrap_or_default();
        let mut pixels: Vec<Option<(u16, Layer)>> = vec![None; (size[0] * size[1]) as usize];
        for (index, item) in scene.items.iter().enumerate() {
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
        let mut front = Self { size, pixels };
        front.close_pinholes();
        front
    }

    /// Whether a point of the scene lies farther than `slack` metres behind what is seen in front of it.
    pub(crate) fn hides(&self, camera: &VirtualCamera, point: Vec3, slack: f32) -> bool {
        let view = camera.view_from_point(point);
        let [u, v] = camera.pixel_from_view(view).map(|c| c.floor() as i64);
        let [width, height] = self.size.map(i64::from);
        let inside = (0..width).contains(&u) && (0..height).contains(&v);
        let front = inside.then(|| self.pixels[(v * width + u) as usize]);
        front
            .flatten()
            .is_some_and(|(_, layer)| layer.depth + slack < view.z)
    }

    /// Gives a pixel without a layer the one of a neighbour, if there are layers on opposite sides of it. That
    /// closes gaps of a few pixels, where a sparse scan does not quite cover the image. Real holes stay.
    fn close_pinholes(&mut self) {
        let width = self.size[0] as usize;
        let inner = width + 1..self.pixels.len().saturating_sub(width + 1);
        let mut empty: Vec<usize> = inner.filter(|&k| self.pixels[k].is_none()).collect();
        for _ in 0..PINHOLE_ROUNDS {
            let closed: Vec<_> = (empty.iter())
                .map(|&k| {
                    let opposite = [1, width, width + 1, width - 1].into_iter();
                    opposite
                        .filter_map(|step| self.pixels[k - step].zip(self.pixels[k + step]))
                        .map(|(a, b)| if a.1.depth > b.1.depth { a } else { b })
                        .max_by(|a, b| a.1.depth.total_cmp(&b.1.depth))
                })
                .collect();
            for (&k, layer) in empty.iter().zip(closed) {
                self.pixels[k] = layer;
            }
            empty.retain(|&k| self.pixels[k].is_none());
        }
    }
}
