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
        // Beyond the ends of a row is the other side of the picture.
        let is_inner = |k: usize| !matches!((k % width, (k + 1) % width), (0, _) | (_, 0));
        let is_empty = |k: &usize| is_inner(*k) && self.pixels[*k].is_none();
        let mut empty: Vec<usize> = inner.filter(is_empty).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use tldi::Facing;

    /// A gap between two layers is closed in the middle of a row. At its ends there is one only on one side: the other
    /// is in the next row.
    #[test]
    fn gaps_at_the_rim_stay() {
        let size = [5, 4];
        let layer = Layer {
            near: 1.0,
            far: 1.0,
            depth: 1.0,
            normal: -Vec3::Z,
            facing: Facing::Unknown,
            color: [0; 4],
            agreement: 1.0,
        };
        for column in 0..5 {
            let mut front = FrontLayers {
                size,
                pixels: vec![Some((0, layer)); 20],
            };
            let gap = 5 + column;
            front.pixels[gap] = None;
            front.close_pinholes();
            assert_eq!(
                front.pixels[gap].is_some(),
                (1..4).contains(&column),
                "{column}"
            );
        }
    }
}
