//! Stage `normals`: a unit normal for each point that is modelled.
//!
//! Normals of the cloud are rotated; where it has none (all-new points), they are the directions
//! of least covariance of the neighbours in its [`Neighborhood`]. Points are sorted into a grid
//! with cells as large as that; all points of a cell share the candidates of its 27 cells, whose
//! moments are summed in lanes.

use crate::cpu::fold::{SpaceFold, is_coarse};
use crate::cpu::lanes::multiversioned;
use crate::cpu::normals::near_values::NearValues;
use crate::cpu::normals::planes::{Batch, LANES, Neighborhood, PartialMoments, Plane};
use crate::cpu::normals::sorted::Sorted;
use glamx::Vec3;

/// Memory of the stage, kept from call to call.
#[derive(Default)]
pub(crate) struct NormalScratch {
    fold: SpaceFold,
    pub(crate) sorted: Sorted,
    /// Coordinates of the points around a cell.
    candidates: NearValues<3>,
    batch: Batch,
    /// Of each sorted point the plane of its neighbourhood, where it was wanted.
    pub(crate) planes: Vec<Plane>,
}

/// Estimates normals at some of the points of `support`. `targets` gets their ids, and `normals`
/// their normals, in the order of the grid.
///
/// `support` are ids of points, `position` tells where the one of an id is, `wanted` whether the
/// normal at the k-th point of `support` is. Points that stand out from the plane of their neighbours are left out: flying
/// pixels of a depth camera close to a surface, dust on it.
/// Cost: linear in points but where they lie more densely than on a surface.
pub(crate) fn estimate(
    support: &[u32],
    position: impl Fn(u32) -> Vec3,
    wanted: impl Fn(usize) -> bool,
    around: &Neighborhood,
    scratch: &mut NormalScratch,
    targets: &mut Vec<u32>,
    normals: &mut Vec<Vec3>,
) {
    targets.clear();
    normals.clear();
    if support.is_empty() {
        scratch.sorted.entries.clear();
        return;
    }
    let radius = around.radius;
    scratch.sorted.put(support.iter().map(|&id| position(id)));
    let mut grid = scratch.sorted.grid(radius);
    if is_coarse(grid.inv_cell, radius) {
        let mut fold = std::mem::take(&mut scratch.fold);
        fold.find(radius, support.iter().map(|&id| position(id)));
        scratch
            .sorted
            .put(support.iter().map(|&id| fold.folded(position(id))));
        scratch.fold = fold;
        grid = scratch.sorted.grid(radius);
    }
    scratch.sorted.sort(support, wanted, &grid);
    let NormalScratch {
        sorted,
        candidates,
        batch,
        planes,
        ..
    } = scratch;
    planes.clear();
    planes.resize(sorted.entries.len(), Plane::UNKNOWN);
    let mut cell = u32::MAX;
    for k in sorted.wanted() {
        let entry = &sorted.entries[k as usize];
        if entry.cell != cell {
            cell = entry.cell;
            let out_of_reach = [f32::INFINITY; 3];
            candidates.gather(
                sorted.rows(cell as usize),
                &sorted.coordinates,
                out_of_reach,
            );
        }
        let sums = batch.push(k);
        moments(
            sorted.position(k as usize),
            radius * radius,
            candidates,
            sums,
        );
        if batch.is_full() {
            batch.solve(planes);
        }
    }
    batch.solve(planes);
    for (entry, plane) in sorted.entries.iter_mut().zip(planes) {
        if plane.stands_out(around) {
            entry.wanted = false;
            // Nor do others adopt it.
            *plane = Plane::UNKNOWN;
        } else if entry.wanted {
            targets.push(entry.id);
            normals.push(plane.normal);
        }
    }
}

multiversioned! {
/// Of the candidates within the neighbourhood of `p`. `out` gets all lanes: if they were added up here, compilers would make
/// scalars of them.
fn moments(p: Vec3, radius_squared: f32, candidates: &NearValues<3>, out: &mut PartialMoments) {
    let mut sums = [[0.0f32; LANES]; 10];
    let [x, y, z] = candidates.lanes();
    for ((x, y), z) in x.iter().zip(y).zip(z) {
        for l in 0..LANES {
            let (dx, dy, dz) = (x[l] - p.x, y[l] - p.y, z[l] - p.z);
            let near = dx * dx + dy * dy + dz * dz <= radius_squared;
            let keep = |d: f32| if near { d } else { 0.0 };
            let (dx, dy, dz) = (keep(dx), keep(dy), keep(dz));
            sums[0][l] += keep(1.0);
            sums[1][l] += dx;
            sums[2][l] += dy;
            sums[3][l] += dz;
            sums[4][l] += dx * dx;
            sums[5][l] += dx * dy;
            sums[6][l] += dx * dz;
            sums[7][l] += dy * dy;
            sums[8][l] += dy * dz;
            sums[9][l] += dz * dz;
        }
    }
    *out = sums;
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::point_normals::{covariance, least_variance_axis};
    use glamx::DVec3;

    /// Normals equal those of all neighbours by brute force in f64, and only those that are wanted
    /// are there.
    #[test]
    fn equal_brute_force() {
        let mut compared = 0;
        for seed in 0..40 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let offset = 10.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32());
            // Sheets that are flat, wavy or thick, and lines, whose normals are not unique.
            let thickness = if seed % 4 == 2 { 0.2 } else { 0.0 };
            let points: Vec<Vec3> = (0..300)
                .map(|_| {
                    let (x, y) = (rng.f32(), if seed % 4 == 0 { 0.0 } else { rng.f32() });
                    let wave = 0.1 * (5.0 * x).sin() * (seed % 2) as f32;
                    offset + Vec3::new(x, y, wave + thickness * rng.f32())
                })
                .collect();
            let radius = 0.1 + 0.1 * rng.f32();
            let support: Vec<u32> = (0..300).collect();
            let (mut targets, mut normals) = (vec![], vec![]);
            estimate(
                &support,
                |i| points[i as usize],
                |k| k % 3 == 1,
                // So noisy that nothing stands out.
                &Neighborhood { radius, noise: 1.0 },
                &mut NormalScratch::default(),
                &mut targets,
                &mut normals,
            );
            let mut sorted = targets.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq((0..300).filter(|i| i % 3 == 1)));
            for (&i, normal) in targets.iter().zip(&normals) {
                let p = points[i as usize];
                let near = points.iter().filter(|q| (**q - p).length() <= radius);
                let covariance = covariance(near.map(|q| (*q - p).as_dvec3()));
                assert!(normal.is_normalized(), "seed {seed}: {normal}");
                // No other direction varies less, but for what rounding makes of f32 coordinates
                // 10 from the origin, a millionth each. Where all directions vary nearly alike the
                // iteration ends before it has told them apart: it leaves 0.01 of the trace.
                let variance = |n: DVec3| n.dot(covariance * n);
                let least = variance(least_variance_axis(covariance));
                let tolerance = if thickness > 0.0 { 0.01 } else { 1e-4 };
                let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
                assert!(
                    variance(normal.as_dvec3()) <= least + tolerance * trace,
                    "seed {seed}: {normal}"
                );
                compared += 1;
            }
        }
        assert_eq!(compared, 4000);
    }

    /// Where points crowd, an even selection of them gives the normal.
    #[test]
    fn crowds_have_normals() {
        let mut rng = fastrand::Rng::with_seed(1);
        let points: Vec<Vec3> = (0..20_000)
            .map(|_| Vec3::new(rng.f32(), rng.f32(), 1e-3 * rng.f32()))
            .collect();
        let support: Vec<u32> = (0..20_000).collect();
        let (mut targets, mut normals) = (vec![], vec![]);
        estimate(
            &support,
            |i| points[i as usize],
            |k| k % 100 == 0,
            &Neighborhood {
                radius: 0.3,
                noise: 0.0,
            },
            &mut NormalScratch::default(),
            &mut targets,
            &mut normals,
        );
        assert_eq!(normals.len(), 200);
        // 1 mm of thickness over 0.3 m of radius with some hundred points.
        assert!(normals.iter().all(|n| n.z.abs() > 0.9999), "{normals:?}");
    }

    /// Ids of the points that get normals.
    fn with_normals(points: &[Vec3], noise: f32) -> Vec<u32> {
        let support: Vec<u32> = (0..points.len() as u32).collect();
        let (mut targets, mut normals) = (vec![], vec![]);
        estimate(
            &support,
            |i| points[i as usize],
            |_| true,
            &Neighborhood { radius: 3.0, noise },
            &mut NormalScratch::default(),
            &mut targets,
            &mut normals,
        );
        assert_eq!(targets.len(), normals.len());
        targets.sort_unstable();
        targets
    }

    /// A point above a flat, a wavy or a noisy sheet of mean radius 1 is left out, and no other of these sheets, but for
    /// three in a thousand of the noisy one; nor any of a pyramid or of a wire.
    #[test]
    fn what_stands_out_is_left_out() {
        let mut rng = fastrand::Rng::with_seed(5);
        let normal = |rng: &mut fastrand::Rng| (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0;
        for (wave, noise, told, most) in [
            (0.0, 0.0, 0.0, 0),
            (1.0, 0.0, 0.0, 0),
            (0.0, 0.1, 0.0, 3),
            (0.0, 0.1, 0.1, 3),
        ] {
            let mut sheet: Vec<Vec3> = (0..850)
                .map(|_| {
                    let (x, y) = (30.0 * rng.f32(), 30.0 * rng.f32());
                    Vec3::new(x, y, wave * (0.3 * x).sin() + noise * normal(&mut rng))
                })
                .collect();
            for height in [0.0, 1.0, 1.5, 2.0, -2.0] {
                sheet.push(Vec3::new(15.0, 15.0, wave * 4.5f32.sin() + height));
                let found = with_normals(&sheet, told);
                let case = format!("wave {wave}, noise {noise}, told {told}, height {height}");
                assert_eq!(found.contains(&850), height == 0.0, "{case}");
                let others = found.iter().filter(|i| **i < 850).count();
                assert!(others >= 850 - most, "{case}: {others}");
                sheet.pop();
            }
        }
        // The square pyramid has its highest point on its tip.
        let pyramid: Vec<Vec3> = (-10..=10)
            .flat_map(|x: i32| (-10..=10).map(move |y: i32| [x, y]))
            .map(|[x, y]| Vec3::new(x as f32, y as f32, -(x.abs().max(y.abs()) as f32)))
            .collect();
        assert_eq!(with_normals(&pyramid, 0.0).len(), pyramid.len());
        let wire: Vec<Vec3> = (0..40).map(|k| k as f32 * Vec3::X).collect();
        assert_eq!(with_normals(&wire, 0.0).len(), wire.len());
    }
}
