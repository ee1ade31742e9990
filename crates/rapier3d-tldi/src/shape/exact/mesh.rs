//! Triangle meshes and height fields.

use super::line::Line;
use super::projection::Projection;
use super::triangle::{self, ShearedLine};
use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::parry::partitioning::BvhNode;
use rapier3d::parry::query::PointQuery;
use rapier3d::parry::shape::{HeightField, TriMesh, TriMeshFlags, Triangle};
use tldi::RayHit;

/// Part of a mesh's size by which boxes are grown against rounding in `f32`. Half or twice: no test of shapes or
/// queries fails.
const ROUNDING: f64 = 1e-6;

pub(super) fn cross_triangle(shape: &Triangle, line: &Line, hits: &mut Vec<RayHit>) {
    let vertices = triangle::vertices(shape);
    if let Some(t) = ShearedLine::new(line).crossing(vertices) {
        line.push(t, triangle::normal(vertices), hits);
    }
}

pub(super) fn cross_trimesh(mesh: &TriMesh, line: &Line, hits: &mut Vec<RayHit>) {
    let sheared = ShearedLine::new(line);
    let aabb = mesh.local_aabb();
    let margin = ROUNDING * f64::from(aabb.mins.abs().max(aabb.maxs.abs()).max_element());
    let near = |node: &BvhNode| {
        let margin = DVec3::splat(margin);
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
        |node: &BvhNode, _| node.aabb().distance_to_local_point(p, true),
        |id, _| {
            let vertices = triangle::vertices(&mesh.triangle(id));
            Some(point.distance(triangle::nearest(point, vertices)) as f32)
        },
    );
    let Some((id, _)) = nearest else {
        // Only a point that is not finite has no nearest triangle.
        return (f64::INFINITY, DVec3::Y);
    };
    let foot = triangle::nearest(point, triangle::vertices(&mesh.triangle(id)));
    let margin = ROUNDING * foot.abs().max_element();
    let touches = |node: &BvhNode| {
        let aabb = node.aabb();
        let gap = (aabb.mins.as_dvec3() - foot).max(foot - aabb.maxs.as_dvec3());
        gap.max_element() <= margin
    };
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
    if delta.length() <= 1e-12 * point.length() || height == 0.0 {
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
    let margin =
        DVec3::splat(ROUNDING * f64::from(aabb.mins.abs().max(aabb.maxs.abs()).max_element()));
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
    let scale = field.scale().as_dvec3();
    // Grid coordinates along the line: columns run along x, rows along z.
    let column_at = |t: f64| (line.at(t).x / scale.x + 0.5) * field.ncols() as f64;
    let row_at = |t: f64| (line.at(t).z / scale.z + 0.5) * field.nrows() as f64;
    for column in cells(column_at(entry), column_at(exit), field.ncols()) {
        // The part of the line over this column.
        let (c0, c1) = (column_at(entry), column_at(exit));
        let (mut t0, mut t1) = (entry, exit);
        if c0 != c1 {
            let t_at = |c: f64| entry + (exit - entry) * ((c - c0) / (c1 - c0)).clamp(0.0, 1.0);
            let (ta, tb) = (
                t_at(column as f64 - CELL_MARGIN),
                t_at(column as f64 + 1.0 + CELL_MARGIN),
            );
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

pub(super) fn project_on_height_field(field: &HeightField, point: DVec3) -> Projection {
    let p = point.as_vec3();
    // parry finds the nearest point within f32 rounding; the triangles around it make it exact.
    let guess = field.project_local_point(p, false).point.as_dvec3();
    let aabb = field.root_aabb();
    let margin = ROUNDING * f64::from(aabb.mins.abs().max(aabb.maxs.abs()).max_element());
    let scale = field.scale().as_dvec3();
    let column = (guess.x / scale.x + 0.5) * field.ncols() as f64;
    let row = (guess.z / scale.z + 0.5) * field.nrows() as f64;
    let around = || {
        let columns = cells(column, column, field.ncols());
        columns.flat_map(move |j| {
            cells(row, row, field.nrows())
                .flat_map(move |i| cell_triangles(field, i, j).into_iter().flatten())
        })
    };
    let foot = around()
        .map(|vertices| triangle::nearest(point, vertices))
        .min_by(|a, b| {
            a.distance_squared(point)
                .total_cmp(&b.distance_squared(point))
        });
    let Some(foot) = foot else {
        return (point.distance(guess), DVec3::Y);
    };
    let normals = around()
        .filter(|&vertices| foot.distance(triangle::nearest(foot, vertices)) <= margin)
        .map(triangle::normal);
    signed(point, foot, normals)
}
