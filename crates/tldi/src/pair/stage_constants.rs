//! The numbers of the stages, for backends on a device.

use crate::BLOCK;
use crate::cpu::normals::{planes, sharpen, sorted};
use crate::cpu::{compare, crossings, splat, sweep};
use crate::pair::sampling::AIM_SAMPLES;
use crate::view::{approach, camera_policy, main_axis, zone_normals};

/// The numbers of the stages, by the names of the override constants that a GPU backend's shaders
/// declare for them.
pub fn stage_constants() -> Vec<(&'static str, f64)> {
    let mut all = vec![("BLOCK", BLOCK as f64), ("AIM_SAMPLES", AIM_SAMPLES as f64)];
    all.extend(sorted::CONSTANTS);
    all.extend(planes::CONSTANTS);
    all.extend(sharpen::CONSTANTS);
    all.extend(splat::CONSTANTS);
    all.extend(sweep::CONSTANTS);
    all.extend(compare::CONSTANTS);
    all.extend(crossings::CONSTANTS);
    all.extend(camera_policy::CONSTANTS);
    all.extend(main_axis::CONSTANTS);
    all.extend(zone_normals::CONSTANTS);
    all.extend(approach::CONSTANTS);
    all
}
