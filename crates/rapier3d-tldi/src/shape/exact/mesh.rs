//! Triangle meshes and height fields.

use super::distance::Projection;
use super::line::Line;
use super::triangle::{self, ShearedLine};
use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::parry::bounding_volume::Aabb;
use rapier3d::parry::partitioning::BvhNode;
use rapier3d::parry::shape::{HeightField, TriMesh, TriMeshFlags, Triangle};
use tldi::RayHit;

/// Part of a mesh's size by which boxes are grown against rounding in `f32`. Half or twice: no test of shapes or
/// queries fails.
const BOX_ROUNDING: f64 = 1e-6;

/// Cosine of the angle between a face's normal and the way to a point beyond which the point is straight above the face:
/// the rounding of an `f64` half a million times. A tenth of that, or ten times: no test of shapes fails.
const STRAIGHT: f64 = 1.0 - 1e-10;

/// Part of a place's coordinates by which it is rounded, and some more. What is shorter has no direction.
const NOTHING: f64 = 1e-12;

/// By how much boxes are grown for a mesh or height field with these bounds, metres.
fn margin_of(bounds: &Aabb) -> f64 {
    BOX_ROUNDING * f64::from(bounds.mins.abs().max(bounds.maxs.abs()).max_element())
}

pub(super) fn cross_triangle(shape: &Triangle, line: &Line, hits: &mut Vec<RayHit>) {
    let vertices = triangle::vertices(shape);
    if let Some(t) = ShearedLine::new(line).crossing(vertices) {
        line.push(t, triangle::normal(vertices), hits);
    }
}

pub(super) fn cross_trimesh(mesh: &TriMesh, line: &Line, hits: &mut Vec<RayHit>) {
    let sheared = ShearedLine::new(line);
    let margin = DVec3::splat(margin_of(&mesh.local_aabb()));
    let near = |node: &BvhNode| {
        line.clip(
            node.mins().as_dvec3() - margin,
            node.maxs().as_dvec3() + margin,
        )
        .is_some_and(|[entry, exit]| exit.0 >= 0.0 && entry.0 <= line.max)
    };
    for id in mesh.bvh().leaves(near) {
        let vertices = triangle::vertices(&mesh.triangle(id));
        if let Some(t) = sheared.crossing(vertices) {
            line.push(t, triangle::normal(vertices), hits);
        }
    }
}

pub(super) fn is_closed(mesh: &TriMesh) -> bool {
    mesh.flags().contains(TriMeshFlags::ORIENTED)
        || mesh
            .topology()
            .is_some_and(|topology| topology.half_edges.iter().all(|half| half.twin != u32::MAX))
}

pub(super) fn project_on_triangle(shape: &Triangle, point: DVec3) -> Projection {
    let vertices = triangle::vertices(shape);
    signed(
        point,
        triangle::nearest(point, vertices),
        [triangle::normal(vertices)],
    )
}

pub(super) fn project_on_trimesh(mesh: &TriMesh, point: DVec3) -> Projection {
    let p = point.as_vec3();
    let nearest = mesh.bvh().find_best(
        f32::MAX,
        |node: &BvhNode, _| {
            let away = (node.mins() - p).max(p - node.maxs()).max(Vec3::ZERO);
            away.length_squared()
        },
        |id, _| {
            let vertices = triangle::vertices(&mesh.triangle(id));
            Some(point.distance_squared(triangle::nearest(point, vertices)) as f32)
        },
    );
    let Some((id, _)) = nearest else {
        // Only a point that is not finite has no nearest triangle.
        return (f64::INFINITY, DVec3::Y);
    };
    let vertices = triangle::vertices(&mesh.triangle(id));
    let (foot, normal) = (
        triangle::nearest(point, vertices),
        triangle::normal(vertices),
    );
    let (delta, height) = (point - foot, normal.dot(point - foot));
    // No other face is more directly below or above the point.
    if height.abs() > STRAIGHT * delta.length() && delta.length() > NOTHING * point.length() {
        return signed(point, foot, [normal]);
    }
    let margin = BOX_ROUNDING * foot.abs().max_element();
    let touches = |node: &BvhNode| outside(&node.aabb(), foot).max_element() <= margin;
    let normals = mesh.bvh().leaves(touches).filter_map(|id| {
        let vertices = triangle::vertices(&mesh.triangle(id));
        (foot.distance(triangle::nearest(foot, vertices)) <= margin)
            .then(|| triangle::normal(vertices))
    });
    signed(point, foot, normals)
}

/// The projection of `point` on a surface whose nearest point is `foot`, where faces with
/// `normals` meet. The face that the point is most directly above or below tells the side.
fn signed(point: DVec3, foot: DVec3, normals: impl IntoIterator<Item = DVec3>) -> Projection {
    let delta = point - foot;
    let mut height = 0.0f64;
    let mut sum = DVec3::ZERO;
    for normal in normals {
        let along = normal.dot(delta);
        if along.abs() > height.abs() {
            height = along;
        }
        sum += normal;
    }
    // So close that the direction is rounding.
    if delta.length() <= NOTHING * point.length() || height == 0.0 {
        return (delta.length(), sum.try_normalize().unwrap_or(DVec3::Y));
    }
    let side = height.signum();
    (side * delta.length(), side * delta.normalize())
}

/// Vertices of the up to two triangles of a cell, wound as parry does: normals point to +y.
///
/// [`HeightField::triangles_at`] would do, but there the corners of neighbouring cells can differ
/// in their last bits.
fn cell_triangles(field: &HeightField, row: usize, column: usize) -> [Option<[DVec3; 3]>; 2] {
    let rows = field.heights().nrows() as u32;
    let vertex = |id: u32| {
        let (i, j) = ((id % rows) as usize, (id / rows) as usize);
        let y = field.heights()[(i, j)] * field.scale().y;
        Vec3::new(field.x_at(j), y, field.z_at(i)).as_dvec3()
    };
    let (left, right) = field.triangles_vids_at(row, column);
    [left, right].map(|ids| ids.map(|ids| ids.map(vertex)))
}

pub(super) fn cross_height_field(field: &HeightField, line: &Line, hits: &mut Vec<RayHit>) {
    let aabb = field.root_aabb();
    let margin = DVec3::splat(margin_of(aabb));
    let Some([(entry, _), (exit, _)]) =
        line.clip(aabb.mins.as_dvec3() - margin, aabb.maxs.as_dvec3() + margin)
    else {
        return;
    };
    let (entry, exit) = (entry.max(0.0), exit.min(line.max));
    if entry > exit {
        return;
    }
    let sheared = ShearedLine::new(line);
    let column_at = |t: f64| grid_place(field, line.at(t))[0];
    let row_at = |t: f64| grid_place(field, line.at(t))[1];
    let (c0, c1) = (column_at(entry), column_at(exit));
    for column in cells(c0, c1, field.ncols()) {
        // The part of the line over this column.
        let (mut t0, mut t1) = (entry, exit);
        if c0 != c1 {
            let t_at = |c: f64| entry + (exit - entry) * ((c - c0) / (c1 - c0)).clamp(0.0, 1.0);
            let ta = t_at(column as f64 - CELL_MARGIN);
            let tb = t_at(column as f64 + 1.0 + CELL_MARGIN);
            (t0, t1) = (ta.min(tb), ta.max(tb));
        }
        for row in cells(row_at(t0), row_at(t1), field.nrows()) {
            for vertices in cell_triangles(field, row, column).into_iter().flatten() {
                if let Some(t) = sheared.crossing(vertices) {
                    line.push(t, triangle::normal(vertices), hits);
                }
            }
        }
    }
}

/// Column and row at a place, with the part of the cell: columns run along x, rows along z.
fn grid_place(field: &HeightField, place: DVec3) -> [f64; 2] {
    let scale = field.scale().as_dvec3();
    [
        (place.x / scale.x + 0.5) * field.ncols() as f64,
        (place.z / scale.z + 0.5) * field.nrows() as f64,
    ]
}

/// Part of a cell by which ranges of cells are grown against rounding in `f32`. Half or twice: no test of shapes or
/// queries fails.
const CELL_MARGIN: f64 = 1e-3;

/// The cells between two grid coordinates, in either order.
fn cells(a: f64, b: f64, count: usize) -> std::ops::RangeInclusive<usize> {
    let last = count.saturating_sub(1);
    let first = (a.min(b) - CELL_MARGIN).floor().max(0.0) as usize;
    let end = (a.max(b) + CELL_MARGIN).floor().max(0.0) as usize;
    first.min(last)..=end.min(last)
}

/// How far a point is outside of a box along each axis; 0 inside.
fn outside(aabb: &Aabb, point: DVec3) -> DVec3 {
    let [mins, maxs] = [aabb.mins, aabb.maxs].map(|corner| corner.as_dvec3());
    (mins - point).max(point - maxs).max(DVec3::ZERO)
}

fn cell_bounds(field: &HeightField, row: usize, column: usize) -> Aabb {
    let at = |i: usize, j: usize| {
        let height = field.heights()[(i, j)] * field.scale().y;
        Vec3::new(field.x_at(j), height, field.z_at(i))
    };
    let corner = |k: usize| at(row + k % 2, column + k / 2);
    let corners = [0, 1, 2, 3].map(corner);
    Aabb::new(
        corners.into_iter().fold(Vec3::INFINITY, Vec3::min),
        corners.into_iter().fold(Vec3::NEG_INFINITY, Vec3::max),
    )
}

/// Searches the cells in rings around that below the point, until those that are left are farther than the nearest
/// triangle found.
pub(super) fn project_on_height_field(field: &HeightField, point: DVec3) -> Projection {
    let counts = [field.ncols(), field.nrows()];
    let edge = f64::from(field.cell_width().min(field.cell_height()));
    let above = outside(field.root_aabb(), point).y;
    let place = grid_place(field, point);
    let below = [0, 1].map(|k| *cells(place[k], place[k], counts[k]).start());
    let mut nearest = (f64::INFINITY, None);
    for ring in 0..counts[0].max(counts[1]) {
        let beside = (edge * (ring as f64 - 1.0 - CELL_MARGIN)).max(0.0);
        if beside * beside + above * above > nearest.0 {
            break;
        }
        for [column, row] in ring_around(below, ring, counts) {
            let bounds = cell_bounds(field, row, column);
            if outside(&bounds, point).length_squared() > nearest.0 {
                continue;
            }
            for vertices in cell_triangles(field, row, column).into_iter().flatten() {
                let foot = triangle::nearest(point, vertices);
                if foot.distance_squared(point) < nearest.0 {
                    nearest = (foot.distance_squared(point), Some(foot));
                }
            }
        }
    }
    let Some(foot) = nearest.1 else {
        // All triangles are removed.
        return (f64::INFINITY, DVec3::Y);
    };
    let margin = margin_of(field.root_aabb());
    let [column, row] = grid_place(field, foot);
    let around = cells(column, column, counts[0])
        .flat_map(|j| cells(row, row, counts[1]).map(move |i| (i, j)));
    let normals = around
        .flat_map(|(i, j)| cell_triangles(field, i, j).into_iter().flatten())
        .filter(|&vertices| foot.distance(triangle::nearest(foot, vertices)) <= margin)
        .map(triangle::normal);
    signed(point, foot, normals)
}

/// The cells, as column and row, that are `ring` cells away from `middle` along one axis, and not farther along the other.
fn ring_around(
    middle: [usize; 2],
    ring: usize,
    counts: [usize; 2],
) -> impl Iterator<Item = [usize; 2]> {
    let [column, row] = middle;
    let rows = row.saturating_sub(ring)..=(row + ring).min(counts[1] - 1);
    rows.flat_map(move |j| {
        let is_end = j.abs_diff(row) == ring;
        let step = if is_end { 1 } else { 2 * ring };
        let columns = (column..=column + 2 * ring).step_by(step);
        let columns = columns.filter_map(move |c| c.checked_sub(ring));
        columns.filter(move |&i| i < counts[0]).map(move |i| [i, j])
    })
}
