//! How many pixels the images of one motion may have together.
//!
//! An image costs at least what its points cost. That much is free: it grows with the points that a user hands over.
//! Pixels beyond, of tiny bodies beside coarse clouds or of points strewn widely, are taken from a room that all
//! images of one motion share. Where an image does not fit into what is left, its pixels grow until it does. So a
//! motion in pieces, each with images of its own, takes a bounded time, whatever its numbers are.

use super::rect::Rect;

/// Pixels that the images of one motion may have together, besides those that their points pay for: 16 MiB of offsets,
/// and a quarter of a second. A ring of 2,000 pixels, of which nothing can be folded, still gets all of them in one
/// image; twice as many would double a pair's memory and its longest step, and half as many would coarsen that ring.
const ROOM: f32 = (1 << 22) as f32;

/// Pixels that each point pays for: several times what the points of a surface cover. Half or twice: no row changes.
pub(super) const PER_POINT: usize = 16;

/// Fragments that take the time of a pixel. Pixels much smaller than points show no more of them. Half or twice: no row
/// changes.
const FRAGMENTS: f32 = 4.0;

/// Fragments that each point pays for: pixels of a sixth of a radius. Half or twice: no row changes.
const FRAGMENTS_PER_POINT: f32 = 128.0;

/// Pixels that take the time of a ray through an exact surface. Half or twice: the test of what one image gets
/// fails.
const RAY: f32 = 8.0;

/// Pixels that an image takes at the least, and gets even where no room is left: culling its points takes that long,
/// and a few points with the border of a cast cover 13 × 13 pixels, with a ray in each.
const LEAST: f32 = (1 << 11) as f32;

/// Pixels that the images of one motion, or of one comparison, share.
///
/// A comparison or a cast has a room of its own. Who moves a body in pieces hands the same room to each of them
/// ([`CpuBackend::impact_within`](crate::CpuBackend::impact_within),
/// [`compare_within`](crate::CpuBackend::compare_within)). The room is 2²² pixels. What the points pay for, 16 pixels
/// and 128 fragments each, takes nothing of it.
///
/// ```
/// use tldi::{CpuBackend, ImpactQuery, Params, PointCloud, Room, Surface};
/// use tldi::glamx::{Pose3, Vec3};
///
/// let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::X]).radius(0.2).build()?;
/// let (backend, mut room) = (CpuBackend::new(), Room::default());
/// for piece in 0..3 {
///     let impact = backend.impact_within(
///         &ImpactQuery {
///             a: Surface::Cloud(&cloud),
///             b: Surface::Cloud(&cloud),
///             a_from_b: Pose3::translation(0.0, 3.0 - piece as f32, 0.0),
///             motion: -Vec3::Y,
///             touching: 0.0,
///             core_only: false,
///             penetration: None,
///             turned: &[],
///             params: Params::for_radius(0.2),
///         },
///         &mut room,
///     )?;
///     assert_eq!(impact.is_some(), piece == 2);
/// }
/// assert_eq!(room.coarser(), None); // all pixels had the size that was asked for
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Room {
    /// Pixels.
    left: f32,
    /// By how much the pixels of a refused image must be larger.
    wanted: Option<f32>,
    coarser: Option<f32>,
}

impl Default for Room {
    fn default() -> Self {
        Self {
            left: ROOM,
            wanted: None,
            coarser: None,
        }
    }
}

/// What an image takes, in pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost {
    pixels: f32,
    /// Those of them that its points pay for.
    paid: f32,
}

impl Cost {
    /// Of the image of a cloud of which `points` are seen, with about so many fragments.
    pub(super) fn new(rect: &Rect, points: usize, fragments: f32) -> Self {
        let paid = (PER_POINT * points) as f32;
        let of_fragments = (fragments - FRAGMENTS_PER_POINT * points as f32) / FRAGMENTS;
        Self {
            pixels: (rect.pixels() as f32).max(paid + of_fragments),
            paid,
        }
    }

    /// The same with so many rays through an exact surface.
    pub(super) fn with_rays(self, rays: f32) -> Self {
        Self {
            pixels: self.pixels.max(RAY * rays),
            ..self
        }
    }
}

impl Room {
    /// The largest factor by which pixels were made larger than asked for, since there was no room for them.
    pub fn coarser(&self) -> Option<f32> {
        self.coarser
    }

    /// Whether nothing is left. Images then have as many pixels as their points pay for, and few more.
    pub fn is_used_up(&self) -> bool {
        self.left <= 0.0
    }

    /// Whether there is no room for an image; [`take_wanted`](Self::take_wanted) then tells what pixels it needs.
    pub(super) fn refuses(&mut self, cost: Cost) -> bool {
        let share = cost.pixels / (self.left.max(LEAST) + cost.paid);
        if share > 1.0 {
            self.wanted = Some(share.sqrt().max(std::f32::consts::SQRT_2));
        }
        share > 1.0
    }

    /// Whether an image was refused since [`take_wanted`](Self::take_wanted).
    pub(super) fn has_refused(&self) -> bool {
        self.wanted.is_some()
    }

    /// By how much the pixels of what was refused must be larger.
    pub(super) fn take_wanted(&mut self) -> Option<f32> {
        self.wanted.take()
    }

    /// Takes what an image took.
    pub(super) fn take(&mut self, cost: Cost) {
        self.left -= (cost.pixels - cost.paid).max(LEAST);
    }

    /// Keeps that the pixels of an answer are larger than asked for by this factor.
    pub(super) fn tell(&mut self, coarser: f32) {
        self.coarser = Some(self.coarser.map_or(coarser, |told| told.max(coarser)));
    }

    /// What is left, to be put back where images are given up for others with larger pixels.
    pub(super) fn left(&self) -> f32 {
        self.left
    }

    /// The counterpart of [`left`](Self::left).
    pub(super) fn put_back(&mut self, left: f32) {
        self.left = left;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(edge: u32) -> Rect {
        Rect {
            origin: [0, 0],
            size: [edge, edge],
        }
    }

    /// Whatever images are asked for, those that are granted take no more than the room, what their points pay for and
    /// the least that each gets; and what is refused fits after it has grown as told.
    #[test]
    fn images_share_the_room() {
        let mut rng = fastrand::Rng::with_seed(34);
        let mut room = Room::default();
        let (mut granted, mut free) = (0.0f64, 0.0f64);
        for _ in 0..500 {
            let mut edge = 1 << rng.u32(4..14);
            let points = rng.usize(1..2000);
            let mut rounds = 0;
            let cost = loop {
                let cost = Cost::new(&square(edge), points, 0.0);
                if !room.refuses(cost) {
                    break cost;
                }
                let by = room.take_wanted().expect("a factor");
                edge = (edge as f32 / by) as u32;
                rounds += 1;
                assert!(rounds < 5, "{edge}");
            };
            room.take(cost);
            granted += f64::from(cost.pixels);
            free += f64::from(cost.paid + LEAST);
        }
        assert!(room.is_used_up());
        assert!(granted <= f64::from(ROOM) + free, "{granted} {free}");
    }

    /// One image gets all of it: 2²² pixels, or 2²⁴ fragments, beyond what its points pay for.
    #[test]
    fn one_image_gets_all() {
        let of = |edge, fragments| !Room::default().refuses(Cost::new(&square(edge), 1, fragments));
        assert!(of(2048, 0.0) && !of(2049, 0.0));
        assert!(of(1, 16_777_216.0) && !of(1, 16_778_000.0));
        let rays = |rays| !Room::default().refuses(Cost::new(&square(1), 1, 0.0).with_rays(rays));
        assert!(rays(524_288.0) && !rays(524_300.0));
    }
}
