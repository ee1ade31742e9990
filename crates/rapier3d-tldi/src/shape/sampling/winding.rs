//! Faces of a mesh that are made to wind alike.

use super::patch::vector_area;
use rapier3d::glamx::Vec3;

/// One edge of one face.
struct Edge {
    /// Its ends, sorted: equal for all faces that have it, whichever vertices they have it from.
    ends: [[u32; 3]; 2],
    face: usize,
    /// Which of the face's edges it is.
    place: usize,
    /// Whether the face passes it from the first end to the second.
    is_forward: bool,
}

/// Turns faces so that neighbours wind alike: two faces that alone share an edge pass it in opposite directions. In each
/// connected part, the winding of the larger area stays. Costs the sorting of the edges.
pub(super) fn make_agree(triangles: &mut [[Vec3; 3]]) {
    let neighbors = neighbors(triangles);
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    for first in 0..triangles.len() {
        if turned[first].is_some() {
            continue;
        }
        turned[first] = Some(false);
        let mut part = vec![first];
        let mut turned_area = 0.0;
        let mut next = 0;
        while let Some(&face) = part.get(next) {
            next += 1;
            let is_turned = turned[face] == Some(true);
            let area = vector_area(&triangles[face]).length();
            turned_area += if is_turned { area } else { -area };
            for (neighbor, disagrees) in neighbors[face].into_iter().flatten() {
                if turned[neighbor].is_none() {
                    turned[neighbor] = Some(is_turned ^ disagrees);
                    part.push(neighbor);
                }
            }
        }
        let is_minority = |face: usize| turned[face] == Some(turned_area <= 0.0);
        for face in part.into_iter().filter(|face| is_minority(*face)) {
            triangles[face].swap(1, 2);
        }
    }
}

/// Across each edge of each face, the only other face that has it, and whether the two wind differently.
fn neighbors(triangles: &[[Vec3; 3]]) -> Vec<[Option<(usize, bool)>; 3]> {
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * triangles.len());
    for (face, corners) in triangles.iter().enumerate() {
        // Adding zero makes one zero of both.
        let keys = corners.map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
        for place in 0..3 {
            let [start, end] = [keys[place], keys[(place + 1) % 3]];
            edges.push(Edge {
                ends: [start.min(end), start.max(end)],
                face,
                place,
                is_forward: start < end,
            });
        }
    }
    edges.sort_unstable_by_key(|edge| (edge.ends, edge.face, edge.place));
    let mut neighbors = vec![[None; 3]; triangles.len()];
    for shared in edges.chunk_by(|a, b| a.ends == b.ends) {
        if let [a, b] = shared {
            let disagree = a.is_forward == b.is_forward;
            neighbors[a.face][a.place] = Some((b.face, disagree));
            neighbors[b.face][b.place] = Some((a.face, disagree));
        }
    }
    neighbors
}
