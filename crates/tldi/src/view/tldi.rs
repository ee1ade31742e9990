//! The thickened layered depth image itself.

use crate::VirtualCamera;
use glamx::Vec3;

/// Which way a layer faces along its ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(i8)]
pub enum Facing {
    /// The ray enters the body: the outward normal points towards the camera.
    Entry = -1,
    /// Unknown, because normals are not oriented.
    Unknown = 0,
    /// The ray leaves the body.
    Exit = 1,
}

/// One surface along one pixel's ray. Depths are metres along the view's z axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Nearest depth of what was merged into the layer.
    pub near: f32,
    /// Farthest depth of what was merged into the layer.
    pub far: f32,
    /// Depth of the surface.
    pub depth: f32,
    /// Unit normal in the view frame. It points outward if `facing` is known, else towards the
    /// camera. It is zero if the variant does not estimate one.
    pub normal: Vec3,
    /// How far the merged normals agree: 1 on a face. If they belong to several faces, the layer is
    /// that of one face, and this is the length of the mean of all unit normals, at most 0.97. It
    /// is positive at an edge, seen from where `normal` points, and negative in a groove.
    pub agreement: f32,
    /// Which way the layer faces.
    pub facing: Facing,
    /// Blended colour, linear in the 8-bit values; alpha is 0 where the cloud has no colours.
    pub color: [u8; 4],
}

/// A thickened layered depth image: for every pixel of a rectangle the layers along its ray, in
/// order of depth.
///
/// Memory: 4 bytes a pixel and one [`Layer`] per layer, whatever the number of points.
#[derive(Clone, Debug)]
pub struct Tldi {
    /// The camera the image was seen from.
    pub camera: VirtualCamera,
    /// Column and row of the first pixel, in the camera's pixel coordinates.
    pub origin: [i32; 2],
    /// Number of columns and rows.
    pub size: [u32; 2],
    /// Layers of pixel `k` are `layers[offsets[k]..offsets[k + 1]]`, row by row.
    pub(crate) offsets: Vec<u32>,
    pub(crate) layers: Vec<Layer>,
}

impl Default for Tldi {
    fn default() -> Self {
        Self {
            camera: VirtualCamera::along(Vec3::Z, 1.0),
            origin: [0, 0],
            size: [0, 0],
            offsets: vec![0],
            layers: Vec::new(),
        }
    }
}

impl Tldi {
    /// The layers of the pixel in column `i`, row `j` (counted from [`Tldi::origin`]), in order of
    /// depth.
    ///
    /// # Panics
    /// If the pixel is outside [`Tldi::size`].
    pub fn layers_at(&self, i: u32, j: u32) -> &[Layer] {
        assert!(
            i < self.size[0] && j < self.size[1],
            "pixel ({i}, {j}) outside {:?}",
            self.size
        );
        self.layers_of((j * self.size[0] + i) as usize)
    }

    /// Empties the image, keeping its memory, for pixels from `origin` on.
    pub(crate) fn begin(&mut self, camera: &VirtualCamera, origin: [i32; 2], size: [u32; 2]) {
        self.camera = *camera;
        self.origin = origin;
        self.size = size;
        self.layers.clear();
        self.offsets.clear();
        self.offsets.push(0);
    }

    /// So many equal rows of pixels with these layers, a metre wide, seen along z.
    #[cfg(test)]
    pub(crate) fn of_rows(rows: u32, columns: &[&[Layer]]) -> Self {
        let mut image = Self::default();
        let size = [columns.len() as u32, rows];
        image.begin(&VirtualCamera::along(Vec3::Z, 1.0), [0, 0], size);
        for column in (0..rows).flat_map(|_| columns) {
            image.layers.extend_from_slice(column);
            image.offsets.push(image.layers.len() as u32);
        }
        image
    }

    /// The layers of the `k`-th pixel, row by row.
    pub(crate) fn layers_of(&self, k: usize) -> &[Layer] {
        &self.layers[self.offsets[k] as usize..self.offsets[k + 1] as usize]
    }

    /// All layers, row by row, each pixel's in order of depth.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Number of pixels.
    pub fn pixel_count(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }

    /// Most layers that one pixel has.
    pub fn max_layers(&self) -> usize {
        self.offsets
            .windows(2)
            .map(|w| (w[1] - w[0]) as usize)
            .max()
            .unwrap_or(0)
    }
}
