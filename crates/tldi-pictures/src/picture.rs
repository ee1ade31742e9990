//! An image, the marks on it, and its file.

use crate::camera::near_of;
use tldi::VirtualCamera;
use tldi::glamx::Vec3;

const CONTACT_COLOR: [u8; 3] = [255, 230, 40];
const CONTACT_RIM: [u8; 3] = [40, 20, 20];
/// Radius of a contact's dot as a share of the picture's height, and in pixels at least: below two pixels its
/// colour is lost in its rim.
const DOT_SHARE: f32 = 0.006;
const LEAST_DOT: f32 = 2.8;
/// Half the width in pixels of the ring of a hidden contact. At half of this it is lost on bright surfaces.
const HIDDEN_RING: f32 = 1.1;
/// Width of a dot's rim in pixels.
const DOT_RIM: f32 = 1.3;
/// An image of 8-bit colours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Red, green and blue of each pixel, row by row.
    pub rgb: Vec<[u8; 3]>,
}

impl Picture {
    /// Draws a dot with a dark rim over a point of the scene, or a faint ring if it `is_hidden`, if it is in view.
    pub(crate) fn mark(&mut self, camera: &VirtualCamera, point: Vec3, is_hidden: bool) {
        let radius = (DOT_SHARE * self.size[1] as f32).max(LEAST_DOT);
        let view = camera.view_from_point(point);
        if view.z < near_of(camera) {
            return;
        }
        let [u, v] = camera.pixel_from_view(view);
        let reach = radius + DOT_RIM;
        // In the picture, however far the point is from it: casts end at what a number holds.
        let within = |middle: f32, count: u32| {
            (middle - reach).floor() as u32..((middle + reach).ceil() as u32).min(count)
        };
        for y in within(v, self.size[1]) {
            for x in within(u, self.size[0]) {
                let distance = (x as f32 + 0.5 - u).hypot(y as f32 + 0.5 - v);
                let pixel = &mut self.rgb[(y * self.size[0] + x) as usize];
                if is_hidden {
                    if (distance - radius).abs() < HIDDEN_RING {
                        *pixel = [0, 1, 2].map(|c| pixel[c].midpoint(CONTACT_COLOR[c]));
                    }
                } else if distance < radius {
                    *pixel = CONTACT_COLOR;
                } else if distance < radius + DOT_RIM {
                    *pixel = CONTACT_RIM;
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
