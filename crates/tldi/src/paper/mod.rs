//! The paper's variant, kept as the baseline that everything can be compared with.
//!
//! P. Radwan, S. Ohrhallinger, M. Wimmer, "Efficient Collision Detection While Rendering Dynamic
//! Point Clouds", Graphics Interface 2014. Around every point lies a ball; seen from the camera it
//! is a *cylinder*: a disc of the ball's radius facing the camera, as deep as the ball. Along the
//! ray of a pixel, cylinders that follow each other without a gap form a *layer*, whose near and
//! far depths are blends of theirs. Two clouds collide where layers of one overlap in depth with
//! layers of the other, both [compressed](compare) a little.
//!
//! One file a pass, named as in the paper: `visibility` (front depth), `stacking` (occupancy mask
//! of up to 128 depth segments, each as high as the frontmost cylinder), `counter` (length of the
//! filled run), `back_visibility` (far end), `blending` with `normalisation`. The paper repeats
//! them over all points for each layer; here the fragments are binned by pixel once, in order of
//! depth, and the passes take from each pixel's fragments what belongs to one layer after the
//! other, so that all layers together cost time linear in fragments.
//!
//! What the paper leaves open is decided as follows:
//! - A cylinder covers the pixels whose centres are within its disc, and in any case the one that
//!   holds the centre of the disc. Its depths are the same over the whole disc, also in
//!   perspective. Near and far planes cull by the point's own depth.
//! - The Gaussian's standard deviation is half the radius.
//! - A cylinder is in every depth segment that it shares a depth with. Gaps of less than two
//!   segments may thus be closed, as with any mask; cylinders that overlap are never separated
//!   but at the mask's end.
//! - Where a run goes on beyond the mask's end, what begins before the end belongs to the layer,
//!   the rest to the next one; the layer's far depth is cut where the next one begins.
//!
//! ```
//! use tldi::{Params, PointCloud, Tldi, VirtualCamera, paper, glamx::{Pose3, Vec3}};
//! let points: Vec<Vec3> = (0..400)
//!     .map(|i| Vec3::new((i % 20) as f32 * 0.05, (i / 20) as f32 * 0.05, 0.0))
//!     .collect();
//! let sheet = PointCloud::builder(&points).radius(0.05).build()?;
//! let camera = VirtualCamera::along(Vec3::Z, 0.05);
//! let params = Params::paper(0.05);
//! let mut scratch = paper::Scratch::default();
//! let (mut a, mut b) = (Tldi::default(), Tldi::default());
//! paper::build(&sheet, &Pose3::IDENTITY, &camera, &params, &mut scratch, &mut a);
//! let away = Pose3::translation(0.0, 0.0, 0.3);
//! paper::build(&sheet, &away, &camera, &params, &mut scratch, &mut b);
//! let found = paper::compare(&a, &b, &params);
//! // The balls reach 0.05 to both sides, and each range is 5 % shorter than they are deep.
//! assert!(!found.collides);
//! assert!((found.gap.unwrap() - (0.3 - 0.95 * 0.1)).abs() < 1e-6);
//! # Ok::<(), tldi::CloudError>(())
//! ```

mod back_visibility;
mod blending;
mod compare;
mod counter;
mod fragments;
mod stacking;
mod visibility;

pub use compare::{PaperComparison, colliding_pixels, compare};

use crate::counting_sort::starts_of;
use crate::cpu::rect::Rect;
use crate::{Layer, Params, PointCloud, Tldi, VirtualCamera};
use blending::blending;
use counter::counter;
use fragments::{Bins, Cylinder, Fragment};
use glamx::Pose3;
use rayon::prelude::*;
use stacking::{MAX_SEGMENTS, stacking};
use visibility::visibility;

/// Rows of the image that are worked on together: one task of the thread pool.
const BAND_ROWS: u32 = 8;

/// Most pixels of an image: 1 GiB of offsets.
pub(crate) const MAX_PIXELS: u64 = 1 << 28;

/// Memory that [`build`] keeps from call to call.
#[derive(Default)]
pub struct Scratch {
    keys: Vec<u64>,
    cylinders: Vec<Cylinder>,
    /// End of each band's cylinders.
    band_ends: Vec<usize>,
    /// Indices of the cylinders in each band, in order of depth.
    band_cylinders: Vec<u32>,
    bands: Vec<Band>,
}

/// Some rows of the image.
#[derive(Default)]
struct Band {
    bins: Bins,
    layers: Vec<Layer>,
    /// End of each pixel's layers.
    layer_ends: Vec<u32>,
}

/// Builds the image of a cloud, all layers of every pixel, as the paper does.
///
/// `frame_from_cloud` places the cloud in the camera's reference frame. The image is the camera's
/// [`size`](VirtualCamera::size), or else the rectangle of rows and columns with
/// pixel centres within the cylinders' bounds. Layers of a
/// pixel are in order of depth and do not overlap each other; they have no normal and
/// [`Facing::Unknown`](crate::Facing::Unknown), `depth` is the mean of near and far. Of `params`
/// only [`stack_segments`](Params::stack_segments) is read, 1 to 128 (limited to these).
///
/// Bit-identical at any number of threads. `scratch` and `out` keep their memory: a warm call
/// allocates nothing. Cost: O(n log n) to sort the points, then linear in pixels and fragments
/// (about π (radius / pixel)² a point); memory: 16 bytes a fragment.
///
/// # Panics
/// If the image would have more than 2²⁸ pixels: give the camera a size, larger pixels, or clouds
/// that are culled to what matters.
pub fn build(
    cloud: &PointCloud,
    frame_from_cloud: &Pose3,
    camera: &VirtualCamera,
    params: &Params,
    scratch: &mut Scratch,
    out: &mut Tldi,
) {
    let cylinders = &mut scratch.cylinders;
    fragments::project(
        cloud,
        frame_from_cloud,
        camera,
        &mut scratch.keys,
        cylinders,
    );
    let rect = match camera.size {
        Some(size) => Rect {
            origin: [0, 0],
            size,
        },
        None => fragments::bounding_rect(cylinders),
    };
    let [width, height] = rect.size;
    assert!(
        u64::from(width) * u64::from(height) <= MAX_PIXELS,
        "an image of {width} × {height} pixels is too large: use larger pixels or a smaller image"
    );

    bin_by_band(
        cylinders,
        &rect,
        &mut scratch.band_ends,
        &mut scratch.band_cylinders,
    );
    let count = scratch.band_ends.len();
    if scratch.bands.len() < count {
        scratch.bands.resize_with(count, Band::default);
    }
    let (band_ends, band_cylinders) = (&scratch.band_ends, &scratch.band_cylinders);
    let bands = &mut scratch.bands[..count];
    bands.par_iter_mut().enumerate().for_each(|(k, band)| {
        let start = if k == 0 { 0 } else { band_ends[k - 1] };
        let indices = &band_cylinders[start..band_ends[k]];
        let top = k as u32 * BAND_ROWS;
        let rows = Rect {
            origin: [rect.origin[0], rect.origin[1].saturating_add_unsigned(top)],
            size: [width, BAND_ROWS.min(height - top)],
        };
        band.build(
            &rows,
            cylinders,
            indices,
            cloud.colors(),
            params.stack_segments,
        );
    });

    out.camera = *camera;
    out.origin = rect.origin;
    out.size = rect.size;
    out.offsets.clear();
    out.offsets.push(0);
    out.layers.clear();
    for band in bands {
        let base = out.layers.len() as u32;
        out.offsets
            .extend(band.layer_ends.iter().map(|end| base + end));
        out.layers.extend_from_slice(&band.layers);
    }
}

/// Bins cylinders by the bands whose rows they cover, keeping their order.
fn bin_by_band(
    cylinders: &[Cylinder],
    rect: &Rect,
    band_ends: &mut Vec<usize>,
    band_cylinders: &mut Vec<u32>,
) {
    let bands_of = |cylinder: &Cylinder| {
        let [first, end] = cylinder.rows_in(rect).map(|j| j.abs_diff(rect.origin[1]));
        let end_band = if first < end {
            end.div_ceil(BAND_ROWS)
        } else {
            0
        };
        (first / BAND_ROWS) as usize..end_band as usize
    };
    band_ends.clear();
    band_ends.resize(rect.size[1].div_ceil(BAND_ROWS) as usize, 0);
    for cylinder in cylinders {
        for band in bands_of(cylinder) {
            band_ends[band] += 1;
        }
    }
    let total = starts_of(band_ends);
    band_cylinders.resize(total, 0);
    for (index, cylinder) in (0..).zip(cylinders) {
        for band in bands_of(cylinder) {
            band_cylinders[band_ends[band]] = index;
            band_ends[band] += 1;
        }
    }
}

impl Band {
    fn build(
        &mut self,
        rows: &Rect,
        cylinders: &[Cylinder],
        indices: &[u32],
        colors: Option<&[[u8; 4]]>,
        stack_segments: u32,
    ) {
        self.layers.clear();
        self.layer_ends.clear();
        if indices.is_empty() {
            self.layer_ends.resize(rows.pixels(), 0);
            return;
        }
        self.bins.fill(rows, cylinders, indices);
        for fragments in self.bins.pixels() {
            layers_of_pixel(fragments, colors, stack_segments, &mut self.layers);
            self.layer_ends.push(self.layers.len() as u32);
        }
    }
}

/// Appends the layers of one pixel, whose fragments are in order of front depth.
fn layers_of_pixel(
    fragments: &[Fragment],
    colors: Option<&[[u8; 4]]>,
    stack_segments: u32,
    layers: &mut Vec<Layer>,
) {
    let segments = stack_segments.clamp(1, MAX_SEGMENTS);
    let mut rest = fragments;
    while !rest.is_empty() {
        let front = visibility(rest);
        let run = counter(stacking(rest, &front, segments));
        // Segments grow with the front depth: the members of the layer come first.
        let end = rest
            .iter()
            .position(|fragment| front.first_segment(fragment) >= run)
            .unwrap_or(rest.len());
        let (members, behind) = rest.split_at(end);
        let mut layer = blending(members, colors);
        if let Some(next) = behind.first()
            && next.near < layer.far
        {
            layer.far = next.near;
            layer.depth = 0.5 * (layer.near + layer.far);
        }
        layers.push(layer);
        rest = behind;
    }
}
