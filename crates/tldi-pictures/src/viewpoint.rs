//! Chooses where to look at bodies from.

use crate::camera::near_of;
use crate::{Item, Paint, Scene, pixels_of, thinned};
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{PointCloud, VirtualCamera};

/// Horizontal field of view in radians (50°).
const FIELD_OF_VIEW: f32 = 0.873;
/// Columns and rows of the images that candidates are judged by.
const TRIAL_SIZE: [u32; 2] = [160, 90];
/// Elevations of candidate views over the horizon, in radians: 22°, 35°, 50°.
const ELEVATIONS: [f32; 3] = [0.38, 0.61, 0.87];
const AZIMUTHS: usize = 16;
/// Points of a cloud, at most, in the images that candidates are judged by.
const TRIAL_POINTS: usize = 40_000;

/// A perspective camera with an image of `size` that sees the bodies of a scene as well as
/// possible: not hidden, with surroundings behind them. `also_at` are other places where bodies
/// will be in the same picture, in the scene's frame. Walls in front of the bodies are cut away by
/// the near plane where there is no view without them.
pub fn choose(scene: &Scene<'_>, also_at: &[Vec3], size: [u32; 2]) -> VirtualCamera {
    let framing = Framing::of(scene, also_at);
    let thinned: Vec<(PointCloud<'static>, Pose3, Paint)> = (scene.items.iter())
        .filter_map(|item| {
            // The fewer points, the larger their discs, so that they cover as much.
            let step = item.cloud.len().div_ceil(TRIAL_POINTS);
            let grown = |radius| radius * (step as f32).sqrt();
            let cloud = thinned(item.cloud, step, grown).ok()?;
            Some((cloud, item.scene_from_cloud, item.paint))
        })
        .collect();
    let items = thinned.iter().map(|(cloud, pose, paint)| Item {
        cloud,
        scene_from_cloud: *pose,
        paint: *paint,
    });
    let (scan, bodies): (Vec<Item<'_>>, Vec<Item<'_>>) =
        items.partition(|item| item.paint == Paint::Scan);
    let mut best = (
        f32::NEG_INFINITY,
        framing.camera(0.0, ELEVATIONS[1], false, scene.up, size),
    );
    for elevation in ELEVATIONS {
        for k in 0..AZIMUTHS {
            let azimuth = k as f32 * std::f32::consts::TAU / AZIMUTHS as f32;
            let camera = |cut, size| framing.camera(azimuth, elevation, cut, scene.up, size);
            let trial = Trial::new(&scan, &bodies, &camera(false, TRIAL_SIZE));
            for cut in [false, true] {
                let candidate = camera(cut, size);
                // A cut through furniture is ugly: only for a much better view. Steep views are
                // dull: only for a better one.
                let penalty = if cut { 0.35 } else { 0.0 } + 0.3 * elevation;
                let score = trial.score(near_of(&candidate)) - penalty;
                if score > best.0 {
                    best = (score, candidate);
                }
            }
        }
    }
    best.1
}

/// What is to be seen: balls of one radius around places, in the scene's frame, metres.
struct Framing {
    places: Vec<Vec3>,
    radius: f32,
}

impl Framing {
    fn of(scene: &Scene<'_>, also_at: &[Vec3]) -> Self {
        let bodies = scene.items.iter().filter(|item| item.paint != Paint::Scan);
        let places = bodies.map(|item| item.scene_from_cloud * item.cloud.bounds().center());
        Self {
            places: places.chain(also_at.iter().copied()).collect(),
            radius: scene.detail,
        }
    }

    /// The camera from a direction, as near as it can be with all balls and a margin in view.
    fn camera(
        &self,
        azimuth: f32,
        elevation: f32,
        cut: bool,
        up: Vec3,
        size: [u32; 2],
    ) -> VirtualCamera {
        let (level, _) = up.any_orthonormal_pair();
        let (sin, cos) = elevation.sin_cos();
        let forward = -(cos * (Quat::from_axis_angle(up, azimuth) * level) + sin * up);
        let right = forward.cross(up).normalize_or(level);
        let down = forward.cross(right);
        let range_along = |axis: Vec3| {
            let along = self.places.iter().map(|place| place.dot(axis));
            along.fold((f32::MAX, f32::MIN), |(min, max), a| {
                (min.min(a), max.max(a))
            })
        };
        let middle = [right, down, forward].map(|axis| {
            let (min, max) = range_along(axis);
            axis * f32::midpoint(min, max)
        });
        let target: Vec3 = middle.into_iter().sum();
        let half_width = (0.5 * FIELD_OF_VIEW).tan();
        let half_height = half_width * size[1] as f32 / size[0] as f32;
        let margin = 2.2 * self.radius;
        let distance = (self.places.iter())
            .flat_map(|place| {
                let offset = *place - target;
                let fit = |axis: Vec3, half: f32| (offset.dot(axis).abs() + margin) / half;
                let nearer = -offset.dot(forward);
                [
                    fit(right, half_width) + nearer,
                    fit(down, half_height) + nearer,
                ]
            })
            .fold(4.0 * self.radius, f32::max);
        let eye = target - distance * forward;
        let near = if cut {
            let nearest = range_along(forward).0 - eye.dot(forward);
            f32::max(nearest - 1.5 * self.radius, 0.05 * distance)
        } else {
            0.05 * distance
        };
        VirtualCamera::perspective(eye, target, up, FIELD_OF_VIEW, size, near, 1e4 * distance)
    }
}

/// Small images of one view.
struct Trial {
    /// Depths of the scan's layers at each pixel, nearest first.
    scan: Vec<Vec<f32>>,
    /// Each body's pixels and their depths.
    bodies: Vec<Vec<(usize, f32)>>,
}

impl Trial {
    fn new(scan: &[Item<'_>], bodies: &[Item<'_>], camera: &VirtualCamera) -> Self {
        let mut depths = vec![Vec::new(); (TRIAL_SIZE[0] * TRIAL_SIZE[1]) as usize];
        for item in scan {
            for (k, layers) in pixels_of(&item.image(camera), TRIAL_SIZE) {
                depths[k].extend(layers.iter().map(|layer| layer.depth));
            }
        }
        for pixel in &mut depths {
            pixel.sort_unstable_by(f32::total_cmp);
        }
        let front = |item: &Item<'_>| {
            let image = item.image(camera);
            let pixels = pixels_of(&image, TRIAL_SIZE);
            pixels
                .filter_map(|(k, layers)| Some((k, layers.first()?.depth)))
                .collect()
        };
        Self {
            scan: depths,
            bodies: bodies.iter().map(front).collect(),
        }
    }

    /// How well the bodies are seen from `near` metres on: the mean and the least share of a body
    /// that is not hidden, and a little for surroundings that fill the image.
    fn score(&self, near: f32) -> f32 {
        let scan_depth = |k: usize| self.scan[k].iter().copied().find(|depth| *depth >= near);
        let seen = |pixels: &Vec<(usize, f32)>| {
            let visible = |(k, depth): &&(usize, f32)| scan_depth(*k).is_none_or(|d| *depth <= d);
            pixels.iter().filter(visible).count() as f32 / pixels.len().max(1) as f32
        };
        let shares: Vec<f32> = self.bodies.iter().map(seen).collect();
        let mean = shares.iter().sum::<f32>() / shares.len().max(1) as f32;
        let least = shares.iter().copied().fold(1.0, f32::min);
        let filled = (0..self.scan.len())
            .filter(|k| scan_depth(*k).is_some())
            .count();
        mean + least + 0.5 * filled as f32 / self.scan.len() as f32
    }
}
