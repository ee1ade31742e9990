//! Stage `cells`: layers of large pixels from the sums of the points in them.
//!
//! A *cell* holds the points of one pixel at one depth: they follow each other in depth within
//! [`MERGED_IN_CELL`] of a pixel. It keeps their number, the sums of their coordinates and of their
//! products. Sums of neighbouring cells add up, and the plane that fits them best gives the layer:
//! no search for neighbours, no normals of points, no splats. Sums are integers: they do not depend
//! on the order of the points.

use crate::counting_sort::sort_by_bin;
use crate::cpu::columns::Columns;
use crate::cpu::first_look::cell_plane::{CellPlane, Sums, moved};
use crate::cpu::lanes::multiversioned;
use crate::cpu::rect::Rect;
use crate::{Facing, Layer, Tldi, VirtualCamera};
use arrayvec::ArrayVec;
use glamx::Vec3;
use std::ops::Range;

/// Points of a pixel whose depths follow each other by no more than this are in one cell, in
/// pixels. Half of it tears surfaces apart that are seen at 45°. Twice as much merges the two sides
/// of bodies thinner than a pixel.
const MERGED_IN_CELL: f32 = 0.6;

/// Steps of a coordinate in a pixel. The rounding is then far smaller than the error of a cell's plane. Half or twice:
/// no change.
const STEPS: f32 = 256.0;

/// Standard deviation, in pixels, up to which a cell and its neighbours are on a plane. A sphere of a radius of 25
/// pixels has 0.02. Half: normals of deep spheres a third worse; twice: no change.
const ON_CELL_PLANE: f32 = 0.1;

/// Standard deviation, in pixels, up to which a plane is one that neighbours adopt. Half: no change; twice: normals 10
/// % worse, the worst three times as wrong.
const FLAT_CELL: f32 = 0.05;

/// The points and cells of an image, kept from call to call.
#[derive(Default)]
pub(crate) struct Cells {
    /// Pixel of each point, one beyond the last where it is beside the image, and what it is there.
    located: Vec<(u32, Point)>,
    /// First point of each pixel; one entry more than pixels.
    starts: Vec<u32>,
    points: Vec<Point>,
    /// First cell of each pixel; one entry more than pixels.
    firsts: Vec<u32>,
    cells: Vec<Cell>,
    planes: Vec<CellPlane>,
    /// Cells that are on no plane with those around them, and which these are.
    rough: Vec<(u32, Neighbors)>,
    /// Those that adopt a plane, and which.
    adopted: Vec<(u32, CellPlane)>,
}

/// The cells around one that continue it, at most one a pixel, and how far they are aside, in pixels.
type Neighbors = ArrayVec<(u32, [f32; 2]), 8>;

/// Where a point is in its pixel, in [`STEPS`].
#[derive(Clone, Copy, Default)]
struct Point {
    /// Depth; above it whether the ray leaves the body there.
    key: u32,
    /// From the middle of the pixel.
    aside: [i16; 2],
}

/// Bit of a key that tells exits from what else there is.
const EXIT: u32 = 1 << 31;

/// Greatest depth in steps: four million pixels, and no sum of two overflows.
const DEEPEST: u32 = 1 << 30;

/// Points of a pixel that follow each other in depth.
#[derive(Clone, Copy)]
struct Cell {
    /// [`EXIT`] or 0.
    class: u32,
    /// Least, greatest and mean depth.
    near: i32,
    far: i32,
    middle: i32,
    /// From the middle of the pixel and the mean depth.
    sums: Sums,
}

/// How an image of cells is taken.
pub(crate) struct CellImaging<'a> {
    pub(crate) camera: &'a VirtualCamera,
    /// Edge of a pixel, metres.
    pub(crate) pixel_size: f32,
    pub(crate) rect: Rect,
    /// Least depth, metres.
    pub(crate) near: f32,
}

impl Cells {
    /// Fills `out` with the layers of the `kept` points of `columns`. `exits` tells of the i-th whether its outward
    /// normal points along the view, where normals tell. Cost: linear in points and pixels.
    pub(crate) fn image(
        &mut self,
        columns: &Columns,
        kept: &[u32],
        exits: Option<&dyn Fn(usize) -> bool>,
        imaging: &CellImaging,
        out: &mut Tldi,
    ) {
        self.sort(columns, kept, exits, imaging);
        self.gather(imaging);
        self.fit(&imaging.rect);
        self.sharpen();
        let Rect { origin, size } = imaging.rect;
        out.begin(imaging.camera, origin, size);
        for pixel in 0..imaging.rect.pixels() {
            let first = out.layers.len();
            for cell in self.of_pixel(pixel) {
                if self.planes[cell].variance < f32::INFINITY {
                    out.layers.push(self.layer(cell, exits.is_some(), imaging));
                }
            }
            out.layers[first..].sort_unstable_by(|l, m| {
                (l.depth.total_cmp(&m.depth)).then(l.facing.cmp(&m.facing))
            });
            out.offsets.push(out.layers.len() as u32);
        }
    }

    /// Indices of the cells of the `k`-th pixel.
    fn of_pixel(&self, k: usize) -> Range<usize> {
        self.firsts[k] as usize..self.firsts[k + 1] as usize
    }

    #[inline(always)]
    fn neighbors(
        &self,
        cell: usize,
        [i, j]: [usize; 2],
        rect: &Rect,
        mut put: impl FnMut(usize, [f32; 2]),
    ) {
        let own = &self.cells[cell];
        let [width, height] = rect.size.map(|s| s as usize);
        let merged = (MERGED_IN_CELL * STEPS) as i32;
        for y in j.saturating_sub(1)..(j + 2).min(height) {
            for x in i.saturating_sub(1)..(i + 2).min(width) {
                if [x, y] == [i, j] {
                    continue;
                }
                let there = self.of_pixel(y * width + x);
                let (mut next, mut least) = (None, i32::MAX);
                for (k, c) in there.clone().zip(&self.cells[there]) {
                    let continues = c.class == own.class
                        && c.near <= own.far + merged
                        && own.near <= c.far + merged;
                    let apart = (c.middle - own.middle).abs();
                    if continues && apart < least {
                        (next, least) = (Some(k), apart);
                    }
                }
                if let Some(next) = next {
                    put(next, [x as f32 - i as f32, y as f32 - j as f32]);
                }
            }
        }
    }

    /// Fits a plane to each cell and its neighbours.
    fn fit(&mut self, rect: &Rect) {
        self.planes.clear();
        self.rough.clear();
        for (k, pixel) in pixels(rect).enumerate() {
            for cell in self.of_pixel(k) {
                let own = &self.cells[cell];
                let mut neighbors = Neighbors::new();
                let mut all = own.sums;
                self.neighbors(cell, pixel, rect, |next, aside| {
                    neighbors.push((next as u32, aside));
                    let next = &self.cells[next];
                    let [x, y] = aside.map(|d| d * STEPS);
                    let moved = moved(&next.sums, [x, y, (next.middle - own.middle) as f32]);
                    all.iter_mut().zip(moved).for_each(|(all, sum)| *all += sum);
                });
                let plane = CellPlane::of(&own.sums, &all);
                if plane.variance > square(ON_CELL_PLANE) && plane.variance < f32::INFINITY {
                    self.rough.push((cell as u32, neighbors));
                }
                self.planes.push(plane);
            }
        }
    }

    /// A cell that lies on no common plane with its neighbours takes the flattest plane of a neighbour that passes through
    /// the cell: beside an edge, the plane of one face.
    fn sharpen(&mut self) {
        self.adopted.clear();
        for (cell, neighbors) in &self.rough {
            let own = &self.cells[*cell as usize];
            let [least, most] = [own.near, own.far].map(|depth| (depth - own.middle) as f32);
            let reached = least - ON_CELL_PLANE * STEPS..=most + ON_CELL_PLANE * STEPS;
            let mut flattest: Option<CellPlane> = None;
            for (next, [x, y]) in neighbors {
                let plane = self.planes[*next as usize];
                let there = (self.cells[*next as usize].middle - own.middle) as f32 + plane.above;
                let above = there - STEPS * (plane.slope[0] * x + plane.slope[1] * y);
                let is_flatter = flattest.is_none_or(|best| plane.variance < best.variance);
                if is_flatter && plane.variance <= square(FLAT_CELL) && reached.contains(&above) {
                    flattest = Some(CellPlane { above, ..plane });
                }
            }
            self.adopted.extend(flattest.map(|plane| (*cell, plane)));
        }
        for (cell, plane) in &self.adopted {
            self.planes[*cell as usize] = *plane;
        }
    }

    /// Counting sort of the points by pixel.
    fn sort(
        &mut self,
        columns: &Columns,
        kept: &[u32],
        exits: Option<&dyn Fn(usize) -> bool>,
        imaging: &CellImaging,
    ) {
        let count = imaging.rect.pixels();
        self.located.resize(kept.len(), (0, Point::default()));
        locate(columns, kept, imaging, &mut self.located);
        if let Some(is_exit) = exits {
            for ((_, point), &i) in self.located.iter_mut().zip(kept) {
                point.key |= if is_exit(i as usize) { EXIT } else { 0 };
            }
        }
        self.points.resize(kept.len(), Point::default());
        let located = self.located.iter().rev().copied();
        sort_by_bin(located, count, &mut self.starts, |place, point| {
            self.points[place] = point;
        });
    }

    /// Makes cells of the points of each pixel.
    fn gather(&mut self, imaging: &CellImaging) {
        let merged = (MERGED_IN_CELL * STEPS) as u32;
        self.cells.clear();
        self.firsts.clear();
        for pixel in 0..imaging.rect.pixels() {
            self.firsts.push(self.cells.len() as u32);
            let range = self.starts[pixel] as usize..self.starts[pixel + 1] as usize;
            let points = &mut self.points[range];
            points.sort_unstable_by_key(|p| p.key);
            let follow = |p: &Point, q: &Point| q.key - p.key <= merged;
            for run in points.chunk_by(follow) {
                let depth = |p: &Point| (p.key & !EXIT) as i32;
                let count = run.len() as i64;
                let sum: i64 = run.iter().map(|p| i64::from(depth(p))).sum();
                let middle = (sum / count) as i32;
                let mut sums = [0i64; 10];
                for p in run {
                    let [x, y] = p.aside.map(i64::from);
                    let z = i64::from(depth(p) - middle);
                    let terms = [1, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z];
                    sums.iter_mut()
                        .zip(terms)
                        .for_each(|(sum, term)| *sum += term);
                }
                self.cells.push(Cell {
                    class: run[0].key & EXIT,
                    near: depth(&run[0]),
                    far: depth(&run[run.len() - 1]),
                    middle,
                    sums: sums.map(|sum| sum as f32),
                });
            }
        }
        self.firsts.push(self.cells.len() as u32);
    }

    /// The layer of a cell.
    fn layer(&self, cell: usize, oriented: bool, imaging: &CellImaging) -> Layer {
        let (own, plane) = (&self.cells[cell], &self.planes[cell]);
        let step = imaging.pixel_size / STEPS;
        let metres = |steps: i32| imaging.near + steps as f32 * step;
        // A plane that is seen steeply ends where its points do.
        let [least, most] = [own.near, own.far].map(|depth| (depth - own.middle) as f32);
        let above = plane.above.clamp(least - 0.5 * STEPS, most + 0.5 * STEPS);
        let toward_camera = Vec3::new(plane.slope[0], plane.slope[1], -1.0).normalize();
        let is_exit = own.class == EXIT;
        Layer {
            near: metres(own.near),
            far: metres(own.far),
            depth: metres(own.middle) + above * step,
            normal: if is_exit {
                -toward_camera
            } else {
                toward_camera
            },
            agreement: 1.0,
            facing: match (oriented, is_exit) {
                (false, _) => Facing::Unknown,
                (true, false) => Facing::Entry,
                (true, true) => Facing::Exit,
            },
            color: [0; 4],
        }
    }
}

multiversioned! {
/// Finds where points are.
fn locate(columns: &Columns, kept: &[u32], imaging: &CellImaging, located: &mut [(u32, Point)]) {
    let inv_pixel = 1.0 / imaging.pixel_size;
    let Rect { origin, size } = imaging.rect;
    let count = imaging.rect.pixels() as u32;
    let [width, height] = size.map(i64::from);
    for (&i, to) in kept.iter().zip(located) {
        let i = i as usize;
        let at = [columns.x[i] * inv_pixel, columns.y[i] * inv_pixel];
        let floor = at.map(f32::floor);
        let [x, y] = [0, 1].map(|k| floor[k] as i64 - i64::from(origin[k]));
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        let depth = (columns.depth[i] - imaging.near) * inv_pixel * STEPS;
        let point = Point {
            key: (depth.max(0.0) as u32).min(DEEPEST),
            aside: [0, 1].map(|k| ((at[k] - floor[k] - 0.5) * STEPS) as i16),
        };
        *to = (if inside { (y * width + x) as u32 } else { count }, point);
    }
}
}

/// In steps, of a distance in pixels.
fn square(pixels: f32) -> f32 {
    (pixels * STEPS).powi(2)
}

/// Columns and rows of the pixels of a rectangle, row by row, from its first.
fn pixels(rect: &Rect) -> impl Iterator<Item = [usize; 2]> + use<> {
    let [width, height] = rect.size.map(|s| s as usize);
    (0..height).flat_map(move |j| (0..width).map(move |i| [i, j]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::cull::Survivors;

    const PIXEL: f32 = 0.1;

    /// The image of points in the view frame; the i-th is of an exit where `exits` says so.
    fn image(points: &[Vec3], exits: Option<&dyn Fn(usize) -> bool>) -> Tldi {
        let mut culled = Survivors::default();
        for point in points {
            culled.x.push(point.x);
            culled.y.push(point.y);
            culled.z.push(point.z);
        }
        let mut camera = VirtualCamera::along(Vec3::Z, PIXEL);
        camera.view_from_frame.rotation = glamx::Quat::IDENTITY;
        let mut columns = Columns::default();
        let seen = columns
            .project(&culled, PIXEL, &camera)
            .expect("is in view");
        let kept: Vec<u32> = (0..points.len() as u32).collect();
        let imaging = CellImaging {
            camera: &camera,
            pixel_size: PIXEL,
            rect: seen.rect,
            near: seen.near,
        };
        let mut image = Tldi::default();
        Cells::default().image(&columns, &kept, exits, &imaging, &mut image);
        image
    }

    /// Layers with the middles of their pixels.
    fn layers(image: &Tldi) -> Vec<([f32; 2], Layer)> {
        let all = pixels(&Rect {
            origin: image.origin,
            size: image.size,
        });
        let of_pixel = |(k, [i, j]): (usize, [usize; 2])| {
            let middle =
                [0, 1].map(|axis| PIXEL * (image.origin[axis] as f32 + [i, j][axis] as f32 + 0.5));
            image.layers_of(k).iter().map(move |layer| (middle, *layer))
        };
        all.enumerate().flat_map(of_pixel).collect()
    }

    fn random_sheet(rng: &mut fastrand::Rng, depth: impl Fn(f32, f32) -> f32) -> Vec<Vec3> {
        let point = |_| {
            let (x, y) = (2.0 * rng.f32() - 1.0, 2.0 * rng.f32() - 1.0);
            Vec3::new(x, y, depth(x, y))
        };
        (0..2400).map(point).collect()
    }

    /// Two tilted sheets, six points a pixel: the depth of the plane at the middle of each pixel, its normal, and which
    /// way it faces.
    #[test]
    fn layers_are_on_the_planes_of_their_points() {
        let mut rng = fastrand::Rng::with_seed(4);
        for slope in [[0.0, 0.0], [0.5, -0.3], [-0.6, 0.5]] {
            let plane = |x: f32, y: f32| slope[0] * x + slope[1] * y;
            let front = random_sheet(&mut rng, plane);
            let back = random_sheet(&mut rng, |x, y| plane(x, y) + 0.5);
            let points = [front, back].concat();
            let is_back = |i: usize| i >= 2400;
            for oriented in [false, true] {
                let image = image(&points, oriented.then_some(&is_back));
                let found = layers(&image);
                assert!(found.len() > 700, "{}", found.len());
                for ([x, y], layer) in found {
                    let of_front = (layer.depth - plane(x, y)).abs() < 0.25;
                    let expected = plane(x, y) + if of_front { 0.0 } else { 0.5 };
                    // Coordinates are in steps of 1/256 of a pixel.
                    let tolerance = 0.02 * PIXEL * (1.0 + slope[0].abs() + slope[1].abs());
                    assert!(
                        (layer.depth - expected).abs() < tolerance,
                        "{slope:?} {layer:?}"
                    );
                    let facing = match (oriented, of_front) {
                        (false, _) => Facing::Unknown,
                        (true, true) => Facing::Entry,
                        (true, false) => Facing::Exit,
                    };
                    assert_eq!(layer.facing, facing);
                    let out = if facing == Facing::Exit { -1.0 } else { 1.0 };
                    let normal = out * Vec3::new(slope[0], slope[1], -1.0).normalize();
                    assert!(layer.normal.distance(normal) < 0.05, "{slope:?} {layer:?}");
                }
            }
        }
    }

    /// A level face and a wall down from its edge: the pixels of the edge are on the face. Without the planes of their
    /// neighbours they are up to half a pixel below it.
    #[test]
    fn beside_an_edge_layers_are_of_one_face() {
        let mut rng = fastrand::Rng::with_seed(5);
        let mut points = random_sheet(&mut rng, |_, _| 0.0);
        points.retain(|p| p.x < 0.03);
        points.extend((0..1200).map(|_| Vec3::new(0.03, 2.0 * rng.f32() - 1.0, 0.3 * rng.f32())));
        let image = image(&points, None);
        let inside = |[x, y]: [f32; 2]| x < 0.05 && y.abs() < 0.9;
        let found = layers(&image).into_iter().filter(|(at, _)| inside(*at));
        let off: Vec<f32> = found.map(|(_, layer)| layer.depth.abs() / PIXEL).collect();
        assert!(off.len() > 150, "{}", off.len());
        assert!(off.iter().all(|off| *off < 0.1), "{off:?}");
    }

    #[test]
    fn what_stands_alone_is_no_layer() {
        let mut points = vec![Vec3::ZERO, Vec3::new(0.02, 0.01, 0.01)];
        assert!(layers(&image(&points, None)).is_empty());
        points.push(Vec3::new(-0.02, 0.03, 0.0));
        assert!(!layers(&image(&points, None)).is_empty());
    }
}
