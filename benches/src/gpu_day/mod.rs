//! All that is to be known of the GPU backend on a machine, within a time budget: see `docs/gpu_day.md`.

mod bodies;
mod budget;
mod card;
mod correctness;
mod floors;
mod frames;
mod host_costs;
mod measure;
mod shown;
mod spread;
mod table;
mod workloads;

pub use bodies::{Kind, Scene};
pub use card::Card;
pub use correctness::{Bin, Correctness, Counted, DefaultLimits, Element, Parity, Repeats};
pub use floors::{Dispatches, Floors, Moved};
pub use host_costs::HostCost;
pub(crate) use shown::Shown;
pub use spread::Spread;
pub use table::print;
pub use workloads::{StageTime, Workload};

use crate::stored::Provenance;
use serde::{Deserialize, Serialize};

/// Name of the results, as other benches name their rows.
pub const KIND: &str = "gpu_day";

/// How much is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// What does not fit into so many seconds is left out.
    pub seconds: f64,
    /// Points of each body.
    pub sizes: Vec<usize>,
    /// Pairs of a batch.
    pub batches: Vec<usize>,
    /// Times that each is measured.
    pub repeats: usize,
    /// Random pairs that are compared with the CPU's.
    pub parity_pairs: u64,
    /// Equal batches.
    pub equal_batches: usize,
    /// Most bytes that are copied.
    pub copy_bytes: u64,
    /// Points of the bodies whose host costs are counted.
    pub host_cost_points: usize,
    /// Seed of everything random but the pairs of the parity, whose seeds are their numbers.
    pub seed: u64,
}

impl Settings {
    /// For a card: nine minutes at most.
    pub fn full() -> Self {
        Self {
            seconds: 500.0,
            sizes: vec![10_000, 100_000, 1_000_000, 5_000_000],
            batches: vec![1, 100, 1000],
            repeats: 20,
            parity_pairs: 1000,
            equal_batches: 50,
            copy_bytes: 1_000_000_000,
            host_cost_points: 100_000,
            seed: 1,
        }
    }

    /// For a driver that computes on the CPU: all parts, in about a minute.
    pub fn small() -> Self {
        Self {
            sizes: vec![2_000, 10_000],
            batches: vec![1, 10],
            repeats: 3,
            parity_pairs: 100,
            equal_batches: 5,
            copy_bytes: 16_000_000,
            seconds: 240.0,
            ..Self::full()
        }
    }
}

/// All that was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`KIND`].
    pub kind: String,
    /// The machine and the code.
    #[serde(flatten)]
    pub provenance: Provenance,
    /// How much was asked for.
    pub settings: Settings,
    /// How long all of it took.
    pub seconds: f64,
    /// What there was no time for, or what the device cannot do.
    pub skipped: Vec<String>,
    /// The device.
    pub card: Card,
    /// What it cannot do faster.
    pub floors: Floors,
    /// Its answers.
    pub correctness: Correctness,
    /// Bytes, dispatches and redos of a batch.
    pub host_costs: Vec<HostCost>,
    /// Times of batches.
    pub workloads: Vec<Workload>,
    /// Names of the files with points.
    pub frames: Vec<String>,
    /// What is wrong with the answers; empty where nothing is.
    pub faults: Vec<String>,
}

#[cfg(test)]
mod tests;
