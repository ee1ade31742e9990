//! Stage `sweep`: the fragments of each pixel become layers.
//!
//! Within a pixel, fragments are sorted by class (entry, exit, edge-on) and depth. A run whose
//! depths follow each other within the merge gap (within a thickness on steep surfaces) is one
//! layer. The layer is the mean of its fragments. At an edge it is the mean of those on the face
//! that the ray meets, because tangent planes do not hold beyond the edge. (Planes of normals that
//! are means of both faces do.) Sums are integers: a layer does not depend on the order of the points.

use super::splat::{
    DEPTH_STEPS, DepthScale, EDGE_ON, Fragment, Fragments, Imaging, NORMAL_STEPS, Splat,
};
use crate::stage::stage;
use crate::{Facing, Layer, Tldi};
use arrayvec::ArrayVec;
use glamx::Vec3;

/// Cosine of the largest angle (35°) between normals of one face, or of two that face each other. Half or twice the
/// angle: no change.
pub(crate) const SAME_FACE: f32 = 0.82;

/// Least share of a layer's weight that a face needs beside another one: estimated normals beside an edge may be of neither
/// face. 0.2: 13 of 10,000 overlaps are falsely deep instead of 7; 0.4: shallow corners with normals are 0.03 r̄ off in place
/// of 0.02.
const LEAST_OF_LAYER: f32 = 0.3;

/// Square of the mean length of unit normals below which a layer has an edge: the smaller of two faces has just
/// [`LEAST_OF_LAYER`], and they differ just by [`SAME_FACE`].
const CREASED: f32 = 1.0 - 2.0 * LEAST_OF_LAYER * (1.0 - LEAST_OF_LAYER) * (1.0 - SAME_FACE);

/// Most faces that meet: those of a corner.
pub(crate) const MOST_FACES: usize = 3;

/// How finely a bend is summed: steps in a pixel, the most pixels aside, and bits of the normals that are dropped. So
/// the sum over 1,024 fragments fits an `i32`, the widest integer of WGSL. Half or twice as many steps or pixels: no
/// change.
const BEND_STEPS: f32 = 16.0;
const MOST_ASIDE: f32 = 4.0;
const BEND_SHIFT: u32 = 6;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 7] = [
    ("CREASED", CREASED as f64),
    ("SAME_FACE", SAME_FACE as f64),
    ("LEAST_OF_LAYER", LEAST_OF_LAYER as f64),
    ("MOST_FACES", MOST_FACES as f64),
    ("BEND_STEPS", BEND_STEPS as f64),
    ("MOST_ASIDE", MOST_ASIDE as f64),
    ("BEND_SHIFT", BEND_SHIFT as f64),
];

/// Appends the layers of the band that was splatted last. `color` tells the colour of a kept
/// point, where the cloud has colours.
pub(crate) fn sweep(
    fragments: &mut Fragments,
    oriented: bool,
    knows_faces: bool,
    merge_steps: u32,
    color: Option<&dyn Fn(u32) -> [u8; 4]>,
    imaging: &Imaging,
    out: &mut Tldi,
) {
    let _stage = stage!("sweep");
    let scale = &imaging.scale;
    let steep_steps = merge_steps.max(DEPTH_STEPS);
    let same_layer = |f: &Fragment, g: &Fragment| {
        let is_steep = f.is_steep() || g.is_steep();
        let apart = if is_steep { steep_steps } else { merge_steps };
        f.class() == g.class() && g.depth() - f.depth() <= apart
    };
    for pixel in 0..fragments.pixels() {
        let (in_pixel, splats) = fragments.of_pixel(pixel);
        in_pixel.sort_unstable_by_key(|f| f.key);
        let first_layer = out.layers.len();
        for run in in_pixel.chunk_by(same_layer) {
            let mut sum = Sum::of(run.iter(), splats, color);
            let mut agreement = 1.0;
            if knows_faces && sum.agreement_squared() < CREASED {
                let faces = faces_of(run, splats);
                let bend = sign_of_bend(run, splats, faces[0]);
                agreement = sum.agreement_squared().sqrt() * bend;
                sum = sum.of_face_met(run, splats, &faces, bend, color);
            }
            out.layers
                .push(sum.layer(run, agreement, oriented, color.is_some(), scale));
        }
        out.layers[first_layer..]
            .sort_unstable_by(|a, b| (a.depth.total_cmp(&b.depth)).then(a.facing.cmp(&b.facing)));
        out.offsets.push(out.layers.len() as u32);
    }
}

/// The splat of the heaviest fragment of each face in a run, the heaviest first. Ties go by key, normal and place, so that
/// the order of the fragments does not matter.
fn faces_of<'a>(run: &[Fragment], splats: &'a [Splat]) -> ArrayVec<&'a Splat, MOST_FACES> {
    let splat = |f: &Fragment| &splats[f.splat as usize];
    let rank = |f: &Fragment| (f.weight, f.key, splat(f).normal);
    let place = |f: &Fragment, g: &Fragment| {
        let [c, d] = [f, g].map(|f| splat(f).centre);
        (c[0].total_cmp(&d[0])).then(c[1].total_cmp(&d[1]))
    };
    let mut faces = ArrayVec::<&Splat, MOST_FACES>::new();
    while !faces.is_full() {
        let is_left = |f: &&Fragment| faces.iter().all(|face| !is_on_face(f, splats, face));
        let left = run.iter().filter(is_left);
        match left.max_by(|f, g| rank(f).cmp(&rank(g)).then(place(f, g))) {
            Some(heaviest) => faces.push(splat(heaviest)),
            None => break,
        }
    }
    faces
}

fn is_on_face(f: &Fragment, splats: &[Splat], face: &Splat) -> bool {
    let normal = splats[f.splat as usize].normal;
    let cosine = (0..3).map(|k| i32::from(face.normal[k]) * i32::from(normal[k]));
    cosine.sum::<i32>() as f32 >= SAME_FACE * (NORMAL_STEPS * NORMAL_STEPS)
}

/// 1 where normals lean apart around a face, as at an edge, −1 where they lean together, as in a groove.
fn sign_of_bend(run: &[Fragment], splats: &[Splat], face: &Splat) -> f32 {
    let bend = run.iter().map(|f| {
        let splat = &splats[f.splat as usize];
        let along = |k: usize| {
            let aside = (splat.centre[k] - face.centre[k]).clamp(-MOST_ASIDE, MOST_ASIDE);
            let turn = (i32::from(splat.normal[k]) - i32::from(face.normal[k])) >> BEND_SHIFT;
            (BEND_STEPS * aside).round() as i32 * turn
        };
        i64::from(along(0) + along(1))
    });
    if bend.sum::<i64>() < 0 { -1.0 } else { 1.0 }
}

#[derive(Default)]
struct Sum {
    weight: i64,
    depth: i64,
    normal: [i64; 3],
    color: [i64; 4],
}

impl Sum {
    fn of<'a>(
        fragments: impl Iterator<Item = &'a Fragment>,
        splats: &[Splat],
        color: Option<&dyn Fn(u32) -> [u8; 4]>,
    ) -> Self {
        let mut sum = Self::default();
        for f in fragments {
            let splat = &splats[f.splat as usize];
            let w = i64::from(f.weight);
            sum.weight += w;
            sum.depth += w * i64::from(f.depth());
            for (sum, c) in sum.normal.iter_mut().zip(splat.normal) {
                *sum += w * i64::from(c);
            }
            if let Some(color) = color {
                for (sum, c) in sum.color.iter_mut().zip(color(splat.kept)) {
                    *sum += w * i64::from(c);
                }
            }
        }
        sum
    }

    /// Of all fragments of a `run`, that of those on the face that the ray meets: at an edge towards the camera the farthest of
    /// the `faces`, in a groove the nearest.
    fn of_face_met(
        &self,
        run: &[Fragment],
        splats: &[Splat],
        faces: &[&Splat],
        bend: f32,
        color: Option<&dyn Fn(u32) -> [u8; 4]>,
    ) -> Self {
        let towards_camera = if faces[0].normal[2] > 0 { -1.0 } else { 1.0 };
        let of_face = |face: &&Splat| {
            let on_face = run.iter().filter(|f| is_on_face(f, splats, face));
            Self::of(on_face, splats, color)
        };
        let counts = |of: &Self| of.weight as f32 >= LEAST_OF_LAYER * self.weight as f32;
        let inwards = |of: &Self| towards_camera * bend * of.mean_depth() as f32;
        let mut faces = faces.iter().map(of_face);
        let heaviest = faces.next().unwrap_or_default();
        let others = faces.filter(counts);
        others.fold(heaviest, |met, of| match inwards(&of) > inwards(&met) {
            true => of,
            false => met,
        })
    }

    fn mean_depth(&self) -> f64 {
        self.depth as f64 / self.weight as f64
    }

    /// Square of the length of the mean of the unit normals.
    fn agreement_squared(&self) -> f32 {
        let squared = Vec3::from_array(self.normal.map(|n| n as f32)).length_squared();
        squared / (NORMAL_STEPS * self.weight as f32).powi(2)
    }

    /// The layer of a run.
    fn layer(
        &self,
        run: &[Fragment],
        agreement: f32,
        oriented: bool,
        colored: bool,
        scale: &DepthScale,
    ) -> Layer {
        let normal = Vec3::from_array(self.normal.map(|n| n as f32)).normalize_or(-Vec3::Z);
        let depth = self.mean_depth();
        let facing = match run[0].class() {
            0 => Facing::Entry,
            1 if oriented => Facing::Exit,
            _ => Facing::Unknown,
        };
        let color = if colored {
            self.color
                .map(|c| ((c + self.weight / 2) / self.weight) as u8)
        } else {
            [0; 4]
        };
        Layer {
            near: scale.metres(run[0].depth() as f32),
            far: scale.metres(run[run.len() - 1].depth() as f32),
            depth: scale.metres(depth as f32),
            normal,
            agreement,
            facing,
            color,
        }
    }
}

/// Whether a layer is seen too steeply for its depth to be that of a surface crossing the ray.
pub(crate) fn is_edge_on(layer: &Layer) -> bool {
    layer.normal.z.abs() < EDGE_ON
}

/// Weight of a layer's normal for a body whose outside is on the camera's side (`side` −1) or
/// beyond the layer (1). At an edge it is how far the faces agree. In a groove both faces touch,
/// each with its own normal, and it is 1.
pub(crate) fn share_of(layer: &Layer, side: f32) -> f32 {
    let is_edge = layer.agreement * side * layer.normal.z > 0.0;
    if is_edge { layer.agreement.abs() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Params, PointCloud, VirtualCamera, build};

    /// An image along z of two faces that meet at x = 0, whose depth rises by `slopes` before and behind it. Their points are 0.1
    /// apart, and twice as wide. The inside is where z is greater, or less.
    fn image_of(slopes: [f32; 2], is_inside_beyond: bool, params: &Params) -> Tldi {
        let slope_at = |x: f32| slopes[usize::from(x > 0.0)];
        let grid = (-9..=9).flat_map(|j| (-9..=9).map(move |i| [i, j]));
        let points: Vec<Vec3> = grid
            .map(|[i, j]| [i as f32 + 0.5_f32.copysign(i as f32), j as f32].map(|x| 0.1 * x))
            .map(|[along, y]| {
                let x = along / slope_at(along).hypot(1.0);
                Vec3::new(x, y, slope_at(x) * x)
            })
            .collect();
        let outwards = if is_inside_beyond { 1.0 } else { -1.0 };
        let normal = |p: &Vec3| outwards * Vec3::new(slope_at(p.x), 0.0, -1.0).normalize();
        let normals = points.iter().map(normal).collect::<Vec<_>>();
        let cloud = PointCloud::builder(&points)
            .radius(0.2)
            .normals(normals)
            .build()
            .expect("the points are valid");
        let camera = VirtualCamera::along(Vec3::Z, params.pixel_size);
        build(&cloud, &camera.view_from_frame.inverse(), &camera, params)
    }

    /// Beside an edge or a groove, each pixel has the face that its ray meets, also a steep one that is narrow in the view. With
    /// the face of the nearest point, pixels up to 0.9 of a pixel beyond an edge would have the other one.
    #[test]
    fn rays_meet_the_face_on_their_side() {
        let params = Params::for_radius(0.1);
        for slopes in [
            [-0.3, 1.6],
            [0.2, 1.6],
            [-1.6, 0.5],
            [1.6, 0.0],
            [-1.0, 1.0],
        ] {
            for is_inside_beyond in [true, false] {
                let image = image_of(slopes, is_inside_beyond, &params);
                let mut beside = 0;
                for k in 0..image.offsets.len() - 1 {
                    let x = (image.origin[0] + (k % image.size[0] as usize) as i32) as f32;
                    let x = (x + 0.5) * params.pixel_size;
                    for layer in image
                        .layers_of(k)
                        .iter()
                        .filter(|l| l.agreement.powi(2) < CREASED)
                    {
                        let slope = slopes[usize::from(x > 0.0)];
                        let face = Vec3::new(slope, 0.0, -1.0).normalize();
                        let off = layer.normal.dot(face).abs();
                        assert!(off > 0.999, "{slopes:?} at {x}: {layer:?}");
                        beside += 1;
                    }
                }
                assert!(beside > 10, "{slopes:?} {is_inside_beyond}: {beside}");
            }
        }
    }

    /// Of fragments that are alike but for their places, the same one is the face in any order, and with it the bend.
    #[test]
    fn like_fragments_are_told_apart_by_their_places() {
        let splat = |x: f32, y: f32, normal: [i16; 3]| {
            let mut splat = Splat::default();
            (splat.centre, splat.normal) = ([x, y], normal);
            splat
        };
        // Two of one face, on both sides of one of another that leans along x.
        let flat = [0, 0, -8192];
        let splats = [
            splat(-1.0, 0.0, flat),
            splat(1.0, 0.0, flat),
            splat(0.0, 0.5, [4096, 0, -7094]),
        ];
        let fragment = |splat: u32, weight| Fragment {
            key: 1 << 8,
            splat,
            weight,
        };
        let [left, right, leaning] = [fragment(0, 200), fragment(1, 200), fragment(2, 100)];
        let orders = [
            [left, right, leaning],
            [right, left, leaning],
            [leaning, right, left],
        ];
        let mut bends = Vec::new();
        for run in orders {
            let face = faces_of(&run, &splats)[0];
            assert_eq!(face.centre, [1.0, 0.0]);
            bends.push(sign_of_bend(&run, &splats, face));
            // The other one would say the opposite.
            assert_eq!(sign_of_bend(&run, &splats, &splats[0]), -bends[0]);
        }
        assert_eq!(bends, [bends[0]; 3]);
    }

    /// Seen from outside, an edge agrees less than its faces do. A groove agrees as they do: both faces touch.
    #[test]
    fn edges_count_less_than_faces_and_grooves_do_not() {
        let params = Params::for_radius(0.1);
        for (ridge, edge_side) in [(1.0, -1.0), (-1.0, 1.0)] {
            let image = image_of([-ridge, ridge], true, &params);
            let creased = |l: &&Layer| l.agreement.powi(2) < CREASED;
            let layers: Vec<_> = image.layers.iter().filter(creased).collect();
            assert!(layers.len() >= 8, "{}", layers.len());
            for layer in layers {
                let face = Vec3::new(layer.normal.x.signum(), 0.0, -1.0).normalize();
                assert!(
                    layer.normal.distance(face) < 1e-3,
                    "{ridge} {layer:?} {face}"
                );
                let shares = [edge_side, -edge_side].map(|side| share_of(layer, side));
                assert!(
                    shares[0].powi(2) < CREASED && shares[1] == 1.0,
                    "{layer:?}: {shares:?}"
                );
            }
        }
    }
}
