//! The nearest point of a surface.

use rapier3d::glamx::DVec3;

/// Signed distance and outward unit normal at the nearest point of the surface.
pub(super) type Projection = (f64, DVec3);
