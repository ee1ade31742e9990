//! How deep a contact is at an edge or a corner.
//!
//! Pixels see such a contact beside its lowest place, and a fit through them is rounded: edges
//! would be 0.1 pixels too high, corners 0.2. The normals of the pixels tell the faces, and the contact is
//! where the planes of the faces meet: down from the lowest pixel to an edge, and along the edge to a
//! corner. No contact is below any of the faces. An edge that is rounded by about a pixel counts as sharp
//! at some places, because at that size pixels show every edge as round.

use crate::ContactPixel;
use crate::contact::beyond::beyond;
use crate::cpu::sweep::MOST_FACES;
use arrayvec::ArrayVec;
use glamx::{FloatExt, Vec2, Vec3};

/// Difference between the slopes of the gaps over two faces [`beyond`] which they count as two. Half: 10 of 636 stability rows
/// fail instead of 3; twice: depths 26 % worse.
const APART: f32 = 0.5;

/// Largest difference between the slope of the gaps in a pixel and that over its face, while the
/// face is searched and once it is found. Steep faces are allowed more. `NEAR_FACE`: half: rounded edges scatter by 0.17 r̄ in
/// place of 0.13; twice: bare sharp corners are 0.27 r̄ off in place of 0.03. `OF_FACE`: half: 0.10 r̄; twice: rounded edges
/// scatter by 0.16 r̄.
const NEAR_FACE: f32 = 0.4;
const OF_FACE: f32 = 0.1;

/// Most slopes that faces are looked for from, and of faces found. Noise has slopes of its own. Half: bare sharp corners are
/// 0.05 r̄ off in place of 0.03; twice: no change.
const MOST_SEARCHED: usize = 10;

/// Least share of the pixels that a face needs: noise has normals of all kinds. Half: rounded edges scatter by 0.18 r̄ in place
/// of 0.13; twice: bare sharp corners are 0.05 r̄ off in place of 0.03.
const LEAST_FACE: f32 = 0.025;

/// Share of the pixels that all faces have together [`beyond`] which faces explain the contact. Half: no change; twice: bare
/// sharp corners are 0.13 r̄ off in place of 0.03.
const OF_FACES: f32 = 0.3;

/// Height in pixels above faces [`beyond`] which these are no explanation, of the pixel that is nearest to where they meet: a
/// round surface is above its tangents. Half: deep corners with normals are 1.4 % off in place of 1.0 %; twice: no change; none:
/// the end of a bar that turns into a floor is not met.
const ROUND: f32 = 0.17;

/// Square of the distance in pixels from where faces meet to the nearest pixel [`beyond`] which they are no explanation. Within
/// a pixel it is at most 0.5 from the middle; faces that meet where there is no pixel are those of noise. Twice: the end of a
/// bar that turns is told to be 0.9 r̄ too deep in place of 0.5.
const OFF_VERTEX: f32 = 0.5;

/// The gap over a face, in metres, at a place on the plane of a contact: `at_origin + slope · place`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Face {
    at_origin: f32,
    slope: Vec2,
    pixels: f32,
}

impl Face {
    fn at(&self, place: Vec2) -> f32 {
        self.at_origin + self.slope.dot(place)
    }
}

/// The plane of a contact.
pub(crate) struct ContactPlane {
    pub(crate) origin: Vec3,
    /// Unit vectors.
    pub(crate) axes: [Vec3; 2],
    pub(crate) normal: Vec3,
}

impl ContactPlane {
    fn place(&self, point: Vec3) -> Vec2 {
        let off = point - self.origin;
        Vec2::new(off.dot(self.axes[0]), off.dot(self.axes[1]))
    }

    /// The gap over the tangent planes of both surfaces in a pixel.
    fn face(&self, contact: &ContactPixel) -> Face {
        let slope = |normal: Vec3| {
            let across = Vec2::new(normal.dot(self.axes[0]), normal.dot(self.axes[1]));
            -across / normal.dot(self.normal)
        };
        let (slope_a, slope_b) = (slope(contact.normal_a), slope(contact.normal_b));
        let (at_a, at_b) = (self.place(contact.point_a), self.place(contact.point_b));
        Face {
            at_origin: self.gap(contact) - slope_b.dot(at_b) + slope_a.dot(at_a),
            slope: slope_b - slope_a,
            pixels: 1.0,
        }
    }

    /// The gap of a pixel along the normal of the contact, and not its own.
    fn gap(&self, contact: &ContactPixel) -> f32 {
        let apart = contact.point_b - contact.point_a;
        let longer = apart.dot(self.normal) / apart.dot(contact.normal());
        let longer = if longer.is_finite() { longer } else { 1.0 };
        longer * contact.gap
    }
}

/// How far the contact of `pixels` is below `deepest_gap`, the gap of the lowest point that was fitted to them, metres;
/// negative: above. `tangents` is scratch.
pub(crate) fn lower_by<'a>(
    pixels: impl Iterator<Item = &'a ContactPixel> + Clone,
    plane: &ContactPlane,
    deepest_gap: f32,
    pixel_size: f32,
    tangents: &mut Vec<Face>,
) -> f32 {
    tangents.clear();
    let all = pixels.clone().map(|contact| plane.face(contact));
    tangents.extend(all.filter(|face| face.slope.is_finite()));
    let mut faces = faces(tangents);
    let gap = |contact: &&ContactPixel| plane.gap(contact);
    let Some(lowest) = pixels.clone().min_by(|m, n| gap(m).total_cmp(&gap(n))) else {
        return 0.0;
    };
    let mut lower = 0.0;
    let start = plane.place(lowest.middle());
    // The lowest pixel reaches over an edge by a pixel at the most. Faces that are farther above it are those of noise.
    let highest = |face: &Face| plane.gap(lowest) + pixel_size * (1.0 + face.slope.length());
    faces.retain(|face| face.at(start) <= highest(face));
    for vertex in vertices(&faces, start) {
        let off = |contact: &ContactPixel| {
            let place = plane.place(contact.middle());
            place.distance_squared(vertex.place) / pixel_size.powi(2)
        };
        let nearest = pixels.clone().min_by(|m, n| off(m).total_cmp(&off(n)));
        let nearest = nearest.unwrap_or(lowest);
        let above = plane.gap(nearest) - gap_over(&vertex.faces, plane.place(nearest.middle()));
        let sure = beyond(vertex.apart / APART)
            * (1.0 - beyond(above / pixel_size / ROUND))
            * (1.0 - beyond(off(nearest) / OFF_VERTEX));
        // The way leads down. Faces that noise makes up may be far above its end.
        let gap = gap_over(&faces, vertex.place).min(gap_over(&faces, start));
        lower = lower.lerp(deepest_gap - gap, sure);
    }
    let of_faces: f32 = faces.iter().map(|face| face.pixels).sum();
    beyond(of_faces / pixels.count() as f32 / OF_FACES) * lower
}

/// The gap over faces that go on for ever: that over the highest one.
fn gap_over(faces: &[Face], place: Vec2) -> f32 {
    let gaps = faces.iter().map(|face| face.at(place));
    gaps.fold(f32::NEG_INFINITY, f32::max)
}

/// The faces that meet. Each is looked for from the slope that is farthest from all where it was looked for before.
fn faces(tangents: &[Face]) -> ArrayVec<Face, MOST_SEARCHED> {
    let count = tangents.len() as f32;
    let around = |slope: Vec2, tolerance: f32| {
        let reach = tolerance * (1.0 + slope.length());
        let near = tangents
            .iter()
            .filter(|face| face.slope.distance(slope) < reach);
        let sum = near.fold(Face::default(), |sum, face| Face {
            at_origin: sum.at_origin + face.at_origin,
            slope: sum.slope + face.slope,
            pixels: sum.pixels + 1.0,
        });
        Face {
            at_origin: sum.at_origin / sum.pixels,
            slope: sum.slope / sum.pixels,
            ..sum
        }
    };
    let mean = tangents.iter().map(|face| face.slope).sum::<Vec2>() / count;
    let mut searched = ArrayVec::<Vec2, MOST_SEARCHED>::new();
    let mut faces = ArrayVec::<Face, MOST_SEARCHED>::new();
    while searched.len() + faces.len() < MOST_SEARCHED {
        let off = |slope: Vec2| {
            let found = faces.iter().map(|face| face.slope);
            let off = searched.iter().copied().chain(found);
            let off = off.map(|other| slope.distance(other));
            off.reduce(f32::min).unwrap_or(slope.distance(mean))
        };
        let farthest = (tangents.iter())
            .map(|face| (off(face.slope), face.slope))
            .max_by(|m, n| m.0.total_cmp(&n.0));
        let Some((off, slope)) = farthest else {
            break;
        };
        if off < APART && !searched.is_empty() {
            break;
        }
        searched.push(slope);
        // From the extremes to where most are.
        let near = around(around(slope, NEAR_FACE).slope, NEAR_FACE);
        let face = around(near.slope, OF_FACE);
        let is_new = |known: &Face| known.slope.distance(face.slope) >= APART;
        if face.pixels > LEAST_FACE * count && faces.iter().all(is_new) {
            faces.push(face);
        }
    }
    faces
}

/// Where two or three faces meet.
struct Vertex {
    place: Vec2,
    faces: ArrayVec<Face, MOST_FACES>,
    /// By how much the slopes over them differ at the least.
    apart: f32,
}

/// The way down from a `place`: over the highest face there to the edge, where it meets one that rises; and along the edge to
/// the corner, where a third one rises.
fn vertices(faces: &[Face], place: Vec2) -> ArrayVec<Vertex, 2> {
    let mut vertices = ArrayVec::new();
    let higher = |f: &&Face, g: &&Face| f.at(place).total_cmp(&g.at(place));
    let Some(f) = faces.iter().max_by(higher) else {
        return vertices;
    };
    let edge_with = |g: &Face| {
        let (across, apart) = (f.slope - g.slope).normalize_and_length();
        let is_lowest = g.slope.dot(across) < 0.0 && f.slope.dot(across) > 0.0;
        is_lowest.then(|| Vertex {
            place: place + (g.at(place) - f.at(place)) / apart * across,
            faces: [*f, *g].into_iter().collect(),
            apart,
        })
    };
    let by_gap = |m: &Vertex, n: &Vertex| f.at(m.place).total_cmp(&f.at(n.place));
    let Some(edge) = faces.iter().filter_map(edge_with).max_by(by_gap) else {
        return vertices;
    };
    let along = (f.slope - edge.faces[1].slope).normalize_or_zero().perp();
    let along = -along * f.slope.dot(along).signum();
    let corner_with = |h: &Face| {
        let [down, up] = [f.slope, h.slope].map(|slope| slope.dot(along));
        let reach = (f.at(edge.place) - h.at(edge.place)) / (up - down);
        let apart = edge.faces.iter().map(|face| face.slope.distance(h.slope));
        (up > 0.0 && reach > 0.0).then(|| Vertex {
            place: edge.place + reach * along,
            faces: edge.faces.iter().copied().chain([*h]).collect(),
            apart: apart.fold(edge.apart, f32::min),
        })
    };
    let corner = faces.iter().filter_map(corner_with).max_by(by_gap);
    vertices.extend([edge].into_iter().chain(corner));
    vertices
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::TAU;

    /// Contact pixels of a body over a floor at height 0, in a view straight down: its height and slope at a place.
    fn pixels(body: impl Fn(Vec2) -> (f32, Vec2)) -> Vec<ContactPixel> {
        let grid = (-4..=4).flat_map(|j| (-4..=4).map(move |i| [i, j]));
        grid.map(|pixel| {
            let [x, z] = pixel.map(|k| k as f32);
            let (height, slope) = body(Vec2::new(x, z));
            let normal_b = Vec3::new(slope.x, -1.0, slope.y).normalize();
            let mut contact = ContactPixel {
                pixel,
                view: 0,
                point_a: Vec3::new(x, 0.0, z),
                point_b: Vec3::new(x, height, z),
                normal_a: Vec3::Y,
                normal_b,
                gap: 0.0,
            };
            contact.gap = height * contact.normal().y;
            contact
        })
        .filter(|contact| contact.point_b.y < 1.0)
        .collect()
    }

    /// Where the contact of `pixels` is, for a fit that is 0.3 above the lowest of them.
    fn found(pixels: &[ContactPixel]) -> f32 {
        let lowest = |m: &&ContactPixel, n: &&ContactPixel| m.point_b.y.total_cmp(&n.point_b.y);
        let lowest = pixels.iter().min_by(lowest).expect("there are some");
        let deepest_gap = lowest.point_b.y + 0.3;
        let plane = ContactPlane {
            origin: Vec3::new(0.2, 0.0, -0.1),
            axes: [Vec3::X, -Vec3::Z],
            normal: Vec3::Y,
        };
        deepest_gap - lower_by(pixels.iter(), &plane, deepest_gap, 1.0, &mut vec![])
    }

    /// The highest of planes through one place, and its slope.
    fn of_planes(planes: &[Vec2], apex: Vec2, depth: f32) -> impl Fn(Vec2) -> (f32, Vec2) {
        move |place| {
            let heights = planes
                .iter()
                .map(|slope| (slope.dot(place - apex) - depth, *slope));
            heights
                .max_by(|m, n| m.0.total_cmp(&n.0))
                .expect("there are some")
        }
    }

    #[test]
    fn edges_and_corners_are_where_their_faces_meet() {
        let mut rng = fastrand::Rng::with_seed(1);
        for faces in [2, 3] {
            for _ in 0..200 {
                let turn = TAU * rng.f32();
                let planes: Vec<Vec2> = (0..faces)
                    .map(|k| {
                        let angle = turn + TAU * k as f32 / faces as f32;
                        (0.7 + 0.8 * rng.f32()) * Vec2::from_angle(angle)
                    })
                    .collect();
                let apex = Vec2::new(rng.f32() - 0.5, rng.f32() - 0.5);
                let depth = 0.5 + rng.f32();
                let off = found(&pixels(of_planes(&planes, apex, depth))) + depth;
                assert!(off.abs() < 1e-3, "{off} of {depth}: {planes:?} at {apex}");
            }
        }
    }

    /// Balls, ridges that are rounded, and normals that say nothing: what is fitted is left.
    #[test]
    fn what_has_no_faces_is_as_low_as_its_pixels() {
        let mut rng = fastrand::Rng::with_seed(3);
        for radius in [2.0, 3.0, 4.0, 5.0, 8.0] {
            for _ in 0..20 {
                let lowest = Vec2::new(rng.f32() - 0.5, rng.f32() - 0.5);
                let ball = |place: Vec2| {
                    let off = place - lowest;
                    (0.5 * off.length_squared() / radius - 1.0, off / radius)
                };
                let pixels = pixels(ball);
                let least = pixels
                    .iter()
                    .map(|c| c.point_b.y)
                    .fold(f32::INFINITY, f32::min);
                let lower = least + 0.3 - found(&pixels);
                assert!(
                    lower.abs() < 0.1,
                    "{lower} of a ball of {radius} at {lowest}"
                );
            }
        }
        let ridge = |place: Vec2| {
            let height = place.x.hypot(3.0);
            (height - 4.0, Vec2::new(place.x / height, 0.0))
        };
        let lower = -0.7 - found(&pixels(ridge));
        assert!(lower.abs() < 0.1, "{lower} of a ridge");
        // An edge of which one normal in eight is its own.
        let faces = [Vec2::X, -Vec2::X];
        let mut noisy = pixels(of_planes(&faces, Vec2::splat(0.4), 0.5));
        for contact in &mut noisy {
            if !contact.pixel.iter().all(|k| k % 2 == 0) || rng.bool() {
                let aside = 1.5 * rng.f32() * Vec2::from_angle(TAU * rng.f32());
                contact.normal_b = Vec3::new(aside.x, -1.0, aside.y).normalize();
                contact.gap = contact.point_b.y * contact.normal().y;
            }
        }
        let (lowest, found) = (
            noisy.iter().map(|c| c.point_b.y).fold(0.0, f32::min),
            found(&noisy),
        );
        assert_eq!(found, lowest + 0.3);
    }

    /// Few odd normals are the most extreme ones, and each is another's.
    #[test]
    fn odd_pixels_do_not_hide_a_face() {
        let mut rng = fastrand::Rng::with_seed(4);
        for _ in 0..50 {
            let faces = [Vec2::new(0.4, 0.0), Vec2::new(-0.5, 0.0)];
            let mut pixels = pixels(of_planes(&faces, Vec2::new(0.3, 0.0), 0.5));
            for k in 0..4 {
                let odd = rng.usize(0..pixels.len());
                let slope = 3.0 * Vec2::from_angle(0.25 * TAU * (k as f32 + rng.f32()));
                let contact = &mut pixels[odd];
                contact.normal_b = Vec3::new(slope.x, -1.0, slope.y).normalize();
                contact.gap = contact.point_b.y * contact.normal().y;
            }
            let off = found(&pixels) + 0.5;
            assert!(off.abs() < 0.02, "{off}");
        }
    }

    /// A slightly tilted face, of which two pixels have the normals of other faces. Where these meet it, it is half a pixel above its
    /// lowest pixel; where they meet each other, 25.
    #[test]
    fn odd_pixels_do_not_lift_a_face() {
        let odd = [
            (Vec2::new(3.0, 0.0), Vec2::new(-3.6, 2.4)),
            (Vec2::new(3.0, -1.0), Vec2::new(-4.0, -0.2)),
        ];
        let face = |place: Vec2| {
            let slope = Vec2::new(0.07, 0.03);
            let told = odd.iter().find(|(at, _)| *at == place);
            (
                slope.dot(place) - 2.0,
                told.map_or(slope, |(_, told)| *told),
            )
        };
        let pixels = pixels(face);
        let lowest = face(Vec2::splat(-4.0)).0;
        let lifted = found(&pixels) - lowest;
        assert!((0.0..0.6).contains(&lifted), "{lifted}");
    }

    #[test]
    fn what_is_seen_edge_on_says_nothing() {
        let upright = |_: Vec2| (0.0, Vec2::new(f32::INFINITY, 0.0));
        assert_eq!(found(&pixels(upright)), 0.3);
    }
}
