//! Random pairs of clouds, and how far two backends' results about them are apart.

use crate::{Samples, aimed_clouds, random_pose, random_unit};
use crate::{sampled_box, sampled_plane, sampled_sphere};
use std::ops::Range;
use tldi::glamx::{Pose3, Vec3};
use tldi::{ContactPixel, PairQuery, PairResult, PointCloud};

/// Mean radius of the clouds of [`random_pairs`], metres.
pub const PARITY_RADIUS: f32 = 0.02;

const R: f32 = PARITY_RADIUS;

/// Radians. A view that is turned by so much shows a place at 25 pixels from the middle of the frame, which is half the
/// size of these clouds, 0.025 pixels further: about as many splats change their pixel.
pub const TURNED: f32 = 1e-3;

/// Contact pixels from which on the least gap of a pair is compared. With fewer, surfaces only just come within reach, and
/// a pixel that one backend has and the other has not is a good part of what is known.
pub const FIRM: usize = 20;

/// Two clouds, and the pose of the second in the frame of the first.
pub type RandomPair = (PointCloud<'static>, PointCloud<'static>, Pose3);

/// A ball, a box or a sheet, with or without normals, with equal radii or not.
fn random_cloud(rng: &mut fastrand::Rng) -> PointCloud<'static> {
    let samples = match rng.u8(..3) {
        0 => sampled_sphere(0.2 + 0.2 * rng.f32(), R),
        1 => sampled_box(Vec3::new(0.2, 0.15, 0.25), R, rng),
        _ => sampled_plane(0.5, R, rng),
    };
    let Samples { points, normals } = samples;
    let radii: Vec<f32> = points.iter().map(|_| R * (0.8 + 0.4 * rng.f32())).collect();
    let builder = PointCloud::builder(points);
    let builder = match rng.bool() {
        true => builder.radius(R),
        false => builder.radii(radii),
    };
    let builder = match rng.bool() {
        true => builder.normals(normals),
        false => builder,
    };
    builder.build().expect("the samples are valid")
}

/// Pairs from apart to deep in each other, one for each seed.
pub fn random_pairs(seeds: Range<u64>) -> Vec<RandomPair> {
    seeds
        .map(|seed| {
            let mut rng = fastrand::Rng::with_seed(seed);
            let (a, b) = (random_cloud(&mut rng), random_cloud(&mut rng));
            let mut pose = random_pose(&mut rng, 0.0);
            pose.translation = 0.6 * rng.f32() * random_unit(&mut rng);
            (a, b, pose)
        })
        .collect()
}

/// One query for each pair, with the default view and parameters.
pub fn pair_queries(pairs: &[RandomPair]) -> Vec<PairQuery<'_>> {
    let pairs = pairs.iter();
    pairs
        .map(|(a, b, pose)| aimed_clouds(a, b, *pose, R))
        .collect()
}

/// How far two backends' results of many pairs are apart.
#[derive(Clone, Debug, Default)]
pub struct Difference {
    /// Pairs that were compared.
    pub pairs: usize,
    /// Pairs whose answers to `collides`, or whose numbers of views, differ.
    pub answers: usize,
    /// Pairs of which a view is turned by more than [`TURNED`]: other pixels show the same places, so that these are not
    /// compared one by one.
    pub turned: usize,
    /// Contact pixels of the first backend, but for those pairs.
    pub contacts: usize,
    /// Contact pixels that only one has, or whose gaps differ by more than 0.01 mean radii.
    pub other_contacts: usize,
    /// Greatest difference of the least gaps, in mean radii, of pairs with at least [`FIRM`] contact pixels.
    pub gap: f32,
    /// Greatest angle between axes, in radians.
    pub axis: f32,
    /// Of each pair with the same answer: difference of the least gaps, in mean radii, where they are compared.
    pub gaps: Vec<f32>,
    /// Of each view of these pairs: angle between the axes, in radians.
    pub axes: Vec<f32>,
}

impl Difference {
    /// Between results of the same batch of [`pair_queries`].
    pub fn between(first: &[PairResult], second: &[PairResult]) -> Self {
        let mut all = Self::default();
        all.add_batch(first, second);
        all
    }

    /// Adds those between results of another batch.
    pub fn add_batch(&mut self, first: &[PairResult], second: &[PairResult]) {
        for (p, q) in first.iter().zip(second) {
            self.add(p, q);
        }
        let greatest = |values: &[f32]| values.iter().copied().fold(0.0, f32::max);
        (self.gap, self.axis) = (greatest(&self.gaps), greatest(&self.axes));
    }

    fn add(&mut self, first: &PairResult, second: &PairResult) {
        self.pairs += 1;
        if first.collides != second.collides || first.axes.len() != second.axes.len() {
            self.answers += 1;
            return;
        }
        let axes = first.axes.iter().zip(&second.axes);
        let turns: Vec<f32> = axes.map(|(p, q)| p.distance(*q)).collect();
        let is_turned = turns.iter().any(|turn| *turn > TURNED);
        self.axes.extend(turns);
        if let (Some(gap), Some(other)) = (first.gap, second.gap)
            && first.contacts.len().min(second.contacts.len()) >= FIRM
        {
            self.gaps.push((gap - other).abs() / R);
        }
        if is_turned {
            self.turned += 1;
            return;
        }
        let is_like = |p: &ContactPixel, q: &ContactPixel| {
            (p.view, p.pixel) == (q.view, q.pixel) && (p.gap - q.gap).abs() <= 0.01 * R
        };
        let only = |own: &[ContactPixel], other: &[ContactPixel]| {
            let is_missing = |p: &&ContactPixel| !other.iter().any(|q| is_like(p, q));
            own.iter().filter(is_missing).count()
        };
        self.contacts += first.contacts.len();
        self.other_contacts +=
            only(&first.contacts, &second.contacts).max(only(&second.contacts, &first.contacts));
    }
}
