//! Rays through convex solids: one entry, one exit.

use super::distance::{self, Projection};
use super::line::Line;
use rapier3d::glamx::DVec3;
use rapier3d::parry::shape::{Ball, ConvexPolyhedron, Cuboid, HalfSpace};
use tldi::RayHit;

pub(super) fn ball(shape: &Ball, line: &Line, hits: &mut Vec<RayHit>) {
    let radius = f64::from(shape.radius);
    let closest = -line.origin.dot(line.direction);
    let half_chord_squared = radius * radius - line.at(closest).length_squared();
    if half_chord_squared <= 0.0 {
        return;
    }
    let half_chord = half_chord_squared.sqrt();
    for t in [closest - half_chord, closest + half_chord] {
        line.push(t, line.at(t) / radius, hits);
    }
}

pub(super) fn cuboid(shape: &Cuboid, line: &Line, hits: &mut Vec<RayHit>) {
    let half = shape.half_extents.as_dvec3();
    let Some([entry, exit]) = line.clip(-half, half) else {
        return;
    };
    for ((t, axis), side) in [(entry, -1.0), (exit, 1.0)] {
        let component = side * line.direction[axis].signum();
        line.push(t, distance::along_axis(axis, component), hits);
    }
}

pub(super) fn half_space(shape: &HalfSpace, line: &Line, hits: &mut Vec<RayHit>) {
    let normal = shape.normal.as_dvec3();
    let t = -normal.dot(line.origin) / normal.dot(line.direction);
    if t.is_finite() {
        line.push(t, normal, hits);
    }
}

/// The outward unit normal and the offset of each face's plane: points inside have
/// `normal · point ≤ offset`.
fn planes(shape: &ConvexPolyhedron) -> impl Iterator<Item = (DVec3, f64)> + '_ {
    shape.faces().iter().enumerate().map(|(face, plane)| {
        let normal = plane.normal.as_dvec3().normalize_or_zero();
        let offset = face_vertices(shape, face)
            .map(|vertex| normal.dot(vertex))
            .fold(f64::NEG_INFINITY, f64::max);
        (normal, offset)
    })
}

fn face_vertices(shape: &ConvexPolyhedron, face: usize) -> impl Iterator<Item = DVec3> + '_ {
    let face = &shape.faces()[face];
    let first = face.first_vertex_or_edge as usize;
    let count = face.num_vertices_or_edges as usize;
    shape.vertices_adj_to_face()[first..first + count]
        .iter()
        .map(|&vertex| shape.points()[vertex as usize].as_dvec3())
}

pub(super) fn polyhedron(shape: &ConvexPolyhedron, line: &Line, hits: &mut Vec<RayHit>) {
    let mut entry = (f64::NEG_INFINITY, DVec3::ZERO);
    let mut exit = (f64::INFINITY, DVec3::ZERO);
    for (normal, offset) in planes(shape) {
        let height = offset - normal.dot(line.origin);
        let rate = normal.dot(line.direction);
        if rate == 0.0 {
            if height < 0.0 {
                return;
            }
            continue;
        }
        let t = height / rate;
        if rate < 0.0 && t > entry.0 {
            entry = (t, normal);
        } else if rate > 0.0 && t < exit.0 {
            exit = (t, normal);
        }
    }
    if entry.0 < exit.0 {
        line.push(entry.0, entry.1, hits);
        line.push(exit.0, exit.1, hits);
    }
}

pub(super) fn project_on_polyhedron(shape: &ConvexPolyhedron, point: DVec3) -> Projection {
    let mut inside = (f64::NEG_INFINITY, DVec3::Y);
    let mut outside: Option<Projection> = None;
    for (face, (normal, offset)) in planes(shape).enumerate() {
        let height = normal.dot(point) - offset;
        if height > inside.0 {
            inside = (height, normal);
        }
        if height <= 0.0 {
            continue;
        }
        // The nearest point lies on a face that is seen from the point.
        let mut vertices = face_vertices(shape, face);
        let (Some(a), Some(mut b)) = (vertices.next(), vertices.next()) else {
            continue;
        };
        for c in vertices {
            let candidate = distance::triangle(point, [a, b, c]);
            if outside.is_none_or(|best| candidate.0 < best.0) {
                outside = Some(candidate);
            }
            b = c;
        }
    }
    match outside {
        // So close that the direction is rounding.
        Some((distance, _)) if distance < 1e-12 * point.length() => (distance, inside.1),
        Some(projection) => projection,
        None => inside,
    }
}

/// Entry and exit by Newton's method on the distance along the line: the distance to a convex set
/// is a convex function of `t`, so that steps from outside never pass the root.
///
/// `center` and `radius` are of a ball around the solid.
pub(super) fn by_distance(
    project: impl Fn(DVec3) -> Projection,
    center: DVec3,
    radius: f64,
    line: &Line,
    hits: &mut Vec<RayHit>,
) {
    let closest = (center - line.origin).dot(line.direction);
    // The ball's own rounding in f32 must not cut the solid.
    let reach = 1.001 * radius;
    let half_chord_squared = reach * reach - (line.at(closest) - center).length_squared();
    if half_chord_squared <= 0.0 {
        return;
    }
    let half_chord = half_chord_squared.sqrt();
    let tolerance = 1e-10 * radius;
    let root = |start: f64, forward: f64| -> Option<(f64, DVec3)> {
        let mut t = start;
        // Quadratic convergence; halving at worst, where the line touches: 2⁻⁶⁴.
        for _ in 0..64 {
            let (distance, normal) = project(line.at(t));
            if distance <= tolerance {
                return Some((t, normal));
            }
            let rate = forward * normal.dot(line.direction);
            if rate >= 0.0 {
                return None;
            }
            t -= forward * distance / rate;
            if (t - closest).abs() > 1.001 * half_chord {
                return None;
            }
        }
        None
    };
    let (Some(entry), Some(exit)) = (
        root(closest - half_chord, 1.0),
        root(closest + half_chord, -1.0),
    ) else {
        return;
    };
    if entry.0 < exit.0 {
        line.push(entry.0, entry.1, hits);
        line.push(exit.0, exit.1, hits);
    }
}
