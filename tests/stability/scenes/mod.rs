//! The scenes, one file a family.

mod bounce;
mod deep_start;
mod density;
mod grazing;
mod heap;
mod holes;
mod moving_cloud;
mod rest;
mod roll_spin;
mod scale_shift;
mod slide;
mod stack;
mod thin_sheet;
mod tunnelling;

use super::case::Scene;

/// All scenes, in the order of tables.
pub(crate) const SCENES: &[Scene] = &[
    rest::SCENE,
    stack::SCENE,
    heap::SCENE,
    slide::SCENE,
    roll_spin::SCENE,
    bounce::SCENE,
    thin_sheet::SCENE,
    tunnelling::SCENE,
    moving_cloud::SCENE,
    deep_start::SCENE,
    holes::SCENE,
    density::SCENE,
    grazing::SCENE,
    scale_shift::SCENE,
];
