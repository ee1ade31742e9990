//! Scenes, their cases, and what a case finds.

use super::method::Method;
use fastrand::Rng;
use rapier3d_tldi::TldiConfig;
use std::collections::BTreeMap;
use thiserror::Error;
use tldi_wgpu::BackendChoice;

/// How a case is to be run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setup {
    /// Who detects the collisions.
    pub(crate) method: Method,
    /// Settings of the clouds' pipeline.
    pub(crate) config: TldiConfig,
    /// Where pairs of clouds are compared.
    pub(crate) backend: BackendChoice,
    /// Whether every step is written to stderr.
    pub(crate) trace: bool,
    /// Seed of everything random in the case.
    pub(crate) seed: u64,
}

impl Setup {
    /// Random numbers of the case, from the first on.
    pub(crate) fn rng(&self) -> Rng {
        Rng::with_seed(self.seed)
    }

    /// The same run with rapier's primitives, untraced.
    pub(crate) fn of_primitive(&self) -> Self {
        Self {
            method: Method::Primitive,
            trace: false,
            ..*self
        }
    }
}

/// How much to run.
#[derive(Clone, Debug)]
pub(crate) struct Scale {
    /// Seeds of all random cases.
    pub(crate) seeds: Vec<u64>,
    /// Whether the long version is wanted.
    pub(crate) long: bool,
    /// Drops of `tunnelling`, over all surfaces.
    pub(crate) drops: usize,
    /// Only this one of each row's drops.
    pub(crate) only_drop: Option<usize>,
}

impl Scale {
    /// One of two values, by the length of the run.
    pub(crate) fn pick<T>(&self, short: T, long: T) -> T {
        if self.long { long } else { short }
    }
}

/// A family of cases with one rule.
pub(crate) struct Scene {
    /// Name on the command line and in rows.
    pub(crate) name: &'static str,
    /// What happens.
    pub(crate) about: &'static str,
    /// What passes.
    pub(crate) rule: &'static str,
    /// Adds its cases of one seed.
    pub(crate) cases: fn(&Scale, &mut Cases),
}

impl Scene {
    /// The cases of all seeds.
    pub(crate) fn all_cases(&self, scale: &Scale) -> Vec<Case> {
        let mut cases = Cases(Vec::new());
        let mut all = Vec::new();
        for &seed in &scale.seeds {
            (self.cases)(scale, &mut cases);
            all.extend(cases.0.drain(..).map(|(name, run)| Case {
                scene: self.name,
                name,
                seed,
                run,
            }));
        }
        all
    }
}

/// Names within a scene, and what carries the cases out.
pub(crate) struct Cases(Vec<(String, Box<Run>)>);

impl Cases {
    /// Adds a case that `run` carries out.
    pub(crate) fn add(
        &mut self,
        name: impl Into<String>,
        run: impl Fn(&Setup, &mut Verdict) -> Result<(), Stop> + Send + Sync + 'static,
    ) {
        self.0.push((name.into(), Box::new(run)));
    }
}

type Run = dyn Fn(&Setup, &mut Verdict) -> Result<(), Stop> + Send + Sync;

/// One situation, for every method the same.
pub(crate) struct Case {
    /// Name of the scene.
    pub(crate) scene: &'static str,
    /// Name within the scene.
    pub(crate) name: String,
    /// Seed of everything random in it.
    pub(crate) seed: u64,
    run: Box<Run>,
}

impl Case {
    /// Runs it with one method, and its own seed.
    pub(crate) fn run(&self, setup: &Setup) -> Result<Verdict, Stop> {
        let mut verdict = Verdict::default();
        let seed = self.seed;
        (self.run)(&Setup { seed, ..*setup }, &mut verdict)?;
        Ok(verdict)
    }
}

/// Why a case came to no verdict.
#[derive(Clone, Debug, Error)]
pub(crate) enum Stop {
    /// The method cannot represent the scene: not applicable, not a failure.
    #[error("{0}")]
    Unfit(&'static str),
    /// The method gave an error: a failure.
    #[error("{0}")]
    Failed(String),
}

/// What was measured, and which of the rules it breaks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Verdict {
    /// Measured values; units are in the names.
    pub(crate) metrics: BTreeMap<String, f64>,
    /// Broken rules.
    pub(crate) failures: Vec<Failure>,
}

/// A broken rule.
#[derive(Clone, Debug)]
pub(crate) struct Failure {
    /// The metric that broke it, or what else was asked.
    pub(crate) metric: String,
    /// What was found and what was asked, with numbers.
    pub(crate) text: String,
}

impl Verdict {
    /// Notes a value that nothing is asked of.
    pub(crate) fn note(&mut self, name: &str, value: impl Into<f64>) -> f64 {
        let value = value.into();
        if value.is_finite() {
            self.metrics.insert(name.to_owned(), rounded(value));
        } else {
            self.fail(name, format!("{name} is {value}"));
        }
        value
    }

    /// Notes a value that must be `limit` at most.
    pub(crate) fn at_most(&mut self, name: &str, value: impl Into<f64>, limit: f64) {
        let value = self.note(name, value);
        if value > limit {
            self.fail(name, format!("{name} {value:.4} > {limit}"));
        }
    }

    /// Notes a value that must be `limit` at least.
    pub(crate) fn at_least(&mut self, name: &str, value: impl Into<f64>, limit: f64) {
        let value = self.note(name, value);
        if value < limit {
            self.fail(name, format!("{name} {value:.4} < {limit}"));
        }
    }

    /// Notes a value that must not be farther than `tolerance` from `expected`.
    pub(crate) fn near(
        &mut self,
        name: &str,
        value: impl Into<f64>,
        expected: f64,
        tolerance: f64,
    ) {
        let value = self.note(name, value);
        if (value - expected).abs() > tolerance {
            let text = format!("{name} {value:.4} is not {expected:.4} ± {tolerance:.2e}");
            self.fail(name, text);
        }
    }

    /// Something that must hold. `name` is that of the metric that tells how far it does not, if there is one.
    pub(crate) fn require(&mut self, name: &str, holds: bool, otherwise: impl FnOnce() -> String) {
        if !holds {
            self.fail(name, otherwise());
        }
    }

    /// A body must fall asleep within `limit` seconds; `after` tells when it did.
    pub(crate) fn asleep_within(&mut self, limit: f64, after: Option<f32>) {
        match after {
            Some(seconds) => self.at_most("asleep_after_s", seconds, limit),
            None => self.require("asleep_after_s", false, || "never asleep".into()),
        }
    }

    fn fail(&mut self, metric: &str, text: String) {
        let metric = metric.to_owned();
        self.failures.push(Failure { metric, text });
    }
}

/// Six significant digits, which is more than any measurement here tells.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}
