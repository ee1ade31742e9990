//! Rays of generated sensors.

use tldi::Aabb;
use tldi::glamx::Vec3;

/// Where a ray's line is in a box: from `enters` to `leaves`, in lengths of its direction; nowhere if that is less.
pub(crate) struct Crossing {
    pub(crate) enters: f32,
    pub(crate) leaves: f32,
    /// The axes, 0 to 2, across which it does.
    pub(crate) axes: [usize; 2],
}

/// Where the line of a ray crosses a box.
pub(crate) fn crossing(bounds: &Aabb, origin: Vec3, direction: Vec3) -> Crossing {
    let (mut enters, mut leaves, mut axes) = (f32::NEG_INFINITY, f32::INFINITY, [0; 2]);
    for k in 0..3 {
        let [a, b] = [bounds.min, bounds.max].map(|side| (side[k] - origin[k]) / direction[k]);
        if a.min(b) > enters {
            (enters, axes[0]) = (a.min(b), k);
        }
        if a.max(b) < leaves {
            (leaves, axes[1]) = (a.max(b), k);
        }
    }
    Crossing {
        enters,
        leaves,
        axes,
    }
}

/// How far ahead a ray meets a box from outside, in lengths of its direction; infinite if it does not.
pub(crate) fn distance_to_box(bounds: &Aabb, origin: Vec3, direction: Vec3) -> f32 {
    let Crossing { enters, leaves, .. } = crossing(bounds, origin, direction);
    if enters > 0.0 && enters <= leaves {
        enters
    } else {
        f32::INFINITY
    }
}

/// How far ahead a ray meets the ground z = 0; infinite if it does not.
pub(crate) fn distance_to_ground(origin: Vec3, direction: Vec3) -> f32 {
    if direction.z < 0.0 {
        -origin.z / direction.z
    } else {
        f32::INFINITY
    }
}
