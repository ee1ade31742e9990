//! When, where and of what a run was made.

use super::args::Args;
use serde::Serialize;
use tldi_tests::Host;

/// What a reader must know about a run.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct RunInfo {
    /// Machine and code.
    #[serde(flatten)]
    pub(crate) host: Host,
    /// Seeds of the random cases.
    pub(crate) seeds: Vec<u64>,
    /// Whether it was the long version.
    pub(crate) long: bool,
    /// Drops of `tunnelling`, over all surfaces.
    pub(crate) drops: usize,
}

impl RunInfo {
    /// A run that starts now.
    pub(crate) fn now(args: &Args) -> Self {
        let scale = args.scale();
        Self {
            host: Host::now(),
            seeds: scale.seeds,
            long: scale.long,
            drops: scale.drops,
        }
    }
}
