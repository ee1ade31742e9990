//! The scenes, one file a family.

mod rest;

use super::case::Scene;

/// All scenes, in the order of tables.
pub(crate) const SCENES: &[Scene] = &[rest::SCENE];
