//! Stages `mark`, `alloc` and `splat`: oriented splats become fragments, sorted by pixel.
//!
//! A splat is the tangent disc of a point. It covers the pixels whose centre lies within its
//! radius, and always the pixel it projects into; its depth at a pixel is that of the tangent
//! plane along the pixel's ray. `mark` counts fragments per pixel, `alloc` turns counts into
//! offsets, `splat` writes the fragments: a counting sort, linear in fragments and pixels.

use super::cull::Survivors;
use crate::{Params, Projection, VirtualCamera};
use glamx::{Mat3, Vec3};

/// Least radius of a splat in pixels: a disc must reach its neighbours' centres (half a pixel's
/// diagonal and a bit), or a cloud finer than the image would leave pixels to single points.
const LEAST_RADIUS_PX: f32 = 0.75;

/// |n·v| under which a surface is seen edge-on (78°): its tangent plane says nothing about depth.
pub(crate) const EDGE_ON: f32 = 0.2;

/// Depth steps in one merge gap: depths are summed as integers, so that sums do not depend on the
/// order of the points.
const DEPTH_STEPS: f32 = 4096.0;

/// Largest weight of a fragment.
const MAX_WEIGHT: f32 = 255.0;

/// One splat in one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fragment {
    /// Depth at the pixel's centre, in [`DepthScale::step`]s from [`DepthScale::zero`].
    pub(crate) depth: i32,
    /// Index of the culled point.
    pub(crate) point: u32,
    /// 1 to 255: falls off with the distance from the centre and with the slope.
    pub(crate) weight: u16,
    /// Sort key before depth: 0 entry, 1 exit (or not oriented), 2 edge-on.
    pub(crate) class: u16,
}

/// Fixed-point depths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthScale {
    /// Depth of step 0, in metres.
    pub(crate) zero: f32,
    /// Metres per step.
    pub(crate) step: f32,
}

impl DepthScale {
    pub(crate) fn new(zero: f32, params: &Params) -> Self {
        Self {
            zero,
            step: params.merge_gap / DEPTH_STEPS,
        }
    }

    pub(crate) fn metres(&self, steps: f32) -> f32 {
        self.zero + steps * self.step
    }
}

/// Fragments of one image and their offsets by pixel.
#[derive(Default)]
pub(crate) struct Fragments {
    /// First fragment of each pixel; one entry more than pixels.
    pub(crate) offsets: Vec<u32>,
    pub(crate) fragments: Vec<Fragment>,
    cursors: Vec<u32>,
    /// Fragments with their pixels, in the order of the points.
    unsorted: Vec<(u32, Fragment)>,
    /// Normal of each culled point in the view frame.
    pub(crate) view_normals: Vec<Vec3>,
    view_points: Vec<Vec3>,
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) origin: [i32; 2],
    pub(crate) size: [u32; 2],
}

impl Rect {
    pub(crate) fn from_corners(min: [i32; 2], max: [i32; 2]) -> Option<Self> {
        if min[0] > max[0] || min[1] > max[1] {
            return None;
        }
        let size = [0, 1].map(|k| (i64::from(max[k]) - i64::from(min[k]) + 1) as u32);
        Some(Self { origin: min, size })
    }

    fn last(&self) -> [i32; 2] {
        [0, 1].map(|k| self.origin[k] + self.size[k] as i32 - 1)
    }

    pub(crate) fn intersection(&self, other: &Self) -> Option<Self> {
        let (a, b) = (self.last(), other.last());
        Self::from_corners(
            [0, 1].map(|k| self.origin[k].max(other.origin[k])),
            [0, 1].map(|k| a[k].min(b[k])),
        )
    }

    pub(crate) fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }
}

/// Where one cloud is seen: pixels and depths, splats included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    pub(crate) rect: Rect,
    pub(crate) near: f32,
    pub(crate) far: f32,
}

fn splat_radius(radius: f32, pixel_size: f32) -> f32 {
    radius.max(LEAST_RADIUS_PX * pixel_size)
}

impl Fragments {
    /// Moves the culled points into the view frame and returns what they cover, or `None` where
    /// nothing is in view.
    pub(crate) fn project(
        &mut self,
        points: &Survivors,
        camera: &VirtualCamera,
    ) -> Option<Footprint> {
        let rotation = Mat3::from_quat(camera.view_from_frame.rotation);
        let translation = camera.view_from_frame.translation;
        self.view_points.clear();
        self.view_points
            .extend((0..points.len()).map(|i| rotation * points.point(i) + translation));
        self.view_normals.clear();
        self.view_normals
            .extend(points.normal.iter().map(|&n| rotation * n));
        let (mut lo, mut hi) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let (mut near, mut far) = (f32::INFINITY, f32::NEG_INFINITY);
        for (view, &radius) in self.view_points.iter().zip(&points.radius) {
            if !in_view(view.z, camera) {
                continue;
            }
            let pixel_size = camera.pixel_size_at(view.z);
            let radius = splat_radius(radius, pixel_size);
            let reach = radius / pixel_size;
            let centre = camera.pixel_from_view(*view);
            for k in 0..2 {
                lo[k] = lo[k].min(centre[k] - reach);
                hi[k] = hi[k].max(centre[k] + reach);
            }
            near = near.min(view.z - radius);
            far = far.max(view.z + radius);
        }
        let mut rect =
            Rect::from_corners(lo.map(|c| c.floor() as i32), hi.map(|c| c.floor() as i32))
                .filter(|_| near <= far)?;
        if let Some(size) = camera.size {
            rect = rect.intersection(&Rect {
                origin: [0, 0],
                size,
            })?;
        }
        Some(Footprint { rect, near, far })
    }

    /// `mark`, `alloc`, `splat` over the pixels of `rect`, for the points of the last `project`.
    pub(crate) fn splat(
        &mut self,
        points: &Survivors,
        oriented: bool,
        camera: &VirtualCamera,
        params: &Params,
        rect: &Rect,
        scale: &DepthScale,
    ) {
        // mark
        self.offsets.clear();
        self.offsets.resize(rect.pixels() + 1, 0);
        self.unsorted.clear();
        for (i, view) in self.view_points.iter().enumerate() {
            if in_view(view.z, camera) {
                let normal = self.view_normals[i];
                let splat = Splat::new(*view, normal, points.radius[i], oriented, camera);
                splat.cover(i as u32, camera, params, rect, scale, |pixel, fragment| {
                    self.offsets[pixel + 1] += 1;
                    self.unsorted.push((pixel as u32, fragment));
                });
            }
        }
        // alloc
        for k in 1..self.offsets.len() {
            self.offsets[k] += self.offsets[k - 1];
        }
        // splat
        self.cursors.clear();
        self.cursors.extend_from_slice(&self.offsets);
        self.fragments.clear();
        self.fragments
            .resize(self.unsorted.len(), Fragment::default());
        for (pixel, fragment) in &self.unsorted {
            let cursor = &mut self.cursors[*pixel as usize];
            self.fragments[*cursor as usize] = *fragment;
            *cursor += 1;
        }
    }
}

fn in_view(depth: f32, camera: &VirtualCamera) -> bool {
    match camera.projection {
        Projection::Orthographic { .. } => true,
        Projection::Perspective { near, far, .. } => depth >= near && depth <= far,
    }
}

/// One oriented disc in the view frame.
struct Splat {
    view: Vec3,
    normal: Vec3,
    centre_px: [f32; 2],
    radius: f32,
    pixel_size: f32,
    class: u16,
    /// |n·v|: the share of the disc's area that the view sees.
    facing: f32,
}

impl Splat {
    fn new(view: Vec3, normal: Vec3, radius: f32, oriented: bool, camera: &VirtualCamera) -> Self {
        let pixel_size = camera.pixel_size_at(view.z);
        let direction = match camera.projection {
            Projection::Orthographic { .. } => Vec3::Z,
            Projection::Perspective { .. } => view.normalize_or(Vec3::Z),
        };
        let along = normal.dot(direction);
        let class = if along.abs() < EDGE_ON {
            2
        } else {
            u16::from(!oriented || along > 0.0)
        };
        Self {
            view,
            normal,
            centre_px: camera.pixel_from_view(view),
            radius: splat_radius(radius, pixel_size),
            pixel_size,
            class,
            facing: along.abs(),
        }
    }

    /// Visits every pixel of `rect` that the splat covers.
    fn cover(
        &self,
        point: u32,
        camera: &VirtualCamera,
        params: &Params,
        rect: &Rect,
        scale: &DepthScale,
        mut visit: impl FnMut(usize, Fragment),
    ) {
        let reach = self.radius / self.pixel_size;
        let own = self.centre_px.map(|c| c.floor() as i32);
        let last = rect.last();
        let range = |k: usize| {
            // Centres at i + 0.5 within reach, and the pixel that holds the point.
            let lo = ((self.centre_px[k] - reach - 0.5).ceil() as i32).min(own[k]);
            let hi = ((self.centre_px[k] + reach - 0.5).floor() as i32).max(own[k]);
            lo.max(rect.origin[k])..=hi.min(last[k])
        };
        let inv_radius_squared = 1.0 / (self.radius * self.radius);
        for j in range(1) {
            for i in range(0) {
                let dx = (i as f32 + 0.5 - self.centre_px[0]) * self.pixel_size;
                let dy = (j as f32 + 0.5 - self.centre_px[1]) * self.pixel_size;
                let rise = self.rise(i, j, dx, dy, camera);
                let share = 1.0 - (dx * dx + dy * dy + rise * rise) * inv_radius_squared;
                if share <= 0.0 && [i, j] != own {
                    continue;
                }
                let depth = self.view.z + params.slope_damping * rise;
                let weight = 1.0 + (MAX_WEIGHT - 1.0) * share.max(0.0) * self.facing;
                let pixel = (j - rect.origin[1]) as usize * rect.size[0] as usize
                    + (i - rect.origin[0]) as usize;
                let fragment = Fragment {
                    depth: ((depth - scale.zero) / scale.step) as i32,
                    point,
                    weight: weight as u16,
                    class: self.class,
                };
                visit(pixel, fragment);
            }
        }
    }

    /// Depth of the tangent plane at the pixel's centre over the depth of the point, in metres,
    /// at most a radius.
    fn rise(&self, i: i32, j: i32, dx: f32, dy: f32, camera: &VirtualCamera) -> f32 {
        let n = self.normal;
        let rise = match camera.projection {
            Projection::Orthographic { .. } => -(n.x * dx + n.y * dy) / n.z,
            Projection::Perspective { .. } => {
                let ray = camera.view_at(i as f32 + 0.5, j as f32 + 0.5, 1.0);
                n.dot(self.view) / n.dot(ray) - self.view.z
            }
        };
        if rise.is_finite() {
            rise.clamp(-self.radius, self.radius)
        } else {
            0.0
        }
    }
}
