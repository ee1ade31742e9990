//! The command line.

use super::case::{Case, Scale, Setup};
use super::method::Method;
use super::scenes::SCENES;
use anyhow::bail;
use rapier3d_tldi::TldiConfig;
use std::path::PathBuf;
use tldi_tests::PolicyChoice;
use tldi_wgpu::BackendChoice;

/// Seeds of the long and of the short version, where none are asked for.
const LONG_SEEDS: u64 = 5;
const SHORT_SEEDS: u64 = 2;
/// Drops of the short and of the long version, where none are asked for.
const SHORT_DROPS: usize = 900;
const LONG_DROPS: usize = 10_000;

/// Runs scenes that physics engines find hard with point clouds, and the same scenes with rapier's
/// primitives, `Voxels` and `TriMesh`; shows where each fails.
#[derive(clap::Parser, Clone, Debug)]
pub(crate) struct Args {
    /// Only this scene (may be given several times; all without)
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Only cases whose names contain this
    #[arg(long, value_name = "TEXT")]
    case: Option<String>,
    /// Only this method (may be given several times; all without)
    #[arg(long, value_enum)]
    method: Vec<Method>,
    /// Number of seeds [default: 2, or 5 with --long]
    #[arg(long, value_name = "N")]
    seeds: Option<u64>,
    /// The first seed: equal seeds give equal rows
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// More cases, more seeds, 10,000 tunnelling drops
    #[arg(long)]
    long: bool,
    /// Drops of `tunnelling` over all surfaces [default: 900, or 10,000 with --long]
    #[arg(long, value_name = "N")]
    drops: Option<usize>,
    /// Only this one of each row's drops, as a failure names it (use with --case and --trace)
    #[arg(long, value_name = "INDEX")]
    only_drop: Option<usize>,
    /// Write the rows to this file as JSON, and beside it a .run.json that says when and where
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write rows, table and charts into this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replace what stands between the markers of this Markdown file by the table
    #[arg(long, value_name = "FILE")]
    pub(crate) docs: Option<PathBuf>,
    /// Where clouds are compared; auto takes the GPU if there is one, else the CPU
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t = BackendChoice::Auto)]
    pub(crate) backend: BackendChoice,
    /// From where pairs of clouds are looked at
    #[arg(long, value_enum, default_value_t = PolicyChoice::ContactZone)]
    camera_policy: PolicyChoice,
    /// Write every step of every world to stderr (use with --scene, --case and --method)
    #[arg(long)]
    trace: bool,
}

impl Args {
    /// How much to run.
    pub(crate) fn scale(&self) -> Scale {
        let default_seeds = if self.long { LONG_SEEDS } else { SHORT_SEEDS };
        let default_drops = if self.long { LONG_DROPS } else { SHORT_DROPS };
        Scale {
            seeds: (0..self.seeds.unwrap_or(default_seeds))
                .map(|k| self.seed.wrapping_add(k))
                .collect(),
            long: self.long,
            drops: self.drops.unwrap_or(default_drops),
            only_drop: self.only_drop,
        }
    }

    /// How to run; method and seed are those of each row.
    pub(crate) fn setup(&self) -> Setup {
        Setup {
            method: Method::Tldi,
            config: TldiConfig {
                camera_policy: self.camera_policy.into(),
                ..TldiConfig::default()
            },
            backend: self.backend,
            trace: self.trace,
            seed: self.seed,
        }
    }

    /// The methods asked for.
    pub(crate) fn chosen_methods(&self) -> Vec<Method> {
        let is_chosen = |method: &Method| self.method.is_empty() || self.method.contains(method);
        Method::ALL.into_iter().filter(is_chosen).collect()
    }

    /// The cases asked for.
    pub(crate) fn chosen_cases(&self, scale: &Scale) -> anyhow::Result<Vec<Case>> {
        for name in &self.scene {
            if !SCENES.iter().any(|scene| scene.name == name) {
                let names: Vec<&str> = SCENES.iter().map(|scene| scene.name).collect();
                bail!("there is no scene `{name}`; there are {}", names.join(", "));
            }
        }
        let cases: Vec<Case> = SCENES
            .iter()
            .filter(|scene| self.scene.is_empty() || self.scene.iter().any(|n| n == scene.name))
            .flat_map(|scene| scene.all_cases(scale))
            .filter(|case| {
                self.case
                    .as_ref()
                    .is_none_or(|text| case.name.contains(text))
            })
            .collect();
        if cases.is_empty() {
            bail!("no case is left to run");
        }
        Ok(cases)
    }
}
