//! What corrects rapier's own solver.
//!
//! | file | rapier's behaviour | no longer needed if |
//! |---|---|---|
//! | `rolling` | contact points stay for a whole step, half a step late on average: what rocks gains energy, with rapier's own shapes, too | `what_rocks_gains_no_energy` passes without it (`tests/bodies/rolling.rs`) |
//! | `surface_motion` | the solver knows velocities of bodies, not of points | a contact point can have a velocity of its own |
//! | `surface_push` | penetrations are resolved at 3 m/s at most, and give the body no velocity | `fast_floors_push_what_stands_on_them` passes without it (`tests/streams/set_points.rs`) |
//! | `sampled_motion` | as for `surface_motion`, where points are new in every frame | users know the velocity of their points |
//! | `restitution` | contact points rebound one after the other, once: bodies leave spinning, and gain energy | `boxes_rebound_as_a_whole` passes without it (`tests/bodies/rebounds.rs`) |
//! | `sweeps` | a sweep does not know the contacts of its pair: it holds a body at a sheet that these push it out of | sweeps get the pair's contacts |
//! | `impulses` | only contacts change velocities, and a body that a sweep holds may have none | `restitution`, `sweeps` and `surface_push` are gone |

mod blocks;
pub(crate) mod impulses;
mod restitution;
pub(crate) mod rolling;
pub(crate) mod sampled_motion;
pub(crate) mod surface_motion;
pub(crate) mod surface_push;
pub(crate) mod sweeps;
