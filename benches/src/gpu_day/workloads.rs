//! Whole batches: how long they take on the device and on the CPU, and what their stages take beside what the bytes that
//! they must move would.

use super::bodies::{Kind, Scene};
use super::budget::Budget;
use super::spread::Spread;
use crate::placements::Placement;
use rayon::ThreadPool;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use tldi::{Backend, CpuBackend, PairQuery, PairResult};
use tldi_wgpu::{Gpu, WgpuBackend};

/// Points of each body of a batch of many: what a pile of things has.
const BATCH_POINTS: usize = 2_000;

/// Repeats on one core of the CPU, which takes longest.
const CPU_REPEATS: usize = 3;

/// A scene on the device and on the CPU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Workload {
    /// How the bodies lie.
    pub placement: String,
    /// What is told of their points.
    pub kind: String,
    /// Of each body (of the scan).
    pub points: usize,
    /// In the batch.
    pub pairs: usize,
    /// Contact pixels of all pairs.
    pub contacts: usize,
    /// From the call to the contacts on the host; the device has the points.
    pub resident: Spread,
    /// The same; all points are new, and uploaded.
    pub uploaded: Spread,
    /// To build the clouds of new points on the host, before that.
    pub built: Spread,
    /// The CPU backend with all cores, as it is used.
    pub cpu: Option<Spread>,
    /// The CPU backend with one core.
    pub cpu_one_core: Option<Spread>,
    /// In the order in which they run; empty where they were not measured.
    pub stages: Vec<StageTime>,
}

/// A stage of a batch with resident points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageTime {
    /// Name.
    pub stage: String,
    /// Median device time; `None` where the device has no timestamps.
    pub ms: Option<f64>,
    /// What it must read and write at least, each element once.
    pub bytes: u64,
    /// These bytes at the bandwidth of the largest copies.
    pub floor_ms: Option<f64>,
}

/// Measures scenes until the budget is used up.
pub(super) struct Workloads<'a> {
    gpu: &'a Gpu,
    repeats: usize,
    seed: u64,
    /// Of copies on the device, bytes per second.
    bandwidth: Option<f64>,
    one_core: ThreadPool,
    rows: Vec<Workload>,
}

impl<'a> Workloads<'a> {
    /// With so many repeats of each.
    pub(super) fn new(
        gpu: &'a Gpu,
        repeats: usize,
        seed: u64,
        bandwidth: Option<f64>,
    ) -> Result<Self, rayon::ThreadPoolBuildError> {
        Ok(Self {
            gpu,
            repeats,
            seed,
            bandwidth,
            one_core: rayon::ThreadPoolBuilder::new().num_threads(1).build()?,
            rows: Vec::new(),
        })
    }

    /// All placements and kinds with these numbers of points, the smallest first; then batches of so many pairs.
    pub(super) fn measure(
        mut self,
        sizes: &[usize],
        batches: &[usize],
        budget: &mut Budget,
    ) -> anyhow::Result<Vec<Workload>> {
        let mut longest = 0.5;
        for (k, &points) in sizes.iter().enumerate() {
            // As many times longer than the longest of the last size as there are more points.
            let growth = points as f64 / sizes[k.saturating_sub(1)] as f64;
            let expected = longest * growth;
            longest = 0.0;
            for kind in Kind::ALL {
                for placement in Placement::ALL {
                    let name = format!("{}, {points} points, {}", placement.name(), kind.name());
                    if !budget.has_time(&name, expected.max(longest)) {
                        longest = f64::max(longest, expected);
                        continue;
                    }
                    let start = budget.elapsed();
                    let scene = Scene::new(placement, points, kind, self.seed)?;
                    self.add(placement, kind, points, vec![scene])?;
                    longest = f64::max(longest, budget.elapsed() - start);
                }
            }
        }
        for &pairs in batches {
            let name = format!("batch of {pairs} pairs of {BATCH_POINTS} points");
            if budget.has_time(&name, 0.02 * pairs as f64) {
                let placement = Placement::Slight;
                let of = |k: usize| {
                    Scene::new(placement, BATCH_POINTS, Kind::Bare, self.seed + k as u64)
                };
                let scenes: Result<Vec<_>, _> = (0..pairs).map(of).collect();
                self.add(placement, Kind::Bare, BATCH_POINTS, scenes?)?;
            }
        }
        Ok(self.rows)
    }

    fn add(
        &mut self,
        placement: Placement,
        kind: Kind,
        points: usize,
        mut scenes: Vec<Scene>,
    ) -> anyhow::Result<()> {
        let mut results = Vec::new();
        let (mut resident, mut uploaded, mut built) = (Vec::new(), Vec::new(), Vec::new());
        let mut plain = WgpuBackend::new(self.gpu.clone())?;
        seconds(&mut plain, &scenes, &mut results)?;
        for _ in 0..self.repeats {
            resident.push(seconds(&mut plain, &scenes, &mut results)?);
        }
        let contacts = results.iter().map(|result| result.contacts.len()).sum();
        for _ in 0..self.repeats {
            let start = Instant::now();
            for scene in &mut scenes {
                scene.renew()?;
            }
            built.push(start.elapsed().as_secs_f64());
            uploaded.push(seconds(&mut plain, &scenes, &mut results)?);
        }
        let stages = self.stages(&scenes, &mut results)?;
        let mut on_cpu = |repeats: usize| -> anyhow::Result<Option<Spread>> {
            let mut cpu = CpuBackend::new();
            let mut all = Vec::new();
            seconds(&mut cpu, &scenes, &mut results)?;
            for _ in 0..repeats {
                all.push(seconds(&mut cpu, &scenes, &mut results)?);
            }
            Ok(Spread::of(all))
        };
        let cpu = on_cpu(self.repeats)?;
        let cpu_one_core = self.one_core.install(|| on_cpu(CPU_REPEATS))?;
        let spreads = (
            Spread::of(resident),
            Spread::of(uploaded),
            Spread::of(built),
        );
        if let (Some(resident), Some(uploaded), Some(built)) = spreads {
            self.rows.push(Workload {
                placement: placement.name().to_owned(),
                kind: kind.name().to_owned(),
                points,
                pairs: scenes.len(),
                contacts,
                resident,
                uploaded,
                built,
                cpu,
                cpu_one_core,
                stages,
            });
        }
        Ok(())
    }

    fn stages(
        &self,
        scenes: &[Scene],
        results: &mut Vec<PairResult>,
    ) -> anyhow::Result<Vec<StageTime>> {
        let mut timed = WgpuBackend::new(self.gpu.clone())?;
        let has_times = timed.measure_stages();
        seconds(&mut timed, scenes, results)?;
        let mut all = Vec::new();
        for _ in 0..self.repeats {
            seconds(&mut timed, scenes, results)?;
            all.push(timed.stage_times().to_vec());
        }
        let needed = timed.needed_bytes();
        let of = |(k, &(stage, bytes)): (usize, &(&'static str, u64))| {
            let times = all.iter().filter_map(|run| Some(run.get(k)?.seconds));
            StageTime {
                stage: stage.to_owned(),
                ms: Spread::of(times.collect())
                    .filter(|_| has_times)
                    .map(|spread| spread.p50_ms),
                bytes,
                floor_ms: self
                    .bandwidth
                    .map(|per_second| bytes as f64 / per_second * 1e3),
            }
        };
        // Where no pair is in reach, no stage ran.
        Ok(match all.iter().any(|run| !run.is_empty()) || !has_times {
            true => needed.iter().enumerate().map(of).collect(),
            false => Vec::new(),
        })
    }
}

/// Seconds from the call to the results.
fn seconds(
    backend: &mut dyn Backend,
    scenes: &[Scene],
    results: &mut Vec<PairResult>,
) -> anyhow::Result<f64> {
    let batch: Vec<PairQuery> = scenes.iter().map(Scene::query).collect();
    let start = Instant::now();
    backend.compare(&batch, results)?;
    Ok(start.elapsed().as_secs_f64())
}
