//! Where two or three faces meet at the contact of an edge or a corner.
//!
//! Pixels see such a contact beside its lowest place, and a quadric through them is rounded. Their normals tell the
//! faces, and the contact is where the planes of the faces meet.

use crate::contact::estimate::Observed;
use crate::contact::quadric::{LEAST_DEVIATION, Quadric, robust};
use arrayvec::ArrayVec;
use glamx::{Mat2, Mat3, Vec2, Vec3};

/// Most faces that meet. A corner has three, or three of its faces suffice.
const MOST_FACES: usize = 3;

/// Least difference between the slopes of gaps over two faces: at 27° between them an edge is an eighth of a pixel below the
/// gaps around it. With half of it noisy normals make faces.
const APART: f32 = 0.5;

/// Slopes that are this much apart, and as much more as they are steep, have a quarter of the weight for a face. With half of
/// it estimated normals are too scattered for a face, with twice of it faces take normals of the edge.
const SAME_FACE: f32 = 0.15;

/// Rounds in which faces move to the middle of their slopes.
const ROUNDS: usize = 6;

/// Most slopes that are tried as a face's.
const MOST_TRIED: usize = 64;

/// Least share of each face in what holds the contact up. A face that rises by less bears the contact alone, as the bottom
/// of a box beside its rims. With a third of it boxes stand on their rims, with three times of it edges that lean are none.
const LEAST_SHARE: f32 = 0.1;

/// How much smaller deviations must be with more faces. One factor for gaps and one for both slopes: as likelihoods
/// of observations whose noise is not known compare. With twice of it the rims of bare boxes are edges; with half of it fewer
/// edges of bare boxes are found.
const BETTER: f32 = 0.25;

/// Most of the deviation of slopes about two faces that is left with a third one. Two of three faces leave the slopes of the
/// third, which are a third of all; noise leaves nearly all of it. With half of it corners on noise are edges, with 1.0 edges
/// are corners.
const THIRD_FACE: f32 = 0.7;

/// Most by which faces meet beyond the middles of the outermost pixels, in pixels. A pixel's corner is 0.7 pixels from its
/// middle.
const MOST_BEYOND: f32 = 1.0;

/// Where faces meet, over places in pixels.
#[derive(Debug)]
pub(crate) struct Vertex {
    /// Planes over places: gap at the origin and slopes.
    faces: ArrayVec<Vec3, MOST_FACES>,
    /// A place at which they meet, pixels.
    pub(crate) place: Vec2,
    /// Across the edge; any axis at a corner.
    pub(crate) across: Vec2,
    /// Whether they meet in one place only.
    pub(crate) is_corner: bool,
    /// Standard deviation of gaps about the highest face, where slopes are those of a face, pixels.
    gaps_off: f32,
    /// Standard deviation of slopes about those of the nearest face.
    slopes_off: f32,
}

impl Vertex {
    /// The faces that meet, if they explain what is `observed` better than `quadric` does, and meet no lower than `least`
    /// pixels.
    pub(crate) fn find(observed: &[Observed], quadric: &Quadric, least: f32) -> Option<Self> {
        let seeds = seeds(observed);
        let better = |count: usize| {
            let vertex = Self::of_faces(observed, seeds.get(..count)?)?;
            let smaller =
                |off: f32, other: f32| off.max(LEAST_DEVIATION) / other.max(LEAST_DEVIATION);
            let gaps = smaller(vertex.gaps_off, quadric.gaps_off);
            let slopes = smaller(vertex.slopes_off, quadric.slopes_off);
            let is_better = gaps * slopes * slopes < BETTER && vertex.gap(vertex.place) > least;
            (is_better && vertex.is_among(observed)).then_some(vertex)
        };
        let edge = better(2);
        let most_off = edge
            .as_ref()
            .map_or(f32::INFINITY, |e| THIRD_FACE * e.slopes_off);
        better(3)
            .filter(|corner| corner.slopes_off <= most_off)
            .or(edge)
    }

    /// The gap at a place: that over the highest face.
    pub(crate) fn gap(&self, place: Vec2) -> f32 {
        let gaps = self.faces.iter().map(|face| over(*face, place));
        gaps.fold(f32::NEG_INFINITY, f32::max)
    }

    /// Whether the faces meet in the footprint. Those of a level face and of two opposite rims meet far away.
    fn is_among(&self, observed: &[Observed]) -> bool {
        let axes = [self.across, self.across.perp()];
        let count = if self.is_corner { 2 } else { 1 };
        axes[..count].iter().all(|axis| {
            let beyond = |sign: f32| {
                let along = |place: Vec2| sign * place.dot(*axis);
                let rim = observed.iter().map(|o| along(o.place));
                along(self.place) - rim.fold(f32::NEG_INFINITY, f32::max)
            };
            beyond(1.0).max(beyond(-1.0)) <= MOST_BEYOND
        })
    }

    /// Standard deviation of gaps, pixels.
    pub(crate) fn deviation(&self) -> f32 {
        self.gaps_off
    }

    fn of_faces(observed: &[Observed], seeds: &[Vec2]) -> Option<Self> {
        let faces = faces(observed, seeds);
        let slope = |k: usize| faces[k].truncate();
        let mut pairs = (0..faces.len()).flat_map(|k| (0..k).map(move |l| (k, l)));
        if pairs.any(|(k, l)| slope(k).distance(slope(l)) < APART) {
            return None;
        }
        let [gaps_off, slopes_off] = deviations(observed, &faces);
        let is_corner = faces.len() == MOST_FACES;
        let (shares, place, across) = if is_corner {
            let columns = [0, 1, 2].map(|k| slope(k).extend(1.0));
            let matrix = Mat3::from_cols(columns[0], columns[1], columns[2]);
            let shares = matrix.inverse() * Vec3::Z;
            // slope · place − gap = −(gap at the origin), for all faces.
            let rows = matrix.transpose();
            let meet = Mat3::from_cols(rows.x_axis, rows.y_axis, -rows.z_axis).inverse();
            let place = meet * -Vec3::new(faces[0].z, faces[1].z, faces[2].z);
            (shares.min_element(), place.truncate(), Vec2::X)
        } else {
            let (across, apart) = (slope(0) - slope(1)).normalize_and_length();
            let [up, down] = [slope(0).dot(across), -slope(1).dot(across)];
            let at = (faces[1].z - faces[0].z) / apart;
            (up.min(down) / apart, at * across, across)
        };
        let meets = shares >= LEAST_SHARE && place.is_finite();
        meets.then_some(Self {
            faces,
            place,
            across,
            is_corner,
            gaps_off,
            slopes_off,
        })
    }
}

/// The gap over a face.
fn over(face: Vec3, place: Vec2) -> f32 {
    face.z + face.truncate().dot(place)
}

/// Weight of a slope for a face.
fn alike(slope: Vec2, of_face: Vec2) -> f32 {
    robust(slope.distance(of_face) / (SAME_FACE * (1.0 + of_face.length())))
}

/// The slopes that most pixels have, each apart from the others.
fn seeds(observed: &[Observed]) -> ArrayVec<Vec2, MOST_FACES> {
    let tried = observed
        .iter()
        .step_by(observed.len().div_ceil(MOST_TRIED).max(1));
    let mut tried: ArrayVec<(f32, Vec2), MOST_TRIED> = tried
        .filter(|o| o.turn_weight > 0.0)
        .map(|o| {
            let pixels = observed.iter();
            let mass = pixels.map(|p| p.turn_weight * alike(p.slope, o.slope));
            (mass.sum::<f32>(), o.slope)
        })
        .collect();
    let mut seeds = ArrayVec::new();
    while !seeds.is_full()
        && let Some((_, most)) = tried.iter().copied().max_by(|s, t| s.0.total_cmp(&t.0))
    {
        seeds.push(most);
        tried.retain(|(_, slope)| slope.distance(most) >= APART);
    }
    seeds
}

/// The planes on which pixels of like slopes lie, from `seeds` on.
fn faces(observed: &[Observed], seeds: &[Vec2]) -> ArrayVec<Vec3, MOST_FACES> {
    let mut slopes: ArrayVec<Vec2, MOST_FACES> = seeds.iter().copied().collect();
    let mut faces = ArrayVec::new();
    for _ in 0..ROUNDS {
        faces = (slopes.iter())
            .map(|&slope| {
                let nearest = |o: &&Observed| {
                    let own = o.slope.distance(slope);
                    slopes.iter().all(|other| other.distance(o.slope) >= own)
                };
                let of_face = observed.iter().filter(|o| o.turn_weight > 0.0);
                let of_face = of_face.filter(nearest);
                let weighted = of_face.map(|o| (alike(o.slope, slope), o));
                plane_of(weighted)
            })
            .collect();
        slopes = faces.iter().map(|face: &Vec3| face.truncate()).collect();
    }
    faces
}

/// The plane with the least squares of both gaps, in pixels, and slopes: gaps tell the slope of a wide face, normals that
/// of a narrow one.
fn plane_of<'a>(weighted: impl Iterator<Item = (f32, &'a Observed)>) -> Vec3 {
    let (mut weights, mut place, mut gap) = (f32::MIN_POSITIVE, Vec2::ZERO, 0.0);
    let (mut spread, mut rise) = (Mat2::ZERO, Vec2::ZERO);
    for (weight, o) in weighted {
        let along = weight * o.place;
        weights += weight;
        place += along;
        gap += weight * o.gap;
        spread += Mat2::from_cols(o.place.x * along, o.place.y * along);
        rise += along * o.gap + weight * o.slope;
    }
    let (place, gap) = (place / weights, gap / weights);
    spread -= weights * Mat2::from_cols(place.x * place, place.y * place);
    let known = spread + Mat2::from_diagonal(Vec2::splat(weights));
    let slope = known.inverse() * (rise - weights * gap * place);
    slope.extend(gap - slope.dot(place))
}

/// Standard deviations of gaps and of slopes about faces.
fn deviations(observed: &[Observed], faces: &[Vec3]) -> [f32; 2] {
    let (mut squares, mut weights) = ([0.0; 2], [f32::MIN_POSITIVE; 2]);
    for o in observed {
        let slopes = || faces.iter().map(|face| face.truncate());
        let off = slopes().map(|slope| o.slope.distance(slope));
        squares[1] += o.turn_weight * off.fold(f32::INFINITY, f32::min).powi(2);
        weights[1] += o.turn_weight;
        let likeness = slopes().map(|slope| alike(o.slope, slope));
        let weight = o.turn_weight * likeness.fold(0.0, f32::max);
        let gaps = faces.iter().map(|face| over(*face, o.place));
        squares[0] += weight * (o.gap - gaps.fold(f32::NEG_INFINITY, f32::max)).powi(2);
        weights[0] += weight;
    }
    [0, 1].map(|k| (squares[k] / weights[k]).sqrt())
}

#[cfg(test)]
mod tests {
    use crate::contact::footprint::{Footprint, ball, faces, normal};
    use glamx::Vec2;
    use std::f32::consts::TAU;

    fn is_noisy(seed: u64) -> bool {
        seed % 2 == 1
    }

    /// What a body touches that has these gaps and slopes, on smooth pixels or with noise of both.
    fn noisy(seed: u64, body: impl Fn(Vec2) -> (f32, Vec2)) -> Footprint {
        let mut rng = fastrand::Rng::with_seed(seed);
        let noise = if is_noisy(seed) { 0.05 } else { 0.0 };
        Footprint::of(|at| {
            let (gap, slope) = body(at);
            let [off, x, y] = [(); 3].map(|()| noise * normal(&mut rng));
            // As high as contacts are seen.
            (gap < 1.0 && at.length() < 10.0).then_some((gap + off, slope + Vec2::new(x, y)))
        })
    }

    #[test]
    fn edges_and_corners_are_where_faces_meet() {
        let mut missed = 0;
        for seed in 0..200 {
            let mut rng = fastrand::Rng::with_seed(1000 + seed);
            let turn = Vec2::from_angle(TAU * rng.f32());
            let meet = Vec2::new(rng.f32(), rng.f32());
            let steep = [(); 3].map(|()| 0.6 + 0.8 * rng.f32());
            let edge = [steep[0] * turn, -steep[1] * turn];
            let third = Vec2::from_angle(TAU / 3.0);
            let corner = [
                steep[0] * turn,
                steep[1] * turn.rotate(third),
                steep[2] * third.rotate(third).rotate(turn),
            ];
            for slopes in [&edge[..], &corner[..]] {
                let footprint = noisy(seed, |at| faces(at, meet, -0.3, slopes));
                let found = footprint.vertex();
                // Noise may hide the third face, but seldom.
                let Some(found) = found.filter(|found| found.is_corner == (slopes.len() == 3))
                else {
                    assert!(is_noisy(seed), "seed {seed}: {slopes:?}");
                    missed += 1;
                    continue;
                };
                let off = found.place - meet;
                let off = if found.is_corner {
                    off.length()
                } else {
                    off.dot(found.across).abs()
                };
                let off = off.max((found.gap(meet) + 0.3).abs());
                let most = if is_noisy(seed) { 0.3 } else { 0.02 };
                assert!(off < most, "seed {seed}: {off}");
            }
        }
        assert!(missed <= 10, "{missed} of 200 with noise");
    }

    /// A ball, a plane, a face that leans and bears alone, and a saddle have no vertex.
    #[test]
    fn what_is_round_or_flat_has_no_vertex() {
        for seed in 0..200 {
            let mut rng = fastrand::Rng::with_seed(2000 + seed);
            let (turn, radius) = (Vec2::from_angle(TAU * rng.f32()), 6.0 + 40.0 * rng.f32());
            let lowest = Vec2::new(rng.f32(), rng.f32());
            let saddle = |at: Vec2| {
                (
                    0.02 * (at.x * at.x - at.y * at.y),
                    0.04 * at * Vec2::new(1.0, -1.0),
                )
            };
            let round = noisy(seed, |at| ball(at, lowest, radius, -0.3));
            let flat = noisy(seed, |_| (-0.3, Vec2::ZERO));
            let leaning = noisy(seed, |at| {
                faces(at, Vec2::ZERO, -0.3, &[0.02 * turn, -turn])
            });
            let saddle = noisy(seed, saddle);
            for (name, footprint) in [
                ("ball", round),
                ("plane", flat),
                ("leaning", leaning),
                ("saddle", saddle),
            ] {
                assert!(
                    footprint.vertex().is_none(),
                    "seed {seed}: {name}, {radius}"
                );
            }
        }
    }
}
