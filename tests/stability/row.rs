//! One row of results.

use super::method::Method;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// What one method did in one case.
#[derive(Clone, Debug, Default, Serialize, PartialEq)]
pub(crate) struct Row {
    /// Name of the scene.
    pub(crate) scene: &'static str,
    /// Name of the case within the scene.
    pub(crate) case: String,
    /// Name of the method.
    pub(crate) method: &'static str,
    /// Seed of everything random in the case.
    pub(crate) seed: u64,
    /// Whether all rules were kept; null where the method cannot represent the case.
    pub(crate) passed: Option<bool>,
    /// Measured values; units are in the names.
    pub(crate) metrics: BTreeMap<String, f64>,
    /// Which rules were broken, by how much; or why the case is not applicable.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) reason: Option<String>,
    /// The cause of a failure of ours that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) known_cause: Option<String>,
}

impl Row {
    /// Whether it is a failure of ours whose cause is not declared.
    pub(crate) fn is_undeclared_failure(&self) -> bool {
        self.method == Method::Tldi.name()
            && self.passed == Some(false)
            && self.known_cause.is_none()
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = self.reason.as_deref().unwrap_or("passed");
        write!(
            f,
            "{} / {} ({}, seed {}): {reason}",
            self.scene, self.case, self.method, self.seed
        )
    }
}
