//! Pictures from the layers of clouds.
//!
//! One image is built per cloud and merged by depth, front layer by front layer, as in the paper
//! (Radwan, Ohrhallinger and Wimmer 2014, section 6): the same images that find collisions carry
//! the colours. Shadows come from images seen from the sun.

use crate::front_layers::FrontLayers;
use crate::picture::Picture;
use crate::scene::Scene;
use crate::shading::Frame;
use rayon::prelude::*;
use tldi::glamx::Vec3;
use tldi::{Projection, VirtualCamera};

/// Depth up to which a contact may lie behind what is seen and still count as seen, in sizes of detail. A contact
/// always lies between two surfaces: half as much hides those at the feet of a body, twice as much shows those on its
/// far side.
const HIDDEN_BEHIND: f32 = 0.35;
/// Samples along each edge of a pixel. One leaves speckled rims; three take twice as long as two.
const SAMPLES: u32 = 2;

impl Scene<'_> {
    /// Draws the scene as `camera` sees it, with a dot at each of `contacts` (in the scene's
    /// frame, metres), or a faint ring where something hides it. The camera must have a fixed size.
    ///
    /// # Panics
    /// If the camera has no fixed size.
    pub fn draw(&self, camera: &VirtualCamera, contacts: &[Vec3]) -> Picture {
        let size = camera.size.expect("a picture's camera has a fixed size");
        let fine = finer(camera, SAMPLES);
        let front = FrontLayers::of(self, &fine);
        let frame = Frame::new(self, &fine, &front);
        let [width, height] = size;
        let rgb = (0..width * height)
            .into_par_iter()
            .map(|k| frame.mean(k % width, k / width, SAMPLES))
            .collect();
        let mut picture = Picture { size, rgb };
        // Those in full view last: they lie over the others.
        let (hidden, seen): (Vec<Vec3>, Vec<Vec3>) = (contacts.iter())
            .partition(|contact| front.hides(&fine, **contact, HIDDEN_BEHIND * self.detail));
        for (contacts, is_hidden) in [(hidden, true), (seen, false)] {
            for contact in contacts {
                picture.mark(camera, contact, is_hidden);
            }
        }
        picture
    }
}

/// The same view in pixels `times` as small.
fn finer(camera: &VirtualCamera, times: u32) -> VirtualCamera {
    let projection = match camera.projection {
        Projection::Orthographic { pixel_size } => Projection::Orthographic {
            pixel_size: pixel_size / times as f32,
        },
        Projection::Perspective {
            focal_px,
            near,
            far,
        } => Projection::Perspective {
            focal_px: focal_px * times as f32,
            near,
            far,
        },
    };
    VirtualCamera {
        projection,
        size: camera.size.map(|size| size.map(|n| n * times)),
        ..*camera
    }
}
