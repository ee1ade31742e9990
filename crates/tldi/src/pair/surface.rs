//! What takes part in a comparison: a cloud, or a surface that answers rays exactly.

use crate::{Aabb, PointCloud};
use glamx::Vec3;

/// Where a ray crosses a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance from the ray's origin, in metres (the direction has unit length).
    pub distance: f32,
    /// Outward unit normal of the surface, in the frame of the ray. A ray enters where it points
    /// against the direction and leaves where it points along it.
    pub normal: Vec3,
}

/// A surface known exactly (a primitive, a mesh, a height field): it is seen through rays, one a
/// pixel, so that it has layers like a cloud.
pub trait RaySurface: Sync {
    /// Bounds in the surface's own frame; may be infinite (a half-space).
    fn bounds(&self) -> Aabb;

    /// Appends every crossing of the ray `origin + t · direction`, `0 ≤ t ≤ max_distance`, in the
    /// surface's own frame, in order of `t`. `direction` has unit length.
    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>);

    /// Signed distance of `point` to the surface (negative inside, where there is an inside) and
    /// the outward unit normal at the nearest point of the surface.
    fn project(&self, point: Vec3) -> (f32, Vec3);

    /// Whether the surface bounds a volume, so that its normals tell inside from outside.
    fn is_closed(&self) -> bool;
}

/// A point cloud without normals whose points only a device holds. This is what the host knows
/// about it. Made by the device's backend, which alone can compare it.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceCloud {
    /// Number by which the backend knows it.
    pub id: u64,
    /// Number of points.
    pub len: usize,
    /// Bounds of the positions, or more, metres.
    pub bounds: Aabb,
    /// Mean point radius r̄ in metres.
    pub mean_radius: f32,
    /// No point has a larger radius, metres.
    pub max_radius: f32,
}

/// One side of a pair.
#[derive(Clone, Copy)]
pub enum Surface<'a> {
    /// A point cloud in its own frame.
    Cloud(&'a PointCloud<'a>),
    /// An exact surface in its own frame.
    Exact(&'a dyn RaySurface),
    /// A point cloud in its own frame that lives on a device.
    Device(&'a DeviceCloud),
}

impl Surface<'_> {
    /// Bounds in the surface's own frame, point radii not included.
    pub fn bounds(&self) -> Aabb {
        match self {
            Surface::Cloud(cloud) => cloud.bounds(),
            Surface::Exact(surface) => surface.bounds(),
            Surface::Device(cloud) => cloud.bounds,
        }
    }

    /// Whether the surface's normals tell its inside from its outside.
    pub(crate) fn is_oriented(&self) -> bool {
        match self {
            Surface::Cloud(cloud) => cloud.normals_oriented(),
            Surface::Exact(surface) => surface.is_closed(),
            Surface::Device(_) => false,
        }
    }

    /// Standard deviation of the points along the surface's normal in metres; 0 where it is not told.
    pub(crate) fn noise(&self) -> f32 {
        match self {
            Surface::Cloud(cloud) => cloud.noise(),
            Surface::Exact(_) | Surface::Device(_) => 0.0,
        }
    }

    /// Mean point radius in metres; 0 for an exact surface.
    pub fn mean_radius(&self) -> f32 {
        match self {
            Surface::Cloud(cloud) => cloud.mean_radius(),
            Surface::Exact(_) => 0.0,
            Surface::Device(cloud) => cloud.mean_radius,
        }
    }
}

/// Whether the first of two surfaces is the smaller one, by the diagonals of their bounds, which have these extents in
/// metres. Of two that are equal, the second counts as the smaller one.
///
/// ```
/// use tldi::{glamx::Vec3, plan::first_is_smaller};
/// let (body, floor) = (Vec3::ONE, Vec3::new(9.0, 0.0, 9.0));
/// assert!(first_is_smaller([body, floor]));
/// assert!(!first_is_smaller([floor, body]) && !first_is_smaller([body, body]));
/// ```
pub fn first_is_smaller([first, second]: [Vec3; 2]) -> bool {
    first.length_squared() < second.length_squared()
}
