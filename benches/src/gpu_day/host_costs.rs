//! What a batch costs beside its stages, counted: these figures do not depend on the machine.

use super::bodies::{Kind, Scene};
use super::budget::Budget;
use crate::placements::Placement;
use serde::{Deserialize, Serialize};
use tldi::Backend;
use tldi_wgpu::{Gpu, WgpuBackend};

/// One batch of one pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HostCost {
    /// How the bodies lie.
    pub placement: String,
    /// Of each body.
    pub points: usize,
    /// "cold" for the first batch of a backend, "resident" for one with the same points, "new points" for one with
    /// others.
    pub frame: String,
    /// Bytes from the host to the device.
    pub uploaded: u64,
    /// Bytes from the device to the host.
    pub read_back: u64,
    /// Bytes filled with zeros by commands of their own.
    pub filled: u64,
    /// Dispatches of stages.
    pub dispatches: u32,
    /// Submissions.
    pub submissions: u32,
    /// Times that the batch was compared again.
    pub redos: u32,
}

/// Of slight and of deep contact, with so many points.
pub(super) fn measure(
    gpu: &Gpu,
    points: usize,
    budget: &mut Budget,
) -> anyhow::Result<Vec<HostCost>> {
    let mut rows = Vec::new();
    for placement in [Placement::Slight, Placement::Deep] {
        if !budget.has_time(&format!("host costs, {}", placement.name()), 5.0) {
            continue;
        }
        let mut scene = Scene::new(placement, points, Kind::Bare, 1)?;
        let mut backend = WgpuBackend::new(gpu.clone())?;
        let mut results = Vec::new();
        for frame in ["cold", "resident", "new points"] {
            if frame == "new points" {
                scene.renew()?;
            }
            backend.compare(&[scene.query()], &mut results)?;
            let traffic = backend.traffic();
            rows.push(HostCost {
                placement: placement.name().to_owned(),
                points,
                frame: frame.to_owned(),
                uploaded: traffic.uploaded,
                read_back: traffic.read_back,
                filled: traffic.filled,
                dispatches: traffic.dispatches,
                submissions: traffic.submissions,
                redos: traffic.redos,
            });
        }
    }
    Ok(rows)
}
