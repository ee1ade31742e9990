//! Voxels: the boundary of the filled cells, without the faces between them.

use super::distance::{Projection, along_axis};
use super::line::Line;
use rapier3d::glamx::{DVec3, IVec3, Vec3};
use rapier3d::parry::query::PointQuery;
use rapier3d::parry::shape::Voxels;
use tldi::RayHit;

fn is_filled(voxels: &Voxels, key: IVec3) -> bool {
    voxels
        .voxel_state(key)
        .is_some_and(|state| !state.is_empty())
}

fn cell(key: IVec3, size: DVec3) -> (DVec3, DVec3) {
    (key.as_dvec3() * size, (key + IVec3::ONE).as_dvec3() * size)
}

/// Walks the cells along the line (Amanatides, Woo: A Fast Voxel Traversal Algorithm, 1987).
pub(super) fn crossings(voxels: &Voxels, line: &Line, hits: &mut Vec<RayHit>) {
    let size = voxels.voxel_size().as_dvec3();
    let [first, end] = voxels.domain();
    let (min, max) = (first.as_dvec3() * size, end.as_dvec3() * size);
    let Some([(entry, mut axis), (exit, exit_axis)]) = line.clip(min, max) else {
        return;
    };
    let mut t = entry.max(0.0);
    let exit_or_end = exit.min(line.max);
    if t > exit_or_end {
        return;
    }
    let normal = |axis: usize, entering: bool| {
        let side = if entering { -1.0 } else { 1.0 };
        along_axis(axis, line.direction[axis].signum() * side)
    };
    let mut key = (line.at(t) / size)
        .floor()
        .as_ivec3()
        .clamp(first, end - IVec3::ONE);
    // Inside from the start: there is no entry ahead.
    let mut inside = entry < 0.0 && is_filled(voxels, key);
    loop {
        let filled = is_filled(voxels, key);
        if filled != inside {
            line.push(t, normal(axis, filled), hits);
            inside = filled;
        }
        let (low, high) = cell(key, size);
        let (mut next, mut next_axis) = (f64::INFINITY, 0);
        for i in 0..3 {
            let d = line.direction[i];
            let plane = if d > 0.0 { high[i] } else { low[i] };
            let reached = (plane - line.origin[i]) / d;
            if d != 0.0 && reached < next {
                (next, next_axis) = (reached, i);
            }
        }
        key[next_axis] += line.direction[next_axis].signum() as i32;
        (t, axis) = (next.max(t), next_axis);
        let left = key.cmplt(first).any() || key.cmpge(end).any();
        if left || t > exit_or_end {
            if left && inside {
                line.push(exit, normal(exit_axis, false), hits);
            }
            return;
        }
    }
}

/// Cost grows with the cube of the depth in cells for a point inside.
pub(super) fn project(voxels: &Voxels, point: Vec3) -> Projection {
    let size = voxels.voxel_size().as_dvec3();
    let p = point.as_dvec3();
    let key = voxels.voxel_at_point(point);
    if is_filled(voxels, key) {
        return project_from_inside(voxels, p, key);
    }
    let projection = voxels.project_local_point(point, false);
    let Some(nearest) = voxels.voxel_at_flat_id(projection.subshape) else {
        return (f64::INFINITY, DVec3::Y);
    };
    let (low, high) = cell(nearest, size);
    let delta = p - p.clamp(low, high);
    let normal = delta.try_normalize().unwrap_or_else(|| {
        // On a face: the one that the point is on.
        let offset = (p - 0.5 * (low + high)) / size;
        let axis = offset.abs().max_position();
        along_axis(axis, offset[axis].signum())
    });
    (delta.length(), normal)
}

fn project_from_inside(voxels: &Voxels, point: DVec3, key: IVec3) -> Projection {
    let size = voxels.voxel_size().as_dvec3();
    let mut best: Option<(f64, DVec3)> = None;
    let mut ring = 1;
    loop {
        for x in -ring..=ring {
            for y in -ring..=ring {
                for z in -ring..=ring {
                    let step = IVec3::new(x, y, z);
                    if step.abs().max_element() != ring || is_filled(voxels, key + step) {
                        continue;
                    }
                    let (low, high) = cell(key + step, size);
                    let delta = point.clamp(low, high) - point;
                    if best.is_none_or(|(distance, _)| delta.length() < distance) {
                        let outward = delta.try_normalize();
                        let axis = step.as_dvec3().normalize();
                        best = Some((delta.length(), outward.unwrap_or(axis)));
                    }
                }
            }
        }
        // Whatever lies in the next ring is at least this far.
        if let Some((distance, normal)) = best
            && distance <= f64::from(ring) * size.min_element()
        {
            return (-distance, normal);
        }
        ring += 1;
    }
}
