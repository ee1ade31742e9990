//! Whether the device's answers are right, by calls of the library.

use super::bodies::{Kind, Scene};
use super::budget::Budget;
use super::card::open_with_defaults;
use crate::placements::Placement;
use serde::{Deserialize, Serialize};
use tldi::{Backend, CpuBackend, PairQuery, PairResult};
use tldi_tests::{Difference, pair_queries, random_pairs};
use tldi_wgpu::{Gpu, WgpuBackend};

/// Pairs that are compared in one batch.
const BATCH: u64 = 100;

/// Answers beside those of the CPU, of the device itself, and of the software adapter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correctness {
    /// Random pairs on both backends.
    pub parity: Option<Parity>,
    /// Equal batches.
    pub repeats: Option<Repeats>,
    /// Elements that scenes need, beside what they needed on the software adapter.
    pub counters: Vec<Counted>,
    /// A device that is given only WebGPU's default limits, and no features.
    pub default_limits: Option<DefaultLimits>,
}

/// Differences from the CPU backend, without its first look, over random pairs of all kinds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parity {
    /// Pairs that were compared.
    pub pairs: usize,
    /// Pairs with another answer to `collides`, or another number of views.
    pub other_answers: usize,
    /// Pairs of which a view is turned by more than a milliradian. Their contact pixels are not compared one by one.
    pub turned: usize,
    /// Contact pixels of the CPU.
    pub contacts: usize,
    /// Of these, or of the device's, those that only one has, or whose gaps differ by more than 0.01 mean radii.
    pub other_contacts: usize,
    /// Differences of the least gaps, in mean radii.
    pub gaps: Vec<Bin>,
    /// Angles between the axes of a view, in radians.
    pub axes: Vec<Bin>,
}

/// How many differences are at most so large, and larger than the bin before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bin {
    /// Greatest difference in the bin. The last one has all that are larger than the one before it.
    pub up_to: f32,
    /// Differences in it.
    pub count: usize,
}

/// Runs of one batch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeats {
    /// Pairs of the batch.
    pub pairs: usize,
    /// Runs beside the first.
    pub runs: usize,
    /// Runs whose results are those of the first, bit by bit.
    pub equal: usize,
}

/// What a scene needed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counted {
    /// Name of the scene.
    pub scene: String,
    /// Elements of each kind.
    pub elements: Vec<Element>,
}

/// Elements of a kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Element {
    /// Kind.
    pub name: String,
    /// Needed here.
    pub count: u32,
    /// Needed on the software adapter when its results were stored; `None`: these have no such scene or element.
    pub stored: Option<u32>,
}

/// The same batch on a device with default limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DefaultLimits {
    /// Whether the results are those of the other device, bit by bit.
    pub equal: bool,
    /// Why there are none.
    pub failure: Option<String>,
}

impl Correctness {
    /// Compares so many random pairs, and runs a batch so many times.
    pub(super) fn measure(
        gpu: &Gpu,
        pairs: u64,
        repeats: usize,
        budget: &mut Budget,
    ) -> anyhow::Result<Self> {
        let mut found = Self::default();
        let mut backend = WgpuBackend::new(gpu.clone())?;
        let mut all = Difference::default();
        for first in (0..pairs).step_by(BATCH as usize) {
            let seeds = first..(first + BATCH).min(pairs);
            if !budget.has_time(&format!("parity of pairs {seeds:?}"), 3.0) {
                continue;
            }
            let pairs = random_pairs(seeds);
            let batch = pair_queries(&pairs);
            let mut on_cpu = Vec::new();
            CpuBackend::without_first_look().compare(&batch, &mut on_cpu)?;
            all.add_batch(&on_cpu, &compared(&mut backend, &batch)?);
        }
        found.parity = (all.pairs > 0).then(|| Parity {
            pairs: all.pairs,
            other_answers: all.answers,
            turned: all.turned,
            contacts: all.contacts,
            other_contacts: all.other_contacts,
            gaps: histogram(&all.gaps),
            axes: histogram(&all.axes),
        });
        let pairs = random_pairs(0..20);
        let batch = pair_queries(&pairs);
        if budget.has_time("repeats", 5.0) {
            let first = compared(&mut backend, &batch)?;
            let mut equal = 0;
            for _ in 0..repeats {
                equal += usize::from(compared(&mut backend, &batch)? == first);
            }
            found.repeats = Some(Repeats {
                pairs: batch.len(),
                runs: repeats,
                equal,
            });
        }
        for (placement, kind) in [
            (Placement::Slight, Kind::Bare),
            (Placement::Deep, Kind::Bare),
            (Placement::BodyOnScan, Kind::Noisy),
        ] {
            let name = format!("{}, 10k, {}", placement.name(), kind.name());
            if budget.has_time(&format!("counters of {name}"), 5.0) {
                let scene = Scene::new(placement, 10_000, kind, 1)?;
                compared(&mut backend, &[scene.query()])?;
                found.counters.push(counted(&name, &backend));
            }
        }
        if budget.has_time("default limits", 10.0) {
            found.default_limits = Some(with_default_limits(&mut backend, &batch)?);
        }
        Ok(found)
    }

    /// What is not as it should be.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if let Some(parity) = &self.parity {
            // Twice what random pairs have.
            if parity.turned * 60 > parity.pairs {
                let turned = parity.turned;
                faults.push(format!(
                    "views of {turned} of {} pairs are turned",
                    parity.pairs
                ));
            }
            // Those of the parity tests, per pair and per contact pixel.
            if parity.other_answers * 50 > parity.pairs {
                faults.push(format!(
                    "{} of {} pairs have other answers than on the CPU",
                    parity.other_answers, parity.pairs
                ));
            }
            if parity.other_contacts * 50 > parity.contacts {
                faults.push(format!(
                    "{} of {} contact pixels are others than on the CPU",
                    parity.other_contacts, parity.contacts
                ));
            }
        }
        if let Some(repeats) = self.repeats.filter(|all| all.equal < all.runs) {
            let other = repeats.runs - repeats.equal;
            faults.push(format!("{other} of {} equal batches differ", repeats.runs));
        }
        for counted in &self.counters {
            for element in counted.elements.iter().filter(|e| e.is_off()) {
                faults.push(format!(
                    "{}: {} {}, on the software adapter {:?}",
                    counted.scene, element.count, element.name, element.stored
                ));
            }
        }
        if let Some(limits) = self.default_limits.as_ref().filter(|found| !found.equal) {
            let reason = limits.failure.as_deref().unwrap_or("other results");
            faults.push(format!("with default limits: {reason}"));
        }
        faults
    }
}

impl Element {
    /// Whether it is off by more than what rounding moves across borders: 1 %, of which few elements
    /// have at most 16. An element without a stored count is one of another name, which nothing checks.
    fn is_off(&self) -> bool {
        let is_far = |stored: u32| self.count.abs_diff(stored) > 16 + stored / 100;
        self.stored.is_none_or(is_far)
    }
}

fn compared(backend: &mut WgpuBackend, batch: &[PairQuery<'_>]) -> anyhow::Result<Vec<PairResult>> {
    let mut results = Vec::new();
    backend.compare(batch, &mut results)?;
    Ok(results)
}

/// By powers of ten, from 10⁻⁶ to 1 and beyond.
fn histogram(values: &[f32]) -> Vec<Bin> {
    let edges = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, f32::MAX];
    let mut below = 0;
    let bins = edges.into_iter().map(|up_to| {
        let all = values.iter().filter(|value| **value <= up_to).count();
        let count = all - std::mem::replace(&mut below, all);
        Bin { up_to, count }
    });
    bins.collect()
}

fn counted(scene: &str, backend: &WgpuBackend) -> Counted {
    let stored = stored_counters(include_str!("../../results/gpu_day/llvmpipe_small.json"));
    let of = |name: &str| {
        let known = stored.iter().find(|counted| counted.scene == scene)?;
        let element = known.elements.iter().find(|e| e.name == name)?;
        Some(element.count)
    };
    let elements = backend.needed_elements().map(|(name, count)| Element {
        name: name.to_owned(),
        count,
        stored: of(name),
    });
    Counted {
        scene: scene.to_owned(),
        elements: elements.into(),
    }
}

/// Those of stored results; none where these have another form.
fn stored_counters(text: &str) -> Vec<Counted> {
    #[derive(Deserialize)]
    struct Only {
        correctness: OfCorrectness,
    }
    #[derive(Deserialize)]
    struct OfCorrectness {
        counters: Vec<Counted>,
    }
    serde_json::from_str::<Only>(text).map_or_else(|_| Vec::new(), |all| all.correctness.counters)
}

fn with_default_limits(
    backend: &mut WgpuBackend,
    batch: &[PairQuery<'_>],
) -> anyhow::Result<DefaultLimits> {
    let expected = compared(backend, batch)?;
    let opened = open_with_defaults();
    let found = opened.and_then(|gpu| compared(&mut WgpuBackend::new(gpu)?, batch));
    Ok(match found {
        Ok(results) => DefaultLimits {
            equal: results == expected,
            failure: None,
        },
        Err(error) => DefaultLimits {
            equal: false,
            failure: Some(error.to_string()),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each value is in one bin.
    #[test]
    fn bins_are_disjoint() {
        let counts: Vec<usize> = (histogram(&[0.0, 1e-6, 2e-6, 0.5, 3.0]).iter())
            .map(|bin| bin.count)
            .collect();
        assert_eq!(counts, [2, 1, 0, 0, 0, 0, 2]);
    }

    /// Each kind of wrong answer is told, and what rounding does is not.
    #[test]
    fn wrong_answers_are_told() {
        let element = |count, stored| Element {
            name: "splats".to_owned(),
            count,
            stored: Some(stored),
        };
        let right = Correctness {
            parity: Some(Parity {
                pairs: 100,
                other_answers: 1,
                turned: 1,
                contacts: 1000,
                other_contacts: 10,
                gaps: Vec::new(),
                axes: Vec::new(),
            }),
            repeats: Some(Repeats {
                pairs: 20,
                runs: 50,
                equal: 50,
            }),
            counters: vec![Counted {
                scene: "deep".to_owned(),
                elements: vec![element(10_050, 10_000), element(3, 1)],
            }],
            default_limits: Some(DefaultLimits {
                equal: true,
                failure: None,
            }),
        };
        assert_eq!(right.faults(), [""; 0]);
        let told = |change: &dyn Fn(&mut Correctness)| {
            let mut wrong = right.clone();
            change(&mut wrong);
            wrong.faults().join("; ")
        };
        let parity =
            |change: &dyn Fn(&mut Parity)| told(&|wrong| wrong.parity.iter_mut().for_each(change));
        assert!(parity(&|p| p.other_answers = 3).contains("3 of 100 pairs"));
        assert!(parity(&|p| p.other_contacts = 21).contains("21 of 1000"));
        assert!(parity(&|p| p.turned = 2).contains("2 of 100 pairs are turned"));
        let unequal = told(&|wrong| wrong.repeats.iter_mut().for_each(|r| r.equal = 49));
        assert!(unequal.contains("1 of 50"), "{unequal}");
        let off = told(&|wrong| wrong.counters[0].elements[0].count = 10_200);
        assert!(off.contains("10200 splats"), "{off}");
        let unknown = told(&|wrong| wrong.counters[0].elements[0].stored = None);
        assert!(unknown.contains("10050 splats"), "{unknown}");
        let limited = told(&|wrong| {
            wrong.default_limits = Some(DefaultLimits {
                equal: false,
                failure: Some("too many buffers".to_owned()),
            });
        });
        assert!(limited.contains("too many buffers"), "{limited}");
    }
}
