//! Finds places in a scan where a body can be dropped and come to rest.
//!
//! The scan is looked at from above with an orthographic camera; the first layers of its image
//! are what a falling body meets. A spot is good where a disc as wide as the body is without
//! holes and level.

use crate::bodies::NamedCloud;
use crate::numbers::range;
use fastrand::Rng;
use thiserror::Error;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Layer, Params, PointCloud, Tldi, VirtualCamera};

/// A place to drop a body on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Highest surface point under the body's footprint, moved to the middle of it; in the frame
    /// of the scan, metres.
    pub surface: Vec3,
    /// How many bodies were given this place before: a stack.
    pub level: usize,
}

impl Spot {
    /// What a body starts above: the surface or, in a stack, room over it for a ball of `body_radius` metres and `gap` metres
    /// for each body below. `up` is a unit vector.
    pub(crate) fn base(&self, up: Vec3, body_radius: f32, gap: f32) -> Vec3 {
        self.surface + self.level as f32 * (2.0 * body_radius + gap) * up
    }
}

/// What the bodies need.
#[derive(Clone, Copy, Debug)]
pub struct Demand {
    /// How many bodies are to be dropped.
    pub count: usize,
    /// Radius in metres of a ball around a body.
    pub body_radius: f32,
    /// Seed of the choice.
    pub seed: u64,
}

impl Demand {
    /// What bodies need that are centred on their origins.
    pub fn of(bodies: &[NamedCloud], seed: u64) -> Self {
        Self {
            count: bodies.len(),
            body_radius: NamedCloud::largest_radius(bodies),
            seed,
        }
    }
}

/// There is nowhere to drop a body.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "the scan has no level surface without holes that is {diameter:.3} m wide: give a smaller --size, or --up if the direction is wrong"
)]
pub struct NoSpot {
    /// Diameter in metres of what was looked for.
    pub diameter: f32,
}

/// Radius of the disc around a spot, in body radii: with room for a body that tips over, else just
/// for the body.
const DISC_RADII: [f32; 2] = [2.5, 1.0];
/// Height differences within a footprint, in body radii, from ideal to barely acceptable.
const LEVEL_TOLERANCES: [f32; 4] = [0.15, 0.3, 0.6, 1.0];
/// Share of a footprint's pixels that must be seen and within the tolerance.
const SEEN_SHARE: f32 = 0.97;
/// Least distance of two spots, in body radii: bodies that tip over do not reach each other.
const LEAST_DISTANCE: f32 = 3.0;
/// Random groups of spots that are compared.
const GROUPS: usize = 256;

/// Chooses places for bodies on the surfaces of `scan` that face `up` (unit length): close enough
/// together for one picture, on as many levels as there are, and never two bodies on one place
/// unless there is no other.
///
/// # Errors
/// [`NoSpot`] if not even one place is level and without holes.
pub fn find_spots(scan: &PointCloud<'_>, up: Vec3, demand: &Demand) -> Result<Vec<Spot>, NoSpot> {
    find_spots_where(scan, up, demand, |_| true)
}

/// The same among the places, metres in the frame of the scan, that `is_usable`. All of the scan counts
/// as an obstacle.
///
/// # Errors
/// Those of [`find_spots`].
pub fn find_spots_where(
    scan: &PointCloud<'_>,
    up: Vec3,
    demand: &Demand,
    is_usable: impl Fn(Vec3) -> bool,
) -> Result<Vec<Spot>, NoSpot> {
    let map = HeightMap::of(scan, up, demand.body_radius);
    let mut places: Vec<Vec3> = Vec::new();
    // The best that give all bodies a place of their own; else those that give the most.
    let qualities = (LEVEL_TOLERANCES.iter())
        .flat_map(|tolerance| DISC_RADII.map(|room| (*tolerance, room * demand.body_radius)));
    for (tolerance, radius) in qualities {
        let mut candidates = map.places_within(radius, tolerance * radius);
        candidates.retain(|place| is_usable(*place));
        if !candidates.is_empty() {
            let group = best_group(&candidates, up, demand);
            if group.len() > places.len() {
                places = group;
            }
        }
        if places.len() >= demand.count.max(1) {
            break;
        }
    }
    if places.is_empty() {
        return Err(NoSpot {
            diameter: 2.0 * demand.body_radius,
        });
    }
    Ok((0..demand.count)
        .map(|k| Spot {
            surface: places[k % places.len()],
            level: k / places.len(),
        })
        .collect())
}

/// Middles of discs of `radius` metres on the surfaces of `scan` that face `up` (unit length), are level and have no
/// holes, with the best tolerance for which there are any; each is as high as its disc's highest point.
pub fn level_places(scan: &PointCloud<'_>, up: Vec3, radius: f32) -> Vec<Vec3> {
    let map = HeightMap::of(scan, up, radius);
    (LEVEL_TOLERANCES.iter())
        .map(|share| map.places_within(radius, share * radius))
        .find(|places| !places.is_empty())
        .unwrap_or_default()
}

/// Heights of the topmost surfaces over a grid of pixels.
struct HeightMap {
    image: Tldi,
    /// Edge of a pixel in metres.
    pixel_size: f32,
    /// Depth below the camera of each pixel's topmost layer, row by row; NaN: nothing there.
    depth: Vec<f32>,
}

impl HeightMap {
    fn of(scan: &PointCloud<'_>, up: Vec3, body_radius: f32) -> Self {
        let pixel_size = f32::max(2.0 * scan.mean_radius(), body_radius / 6.0);
        let camera = VirtualCamera::along(-up, pixel_size);
        let params = Params::for_radius(scan.mean_radius()).with_pixel_size(pixel_size);
        let image = tldi::build(scan, &Pose3::IDENTITY, &camera, &params);
        // Where the image would be too large, its pixels are larger than asked for.
        let pixel_size = image.camera.pixel_size_at(0.0);
        let mut map = Self {
            depth: Vec::new(),
            image,
            pixel_size,
        };
        let roof = map.roof_depth();
        let topmost = |layers: &[Layer]| {
            let mut depths = layers.iter().map(|layer| layer.depth);
            depths.find(|depth| *depth > roof).unwrap_or(f32::NAN)
        };
        map.depth = map.columns().map(topmost).collect();
        map
    }

    /// The layers of each pixel, row by row.
    fn columns(&self) -> impl Iterator<Item = &[Layer]> {
        let [width, height] = self.image.size;
        let pixels = (0..height).flat_map(move |j| (0..width).map(move |i| (i, j)));
        pixels.map(|(i, j)| self.image.layers_at(i, j))
    }

    /// Depth down to which there is a roof or a ceiling over most of the scan, with surfaces
    /// under it: nothing is dropped on top of that. `-∞` without one.
    fn roof_depth(&self) -> f32 {
        let seen = || self.columns().filter(|layers| !layers.is_empty());
        let [top, bottom] = range(seen().flatten().map(|layer| layer.depth));
        let under_roof = top + 0.15 * (bottom - top);
        let is_roofed = |layers: &&[Layer]| {
            layers[0].depth < under_roof && layers[layers.len() - 1].depth > under_roof
        };
        if 2 * seen().filter(is_roofed).count() > seen().count() {
            under_roof
        } else {
            f32::NEG_INFINITY
        }
    }

    /// Middles of discs of `radius` metres that are seen without holes and whose heights differ from
    /// that of the middle by `tolerance` metres at most.
    fn places_within(&self, radius: f32, tolerance: f32) -> Vec<Vec3> {
        let reach = (radius / self.pixel_size).ceil() as i32;
        let disc: Vec<[i32; 2]> = (-reach..=reach)
            .flat_map(|y| (-reach..=reach).map(move |x| [x, y]))
            .filter(|[x, y]| x * x + y * y <= reach * reach)
            .collect();
        let [width, height] = self.image.size.map(|n| n as i32);
        let inner = |n: i32| (reach..n - reach).step_by((reach / 3).max(1) as usize);
        inner(height)
            .flat_map(|j| inner(width).map(move |i| [i, j]))
            .filter_map(|middle| self.level_place(middle, &disc, tolerance))
            .collect()
    }

    /// The highest point of a disc around pixel `[i, j]`, moved to its middle, if the disc is
    /// level. Nothing may stand out above the tolerance; a few holes may be there.
    fn level_place(&self, [i, j]: [i32; 2], disc: &[[i32; 2]], tolerance: f32) -> Option<Vec3> {
        let width = self.image.size[0] as i32;
        let depth_at = |[x, y]: [i32; 2]| self.depth[((j + y) * width + i + x) as usize];
        let middle = depth_at([0, 0]);
        let (mut seen, mut top) = (0usize, middle);
        for depth in disc.iter().map(|offset| depth_at(*offset)) {
            if depth < middle - tolerance {
                return None;
            }
            seen += usize::from(depth <= middle + tolerance);
            top = top.min(depth);
        }
        if middle.is_nan() || (seen as f32) < SEEN_SHARE * disc.len() as f32 {
            return None;
        }
        let pixel = [i, j].map(|k| k as f32 + 0.5);
        let [u, v] = [0, 1].map(|k| self.image.origin[k] as f32 + pixel[k]);
        Some(self.image.camera.point_at(u, v, top))
    }
}

/// Up to `count` places that lie together, well apart and on many levels.
fn best_group(candidates: &[Vec3], up: Vec3, demand: &Demand) -> Vec<Vec3> {
    let mut rng = Rng::with_seed(demand.seed);
    let mut best: (f32, Vec<Vec3>) = (f32::MIN, Vec::new());
    let mut reach = 5.0 * demand.body_radius * (demand.count as f32).sqrt();
    // Twice as far in each round, up to where every candidate is within reach.
    for _ in 0..8 {
        for _ in 0..GROUPS {
            let group = random_group(candidates, up, reach, demand, &mut rng);
            let score = group_score(&group, up, demand.body_radius);
            if score > best.0 {
                best = (score, group);
            }
        }
        if best.1.len() >= demand.count {
            break;
        }
        reach *= 2.0;
    }
    best.1
}

/// Places within `reach` metres of a random one, picked at random, those on new levels first.
fn random_group(
    candidates: &[Vec3],
    up: Vec3,
    reach: f32,
    demand: &Demand,
    rng: &mut Rng,
) -> Vec<Vec3> {
    let first = candidates[rng.usize(..candidates.len())];
    let mut near: Vec<Vec3> = candidates
        .iter()
        .copied()
        .filter(|place| place.distance(first) <= reach)
        .collect();
    rng.shuffle(&mut near);
    let mut group = vec![first];
    for on_new_level in [true, false] {
        for place in &near {
            if group.len() >= demand.count {
                return group;
            }
            let apart = group.iter().all(|other| {
                (*place - *other).reject_from(up).length() >= LEAST_DISTANCE * demand.body_radius
            });
            let new_level =
                || (group.iter()).all(|other| (*place - *other).dot(up).abs() > demand.body_radius);
            if apart && (!on_new_level || new_level()) {
                group.push(*place);
            }
        }
    }
    group
}

/// How good a group is: full ones first, then those on many levels.
fn group_score(group: &[Vec3], up: Vec3, body_radius: f32) -> f32 {
    let mut heights: Vec<f32> = group.iter().map(|place| place.dot(up)).collect();
    heights.sort_unstable_by(f32::total_cmp);
    let steps = heights
        .windows(2)
        .filter(|pair| pair[1] - pair[0] > body_radius)
        .count();
    group.len() as f32 + 0.3 * steps.min(3) as f32
}
