//! Failures of ours that are known, each with its cause. Everything else that fails is an error.

use super::case::Verdict;
use super::row::Row;
use std::fmt;
use std::ops::RangeInclusive;

/// What is less likely than this is no chance. Ten times as much: a run of 40 seeds has a false alarm in one of 100
/// changes; a tenth: a rate that grows five-fold is seen with twice as many seeds.
pub(crate) const UNLIKELY: f64 = 1e-4;

/// What a declared failure is counted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tries {
    /// Rows: one a seed.
    Rows,
    /// Bodies that hit a surface: many a row.
    Hits,
}

/// A failure of `tldi` that is declared.
pub(crate) struct KnownFailure {
    /// Name of the scene.
    pub(crate) scene: &'static str,
    /// What the names of the cases start with.
    pub(crate) case_prefix: &'static str,
    /// How many failed, of so many tries.
    rate: (u32, u32, Tries),
    /// Why it fails, in one sentence.
    cause: &'static str,
    /// The metrics that may break their rules, and the values that they then have. A rule that any other metric breaks, or
    /// a value outside its range, is another failure.
    ranges: &'static [(&'static str, RangeInclusive<f64>)],
}

impl KnownFailure {
    /// Whether it is about this case.
    pub(crate) fn is_about(&self, scene: &str, case: &str) -> bool {
        self.scene == scene && case.starts_with(self.case_prefix)
    }

    /// Whether it explains every broken rule. An error or a panic breaks none by name: it is never covered.
    fn covers(&self, verdict: &Verdict) -> bool {
        let is_declared = |metric: &str| {
            let value = verdict.metrics.get(metric);
            let range = self.ranges.iter().find(|(name, _)| *name == metric);
            (value.zip(range)).is_some_and(|(value, (_, range))| range.contains(value))
        };
        let failures = &verdict.failures;
        !failures.is_empty() && failures.iter().all(|failure| is_declared(&failure.metric))
    }

    /// If more of these rows fail than chance makes of the declared rate: how many, of how many tries.
    pub(crate) fn excess<'a>(&self, rows: impl Iterator<Item = &'a Row>) -> Option<[u32; 2]> {
        let (declared, of, tries) = self.rate;
        let mut total = [0, 0];
        for row in rows.filter(|row| self.is_about(row.scene, &row.case)) {
            let count = |metric| row.metrics.get(metric).map_or(0, |count| *count as u32);
            let [failed, tried] = match tries {
                Tries::Rows => [u32::from(row.passed == Some(false)), 1],
                Tries::Hits => [count("passed_through"), count("hits")],
            };
            total = [total[0] + failed, total[1] + tried];
        }
        let rate = f64::from(declared) / f64::from(of);
        (chance_of_as_many(total, rate) < UNLIKELY).then_some(total)
    }
}

impl fmt::Display for KnownFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (failed, of, tries) = self.rate;
        let tries = match tries {
            Tries::Rows => "rows",
            Tries::Hits => "hits",
        };
        write!(f, "{failed} of {of} {tries}: {}", self.cause)
    }
}

/// How likely at least so many of so many tries fail, each at the same rate.
pub(crate) fn chance_of_as_many([failed, of]: [u32; 2], rate: f64) -> f64 {
    let [mut fewer, mut exactly] = [0.0, (1.0 - rate).powf(of.into())];
    for k in 0..failed {
        fewer += exactly;
        exactly *= f64::from(of - k) / f64::from(k + 1) * rate / (1.0 - rate);
    }
    1.0 - fewer
}

const fn known(
    scene: &'static str,
    case_prefix: &'static str,
    rate: (u32, u32, Tries),
    cause: &'static str,
    ranges: &'static [(&'static str, RangeInclusive<f64>)],
) -> KnownFailure {
    KnownFailure {
        scene,
        case_prefix,
        rate,
        cause,
        ranges,
    }
}

/// One body is a large share of a row with few hits. How many may pass, the rate tells.
const ANY_SHARE: &[(&str, RangeInclusive<f64>)] = &[("passed_share", 0.0..=1.0)];

/// All of them.
pub(crate) const KNOWN_FAILURES: &[KnownFailure] = &[
    known(
        "tunnelling",
        "scan",
        (1, 52_157, Tries::Hits),
        "of a small spinning body that is deep in a rough scan without normals a view takes the wrong side.",
        ANY_SHARE,
    ),
    known(
        "tunnelling",
        "sheet",
        (1, 108_000, Tries::Hits),
        "a spinning box that slides at 16 m/s turns its middle 0.01 r̄ under the sheet.",
        ANY_SHARE,
    ),
    known(
        "tunnelling",
        "waves",
        (8, 48_867, Tries::Hits),
        "of bodies of 2.7 to 4.1 r̄ in troughs hardly wider than they are, where a wave rises faster than rapier undoes \
         penetrations, or their first contacts push to both sides.",
        ANY_SHARE,
    ),
    known(
        "density",
        "1 % flying pixels",
        (12, 300, Tries::Rows),
        "several flying pixels near each other look like a surface.",
        &[("worst_corner_local_radii", 1.0..=10.6)],
    ),
    known(
        "grazing",
        "ball in a groove, bare",
        (2, 3_780, Tries::Rows),
        "one of the two contacts takes pixels of the other sheet.",
        &[("worst_pushing_normal_error_deg", 5.0..=12.0)],
    ),
];

/// The declared cause of a failure, if there is one.
pub(crate) fn known_cause(scene: &str, case: &str, verdict: &Verdict) -> Option<String> {
    let explains = |known: &&KnownFailure| known.is_about(scene, case) && known.covers(verdict);
    KNOWN_FAILURES
        .iter()
        .find(explains)
        .map(KnownFailure::to_string)
}

#[cfg(test)]
mod tests {
    use super::{KNOWN_FAILURES, KnownFailure, Tries, chance_of_as_many, known, known_cause};
    use crate::suite::case::{Scale, Verdict};
    use crate::suite::row::Row;
    use crate::suite::scenes::SCENES;
    use std::ops::RangeInclusive;

    #[test]
    fn every_known_failure_is_about_a_case() {
        let scale = Scale {
            seeds: vec![1],
            long: false,
            drops: 9,
            only_drop: None,
        };
        let cases: Vec<_> = SCENES.iter().flat_map(|s| s.all_cases(&scale)).collect();
        for known in KNOWN_FAILURES {
            let is_about_one = cases.iter().any(|c| known.is_about(c.scene, &c.name));
            assert!(is_about_one, "{} / {}", known.scene, known.case_prefix);
        }
    }

    #[test]
    fn what_is_worse_than_declared_is_another_failure() {
        let groove = "ball in a groove, bare, about y";
        let cause = |case: &str, error_deg: f64| {
            let mut verdict = Verdict::default();
            verdict.at_most("worst_pushing_normal_error_deg", error_deg, 5.0);
            known_cause("grazing", case, &verdict)
        };
        assert!(cause(groove, 11.0).is_some());
        assert_eq!(cause(groove, 40.0), None);
        // What passed has no cause.
        assert_eq!(cause(groove, 3.0), None);
        // A number that is none.
        assert_eq!(cause(groove, f64::NAN), None);
        // An error or a panic measures nothing.
        assert_eq!(known_cause("grazing", groove, &Verdict::default()), None);
        assert_eq!(cause("ball in a groove, oriented, about y", 11.0), None);
    }

    /// Of the throws of dice.
    #[test]
    fn chances_are_binomial() {
        let sixth = 1.0 / 6.0;
        for (count, truth) in [
            ([0, 3], 1.0),
            ([1, 3], 91.0 / 216.0),
            ([2, 3], 16.0 / 216.0),
            ([3, 3], 1.0 / 216.0),
        ] {
            assert!((chance_of_as_many(count, sixth) - truth).abs() < 1e-12);
        }
    }

    /// One body of a run passes through a scan by chance, one of each row does not.
    #[test]
    fn what_fails_more_often_than_declared_is_another_failure() {
        let scan = |known: &&KnownFailure| known.is_about("tunnelling", "scan, small bodies");
        let scan = KNOWN_FAILURES.iter().find(scan).expect("it is declared");
        let row = |passed_through: f64| Row {
            scene: "tunnelling",
            case: "scan, small bodies".to_owned(),
            metrics: [("hits", 44.0), ("passed_through", passed_through)]
                .map(|(metric, count)| (metric.to_owned(), count))
                .into(),
            ..Row::default()
        };
        let one = [row(1.0), row(0.0), row(0.0)];
        assert_eq!(scan.excess(one.iter()), None);
        let all = [row(1.0), row(1.0), row(1.0)];
        assert_eq!(scan.excess(all.iter()), Some([3, 132]));
    }

    const fn declared(ranges: &'static [(&'static str, RangeInclusive<f64>)]) -> KnownFailure {
        known("scene", "case", (1, 10, Tries::Rows), "cause", ranges)
    }

    /// A failure on the other side of the rule: the rod stops early.
    #[test]
    fn what_fails_the_other_way_is_another_failure() {
        const RODS: KnownFailure = declared(&[("angle_rad", 0.99..=1.01)]);
        let covers = |angle: f64| {
            let mut verdict = Verdict::default();
            verdict.near("angle_rad", angle, 0.9467, 0.0473);
            RODS.covers(&verdict)
        };
        assert!(covers(0.995));
        assert!(!covers(0.1));
    }

    /// A declared failure does not excuse another one of the same row.
    #[test]
    fn every_broken_rule_is_declared() {
        const STACKS: KnownFailure = declared(&[("top_drift_mean_radii", 1.0..=1.6)]);
        let covers = |height: f64| {
            let mut verdict = Verdict::default();
            verdict.at_most("top_drift_mean_radii", 1.5, 1.0);
            verdict.near("top_height_error_mean_radii", height, 0.0, 10.0);
            STACKS.covers(&verdict)
        };
        assert!(covers(0.1));
        assert!(!covers(-20.0));
    }
}
