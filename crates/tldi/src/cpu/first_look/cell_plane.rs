//! The plane of a cell, from sums over its points and those around it.

/// Least points of a cell and its neighbours: three tell a plane. Fewer stand alone. Half or twice: no row changes.
const LEAST_POINTS: f32 = 3.0;

/// Least spread of the points across their main direction, as a share of their squared spread over the pixels. Below it
/// they lie on a line and tell no plane, only a mean depth. Half or twice: no change.
const LEAST_SPREAD: f32 = 1e-2;

/// Sums over points, of 1, x, y, z, xx, xy, xz, yy, yz and zz.
pub(super) type Sums = [f32; 10];

/// Sums of points that are moved by [x, y, z].
#[inline(always)]
pub(super) fn moved(sums: &Sums, [x, y, z]: [f32; 3]) -> Sums {
    let [n, sx, sy, sz, xx, xy, xz, yy, yz, zz] = *sums;
    [
        n,
        sx + n * x,
        sy + n * y,
        sz + n * z,
        xx + x * (2.0 * sx + n * x),
        xy + x * sy + y * (sx + n * x),
        xz + x * sz + z * (sx + n * x),
        yy + y * (2.0 * sy + n * y),
        yz + y * sz + z * (sy + n * y),
        zz + z * (2.0 * sz + n * z),
    ]
}

/// A plane through a cell, in steps of coordinates.
#[derive(Clone, Copy)]
pub(super) struct CellPlane {
    /// Rise of the depth along columns and rows.
    pub(super) slope: [f32; 2],
    /// Depth at the middle of the pixel, from the cell's mean depth.
    pub(super) above: f32,
    /// Mean squared distance of the points of the cell and its neighbours from it; infinite if they
    /// are too few.
    pub(super) variance: f32,
}

impl CellPlane {
    /// The plane of a cell with sums `own`. Its slope fits `all` best: the sums of the cell and its neighbours.
    pub(super) fn of(own: &Sums, all: &Sums) -> Self {
        let [n, x, y, z, xx, xy, xz, yy, yz, zz] = *all;
        let [x, y, z] = [x, y, z].map(|sum| sum / n);
        let (xx, xy, yy) = (xx / n - x * x, xy / n - x * y, yy / n - y * y);
        let (xz, yz, zz) = (xz / n - x * z, yz / n - y * z, zz / n - z * z);
        let determinant = xx * yy - xy * xy;
        let slope = match determinant > LEAST_SPREAD * (xx + yy).powi(2) {
            true => [
                (xz * yy - yz * xy) / determinant,
                (yz * xx - xz * xy) / determinant,
            ],
            false => [0.0; 2],
        };
        // Through its own points: those around it lie beside the plane where the surface bends.
        let [own_n, own_x, own_y, own_z, ..] = *own;
        Self {
            slope,
            above: (own_z - slope[0] * own_x - slope[1] * own_y) / own_n,
            variance: match n < LEAST_POINTS {
                true => f32::INFINITY,
                false => (zz - slope[0] * xz - slope[1] * yz).max(0.0),
            },
        }
    }
}
