//! What corrects rapier's own solver.
//!
//! | file | rapier's behaviour | needed until |
//! |---|---|---|
//! | `rolling` | contact points stay where they were at the start of a step, so that round bodies lose energy as they roll | rapier moves the contacts of round shapes within a step |
//! | `surface_motion`, `surface_push`, `sampled_motion` | a collider's surface has the velocity of its body; a surface that deforms has none | rapier takes a velocity for each contact point from the shape |
//! | `sweeps` | continuous collision detection stops a body at any surface, also at one that its contacts push it out of | rapier tells a sweep which contacts a pair has |
//! | `impulses` | velocities change by contacts only, of which there are none where a sweep stopped a body | `sweeps` and `surface_push` are gone |

pub(crate) mod impulses;
pub(crate) mod rolling;
pub(crate) mod sampled_motion;
pub(crate) mod surface_motion;
pub(crate) mod surface_push;
pub(crate) mod sweeps;
