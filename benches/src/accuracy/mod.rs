//! The paper's accuracy protocol: every method answers the same cases, and is held against the truth of
//! the meshes.

mod truth;
mod way_out;

pub use truth::Truth;
pub use way_out::way_out;

use crate::mesh_truth::ExactMesh;
use crate::model::Model;
use crate::peers::{Frame, Method, Peer, TldiPeer};
use crate::protocol::Case;
use crate::stored::{AccuracyRow, DistanceTally};
use crate::times::Times;
use rayon::ThreadPoolBuildError;
use std::collections::HashMap;
use tldi::{Backend, PointCloud};

/// Name in the rows of the default, told how large the noise is.
pub const TOLD: &str = "default, noise told";

/// A method with its settings.
pub struct Contender {
    /// Name in the rows.
    pub variant: String,
    /// What it does.
    pub peer: Box<dyn Peer>,
    /// Factor of all radii; `None` for methods without radii.
    pub radius_scale: Option<f32>,
    /// Of the paper.
    pub rho: Option<f32>,
    /// Of the paper.
    pub resolution: Option<u32>,
    /// Of the default.
    pub pixel_scale: Option<f32>,
}

impl Contender {
    /// A peer with balls, or half edges of voxels, of that many mean radii; `None`: it has no radii.
    pub fn new(peer: Box<dyn Peer>, radius_scale: Option<f32>) -> Self {
        Self {
            variant: peer.name(),
            peer,
            radius_scale,
            rho: None,
            resolution: None,
            pixel_scale: None,
        }
    }

    /// The default on one thread, with pixels of an edge of so many mean radii. It is told that all points have noise
    /// of that standard deviation, metres.
    pub fn ours(
        backend: Box<dyn Backend>,
        pixel_scale: f32,
        noise: f32,
    ) -> Result<Self, ThreadPoolBuildError> {
        let peer = TldiPeer::new(backend, Method::Default { pixel_scale }, 1)?;
        Ok(Self {
            variant: "default".to_owned(),
            pixel_scale: Some(pixel_scale),
            ..Self::new(Box::new(peer.with_noise(noise)), Some(1.0))
        })
    }
}

/// Both copies as a sensor has them, and their radii.
pub struct Copies<'a> {
    /// The mesh that they were sampled from.
    pub model: &'a Model,
    /// With the noise that each has.
    pub clouds: [&'a PointCloud<'static>; 2],
    /// Standard deviation of the noise in mean radii.
    pub noise: f32,
}

/// What one contender has answered so far.
#[derive(Clone, Default)]
struct Answers {
    seconds: Vec<f64>,
    by_distance: Vec<DistanceTally>,
    worst: f32,
}

/// Answers of all contenders to all cases, one case after the other, so that a change of the machine's
/// speed meets all alike. `truth` has one entry a case; `on_case` is called after each.
///
/// Seconds go from points to contacts: all points are taken to be new. Memory is warm: the first case
/// is answered twice.
pub fn measure(
    contenders: &mut [Contender],
    copies: &Copies,
    mesh: &ExactMesh,
    cases: &[Case],
    truth: &[bool],
    mut on_case: impl FnMut(),
) -> Vec<AccuracyRow> {
    let radii = copies
        .clouds
        .map(|cloud| -> Vec<f32> { (0..cloud.len()).map(|i| cloud.radius(i)).collect() });
    let points = copies.clouds.map(|cloud| cloud.points().to_vec());
    let mean_radius = copies.clouds[0].mean_radius();
    let mut scaled: HashMap<u32, [Vec<f32>; 2]> = HashMap::new();
    for contender in &*contenders {
        let scale = contender.radius_scale.unwrap_or(1.0);
        scaled.entry(scale.to_bits()).or_insert_with(|| {
            [&radii[0], &radii[1]].map(|radii| radii.iter().map(|r| scale * r).collect())
        });
    }
    let mut answers = vec![Answers::default(); contenders.len()];
    let mut moved = Vec::new();
    for (k, (case, &meets)) in cases.iter().zip(truth).enumerate() {
        moved.clear();
        moved.extend(points[1].iter().map(|p| case.a_from_b * *p));
        let mut depth = None;
        for (contender, answers) in contenders.iter_mut().zip(&mut answers) {
            let scale = contender.radius_scale.unwrap_or(1.0);
            let [radii_a, radii_b] = &scaled[&scale.to_bits()];
            let frame = Frame {
                radii: Some([radii_a, radii_b]),
                faces: Some([&copies.model.faces, &copies.model.faces]),
                ..Frame::new(&points[0], &moved, scale * mean_radius)
            };
            if k == 0 {
                contender.peer.compare(&frame);
            }
            let found = contender.peer.compare(&frame);
            answers
                .seconds
                .push(found.build_seconds + found.query_seconds);
            let is_missed = meets && !found.collides;
            if is_missed {
                let depth = *depth.get_or_insert_with(|| way_out(mesh, &case.a_from_b));
                answers.worst = answers.worst.max(depth / mean_radius);
            }
            answers.tally(case.distance, is_missed, !meets && found.collides);
        }
        on_case();
    }
    let colliding = truth.iter().filter(|meets| **meets).count();
    contenders
        .iter()
        .zip(answers)
        .map(|(contender, answers)| answers.row(contender, copies, colliding))
        .collect()
}

impl Answers {
    fn tally(&mut self, distance: f32, is_missed: bool, is_invented: bool) {
        let is_same = |tally: &&mut DistanceTally| (tally.distance - distance).abs() < 1e-4;
        let tally = match self.by_distance.last_mut().filter(is_same) {
            Some(tally) => tally,
            None => {
                self.by_distance.push(DistanceTally {
                    distance,
                    cases: 0,
                    false_negatives: 0,
                    false_positives: 0,
                });
                self.by_distance.last_mut().expect("it was pushed")
            }
        };
        tally.cases += 1;
        tally.false_negatives += usize::from(is_missed);
        tally.false_positives += usize::from(is_invented);
    }

    fn row(self, contender: &Contender, copies: &Copies, colliding: usize) -> AccuracyRow {
        let cases = self.seconds.len();
        let ms = Times::of(self.seconds.iter().map(|seconds| 1e3 * seconds));
        let share = |count: usize| 100.0 * count as f64 / cases as f64;
        let sum = |of: fn(&DistanceTally) -> usize| self.by_distance.iter().map(of).sum::<usize>();
        let (missed, invented) = (sum(|t| t.false_negatives), sum(|t| t.false_positives));
        AccuracyRow {
            model: copies.model.name.clone(),
            points: copies.clouds[0].len(),
            cases,
            variant: contender.variant.clone(),
            backend: contender.peer.backend().map(|b| b.name().to_owned()),
            rho: contender.rho,
            resolution: contender.resolution,
            pixel_scale: contender.pixel_scale,
            radius_scale: contender.radius_scale,
            noise: copies.noise,
            false_negative_pct: share(missed),
            false_positive_pct: share(invented),
            error_pct: share(missed) + share(invented),
            colliding_pct: share(colliding),
            worst_false_negative_mean_radii: self.worst,
            median_ms: ms.median,
            lower_quartile_ms: ms.quartiles[0],
            upper_quartile_ms: ms.quartiles[1],
            by_distance: self.by_distance,
        }
    }
}

#[cfg(test)]
mod tests;
