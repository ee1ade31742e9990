//! The paper's layers by brute force: every pixel on its own, in f64, from the description.
//!
//! It shares nothing with the implementation but the definitions: no binning, no sorting, no bit
//! masks. Its own limits: where a yes-or-no question (is the pixel's centre within the disc, do two
//! ranges overlap, in which segment does a cylinder begin) is closer than rounding can decide, the
//! pixel is reported as undecided.

use tldi::glamx::{DQuat, DVec3, Pose3, Vec3};
use tldi::{Projection, VirtualCamera};

/// Pixels: f32 pixel coordinates below 128 are good to 1e-5, their errors from f32 poses to less
/// than 1e-4.
const UNDECIDED_PX: f64 = 1e-3;
/// Metres: f32 depths below 8 m are good to 1e-6.
const UNDECIDED_DEPTH: f64 = 1e-5;

/// How cylinders are connected to layers.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Connectivity {
    /// By overlapping depth ranges, every pair tried.
    Overlap,
    /// By filled depth segments, this many at most.
    Segments(usize),
}

#[derive(Debug)]
pub(crate) struct OracleLayer {
    pub(crate) near: f64,
    pub(crate) far: f64,
    pub(crate) color: [f64; 4],
}

#[derive(Debug)]
pub(crate) struct OraclePixel {
    pub(crate) layers: Vec<OracleLayer>,
    pub(crate) decided: bool,
}

#[derive(Clone, Copy)]
struct Cylinder {
    near: f64,
    far: f64,
    weight: f64,
    color: [u8; 4],
}

impl Cylinder {
    fn overlaps(&self, other: &Self) -> bool {
        self.near <= other.far && other.near <= self.far
    }
}

pub(crate) struct Scene<'a> {
    pub(crate) points: &'a [Vec3],
    pub(crate) radii: &'a [f32],
    pub(crate) colors: &'a [[u8; 4]],
    pub(crate) frame_from_cloud: Pose3,
    pub(crate) camera: VirtualCamera,
}

impl Scene<'_> {
    /// The layers at pixel `(i, j)` of the camera's grid.
    pub(crate) fn pixel(&self, i: i32, j: i32, connectivity: Connectivity) -> OraclePixel {
        let mut decided = true;
        let mut rest = self.cylinders(i, j, &mut decided);
        let mut layers = Vec::new();
        while !rest.is_empty() {
            let members: Vec<Cylinder>;
            (members, rest) = match connectivity {
                Connectivity::Overlap => connected(&rest),
                Connectivity::Segments(count) => filled_run(&rest, count, &mut decided),
            };
            let next = rest.iter().map(|c| c.near).fold(f64::INFINITY, f64::min);
            let mut layer = blend(&members, &mut decided);
            layer.far = layer.far.min(next);
            layers.push(layer);
        }
        layers.sort_by(|a, b| a.near.total_cmp(&b.near));
        OraclePixel { layers, decided }
    }

    fn cylinders(&self, i: i32, j: i32, decided: &mut bool) -> Vec<Cylinder> {
        let mut cylinders = Vec::new();
        for (k, point) in self.points.iter().enumerate() {
            let frame = moved(&self.frame_from_cloud, point.as_dvec3());
            let view = moved(&self.camera.view_from_frame, frame);
            let radius = f64::from(self.radii[k]);
            let [w, h] = self.camera.size.unwrap_or([0, 0]).map(f64::from);
            let (u, v, pixel_size) = match self.camera.projection {
                Projection::Orthographic { pixel_size } => {
                    let p = f64::from(pixel_size);
                    (view.x / p, view.y / p, p)
                }
                Projection::Perspective {
                    focal_px,
                    near,
                    far,
                } => {
                    let edges = [f64::from(near), f64::from(far)];
                    *decided &= edges.iter().all(|e| (view.z - e).abs() > UNDECIDED_DEPTH);
                    if view.z < edges[0] || view.z > edges[1] {
                        continue;
                    }
                    let p = view.z / f64::from(focal_px);
                    (view.x / p + 0.5 * w, view.y / p + 0.5 * h, p)
                }
            };
            let (dx, dy) = (f64::from(i) + 0.5 - u, f64::from(j) + 0.5 - v);
            let distance = dx.hypot(dy) * pixel_size;
            // Whether the disc's centre is in this pixel: the larger offset is at most a half.
            let offset = dx.abs().max(dy.abs());
            let covers = distance <= radius || offset < 0.5;
            let by_rim = ((distance - radius) / pixel_size).abs() < UNDECIDED_PX;
            let by_centre = distance > radius && (offset - 0.5).abs() < UNDECIDED_PX;
            *decided &= !by_rim && !by_centre;
            if covers {
                let share = (distance / radius).min(1.0);
                cylinders.push(Cylinder {
                    near: view.z - radius,
                    far: view.z + radius,
                    weight: (-0.5 * (share / 0.5).powi(2)).exp(),
                    color: self.colors[k],
                });
            }
        }
        cylinders
    }
}

fn moved(pose: &Pose3, point: DVec3) -> DVec3 {
    let q = pose.rotation;
    let rotation = DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into()).normalize();
    rotation * point + pose.translation.as_dvec3()
}

fn frontmost(cylinders: &[Cylinder]) -> usize {
    (0..cylinders.len())
        .min_by(|&a, &b| cylinders[a].near.total_cmp(&cylinders[b].near))
        .unwrap()
}

/// What hangs together with the frontmost cylinder by overlaps, and the rest.
fn connected(cylinders: &[Cylinder]) -> (Vec<Cylinder>, Vec<Cylinder>) {
    let mut reached = vec![false; cylinders.len()];
    reached[frontmost(cylinders)] = true;
    loop {
        let before = reached.clone();
        for a in 0..cylinders.len() {
            for b in 0..cylinders.len() {
                reached[b] |= reached[a] && cylinders[a].overlaps(&cylinders[b]);
            }
        }
        if before == reached {
            break;
        }
    }
    split(cylinders, |k| reached[k])
}

/// What begins in the run of filled segments at the front, and the rest.
fn filled_run(
    cylinders: &[Cylinder],
    segments: usize,
    decided: &mut bool,
) -> (Vec<Cylinder>, Vec<Cylinder>) {
    let first = frontmost(cylinders);
    let front = cylinders[first].near;
    let height = cylinders[first].far - front;
    for (k, cylinder) in cylinders.iter().enumerate() {
        if k != first {
            for edge in [cylinder.near, cylinder.far] {
                let from_edge = ((edge - front) / height).round() * height - (edge - front);
                *decided &= from_edge.abs() > UNDECIDED_DEPTH;
            }
        }
    }
    let bounds = |k: usize| [front + k as f64 * height, front + (k + 1) as f64 * height];
    let filled = |k: usize| {
        let [low, high] = bounds(k);
        k == 0
            || cylinders
                .iter()
                .enumerate()
                .any(|(c, cylinder)| c != first && cylinder.near < high && cylinder.far > low)
    };
    let run = (0..segments).take_while(|&k| filled(k)).count();
    let end = bounds(run)[0];
    split(cylinders, |k| k == first || cylinders[k].near < end)
}

fn split(cylinders: &[Cylinder], member: impl Fn(usize) -> bool) -> (Vec<Cylinder>, Vec<Cylinder>) {
    let pick = |wanted: bool| {
        (0..cylinders.len())
            .filter(|&k| member(k) == wanted)
            .map(|k| cylinders[k])
            .collect()
    };
    (pick(true), pick(false))
}

fn blend(members: &[Cylinder], decided: &mut bool) -> OracleLayer {
    for a in members {
        for b in members {
            *decided &= (a.near - b.far).abs() > UNDECIDED_DEPTH;
        }
    }
    let front = members[frontmost(members)];
    let back = *members
        .iter()
        .max_by(|a, b| a.far.total_cmp(&b.far))
        .unwrap();
    // Another cylinder that ends as far back decides whom far blends, unless it is as long.
    *decided &= members
        .iter()
        .all(|c| c.far == back.far || (c.far - back.far).abs() > UNDECIDED_DEPTH);
    let stacked = members
        .iter()
        .any(|a| members.iter().any(|b| !a.overlaps(b)));
    let mean = |with: &Cylinder, value: &dyn Fn(&Cylinder) -> f64| {
        let chosen = || members.iter().filter(|c| !stacked || c.overlaps(with));
        let weight: f64 = chosen().map(|c| c.weight).sum();
        chosen().map(|c| c.weight * value(c)).sum::<f64>() / weight
    };
    OracleLayer {
        near: mean(&front, &|c| c.near),
        far: mean(&back, &|c| c.far),
        color: [0, 1, 2, 3].map(|k| mean(&front, &|c| f64::from(c.color[k]))),
    }
}
