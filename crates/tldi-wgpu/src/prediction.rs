//! How many elements a pair will need, from what is known before its points are read.
//!
//! An estimate, and no bound: what it misses is found out by the stages and costs a redo. Twice as much would cost memory
//! of the device, half as much redos of first batches.

use crate::counters::Counters;
use crate::layout::{GROUP, MAX_VIEWS};
use tldi::plan::{PairPlan, stride};
use tldi::{BLOCK, PairQuery};

/// Points of a cloud in a square of a mean radius, with radii of 0.65 times the distance of the 7th neighbour: see
/// [`stride`]. Half or twice: no test fails; a batch that does not fit is repeated.
const DENSITY: f32 = 0.94;

/// Views of a culled point, on average: one, or up to three of bodies that meet on several sides. Half or twice: no
/// test fails; a batch that does not fit is repeated.
const VIEWS: f32 = 2.5;

/// Shares of an image's pixels that have a contact. Only of surfaces that coincide it is more. Half or twice: no
/// test fails; a batch that does not fit is repeated.
const CONTACTS: f32 = 0.25;

/// Pixels of an image for each point, at most: there are more only where points are far apart. Half or twice: no
/// test fails; a batch that does not fit is repeated.
const PIXELS: f32 = 4.0;

/// Elements for a pair with so many blocks of each side in reach.
pub(crate) fn predicted(query: &PairQuery, plan: &PairPlan, blocks: [usize; 2]) -> Counters {
    let params = &query.params;
    let extents = plan.overlap.extents();
    // Half the surface of the overlap's box. A view sees no more of it, and a convex body no more than twice of it.
    let area = extents.x * extents.y + extents.y * extents.z + extents.z * extents.x;
    let image = area / (params.pixel_size * params.pixel_size);
    let (mut survivors, mut fragments) = (0.0, 0.0);
    for (surface, blocks) in [query.a, query.b].iter().zip(blocks) {
        let radius = surface.mean_radius();
        let stride = stride(radius, params.pixel_size) as f32;
        let on_surface = 2.0 * area * DENSITY / (radius * radius);
        let of_side = on_surface.min((blocks * BLOCK) as f32) / stride;
        survivors += of_side;
        // A splat is counted in all pixels of the square around it that the image has.
        let reach_px = (radius * stride.sqrt() / params.pixel_size).max(1.0);
        fragments += VIEWS * of_side * (2.0 * reach_px + 0.5).powi(2).min(image + 1.0);
    }
    let splats = VIEWS * survivors;
    // Two views, each with whole workgroups.
    let pixels = (2.0 * image).min(PIXELS * survivors) + (MAX_VIEWS * GROUP) as f32;
    // A tile has at least a pixel, and around them is a rim.
    let tiles = pixels + (MAX_VIEWS * GROUP) as f32;
    // Beyond the words, the largest.
    Counters {
        survivors: survivors as u32,
        tiles: tiles as u32,
        pixels: pixels as u32,
        splats: splats as u32,
        fragments: fragments as u32,
        layers: splats as u32,
        contacts: (CONTACTS * pixels) as u32,
    }
}
