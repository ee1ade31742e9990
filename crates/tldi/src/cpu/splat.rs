//! Stages `mark`, `alloc` and `splat`: oriented splats become fragments, sorted by pixel.
//!
//! A splat is the tangent disc of a point. It covers the pixel that its centre falls into, and all pixels whose centres
//! lie within its radius. Its depth at a pixel is the depth of the tangent plane there. `mark` counts the fragments
//! of each pixel, `alloc` turns counts into offsets, `splat` writes the fragments: a counting sort, linear in fragments
//! and pixels. It works on one band of rows at a time, so that the fragments stay in a core's cache.

use super::columns::{Columns, Tiles};
use super::cull::PointRadii;
use super::lanes::{multiversioned, truncated};
use super::rect::Rect;
use super::splat_radius::{LEAST_RADIUS_PX, splat_radius};
use crate::counting_sort::{ends_of, starts_of};
use crate::stage::stage;
use crate::{Params, Projection, VirtualCamera};
use glamx::Vec3;

/// |n·v| below which a surface is seen edge-on (78°). There, its tangent plane says nothing about depth. Half: no
/// change in any suite; twice: normals five times as wrong, and 11 of 636 stability rows fail instead of 3.
pub(crate) const EDGE_ON: f32 = 0.2;

/// |n·v| below which a splat is steep (37°). Its depth varies so much within a pixel that fragments within one thickness
/// of each other count as one layer, and a layer may be the end of a wall (`rims`). Half the angle: no change; twice: bodies sink
/// in by 0.9 r̄ that stand on walls that lean by 20°.
pub(crate) const STEEP: f32 = 0.8;

/// Depth steps in a surface's thickness. Depths are summed as integers, so that the order of the points does not change
/// a sum. Half or twice: no change.
pub(super) const DEPTH_STEPS: u32 = 4096;

/// The share of a cloud's noise by which the merge gap grows. With noise of r̄ the gap is then as wide as a surface is
/// thick. Narrower gaps tear noisy sheets apart (`accuracy --variant told`). Half: 5 of 930 cases with noise of 0.25
/// to 1 are wrong instead of 3; twice: 3.
const NOISE_MERGED: f32 = 0.8;

/// Steps of a normal's component in the integer sums.
pub(crate) const NORMAL_STEPS: f32 = 16384.0;

/// Largest weight of a fragment.
const MAX_WEIGHT: f32 = 255.0;

/// Rows of a band. With a thousand columns and eight fragments a pixel, a band takes a megabyte, as much as a core's
/// second cache holds. Half or twice: no row changes.
const BAND_ROWS: u32 = 16;

/// Bits of a fragment's key that hold the depth. The bits above them hold the class.
const DEPTH_BITS: u32 = 30;

/// Largest depth in steps: 2 to the power of [`DEPTH_BITS`], less the step of an `f32` there.
const MAX_DEPTH: f32 = ((1 << DEPTH_BITS) - 64) as f32;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 8] = [
    ("STEEP", STEEP as f64),
    ("DEPTH_STEPS", DEPTH_STEPS as f64),
    ("LEAST_RADIUS_PX", LEAST_RADIUS_PX as f64),
    ("EDGE_ON", EDGE_ON as f64),
    ("NORMAL_STEPS", NORMAL_STEPS as f64),
    ("MAX_WEIGHT", MAX_WEIGHT as f64),
    ("DEPTH_BITS", DEPTH_BITS as f64),
    ("MAX_DEPTH", MAX_DEPTH as f64),
];

/// One splat in one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fragment {
    /// The class in the highest bits, then the depth at the pixel's centre in [`DepthScale::step`]s from
    /// [`DepthScale::zero`]. The lowest bit says whether it is steep.
    pub(crate) key: u32,
    /// Index of the splat.
    pub(crate) splat: u32,
    /// 1 to 255. It falls with the distance from the centre, and with the slope.
    pub(crate) weight: u32,
}

impl Fragment {
    /// 0 entry, 1 exit (or not oriented), 2 edge-on.
    pub(crate) fn class(&self) -> u32 {
        self.key >> DEPTH_BITS
    }

    /// In steps; even.
    pub(crate) fn depth(&self) -> u32 {
        self.key & ((1 << DEPTH_BITS) - 2)
    }

    /// Whether its splat is [`STEEP`].
    pub(crate) fn is_steep(&self) -> bool {
        self.key & 1 > 0
    }
}

/// Fixed-point depths.
#[derive(Clone, Copy, Debug)]
pub struct DepthScale {
    /// Depth of step 0, in metres.
    pub zero: f32,
    /// Metres per step.
    pub step: f32,
    /// Steps per metre.
    pub inv_step: f32,
}

impl DepthScale {
    /// The scale that counts from `zero` metres.
    pub fn new(zero: f32, params: &Params) -> Self {
        let step = params.thickness / DEPTH_STEPS as f32;
        Self {
            zero,
            step,
            inv_step: 1.0 / step,
        }
    }

    /// How far from the middle depth the scale reaches on either side, metres: 2¹⁷ thicknesses. Within it, an `f32` tells
    /// its steps apart.
    ///
    /// ```
    /// use tldi::{Params, plan::DepthScale};
    /// let params = Params::for_radius(0.001);
    /// assert!((DepthScale::reach(&params) - 131_072.0 * params.thickness).abs() < 0.01);
    /// ```
    pub fn reach(params: &Params) -> f32 {
        0.5 * MAX_DEPTH * params.thickness / DEPTH_STEPS as f32
    }

    /// The merge gap in steps: fragments of one layer are at most this far apart in depth. `noise` is the standard
    /// deviation of the cloud's noise, metres.
    pub fn merge_steps(&self, params: &Params, noise: f32) -> u32 {
        ((params.merge_gap + NOISE_MERGED * noise) * self.inv_step) as u32
    }

    pub(crate) fn metres(&self, steps: f32) -> f32 {
        self.zero + steps * self.step
    }
}

/// The points that become fragments: those of the culled points that a view keeps.
#[derive(Clone, Copy)]
pub(crate) struct SplatPoints<'a> {
    pub(crate) columns: &'a Columns,
    /// Indices into `columns`.
    pub(crate) kept: &'a [u32],
    /// Unit normal of each kept point in the view frame.
    pub(crate) normals: &'a [Vec3],
    /// Whether normals point outward.
    pub(crate) oriented: bool,
    pub(crate) radii: PointRadii<'a>,
}

/// How an image is taken.
#[derive(Clone, Copy)]
pub(crate) struct Imaging<'a> {
    pub(crate) camera: &'a VirtualCamera,
    pub(crate) params: &'a Params,
    pub(crate) rect: Rect,
    /// The tiles that the points were sorted into.
    pub(crate) tiles: Tiles,
    pub(crate) scale: DepthScale,
}

/// One oriented disc. Lengths are in pixels, at the depth of the point. A cache line.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
pub(crate) struct Splat {
    /// Pixel coordinates of the point.
    pub(crate) centre: [f32; 2],
    radius: f32,
    /// Rise of the depth per pixel along columns and rows, at the centre.
    slope: [f32; 2],
    /// Depth of the point, in depth steps.
    depth: f32,
    /// Depth steps per pixel of (damped) rise; none where its plane is edge-on.
    steps: f32,
    /// |n·v|: the share of the disc's area that is left in the view.
    facing: f32,
    /// First and last column and row that may be covered, within the image.
    first: [i32; 2],
    last: [i32; 2],
    /// The class, and whether it is steep, in the bits of a fragment's key.
    class: u32,
    /// Which of the kept points this is.
    pub(crate) kept: u32,
    /// Unit normal in [`NORMAL_STEPS`]; towards the camera if not oriented.
    pub(crate) normal: [i16; 3],
}

/// The splats of one image and the fragments of one of its bands, kept from call to call.
#[derive(Default)]
pub(crate) struct Fragments {
    /// First splat of each tile; one entry more than tiles.
    tiles: Vec<u32>,
    /// In the order of their tiles.
    splats: Vec<Splat>,
    /// First fragment of each pixel of the current band; one entry more than pixels.
    offsets: Vec<u32>,
    /// End of the fragments of each pixel.
    ends: Vec<u32>,
    /// At least as many as the current band has.
    fragments: Vec<Fragment>,
}

impl Fragments {
    /// Makes the splats of an image, in the order of their tiles; returns the number of bands.
    pub(crate) fn begin(&mut self, points: &SplatPoints, imaging: &Imaging) -> u32 {
        let _stage = stage!("splat");
        self.tiles.clear();
        self.tiles.resize(imaging.tiles.count() + 1, 0);
        for &i in points.kept {
            self.tiles[points.columns.tile[i as usize] as usize] += 1;
        }
        ends_of(&mut self.tiles);
        self.splats.resize(points.kept.len(), Splat::default());
        make_splats(points, imaging, &mut self.tiles, &mut self.splats);
        imaging.rect.size[1].div_ceil(BAND_ROWS)
    }

    /// `mark`, `alloc`, `splat` over the rows of one band.
    pub(crate) fn splat_band(&mut self, band: u32, imaging: &Imaging) {
        let _stage = stage!("splat");
        let Rect { origin, size } = imaging.rect;
        let top = band * BAND_ROWS;
        let rows = Rect {
            origin: [origin[0], origin[1] + top as i32],
            size: [size[0], BAND_ROWS.min(size[1] - top)],
        };
        let pixels = rows.pixels();
        let members = imaging.tiles.around_rows(&rows);
        let members = self.tiles[members.start] as usize..self.tiles[members.end] as usize;
        let splats = &self.splats[members.clone()];
        // mark: as many as the splats' boxes have pixels
        self.offsets.clear();
        self.offsets.resize(pixels + 1, 0);
        for splat in splats {
            for j in splat.rows(&rows) {
                for count in &mut self.offsets[splat.columns(j, &rows)] {
                    *count += 1;
                }
            }
        }
        // alloc
        let count = starts_of(&mut self.offsets) as usize;
        if self.fragments.len() < count {
            self.fragments.resize(count, Fragment::default());
        }
        self.ends.clear();
        self.ends.extend_from_slice(&self.offsets[..pixels]);
        // splat
        let out = Out {
            ends: &mut self.ends,
            fragments: &mut self.fragments,
            first_splat: members.start as u32,
        };
        match imaging.camera.projection {
            Projection::Orthographic { .. } => fill_orthographic(splats, &rows, out),
            Projection::Perspective { focal_px, .. } => {
                fill_perspective(splats, &rows, out, 1.0 / focal_px);
            }
        }
    }

    /// Number of pixels of the current band.
    pub(crate) fn pixels(&self) -> usize {
        self.ends.len()
    }

    /// The fragments of a pixel of the current band, and the list that their `splat` is an index of.
    pub(crate) fn of_pixel(&mut self, pixel: usize) -> (&mut [Fragment], &[Splat]) {
        let range = self.offsets[pixel] as usize..self.ends[pixel] as usize;
        (&mut self.fragments[range], &self.splats)
    }
}

/// Splats that are made before they are written to their places. The core then waits for that many cache lines at once,
/// and not for one after the other.
const CHUNK: usize = 64;

multiversioned! {
/// Writes the splats. Each entry of `tiles` starts at the end of its tile and counts down to its first splat.
fn make_splats(
    points: &SplatPoints,
    imaging: &Imaging,
    tiles: &mut [u32],
    splats: &mut [Splat],
) {
    let mut chunk = [Splat::default(); CHUNK];
    for first in (0..points.kept.len()).step_by(CHUNK).rev() {
        let kept = &points.kept[first..points.kept.len().min(first + CHUNK)];
        let normals = &points.normals[first..first + kept.len()];
        for (k, (splat, (&i, &normal))) in chunk.iter_mut().zip(kept.iter().zip(normals)).enumerate() {
            let radius = points.radii.of(i as usize);
            let view = points.columns.view(i as usize);
            *splat = Splat::new(view, normal, radius, points.oriented, imaging);
            splat.kept = (first + k) as u32;
        }
        for (splat, &i) in chunk.iter().zip(kept).rev() {
            let cursor = &mut tiles[points.columns.tile[i as usize] as usize];
            *cursor -= 1;
            splats[*cursor as usize] = *splat;
        }
    }
}
}

/// First and last pixel along an axis of the image whose centres lie within `radius` of `centre`, or the one that holds
/// it.
#[inline(always)]
fn covered(centre: f32, radius: f32, origin: i32, size: u32) -> (i32, i32) {
    let own = centre.floor();
    let lo = (centre - radius - 0.5).ceil().min(own);
    let hi = (centre + radius - 0.5).floor().max(own);
    // Both lie within the image, or the range is empty: beyond its end, or before its start.
    let first = truncated(lo - origin as f32, size as f32) as i32;
    let end = truncated(hi - origin as f32 + 1.0, size as f32) as i32;
    (origin + first, origin + end - 1)
}

impl Splat {
    #[inline(always)]
    fn new(view: Vec3, normal: Vec3, radius: f32, oriented: bool, imaging: &Imaging) -> Self {
        let Imaging {
            camera,
            params,
            rect,
            scale,
            ..
        } = imaging;
        let pixel_size = camera.pixel_size_at(view.z);
        // Through the point, one metre deep.
        let ray = match camera.projection {
            Projection::Orthographic { .. } => Vec3::Z,
            Projection::Perspective { .. } => view / view.z,
        };
        let along = normal.dot(ray) / ray.length();
        let is_edge_on = along.abs() < EDGE_ON;
        let class = if is_edge_on {
            2
        } else {
            u32::from(!oriented || along > 0.0)
        };
        let per_depth = -1.0 / normal.dot(ray);
        let slope = [normal.x * per_depth, normal.y * per_depth];
        let centre = camera.pixel_from_view(view);
        let radius = splat_radius(radius, pixel_size) / pixel_size;
        let (first_column, last_column) = covered(centre[0], radius, rect.origin[0], rect.size[0]);
        let (first_row, mut last_row) = covered(centre[1], radius, rect.origin[1], rect.size[1]);
        if last_column < first_column {
            // It lies beside the image. It then has no rows, either.
            last_row = first_row - 1;
        }
        // Normals of unknown side are taken to face the camera.
        let sign = if !oriented && normal.z > 0.0 {
            -1.0
        } else {
            1.0
        };
        Self {
            centre,
            radius,
            slope: match slope[0].is_finite() && slope[1].is_finite() {
                true => slope,
                false => [0.0; 2],
            },
            depth: (view.z - scale.zero) * scale.inv_step,
            steps: match is_edge_on {
                true => 0.0,
                false => params.slope_damping * pixel_size * scale.inv_step,
            },
            facing: along.abs(),
            class: class << DEPTH_BITS | u32::from(along.abs() < STEEP),
            normal: [
                (sign * normal.x * NORMAL_STEPS) as i16,
                (sign * normal.y * NORMAL_STEPS) as i16,
                (sign * normal.z * NORMAL_STEPS) as i16,
            ],
            first: [first_column, first_row],
            last: [last_column, last_row],
            kept: 0,
        }
    }

    /// A rise in depth within the splat, at most its radius.
    #[inline(always)]
    fn limited(&self, rise: f32) -> f32 {
        let rise = if rise.is_finite() { rise } else { 0.0 };
        rise.max(-self.radius).min(self.radius)
    }

    /// Rows of the image within `rows` that may be covered.
    #[inline(always)]
    fn rows(&self, rows: &Rect) -> std::ops::RangeInclusive<i32> {
        let last = rows.origin[1] + rows.size[1] as i32 - 1;
        self.first[1].max(rows.origin[1])..=self.last[1].min(last)
    }

    /// The pixels of row `j` that may be covered, as indices into `rows`.
    #[inline(always)]
    fn columns(&self, j: i32, rows: &Rect) -> std::ops::Range<usize> {
        let start = (j - rows.origin[1]) as usize * rows.size[0] as usize;
        start + (self.first[0] - rows.origin[0]) as usize
            ..start + (self.last[0] - rows.origin[0]) as usize + 1
    }
}

/// Where fragments go.
struct Out<'a> {
    ends: &'a mut [u32],
    fragments: &'a mut [Fragment],
    /// Index of the first of the splats.
    first_splat: u32,
}

/// Pixels whose fragments are computed side by side: columns, and rows.
const LANE_COLUMNS: usize = 4;
const LANES: usize = 2 * LANE_COLUMNS;

multiversioned! {
fn fill_orthographic(splats: &[Splat], rows: &Rect, out: Out) {
    fill(splats, rows, out, |rise| rise);
}
}

multiversioned! {
/// Rays spread: one that is `d` pixels aside at the depth of the centre is `d · rise / focal_px` farther aside where it meets
/// the plane. That adds to the rise by the slope, and so on: a geometric series.
fn fill_perspective(splats: &[Splat], rows: &Rect, out: Out, inv_focal_px: f32) {
    fill(splats, rows, out, |rise| rise / (1.0 - rise * inv_focal_px));
}
}

/// Writes the fragments of `splats`. `met` gets how far a tangent plane rises from the centre of its disc to a pixel along
/// parallel rays, and tells how far it rises to where the pixel's own ray meets it; both in pixels.
#[inline(always)]
fn fill(splats: &[Splat], rows: &Rect, out: Out, met: impl Fn(f32) -> f32) {
    let width = rows.size[0] as usize;
    let own = |d: f32| (d > -0.5) & (d <= 0.5);
    // Columns and rows from the first of the lanes.
    let places: [_; LANES] =
        std::array::from_fn(|l| [l % LANE_COLUMNS, l / LANE_COLUMNS].map(|k| k as f32));
    for (splat, k) in splats.iter().zip(out.first_splat..) {
        let inv_radius_squared = 1.0 / (splat.radius * splat.radius);
        let range = splat.rows(rows);
        let last = [splat.last[0], *range.end()].map(|k| k as f32 + 0.5);
        for j in range.step_by(LANES / LANE_COLUMNS) {
            for i in (splat.first[0]..=splat.last[0]).step_by(LANE_COLUMNS) {
                let (mut keys, mut weights) = ([0; LANES], [0; LANES]);
                let mut covered = [0; LANES];
                let first = [i, j].map(|k| k as f32 + 0.5);
                for l in 0..LANES {
                    let (u, v) = (first[0] + places[l][0], first[1] + places[l][1]);
                    let (dx, dy) = (u - splat.centre[0], v - splat.centre[1]);
                    let rise = splat.slope[0] * dx + splat.slope[1] * dy;
                    let rise = splat.limited(met(rise));
                    let share = 1.0 - (dx * dx + dy * dy + rise * rise) * inv_radius_squared;
                    let depth = truncated(splat.depth + splat.steps * rise, MAX_DEPTH);
                    keys[l] = splat.class | depth & !1;
                    let share_seen = share.max(0.0) * splat.facing;
                    weights[l] = truncated(1.0 + (MAX_WEIGHT - 1.0) * share_seen, MAX_WEIGHT);
                    let inside = (u <= last[0]) & (v <= last[1]);
                    let hit = inside & ((share > 0.0) | (own(dx) & own(dy)));
                    covered[l] = u32::from(hit) << l;
                }
                let mut covered = covered.into_iter().fold(0, |all, bit| all | bit);
                let start = (j - rows.origin[1]) as usize * width + (i - rows.origin[0]) as usize;
                while covered != 0 {
                    let l = covered.trailing_zeros() as usize % LANES;
                    covered &= covered - 1;
                    let end = &mut out.ends[start + l / LANE_COLUMNS * width + l % LANE_COLUMNS];
                    out.fragments[*end as usize] = Fragment {
                        key: keys[l],
                        splat: k,
                        weight: weights[l],
                    };
                    *end += 1;
                }
            }
        }
    }
}
