//! Stage `columns`: the culled points in the view, and the columns of pixels in which the surfaces
//! can meet.
//!
//! If all of `a` is out of reach behind all of `b`, neither needs to be drawn. This is the early
//! rejection of the paper (section 5), for tiles of a few pixels instead of the whole image. In the
//! remaining columns, all layers of both are built, because deep contacts need them.

use super::cull::Survivors;
use super::fold::{FARTHEST_PIXEL, ViewFold};
use super::lanes::{bounds, multiversioned, truncated};
use super::rect::{Footprint, Rect};
use super::splat_radius::splat_radius;
use crate::pair::sampling::AIM_SAMPLES;
use crate::{Projection, VirtualCamera};
use glamx::{Mat3, Vec3};
use std::f32::consts::FRAC_1_SQRT_2;

/// Places in which the depths of points out of view end up by turns. In a single one, each would wait for the one before.
/// Only speed depends on it.
const OUT_OF_VIEW_PLACES: usize = 8;

/// The culled points of one side in the view frame, metres.
#[derive(Default)]
pub(crate) struct Columns {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) depth: Vec<f32>,
    /// Index of the tile of each point. Points out of view have one beyond the last tile.
    pub(crate) tile: Vec<u32>,
    /// For each tile, the least depth (of `a`) or the greatest (of `b`) that may be seen in it.
    depths: Vec<f32>,
    /// The negative of the greatest ones, where both are of interest.
    greatest: Vec<f32>,
    spare: Vec<f32>,
}

/// Tiles over a rectangle of pixels and a rim of one tile. What a point covers is within the
/// tiles next to its own.
#[derive(Clone, Copy)]
pub(crate) struct Tiles {
    origin: [i32; 2],
    /// Pixels.
    edge: i32,
    dims: [usize; 2],
}

/// Which tiles are needed, 1 or 0; kept from call to call.
#[derive(Default)]
pub(crate) struct Touching {
    /// Those from which splats reach where the surfaces can meet.
    modelled: Vec<u8>,
    /// Those and what holds neighbours of their points.
    around: Vec<u8>,
    spare: Vec<u8>,
}

impl Columns {
    /// Moves the culled points into the view frame and returns what their splats, of `radius`
    /// metres at the most, cover; `None` where nothing is in view.
    pub(crate) fn project(
        &mut self,
        points: &Survivors,
        radius: f32,
        camera: &VirtualCamera,
    ) -> Option<Footprint> {
        let n = points.len();
        for coordinate in [&mut self.x, &mut self.y, &mut self.depth] {
            coordinate.resize(n, 0.0);
        }
        transform(
            &Mat3::from_quat(camera.view_from_frame.rotation),
            camera.view_from_frame.translation,
            [&points.x, &points.y, &points.z],
            [&mut self.x, &mut self.y, &mut self.depth],
        );
        let [x, y, z] = [&self.x, &self.y, &self.depth].map(|c| bounds(c));
        let (mut lo, mut hi) = (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1));
        let (mut first, mut last) = match camera.projection {
            Projection::Orthographic { .. } => {
                (camera.pixel_from_view(lo), camera.pixel_from_view(hi))
            }
            Projection::Perspective { near, far, .. } => {
                (lo.z, hi.z) = (f32::INFINITY, f32::NEG_INFINITY);
                let (mut first, mut last) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
                for i in 0..n {
                    let view = self.view(i);
                    if view.z >= near && view.z <= far {
                        let pixel = camera.pixel_from_view(view);
                        first = [0, 1].map(|k| first[k].min(pixel[k]));
                        last = [0, 1].map(|k| last[k].max(pixel[k]));
                        lo.z = lo.z.min(view.z);
                        hi.z = hi.z.max(view.z);
                    }
                }
                (first, last)
            }
        };
        if lo.z > hi.z {
            return None;
        }
        // Splats look largest in pixels where they are nearest, and are largest in metres where
        // they are farthest.
        let nearest = camera.pixel_size_at(lo.z);
        let reach = splat_radius(radius, nearest) / nearest;
        let radius = splat_radius(radius, camera.pixel_size_at(hi.z));
        first = first.map(|c| c - reach);
        last = last.map(|c| c + reach);
        let mut rect = rect_of(first, last)?;
        if let Some(size) = camera.size {
            rect = rect.intersection(&Rect {
                origin: [0, 0],
                size,
            })?;
        }
        Some(Footprint {
            rect,
            near: lo.z - radius,
            far: hi.z + radius,
            reach,
            pixel_size: nearest,
        })
    }

    /// Moves the points of an orthographic view to where `fold` has them, and `seen` with them.
    pub(crate) fn fold(&mut self, fold: &ViewFold, camera: &VirtualCamera, seen: &mut Footprint) {
        fold.fold(&mut self.x, &mut self.y);
        let [x, y] = [bounds(&self.x), bounds(&self.y)];
        let corner = |x, y, reach| {
            let pixel = camera.pixel_from_view(Vec3::new(x, y, 0.0));
            pixel.map(|c| c + reach)
        };
        let (first, last) = (corner(x.0, y.0, -seen.reach), corner(x.1, y.1, seen.reach));
        seen.rect = rect_of(first, last).unwrap_or(seen.rect);
    }

    /// Coordinates of the points across the view, metres.
    pub(crate) fn across(&self) -> impl Iterator<Item = [f32; 2]> + Clone {
        self.x.iter().zip(&self.y).map(|(x, y)| [*x, *y])
    }

    /// Median depth of an even selection of the points, metres.
    pub(crate) fn median_depth(&self) -> f32 {
        let mut depths = arrayvec::ArrayVec::<f32, AIM_SAMPLES>::new();
        let step = self.depth.len().div_ceil(AIM_SAMPLES).max(1);
        depths.extend(self.depth.iter().copied().step_by(step));
        depths.sort_unstable_by(f32::total_cmp);
        depths.get(depths.len() / 2).copied().unwrap_or(0.0)
    }

    pub(crate) fn view(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.depth[i])
    }

    /// Sorts the points into tiles.
    pub(crate) fn sort(&mut self, tiles: &Tiles, camera: &VirtualCamera) {
        self.tile.resize(self.x.len(), 0);
        match camera.projection {
            Projection::Orthographic { pixel_size } => {
                locate(tiles, pixel_size, &self.x, &self.y, &mut self.tile);
            }
            Projection::Perspective { near, far, .. } => {
                for i in 0..self.x.len() {
                    let view = self.view(i);
                    self.tile[i] = match view.z >= near && view.z <= far {
                        true => tiles.of(camera.pixel_from_view(view)),
                        false => tiles.out_of_view(),
                    };
                }
            }
        }
    }

    /// Finds the least `depth · sign`, metres, of the points in each tile and its neighbours. Their splats, which are
    /// tilted, may be nearer by up to a radius: that much is not added, because the next points of the surface are in
    /// the neighbouring tiles.
    pub(crate) fn reduce(&mut self, tiles: &Tiles, sign: f32) {
        self.depths.clear();
        (self.depths).resize(tiles.count() + OUT_OF_VIEW_PLACES, f32::INFINITY);
        for (k, (&tile, depth)) in self.tile.iter().zip(&self.depth).enumerate() {
            let is_out = tile == tiles.out_of_view();
            let aside = if is_out { k % OUT_OF_VIEW_PLACES } else { 0 };
            let least = &mut self.depths[tile as usize + aside];
            let depth = sign * depth;
            *least = if depth < *least { depth } else { *least };
        }
        self.depths.truncate(tiles.count());
        dilate(&mut self.depths, &mut self.spare, tiles.dims[0], |a, b| {
            if a < b { a } else { b }
        });
    }

    /// Whether in a tile a point lies less than `reach` metres behind one of `b`, or before it. After
    /// [`reduce`](Self::reduce) with the signs 1 and, for `b`, -1.
    pub(crate) fn meet(&self, b: &Self, tile: usize, reach: f32) -> bool {
        self.depths[tile] + b.depths[tile] <= reach
    }

    /// Largest distance by which a point of `b` lies behind one of this side in a tile, metres.
    /// After [`reduce`](Self::reduce) as for [`meet`](Self::meet).
    pub(crate) fn greatest_overlap(&self, b: &Self) -> f32 {
        let behind = self.depths.iter().zip(&b.depths).map(|(a, b)| -(a + b));
        behind.fold(f32::NEG_INFINITY, f32::max)
    }

    /// Finds the least and the greatest depth, metres, of the points in each tile and its neighbours.
    pub(crate) fn reduce_both(&mut self, tiles: &Tiles) {
        self.reduce(tiles, -1.0);
        std::mem::swap(&mut self.depths, &mut self.greatest);
        self.reduce(tiles, 1.0);
    }

    /// Least and greatest depth in a tile, metres; in this order where it holds something. After
    /// [`reduce_both`](Self::reduce_both).
    pub(crate) fn depths(&self, tile: usize) -> [f32; 2] {
        [self.depths[tile], -self.greatest[tile]]
    }

    /// Fills `out` with the indices of all points that are in view.
    pub(crate) fn in_view(&self, tiles: &Tiles, out: &mut Vec<u32>) {
        let all = 0..self.tile.len() as u32;
        out.clear();
        out.extend(all.filter(|&i| self.tile[i as usize] != tiles.out_of_view()));
    }

    /// Fills `out` with the indices of the points that are modelled.
    pub(crate) fn modelled(&self, touching: &Touching, out: &mut Vec<u32>) {
        self.filter(&touching.modelled, out);
    }

    /// Fills `out` with the indices of the points that are modelled and of their neighbours.
    pub(crate) fn around(&self, touching: &Touching, out: &mut Vec<u32>) {
        self.filter(&touching.around, out);
    }

    fn filter(&self, tiles: &[u8], out: &mut Vec<u32>) {
        out.resize(self.tile.len(), 0);
        let mut count = 0;
        for (i, tile) in self.tile.iter().enumerate() {
            out[count] = i as u32;
            count += usize::from(tiles[*tile as usize]);
        }
        out.truncate(count);
    }

    /// Whether a point is in a tile that is modelled.
    pub(crate) fn is_modelled(&self, touching: &Touching, i: u32) -> bool {
        touching.modelled[self.tile[i as usize] as usize] > 0
    }
}

impl Tiles {
    /// `reach` is that of the largest splat in pixels, more than 0. Tiles are as small as it allows: with twice the edge,
    /// shallow frames draw up to twice the points.
    pub(crate) fn new(rect: &Rect, reach: f32) -> Self {
        // No image is wider.
        let edge = reach.ceil().min(FARTHEST_PIXEL) as i32;
        Self {
            origin: rect.origin.map(|o| o.saturating_sub(edge)),
            edge,
            dims: rect.size.map(|s| s.div_ceil(edge as u32) as usize + 2),
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.dims[0] * self.dims[1]
    }

    /// Index of the tile of points that are out of view, beyond the last.
    fn out_of_view(&self) -> u32 {
        self.count() as u32
    }

    /// Indices of the tiles whose points can reach into `rows`.
    pub(crate) fn around_rows(&self, rows: &Rect) -> std::ops::Range<usize> {
        let row_of = |j: i32| ((j - self.origin[1]) / self.edge) as usize;
        let last = rows.origin[1] + rows.size[1] as i32 - 1;
        let (first, end) = (row_of(rows.origin[1]) - 1, row_of(last) + 2);
        first * self.dims[0]..end.min(self.dims[1]) * self.dims[0]
    }

    /// Half the diagonal of a tile, pixels.
    pub(crate) fn half_diagonal(&self) -> f32 {
        FRAC_1_SQRT_2 * self.edge as f32
    }

    /// Pixel coordinates of the middle of a tile.
    pub(crate) fn middle(&self, tile: usize) -> [f32; 2] {
        let place = [tile % self.dims[0], tile / self.dims[0]];
        [0, 1].map(|k| self.origin[k] as f32 + (place[k] as f32 + 0.5) * self.edge as f32)
    }

    fn of(&self, pixel: [f32; 2]) -> u32 {
        let [x, y] = [0, 1].map(|k| (pixel[k].floor() - self.origin[k] as f32) / self.edge as f32);
        let [w, h] = self.dims.map(|d| d as f32);
        if x >= 0.0 && y >= 0.0 && x < w && y < h {
            y as u32 * self.dims[0] as u32 + x as u32
        } else {
            self.out_of_view()
        }
    }
}

impl Touching {
    /// Marks the tiles in which the surfaces can `meet`, and those from which splats reach into them; the
    /// neighbours of their points are within `support_px` pixels. Returns the pixels of `rect` in the
    /// former tiles, or `None` where there is no such tile.
    pub(crate) fn mark(
        &mut self,
        tiles: &Tiles,
        rect: &Rect,
        support_px: f32,
        meet: impl Fn(usize) -> bool,
    ) -> Option<Rect> {
        let [width, height] = tiles.dims;
        self.modelled.clear();
        self.modelled.resize(tiles.count(), 0);
        let (mut lo, mut hi) = ([usize::MAX; 2], [0; 2]);
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let k = y * width + x;
                if meet(k) {
                    self.modelled[k] = 1;
                    lo = [lo[0].min(x), lo[1].min(y)];
                    hi = [hi[0].max(x), hi[1].max(y)];
                }
            }
        }
        if lo[0] > hi[0] {
            return None;
        }
        dilate(&mut self.modelled, &mut self.spare, width, u8::max);
        self.around.clear();
        self.around.extend_from_slice(&self.modelled);
        for _ in 0..(support_px / tiles.edge as f32).ceil() as usize {
            dilate(&mut self.around, &mut self.spare, width, u8::max);
        }
        // Not what is out of view.
        self.modelled.push(0);
        self.around.push(0);
        let first = [0, 1].map(|k| tiles.origin[k] + lo[k] as i32 * tiles.edge);
        let last = [0, 1].map(|k| tiles.origin[k] + (hi[k] as i32 + 1) * tiles.edge - 1);
        Rect::from_corners(first, last)?.intersection(rect)
    }
}

/// The pixels between two corners in pixel coordinates, if there are any.
pub(super) fn rect_of(first: [f32; 2], last: [f32; 2]) -> Option<Rect> {
    let corner = |c: [f32; 2]| c.map(|c| c.floor().clamp(-FARTHEST_PIXEL, FARTHEST_PIXEL) as i32);
    Rect::from_corners(corner(first), corner(last))
}

/// Replaces each value by what `op` makes of it and its eight neighbours. `spare` is overwritten.
pub(crate) fn dilate<T: Copy>(
    values: &mut [T],
    spare: &mut Vec<T>,
    width: usize,
    op: impl Fn(T, T) -> T,
) {
    spare.clear();
    spare.extend_from_slice(values);
    // Along rows into `spare`, then along columns back.
    for (from, to) in values
        .chunks_exact(width)
        .zip(spare.chunks_exact_mut(width))
    {
        for (to, w) in to[1..].iter_mut().zip(from.windows(3)) {
            *to = op(op(w[0], w[1]), w[2]);
        }
        to[0] = op(from[0], from[1]);
        to[width - 1] = op(from[width - 2], from[width - 1]);
    }
    let height = values.len() / width;
    for y in 0..height {
        let row = |y: usize| &spare[y * width..(y + 1) * width];
        let (above, own, below) = (row(y.max(1) - 1), row(y), row((y + 1).min(height - 1)));
        let to = &mut values[y * width..(y + 1) * width];
        for (to, ((a, b), c)) in to.iter_mut().zip(above.iter().zip(own).zip(below)) {
            *to = op(op(*a, *b), *c);
        }
    }
}

multiversioned! {
/// Transforms points.
fn transform(r: &Mat3, t: Vec3, from: [&[f32]; 3], to: [&mut [f32]; 3]) {
    let [x, y, z] = from;
    let [to_x, to_y, to_z] = to;
    let n = x.len();
    let (y, z, to_x, to_y, to_z) = (&y[..n], &z[..n], &mut to_x[..n], &mut to_y[..n], &mut to_z[..n]);
    for i in 0..n {
        to_x[i] = r.x_axis.x * x[i] + r.y_axis.x * y[i] + r.z_axis.x * z[i] + t.x;
        to_y[i] = r.x_axis.y * x[i] + r.y_axis.y * y[i] + r.z_axis.y * z[i] + t.y;
        to_z[i] = r.x_axis.z * x[i] + r.y_axis.z * y[i] + r.z_axis.z * z[i] + t.z;
    }
}
}

multiversioned! {
/// Tile of each point of an orthographic view.
fn locate(tiles: &Tiles, pixel_size: f32, x: &[f32], y: &[f32], out: &mut [u32]) {
    let n = x.len().min(y.len()).min(out.len());
    let (x, y, out) = (&x[..n], &y[..n], &mut out[..n]);
    let scale = 1.0 / (pixel_size * tiles.edge as f32);
    let [ox, oy] = tiles.origin.map(|o| o as f32 / tiles.edge as f32);
    let [w, h] = tiles.dims.map(|d| d as f32);
    let (width, out_of_view) = (tiles.dims[0] as u32, tiles.out_of_view());
    for i in 0..n {
        let (tx, ty) = (x[i] * scale - ox, y[i] * scale - oy);
        let inside = (tx >= 0.0) & (ty >= 0.0) & (tx < w) & (ty < h);
        let tile = truncated(ty, h) * width + truncated(tx, w);
        out[i] = if inside { tile } else { out_of_view };
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXEL: f32 = 0.1;
    const REACH: f32 = 0.3;

    fn random(rng: &mut fastrand::Rng, count: usize, depth: f32) -> Survivors {
        let mut points = Survivors::default();
        for _ in 0..count {
            points.x.push(6.0 * rng.f32() - 3.0);
            points.y.push(3.0 * rng.f32());
            points.z.push(depth + rng.f32());
        }
        points
    }

    /// By brute force: a point is modelled if a point of the other cloud can cover the same pixel
    /// and is not out of reach, and only if one is that within five tiles.
    #[test]
    fn models_what_can_meet() {
        let (mut modelled, mut left_out) = (0, 0);
        for seed in 0..60 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let radius = PIXEL * (0.8 + 1.5 * rng.f32());
            let behind = 0.6 + 0.5 * rng.f32();
            let a = random(&mut rng, 40, behind);
            let b = random(&mut rng, 40, 0.0);
            let mut camera = VirtualCamera::along(Vec3::Z, PIXEL);
            camera.view_from_frame.rotation = glamx::Quat::IDENTITY;
            let (mut columns_a, mut columns_b) = (Columns::default(), Columns::default());
            let seen_a = columns_a.project(&a, radius, &camera).expect("is in view");
            let seen_b = columns_b.project(&b, radius, &camera).expect("is in view");
            let rect = seen_a.rect.intersection(&seen_b.rect).expect("overlap");
            let tiles = Tiles::new(&rect, seen_a.reach);
            columns_a.sort(&tiles, &camera);
            columns_a.reduce(&tiles, 1.0);
            columns_b.sort(&tiles, &camera);
            columns_b.reduce(&tiles, -1.0);
            let mut touching = Touching::default();
            let meet = |tile: usize| columns_a.meet(&columns_b, tile, REACH);
            touching.mark(&tiles, &rect, 0.0, meet);
            let meet = |i: usize, j: usize, apart: f32| {
                (a.x[i] - b.x[j]).abs() <= apart
                    && (a.y[i] - b.y[j]).abs() <= apart
                    && a.z[i] - b.z[j] <= REACH
            };
            let far = 5.0 * tiles.edge as f32 * PIXEL;
            for i in 0..40 {
                let is_modelled = columns_a.is_modelled(&touching, i as u32);
                // Both discs can cover a pixel halfway.
                if (0..40).any(|j| meet(i, j, 1.4 * radius)) {
                    assert!(is_modelled, "seed {seed}: point {i} of a");
                }
                // The tile is needed for any pair near it, not only one with this point.
                let near =
                    |k: usize| (a.x[i] - a.x[k]).abs() <= far && (a.y[i] - a.y[k]).abs() <= far;
                if is_modelled {
                    let why = (0..40).any(|k| near(k) && (0..40).any(|j| meet(k, j, far)));
                    assert!(why, "seed {seed}: point {i} of a");
                    modelled += 1;
                } else {
                    left_out += 1;
                }
            }
            for j in 0..40 {
                if (0..40).any(|i| meet(i, j, 1.4 * radius)) {
                    assert!(
                        columns_b.is_modelled(&touching, j as u32),
                        "seed {seed}: point {j} of b"
                    );
                }
            }
        }
        assert!(modelled > 300 && left_out > 300, "{modelled} {left_out}");
    }
}
