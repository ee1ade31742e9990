//! Virtual cameras: where a pair of clouds is looked at from.

use glamx::{Mat3, Pose3, Vec3};

/// How a camera maps points to pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Parallel rays; every pixel covers `pixel_size` × `pixel_size` metres.
    Orthographic {
        /// Edge of a pixel in metres.
        pixel_size: f32,
    },
    /// Rays through the origin of the view frame; a pixel covers `depth / focal_px` metres.
    Perspective {
        /// Focal length in pixels: `width / (2 tan(fov / 2))`.
        focal_px: f32,
        /// Nearest depth that is seen, in metres (> 0).
        near: f32,
        /// Farthest depth that is seen, in metres.
        far: f32,
    },
}

/// A camera in the reference frame of a query (usually the frame of the first body).
///
/// The view frame has x to the right, y down and z along the viewing direction: `depth` is the z
/// of the view frame and grows away from the camera. Pixel `(i, j)` has its centre at
/// `(i + 0.5, j + 0.5)` in pixel coordinates. Orthographic pixel coordinates are anchored at the
/// origin of the view frame, so that a camera whose axis stays the same keeps the same pixel grid
/// from frame to frame.
///
/// ```
/// use tldi::{VirtualCamera, glamx::Vec3};
/// let camera = VirtualCamera::along(Vec3::new(0.0, -1.0, 0.0), 0.01);
/// let view = camera.view_from_point(Vec3::new(0.0, -2.0, 0.0));
/// assert!((view.z - 2.0).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualCamera {
    /// From the reference frame into the view frame.
    pub view_from_frame: Pose3,
    /// How view coordinates become pixels.
    pub projection: Projection,
    /// Number of columns and rows of a fixed image. With `None`, the image is as large as what the
    /// camera sees (orthographic cameras only).
    pub size: Option<[u32; 2]>,
}

impl VirtualCamera {
    /// An orthographic camera looking along `axis` (need not be of unit length, must not be zero)
    /// with pixels of `pixel_size` metres, through the origin of the reference frame.
    pub fn along(axis: Vec3, pixel_size: f32) -> Self {
        let z = axis.normalize();
        // The frame is a function of the axis alone, continuous but at one pole: equal axes give
        // equal pixel grids (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
        let (x, y) = z.any_orthonormal_pair();
        let frame_from_view = Mat3::from_cols(x, y, z);
        let rotation = glamx::Quat::from_mat3(&frame_from_view.transpose()).normalize();
        Self {
            view_from_frame: Pose3::from_parts(Vec3::ZERO, rotation),
            projection: Projection::Orthographic { pixel_size },
            size: None,
        }
    }

    /// The same view with pixels larger by a factor of `by`, where it has no fixed size.
    pub(crate) fn coarser(self, by: f32) -> Self {
        match (self.projection, self.size) {
            (Projection::Orthographic { pixel_size }, None) => Self {
                projection: Projection::Orthographic {
                    pixel_size: by * pixel_size,
                },
                ..self
            },
            _ => self,
        }
    }

    /// A perspective camera at `eye` that looks at `target`, with the image's vertical axis along
    /// `up`, a horizontal field of view `fov` in radians, and `near` and `far` depths in metres.
    pub fn perspective(
        eye: Vec3,
        target: Vec3,
        up: Vec3,
        fov: f32,
        size: [u32; 2],
        near: f32,
        far: f32,
    ) -> Self {
        let z = (target - eye).normalize();
        let x = z
            .cross(up)
            .try_normalize()
            .unwrap_or_else(|| z.any_orthonormal_vector());
        let y = z.cross(x);
        let frame_from_view = Mat3::from_cols(x, y, z);
        let rotation = glamx::Quat::from_mat3(&frame_from_view.transpose()).normalize();
        Self {
            view_from_frame: Pose3::from_parts(rotation * -eye, rotation),
            projection: Projection::Perspective {
                focal_px: 0.5 * size[0] as f32 / (0.5 * fov).tan(),
                near,
                far,
            },
            size: Some(size),
        }
    }

    /// The viewing direction in the reference frame (unit length).
    pub fn axis(&self) -> Vec3 {
        self.view_from_frame.rotation.inverse() * Vec3::Z
    }

    /// View coordinates (metres) of a point of the reference frame.
    pub fn view_from_point(&self, point: Vec3) -> Vec3 {
        self.view_from_frame * point
    }

    /// The point of the reference frame at pixel coordinates `(u, v)` and `depth` metres.
    pub fn point_at(&self, u: f32, v: f32, depth: f32) -> Vec3 {
        self.view_from_frame
            .inverse_transform_point(self.view_at(u, v, depth))
    }

    /// View coordinates (metres) at pixel coordinates `(u, v)` and `depth` metres.
    pub fn view_at(&self, u: f32, v: f32, depth: f32) -> Vec3 {
        match self.projection {
            Projection::Orthographic { pixel_size } => {
                Vec3::new(u * pixel_size, v * pixel_size, depth)
            }
            Projection::Perspective { focal_px, .. } => {
                let [w, h] = self.size.unwrap_or([0, 0]);
                let s = depth / focal_px;
                Vec3::new((u - 0.5 * w as f32) * s, (v - 0.5 * h as f32) * s, depth)
            }
        }
    }

    /// Pixel coordinates of a point given in view coordinates.
    pub fn pixel_from_view(&self, view: Vec3) -> [f32; 2] {
        match self.projection {
            Projection::Orthographic { pixel_size } => [view.x / pixel_size, view.y / pixel_size],
            Projection::Perspective { focal_px, .. } => {
                let [w, h] = self.size.unwrap_or([0, 0]);
                let s = focal_px / view.z;
                [view.x * s + 0.5 * w as f32, view.y * s + 0.5 * h as f32]
            }
        }
    }

    /// Edge of a pixel in metres at `depth`.
    pub fn pixel_size_at(&self, depth: f32) -> f32 {
        match self.projection {
            Projection::Orthographic { pixel_size } => pixel_size,
            Projection::Perspective { focal_px, .. } => depth / focal_px,
        }
    }
}
