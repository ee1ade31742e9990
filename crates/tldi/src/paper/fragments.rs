//! From points to the fragments of each pixel: one per cylinder that covers the pixel, in order of
//! front depth.
//!
//! The cylinders are sorted by front depth once; binning them by pixel keeps that order, so that no
//! pixel is sorted on its own, however many fragments it has.

use crate::counting_sort::starts_of;
use crate::cpu::rect::Rect;
use crate::ordered_bits::ordered_bits;
use crate::{PointCloud, Projection, VirtualCamera};
use glamx::{Pose3, Vec3};
use rayon::prelude::*;

/// Exponent of the Gaussian at the rim of a disc: the weight at the in-plane distance `d` is
/// `exp(RIM_EXPONENT (d / r)²)`, so that the standard deviation is half the radius.
const RIM_EXPONENT: f32 = -2.0;

/// Beyond this many pixels from the origin of the image, `f32` does not tell pixels apart: no
/// image reaches there.
const MAX_PIXEL: f32 = (1 << 24) as f32;

/// One cylinder in one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fragment {
    /// Front depth of the cylinder, metres.
    pub(super) near: f32,
    /// Back depth of the cylinder, metres.
    pub(super) far: f32,
    /// Gaussian of the in-plane distance between the pixel's centre and the cylinder's axis:
    /// 1 at the axis, e⁻² at the rim.
    pub(super) weight: f32,
    /// Index of the point in the cloud.
    pub(super) point: u32,
}

impl Fragment {
    /// Whether the depth ranges of the cylinders share a depth.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.near <= other.far && other.near <= self.far
    }
}

/// A view-aligned cylinder in pixel coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cylinder {
    /// Centre of the disc in pixels.
    center: [f32; 2],
    /// Radius of the disc in pixels.
    radius: f32,
    /// Front and back depth, metres.
    near: f32,
    far: f32,
    point: u32,
    /// First row and the one after the last, in the whole pixel grid.
    rows: [i32; 2],
}

impl Cylinder {
    /// The cylinder around a point in view coordinates, or `None` where it is outside the camera's
    /// depths or pixels.
    fn new(view: Vec3, radius: f32, point: u32, camera: &VirtualCamera) -> Option<Self> {
        let center = camera.pixel_from_view(view);
        let radius_px = radius / camera.pixel_size_at(view.z);
        let inside = |c: f32| c.abs() + radius_px < MAX_PIXEL;
        if !(inside(center[0]) && inside(center[1])) {
            return None;
        }
        let [low, high] = centers_within(center[1], radius_px);
        let own = center[1].floor() as i32;
        Some(Self {
            center,
            radius: radius_px,
            near: view.z - radius,
            far: view.z + radius,
            point,
            rows: [low.min(own), high.max(own + 1)],
        })
    }

    /// Columns of row `j` that the disc covers: the first and the one after the last.
    ///
    /// A pixel is covered where its centre is within the disc; the pixel that holds the disc's
    /// centre is always covered, so that discs smaller than a pixel are seen, as rasterisers of
    /// points do.
    fn columns(&self, j: i32) -> [i32; 2] {
        let [u, v] = self.center;
        let dy = j as f32 + 0.5 - v;
        let own = u.floor() as i32;
        let half_squared = self.radius * self.radius - dy * dy;
        let [low, high] = if half_squared >= 0.0 {
            centers_within(u, half_squared.sqrt())
        } else {
            [own, own]
        };
        if j == v.floor() as i32 {
            [low.min(own), high.max(own + 1)]
        } else {
            [low, high]
        }
    }

    /// The Gaussian weight in pixel `(i, j)`. The pixel that is covered for want of any centre
    /// counts as at the rim.
    fn weight(&self, i: i32, j: i32) -> f32 {
        let dx = i as f32 + 0.5 - self.center[0];
        let dy = j as f32 + 0.5 - self.center[1];
        let share = (dx * dx + dy * dy) / (self.radius * self.radius);
        (RIM_EXPONENT * share.min(1.0)).exp()
    }

    fn fragment(&self, i: i32, j: i32) -> Fragment {
        Fragment {
            near: self.near,
            far: self.far,
            weight: self.weight(i, j),
            point: self.point,
        }
    }
}

/// The pixels of one axis whose centres are within `reach` of `position`: the first and the one
/// after the last.
fn centers_within(position: f32, reach: f32) -> [i32; 2] {
    [
        (position - reach - 0.5).ceil() as i32,
        (position + reach - 0.5).floor() as i32 + 1,
    ]
}

/// The cylinders of all points that the camera sees, in order of front depth; `keys` is memory to
/// sort in.
pub(super) fn project(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    camera: &VirtualCamera,
    keys: &mut Vec<u64>,
    cylinders: &mut Vec<Cylinder>,
) {
    let view_from_cloud = camera.view_from_frame * *frame_from_cloud;
    let view = |point: u32| view_from_cloud * cloud.point(point as usize);
    let [min_depth, max_depth] = match camera.projection {
        Projection::Orthographic { .. } => [f32::MIN, f32::MAX],
        Projection::Perspective { near, far, .. } => [near.max(f32::MIN_POSITIVE), far],
    };

    // One key a point: front depth, then index, so that the order is total and the same however
    // it is sorted.
    (0..cloud.len() as u32)
        .into_par_iter()
        .with_min_len(1024)
        .map(|point| {
            let depth = view(point).z;
            if depth >= min_depth && depth <= max_depth {
                let near = depth - cloud.radius(point as usize);
                u64::from(ordered_bits(near)) << 32 | u64::from(point)
            } else {
                u64::MAX
            }
        })
        .collect_into_vec(keys);
    keys.par_sort_unstable();
    keys.truncate(keys.partition_point(|key| *key != u64::MAX));

    keys.par_iter()
        .with_min_len(1024)
        .map(|key| {
            let point = *key as u32;
            Cylinder::new(view(point), cloud.radius(point as usize), point, camera)
                .unwrap_or_default()
        })
        .collect_into_vec(cylinders);
    cylinders.retain(|cylinder| cylinder.rows[0] < cylinder.rows[1]);
}

/// The rectangle of all rows and columns with pixel centres within the bounds of a cylinder.
pub(super) fn bounding_rect(cylinders: &[Cylinder]) -> Rect {
    if cylinders.is_empty() {
        return Rect {
            origin: [0, 0],
            size: [0, 0],
        };
    }
    let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
    for cylinder in cylinders {
        let own = cylinder.center[0].floor() as i32;
        let [first, end] = centers_within(cylinder.center[0], cylinder.radius);
        low = [low[0].min(first.min(own)), low[1].min(cylinder.rows[0])];
        high = [high[0].max(end.max(own + 1)), high[1].max(cylinder.rows[1])];
    }
    Rect {
        origin: low,
        size: [0, 1].map(|axis| high[axis].abs_diff(low[axis])),
    }
}

/// The fragments of every pixel of a rectangle.
#[derive(Default)]
pub(super) struct Bins {
    /// End of each pixel's fragments, row by row.
    ends: Vec<usize>,
    fragments: Vec<Fragment>,
}

impl Bins {
    /// Bins the fragments of the cylinders `indices`, in that order, by the pixels of `rect`.
    /// Cost: linear in pixels and fragments.
    pub(super) fn fill(&mut self, rect: &Rect, cylinders: &[Cylinder], indices: &[u32]) {
        self.ends.clear();
        self.ends.resize(rect.pixels(), 0);
        for &index in indices {
            for (_, columns, row_start) in spans(&cylinders[index as usize], rect) {
                for i in columns {
                    self.ends[row_start + i] += 1;
                }
            }
        }
        let total = starts_of(&mut self.ends);
        let unset = Fragment {
            near: 0.0,
            far: 0.0,
            weight: 0.0,
            point: 0,
        };
        self.fragments.resize(total, unset);
        for &index in indices {
            let cylinder = &cylinders[index as usize];
            for (j, columns, row_start) in spans(cylinder, rect) {
                for i in columns {
                    let end = &mut self.ends[row_start + i];
                    self.fragments[*end] = cylinder.fragment(rect.origin[0] + i as i32, j);
                    *end += 1;
                }
            }
        }
    }

    /// The fragments of every pixel, row by row, each pixel's in the order of the cylinders.
    pub(super) fn pixels(&self) -> impl Iterator<Item = &[Fragment]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| {
            let fragments = &self.fragments[start..end];
            start = end;
            fragments
        })
    }
}

/// What a cylinder covers of a rectangle: row in the pixel grid, columns from the rectangle's
/// first, index of the row's first pixel in the rectangle.
fn spans(
    cylinder: &Cylinder,
    rect: &Rect,
) -> impl Iterator<Item = (i32, std::ops::Range<usize>, usize)> {
    let [first_row, end_row] = cylinder.rows_in(rect);
    let [left, width] = [i64::from(rect.origin[0]), i64::from(rect.size[0])];
    (first_row..end_row).map(move |j| {
        let columns = cylinder.columns(j);
        let [low, high] = columns.map(|i| (i64::from(i) - left).clamp(0, width) as usize);
        let row = j.abs_diff(rect.origin[1]) as usize;
        (j, low..high, row * width as usize)
    })
}

impl Cylinder {
    /// The cylinder's rows within a rectangle: the first and the one after the last.
    pub(super) fn rows_in(&self, rect: &Rect) -> [i32; 2] {
        let top = i64::from(rect.origin[1]);
        let bottom = top + i64::from(rect.size[1]);
        self.rows.map(|j| i64::from(j).clamp(top, bottom) as i32)
    }
}
