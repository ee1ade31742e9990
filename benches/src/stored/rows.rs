//! Rows of results.

use super::Measured;
use serde::{Deserialize, Serialize};
use tldi::{Looked, Work};
use tldi_tests::{ContactPair, Regime};

/// What is wrong with times that must rise, ms.
fn fault_of_times(times: &[f64]) -> Option<String> {
    let are_possible = times[0] > 0.0 && times.is_sorted();
    (!are_possible).then(|| format!("times of {times:?} ms are not positive and rising"))
}

/// Answers of one method, with its settings, to the cases of the accuracy protocol.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct AccuracyRow {
    /// Whose copies are compared.
    pub model: String,
    /// Of each copy.
    pub points: usize,
    /// How many of the protocol's 27,900.
    pub cases: usize,
    /// `default`, `paper` or the name of a peer.
    pub variant: String,
    /// What compared, of methods that have a backend.
    pub backend: Option<String>,
    /// ρ of the paper.
    pub rho: Option<f32>,
    /// Edge of the paper's image in pixels.
    pub resolution: Option<u32>,
    /// Edge of the default's pixels in mean radii.
    pub pixel_scale: Option<f32>,
    /// Radii of the points, of balls, half the edges of voxels: in units of 0.65 × the distance of the
    /// 7th neighbour, the mean of all where a method has one radius. `None` for methods without any.
    pub radius_scale: Option<f32>,
    /// Standard deviation of the noise on the points in mean radii.
    pub noise: f32,
    /// Share of the cases in which the meshes meet and the method says that they do not.
    pub false_negative_pct: f64,
    /// Share of the cases in which the meshes do not meet and the method says that they do.
    pub false_positive_pct: f64,
    /// Sum of both.
    pub error_pct: f64,
    /// Of the cases that the mesh says to be collisions.
    pub colliding_pct: f64,
    /// How far the copies of the worst false negative must be moved apart until the meshes are free of
    /// each other, in mean radii: the least of some directions, at least the true depth.
    pub worst_false_negative_mean_radii: f32,
    /// From new points to the answer and its contacts, processor time of one thread: median over the
    /// cases.
    pub median_ms: f64,
    /// A quarter of the cases took less.
    pub lower_quartile_ms: f64,
    /// A quarter of the cases took more.
    pub upper_quartile_ms: f64,
    /// The same answers, by distance of the copies.
    pub by_distance: Vec<DistanceTally>,
}

/// Answers at one of the distances of the protocol.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, PartialEq)]
pub struct DistanceTally {
    /// Of the middles of the copies, which are 2 large.
    pub distance: f32,
    /// Cases at this distance.
    pub cases: usize,
    /// The meshes meet, and the method denies it.
    pub false_negatives: usize,
    /// The meshes do not meet, and the method says so.
    pub false_positives: usize,
}

impl Measured for AccuracyRow {
    const KIND: &'static str = "accuracy";

    fn fault(&self) -> Option<String> {
        if self.cases == 0 || self.points == 0 {
            return Some("cases and points must be at least 1".to_owned());
        }
        let times = [
            self.lower_quartile_ms,
            self.median_ms,
            self.upper_quartile_ms,
        ];
        if let Some(fault) = fault_of_times(&times) {
            return Some(fault);
        }
        let parts = self.false_negative_pct + self.false_positive_pct;
        if !(0.0..=100.0).contains(&self.error_pct) || (parts - self.error_pct).abs() > 1e-6 {
            return Some(format!(
                "error_pct {} is not the sum of its parts, {parts}, within 0 and 100",
                self.error_pct
            ));
        }
        let tallied: usize = self.by_distance.iter().map(|tally| tally.cases).sum();
        if tallied != self.cases {
            return Some(format!(
                "by_distance has {tallied} cases, not {}",
                self.cases
            ));
        }
        None
    }
}

/// What a frame of new points costs with one method.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct FrameRow {
    /// What the points are of.
    pub model: String,
    /// Of the first body.
    pub points: usize,
    /// Of the second body.
    pub points_b: usize,
    /// How the bodies lie.
    pub placement: String,
    /// Name of the method.
    pub method: String,
    /// That it could use.
    pub threads: usize,
    /// Median time until queries could begin: processor time on one thread, by the clock on several.
    pub build_ms: f64,
    /// Median time of the queries.
    pub query_ms: f64,
    /// Median time of both.
    pub total_ms: f64,
    /// Fastest frame.
    pub least_ms: f64,
    /// A quarter of the frames is faster than the first, and a quarter is slower than the second; none in rows of before
    /// they were told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quartiles_ms: Option<[f64; 2]>,
    /// Slowest frame.
    pub most_ms: f64,
    /// Frames that were measured.
    pub frames: usize,
    /// Whether anything was found to touch, in the last frame.
    pub collides: bool,
    /// Pairs of balls or contact points, in the last frame.
    pub contacts: usize,
    /// Most memory that the method held beside the points, MiB.
    pub peak_mib: f64,
    /// Median total over the floor: one pass that transforms and culls both clouds.
    pub floor_ratio: f64,
    /// How much was modelled in the last frame, of methods that tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work: Option<WorkRow>,
    /// Median time of each stage by the clock, in frames of their own with the same points, of methods that tell them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stages: Option<Vec<StageRow>>,
}

/// How long a stage takes, without the stages within it.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct StageRow {
    /// As the method names it; `rest`: what is outside of all stages.
    pub name: String,
    /// Milliseconds.
    pub ms: f64,
}

/// How much of two clouds one comparison modelled, as [`Work`] has it.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, PartialEq, Eq)]
pub struct WorkRow {
    /// Points that passed a cull, of all culls.
    pub culled: usize,
    /// Looks with large pixels.
    pub large: LookedRow,
    /// Looks through small windows.
    pub windows: LookedRow,
    /// Fine looks at all of the contact zone.
    pub fine: LookedRow,
}

impl WorkRow {
    /// The looks: with large pixels, through windows, fine.
    pub fn looks(&self) -> [LookedRow; 3] {
        [self.large, self.windows, self.fine]
    }

    /// Points and pixels of all looks.
    pub fn modelled(&self) -> usize {
        let looks = self.looks();
        looks.iter().map(|look| look.points + look.pixels).sum()
    }
}

impl From<Work> for WorkRow {
    fn from(work: Work) -> Self {
        Self {
            culled: work.culled,
            large: work.large.into(),
            windows: work.windows.into(),
            fine: work.fine.into(),
        }
    }
}

/// What looks of one kind had to do.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, PartialEq, Eq)]
pub struct LookedRow {
    /// Points that were modelled.
    pub points: usize,
    /// Pixels of both images.
    pub pixels: usize,
    /// Layers of both images.
    pub layers: usize,
}

impl From<Looked> for LookedRow {
    fn from(looked: Looked) -> Self {
        let Looked {
            points,
            pixels,
            layers,
        } = looked;
        Self {
            points,
            pixels,
            layers,
        }
    }
}

impl Measured for FrameRow {
    const KIND: &'static str = "frames";

    fn fault(&self) -> Option<String> {
        if self.points == 0 || self.points_b == 0 || self.threads == 0 || self.frames == 0 {
            return Some("points, threads and frames must be at least 1".to_owned());
        }
        let [lower, upper] = self.quartiles_ms.unwrap_or([self.total_ms; 2]);
        let times = [self.least_ms, lower, self.total_ms, upper, self.most_ms];
        if let Some(fault) = fault_of_times(&times) {
            return Some(fault);
        }
        if self.floor_ratio.is_nan() || self.floor_ratio <= 0.0 {
            return Some(format!("floor_ratio {} is not positive", self.floor_ratio));
        }
        let is_time = |stage: &&StageRow| stage.ms.is_finite() && stage.ms >= 0.0;
        if let Some(stage) = self.stages.iter().flatten().find(|stage| !is_time(stage)) {
            return Some(format!(
                "stage {} of {} ms is no time",
                stage.name, stage.ms
            ));
        }
        None
    }
}

/// Contacts of known normal and depth as one method tells them, with its settings: the deepest contact
/// of each case. A missed contact counts as infinitely wrong.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct ContactRow {
    /// The shapes; `None`: those of all rows of the same method and regime together.
    pub pair: Option<ContactPair>,
    /// How deep they are in each other.
    pub regime: Regime,
    /// Contacts that were tried.
    pub cases: usize,
    /// `default` or the name of a peer.
    pub variant: String,
    /// What compared, of methods that have a backend.
    pub backend: Option<String>,
    /// Edge of the default's pixels in r̄.
    pub pixel_scale: Option<f32>,
    /// Radii of the points, of balls, half the edges of voxels, in r̄, which is the spacing of the
    /// points. `None` for methods without any.
    pub radius_scale: Option<f32>,
    /// Whether methods were told how the bodies move, which this project makes use of.
    pub tells_motion: bool,
    /// Share of the cases in which no contact was told.
    pub missed_pct: f64,
    /// Share of the cases in which the told normal is more than 90° from the true one: bodies are
    /// pushed through each other.
    pub wrong_side_pct: f64,
    /// Median angle between told and true normal, degrees. `None`: infinite.
    pub normal_median_deg: Option<f64>,
    /// Nineteen of twenty angles are at most this, degrees. `None`: infinite.
    pub normal_p95_deg: Option<f64>,
    /// Median absolute error of the depth, in r̄. `None`: infinite.
    pub depth_median_radii: Option<f64>,
    /// Nineteen of twenty errors of the depth are at most this, in r̄. `None`: infinite.
    pub depth_p95_radii: Option<f64>,
    /// From new points to the contacts, processor time of one thread: median over the cases.
    pub median_ms: f64,
    /// A quarter of the cases took less.
    pub lower_quartile_ms: f64,
    /// A quarter of the cases took more.
    pub upper_quartile_ms: f64,
}

impl Measured for ContactRow {
    const KIND: &'static str = "contact_quality";

    fn fault(&self) -> Option<String> {
        if self.cases == 0 {
            return Some("cases must be at least 1".to_owned());
        }
        let times = [
            self.lower_quartile_ms,
            self.median_ms,
            self.upper_quartile_ms,
        ];
        if let Some(fault) = fault_of_times(&times) {
            return Some(fault);
        }
        let shares = [self.missed_pct, self.wrong_side_pct];
        let are_possible = shares.iter().all(|share| *share >= 0.0);
        if !are_possible || shares.iter().sum::<f64>() > 100.0 + 1e-6 {
            return Some(format!(
                "missed_pct and wrong_side_pct, {shares:?}, are not shares of the same cases"
            ));
        }
        for (name, median, most) in [
            ("normal", self.normal_median_deg, self.normal_p95_deg),
            ("depth", self.depth_median_radii, self.depth_p95_radii),
        ] {
            let errors = [median, most].map(|error| error.unwrap_or(f64::INFINITY));
            if !(errors[0] >= 0.0 && errors.is_sorted()) {
                return Some(format!(
                    "errors of the {name}, {errors:?}, are not positive and rising"
                ));
            }
        }
        None
    }
}
