//! A robot from a URDF whose links are point clouds, in a scan.

mod assembly;
mod completed;
mod description;
mod geometry;
mod inertia;
mod kinematics;
mod links;
mod loose_bodies;
mod mimic;
mod model;
mod motion;
mod own_camera;
mod packages;
mod placing;
mod plan;
mod quadruped;
mod report;
mod self_filter;
mod simulation;
mod standing;
mod tally;

pub use description::{BUILT_IN, Description, DescriptionError};
pub use kinematics::{Aim, JointKind, JointModel, Kinematics};
pub use links::{LinkCloud, clouds_of_links, link_spacing};
pub use motion::{Motion, Waypoint};
pub use packages::MeshFolders;
pub use plan::Base;
pub use quadruped::{Walk, quadruped};
pub use report::{Hardest, LinkReport, LooseBodyReport, RobotReport};
pub use simulation::{RobotScene, RobotSimulation, RobotSnapshot};
pub use standing::StandingReport;

fn count(flags: &[bool]) -> usize {
    flags.iter().filter(|flag| **flag).count()
}
