//! Poisson-disc sampling by darts thrown at pieces of a surface, until each is covered.

use super::patch::Patch;
use fastrand::Rng;
use rapier3d::glamx::Vec3;
use std::collections::HashMap;

/// Least distance of two points on one side of the surface, in spacings. What is left to 1 is the size of
/// pieces that are covered as a whole. Half or twice the rest to 1: 1 or 2 of 300 overlaps are falsely deep
/// instead of 4, with other samples.
const LEAST_DISTANCE: f32 = 0.8;

/// Pieces this small, in spacings, are left out where they are hidden in part. Half or twice: the test of samples
/// fails, which must be even and close the surface.
const FINEST: f32 = 0.1;

/// Width of the cells that hold the points, in spacings: all that is within a spacing is in eight of them. Half: 2
/// of 300 overlaps are falsely deep instead of 4, with other samples; twice: no row of `overlaps` changes.
const CELL: f32 = 2.0;

/// Points so far.
pub(super) struct Scatter {
    spacing: f32,
    cells: HashMap<[i32; 3], Vec<u32>>,
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    rng: Rng,
}

impl Scatter {
    pub(super) fn new(spacing: f32) -> Self {
        Self {
            spacing,
            cells: HashMap::new(),
            points: Vec::new(),
            normals: Vec::new(),
            rng: Rng::with_seed(0),
        }
    }

    /// Positions and normals.
    pub(super) fn finish(self) -> (Vec<Vec3>, Vec<Vec3>) {
        (self.points, self.normals)
    }

    /// Adds points until all of the patch is within a spacing of one on its side, but what `hidden_around`
    /// says to be hidden: how far around a place, with its normal, of a piece.
    ///
    /// A dart is a place of a piece. All other places of the piece are within `reach` of it, since the patch's map
    /// lengthens nothing. So a dart that is near enough to a point tells that the piece is covered. Else
    /// the piece is halved. The dart becomes a point where none is near. A dart that does not is
    /// within [`LEAST_DISTANCE`] of a point: small pieces are covered, and it comes to an end.
    pub(super) fn cover(
        &mut self,
        patch: &Patch<'_>,
        hidden_around: impl Fn(&[Vec3; 3], (Vec3, Vec3)) -> f32,
    ) {
        let mut pieces = vec![patch.corners];
        while let Some(piece) = pieces.pop() {
            let dart = self.place_in(piece);
            let reach = piece
                .map(|corner| corner.distance(dart))
                .into_iter()
                .fold(0.0, f32::max);
            let (place, normal) = patch.at(dart);
            let hidden = hidden_around(&piece, (place, normal));
            let is_done = if hidden > 0.0 {
                hidden >= reach || reach <= FINEST * self.spacing
            } else {
                let mut distance = self.distance(place, normal);
                if distance >= LEAST_DISTANCE * self.spacing {
                    self.take(place, normal);
                    distance = 0.0;
                }
                distance + reach <= self.spacing
            };
            if !is_done {
                pieces.extend(halves(piece));
            }
        }
    }

    /// A random place of a triangle, evenly distributed.
    fn place_in(&mut self, [a, b, c]: [Vec3; 3]) -> Vec3 {
        let (mut u, mut v) = (self.rng.f32(), self.rng.f32());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        a + (b - a) * u + (c - a) * v
    }

    fn cell(&self, place: Vec3) -> [f32; 3] {
        (place / (CELL * self.spacing)).to_array()
    }

    /// Distance in metres to the nearest point on the same side; more than a spacing if none is
    /// within one.
    fn distance(&self, place: Vec3, normal: Vec3) -> f32 {
        let cell = self.cell(place);
        let mut least = 2.0 * self.spacing;
        for corner in 0..8 {
            let key = std::array::from_fn(|axis| {
                let low = cell[axis].floor();
                let toward = if cell[axis] - low < 0.5 { -1.0 } else { 1.0 };
                // `as` saturates.
                (low + if corner >> axis & 1 == 1 { toward } else { 0.0 }) as i32
            });
            for &i in self.cells.get(&key).into_iter().flatten() {
                let i = i as usize;
                if self.normals[i].dot(normal) > 0.0 {
                    least = least.min(self.points[i].distance(place));
                }
            }
        }
        least
    }

    fn take(&mut self, place: Vec3, normal: Vec3) {
        let key = self.cell(place).map(|c| c.floor() as i32);
        let index = self.points.len() as u32;
        self.cells.entry(key).or_default().push(index);
        self.points.push(place);
        self.normals.push(normal);
    }
}

/// The halves of a triangle, cut through the middle of its longest edge.
fn halves(corners: [Vec3; 3]) -> [[Vec3; 3]; 2] {
    let length = |k: usize| corners[k].distance_squared(corners[(k + 1) % 3]);
    let longest = (0..3)
        .max_by(|i, j| length(*i).total_cmp(&length(*j)))
        .unwrap_or(0);
    let [a, b, c] = std::array::from_fn(|k| corners[(longest + k) % 3]);
    let middle = a.midpoint(b);
    [[a, middle, c], [middle, b, c]]
}
