//! How deep two meshes are in each other.

use crate::mesh_truth::ExactMesh;
use tldi::glamx::{Pose3, Vec3};

/// Where ways out are looked for: the middles of faces, edges and corners of a cube.
fn directions() -> impl Iterator<Item = Vec3> {
    (0..27)
        .map(|k| Vec3::new((k % 3) as f32, (k / 3 % 3) as f32, (k / 9) as f32) - Vec3::ONE)
        .filter(|direction| *direction != Vec3::ZERO)
        .map(Vec3::normalize)
}

/// The least distance, of 26 directions, by which the second copy must be moved until the mesh and its
/// copy at `pose` are free of each other, within a thousandth, metres: at least how deep they are in
/// each other. 0 where they are free.
pub fn way_out(mesh: &ExactMesh, pose: &Pose3) -> f32 {
    if !mesh.intersects(mesh, pose) {
        return 0.0;
    }
    let mut best = 4.0 * pose.translation.length().max(1.0);
    for direction in directions() {
        let meets = |distance: f32| {
            let mut moved = *pose;
            moved.translation += distance * direction;
            mesh.intersects(mesh, &moved)
        };
        // A direction that is not better is left at once.
        if meets(best * (1.0 - 1e-3)) {
            continue;
        }
        best = nearest_free(meets, best);
    }
    best
}

/// A distance, found by doubling and bisection, from which on the first step is free.
fn nearest_free(meets: impl Fn(f32) -> bool, most: f32) -> f32 {
    let (mut inside, mut outside) = (0.0, most / 1024.0);
    while outside < most && meets(outside) {
        (inside, outside) = (outside, 2.0 * outside);
    }
    outside = outside.min(most);
    while outside - inside > 1e-3 * outside {
        let middle = 0.5 * (inside + outside);
        if meets(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    outside
}
