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

/// All of them.
pub(crate) const KNOWN_FAILURES: &[KnownFailure] = &[];

/// The declared cause of a failure, if there is one.
pub(crate) fn known_cause(scene: &str, case: &str) -> Option<&'static str> {
    KNOWN_FAILURES
        .iter()
        .find(|known| known.scene == scene && case.starts_with(known.case_prefix))
        .map(|known| known.cause)
}
