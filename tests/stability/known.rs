//! Failures of ours that are known, each with its cause. Everything else that fails is an error.

/// A failure of `tldi` that is declared.
pub(crate) struct KnownFailure {
    /// Name of the scene.
    pub(crate) scene: &'static str,
    /// What the names of the cases start with.
    pub(crate) case_prefix: &'static str,
    /// Why it fails, in one sentence.
    pub(crate) cause: &'static str,
}

impl KnownFailure {
    /// Whether it is about this case.
    pub(crate) fn is_about(&self, scene: &str, case: &str) -> bool {
        self.scene == scene && case.starts_with(self.case_prefix)
    }
}

const fn known(
    scene: &'static str,
    case_prefix: &'static str,
    cause: &'static str,
) -> KnownFailure {
    KnownFailure {
        scene,
        case_prefix,
        cause,
    }
}

/// Several rows fail for it.
const FOUR_LEGS: &str = "A curved surface touches with four points of about equal gap, spread over \
                         the contact patch, so that a ball stands as on four legs.";
const UNEVEN_GAPS: &str = "The gaps of one flat contact differ by up to 0.2 r̄ from point to point, \
                           and so do the times at which its points touch.";
const RESAMPLED: &str =
    "New samples bring new gaps in every frame, which push although nothing moved.";
const CCD_SLIDES: &str = "The swept shapes touch already, and the sweep takes sliding along for \
                          approaching: the body is held back in most frames.";
const NO_VELOCITY: &str = "A wall that is sampled anew has no velocity, and rapier closes \
                           penetrations by 3 m/s at most.";
const ONE_LAYER: &str = "Sheets within 2 r̄ of each other without normals become one layer at their \
                         mean depth.";
const WRONG_SIDE: &str = "Rarely, the side on which a body is of a noisy sheet without normals is \
                          mistaken while the body is partly in it.";

/// All of them.
pub(crate) const KNOWN_FAILURES: &[KnownFailure] = &[
    known("rest", "ball, ", FOUR_LEGS),
    known("rest", "box, new samples", RESAMPLED),
    known("rest", "bunny, new samples", RESAMPLED),
    known("stack", "10 boxes", UNEVEN_GAPS),
    known("slide", "plane, 5 m/s", CCD_SLIDES),
    known("slide", "plane, 10 m/s", CCD_SLIDES),
    known("slide", "noisy plane, 10 m/s", CCD_SLIDES),
    known("slide", "noisy plane, 1 m/s", UNEVEN_GAPS),
    known("roll-spin", "ball", FOUR_LEGS),
    known("roll-spin", "top", FOUR_LEGS),
    known("bounce", "ball, restitution 1", FOUR_LEGS),
    known("bounce", "box, restitution", UNEVEN_GAPS),
    known("thin-sheet", "box on each of two sheets, bare", ONE_LAYER),
    known("thin-sheet", "ball on each of two sheets, bare", ONE_LAYER),
    known("tunnelling", "scan", WRONG_SIDE),
    known(
        "tunnelling",
        "waves",
        "Sweeps take the surface to stand still during a step, but it moves by up to a mean radius.",
    ),
    known("moving-cloud", "kinematic wall, box, 5 m/s", CCD_SLIDES),
    known("moving-cloud", "kinematic wall, ball, 5 m/s", CCD_SLIDES),
    known("moving-cloud", "kinematic wall, ball, 2 m/s", FOUR_LEGS),
    known(
        "moving-cloud",
        "deforming wall, box, 5 m/s",
        "The velocity of the deforming wall does not reach contacts in the first frame of contact, \
         and the body is then deeper than rapier can close.",
    ),
    known(
        "moving-cloud",
        "deforming wall, ball, 5 m/s",
        "The velocity of the deforming wall does not reach contacts in the first frame of contact, \
         and the body is then deeper than rapier can close.",
    ),
    known("moving-cloud", "streamed wall", NO_VELOCITY),
    known(
        "deep-start",
        "two balls, 30 %",
        "No contact is found between two balls 3 r̄ deep in each other (10, 50 and 80 % are).",
    ),
    known(
        "density",
        "1 % flying pixels",
        "Lone points in the air collide like any other.",
    ),
    known(
        "grazing",
        "ball in a groove",
        "Near the bottom of a groove without normals, the estimated ones are means of both sides.",
    ),
    known("scale-shift", "box of 100 m", UNEVEN_GAPS),
    known("scale-shift", "points 1 km", UNEVEN_GAPS),
];

/// The declared cause of a failure, if there is one.
pub(crate) fn known_cause(scene: &str, case: &str) -> Option<&'static str> {
    let about_it = |known: &&KnownFailure| known.is_about(scene, case);
    KNOWN_FAILURES
        .iter()
        .find(about_it)
        .map(|known| known.cause)
}

#[cfg(test)]
mod tests {
    use super::KNOWN_FAILURES;
    use crate::suite::case::Scale;
    use crate::suite::scenes::SCENES;

    #[test]
    fn every_known_failure_is_about_a_case() {
        let scale = Scale {
            seeds: vec![1],
            long: false,
            drops: 9,
            only_drop: None,
        };
        let cases: Vec<_> = SCENES.iter().flat_map(|s| (s.cases)(&scale)).collect();
        for known in KNOWN_FAILURES {
            let is_about_one = cases.iter().any(|c| known.is_about(c.scene, &c.name));
            assert!(is_about_one, "{} / {}", known.scene, known.case_prefix);
        }
    }
}
