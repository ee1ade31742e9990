//! The scenes, one file a family.

mod rest;
mod slide;
mod thin_sheet;
mod tunnelling;

use super::case::Scene;

/// All scenes, in the order of tables.
pub(crate) const SCENES: &[Scene] = &[
    rest::SCENE,
    slide::SCENE,
    thin_sheet::SCENE,
    tunnelling::SCENE,
];
