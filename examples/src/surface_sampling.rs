//! Scatters points evenly over a surface that is given by its signed distance.

use fastrand::Rng;
use std::collections::HashMap;
use tldi::Aabb;
use tldi::glamx::Vec3;

/// Points scattered over a surface, with what is known about each.
#[derive(Clone, Debug, Default)]
pub struct SampledSurface {
    /// Positions in metres.
    pub points: Vec<Vec3>,
    /// Outward unit normals, one for each point.
    pub normals: Vec<Vec3>,
    /// Colours (red, green, blue, alpha), one for each point; none where the scene gives none.
    pub colors: Vec<[u8; 4]>,
}

/// Scatters points over the part of the surface `distance(p) = 0` inside `bounds`: no two are
/// nearer to each other than 0.7 × `spacing`, and hardly any gap is wider than 1.4 × `spacing`.
///
/// `distance` is the signed distance to the surface in metres, or a bound of it that is no larger;
/// its gradient must not vanish near the surface. Costs time in proportion to the surface's area.
///
/// ```
/// use tldi::{Aabb, glamx::Vec3};
/// use tldi_examples::surface_sampling::sample_surface;
/// let bounds = Aabb { min: Vec3::splat(-1.1), max: Vec3::splat(1.1) };
/// let ball = sample_surface(|p| p.length() - 1.0, bounds, 0.1, 7);
/// assert!(ball.points.iter().all(|p| (p.length() - 1.0).abs() < 1e-3));
/// ```
pub fn sample_surface(
    distance: impl Fn(Vec3) -> f32,
    bounds: Aabb,
    spacing: f32,
    seed: u64,
) -> SampledSurface {
    let mut sampler = Sampler {
        distance,
        bounds,
        cell: 0.6 * spacing,
        least_distance: 0.7 * spacing,
        rng: Rng::with_seed(seed),
        taken: HashMap::new(),
        surface: SampledSurface::default(),
    };
    let cells = (bounds.extents().max_element() / sampler.cell).max(1.0);
    let edge = sampler.cell * cells.log2().ceil().exp2();
    sampler.visit(bounds.min, edge);
    sampler.surface
}

struct Sampler<D> {
    distance: D,
    bounds: Aabb,
    /// Edge in metres of the smallest cubes, each of which gets a try.
    cell: f32,
    least_distance: f32,
    rng: Rng,
    /// The points taken, in cubes of `least_distance`.
    taken: HashMap<[i32; 3], Vec<Vec3>>,
    surface: SampledSurface,
}

impl<D: Fn(Vec3) -> f32> Sampler<D> {
    /// Visits the cube with its lower corner at `min`: eight halves, down to the smallest cubes,
    /// as far as the surface passes through.
    fn visit(&mut self, min: Vec3, edge: f32) {
        let half_diagonal = 0.5 * 3.0f32.sqrt() * edge;
        let center = min + Vec3::splat(0.5 * edge);
        if (self.distance)(center).abs() > half_diagonal || !min.cmple(self.bounds.max).all() {
            return;
        }
        if edge <= self.cell * 1.5 {
            self.try_point(min, edge);
            return;
        }
        for octant in 0..8 {
            let corner = Vec3::new(
                (octant & 1) as f32,
                (octant >> 1 & 1) as f32,
                (octant >> 2) as f32,
            );
            self.visit(min + 0.5 * edge * corner, 0.5 * edge);
        }
    }

    fn try_point(&mut self, min: Vec3, edge: f32) {
        let rng = &mut self.rng;
        let mut point = min + edge * Vec3::new(rng.f32(), rng.f32(), rng.f32());
        let mut normal = Vec3::ZERO;
        let mut distance = (self.distance)(point);
        for _ in 0..8 {
            normal = self.gradient(point);
            point -= distance * normal;
            distance = (self.distance)(point);
            if distance.abs() < 0.01 * self.cell {
                break;
            }
        }
        let on_surface = distance.abs() < 0.02 * self.cell;
        if !on_surface || !self.bounds.contains(point) {
            return;
        }
        let key = (point / self.least_distance).floor().as_ivec3();
        let crowded = (0..27).any(|k| {
            let cube = [key.x + k % 3 - 1, key.y + k / 3 % 3 - 1, key.z + k / 9 - 1];
            self.taken.get(&cube).is_some_and(|points| {
                points
                    .iter()
                    .any(|other| other.distance(point) < self.least_distance)
            })
        });
        if crowded {
            return;
        }
        self.taken.entry(key.to_array()).or_default().push(point);
        self.surface.points.push(point);
        self.surface.normals.push(normal);
    }

    /// Unit direction in which the distance grows fastest, from the corners of a tetrahedron.
    fn gradient(&self, point: Vec3) -> Vec3 {
        let h = 0.05 * self.cell;
        let corners = [
            [1.0, 1.0, 1.0],
            [1.0, -1.0, -1.0],
            [-1.0, 1.0, -1.0],
            [-1.0, -1.0, 1.0],
        ];
        let weighted = corners.map(|corner| {
            let corner = Vec3::from(corner);
            (self.distance)(point + h * corner) * corner
        });
        weighted.into_iter().sum::<Vec3>().normalize_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_plane_are_evenly_spread() {
        let bounds = Aabb {
            min: Vec3::new(0.0, 0.0, -0.5),
            max: Vec3::new(1.0, 1.0, 0.5),
        };
        let plane = sample_surface(|p| p.z, bounds, 0.05, 3);
        // Discs of radius 0.35 × spacing do not overlap: at most 0.907 of the area (hexagonal
        // packing); random sequential packing saturates at 0.547, and 60 % of that is enough
        // for a surface without gaps.
        let covered = plane.points.len() as f32 * std::f32::consts::PI * 0.0175f32.powi(2);
        assert!((0.33..0.907).contains(&covered), "{covered}");
        for (k, p) in plane.points.iter().enumerate() {
            assert!(p.z.abs() < 1e-3);
            assert!(plane.normals[k].dot(Vec3::Z) > 0.999);
            assert!(plane.points[..k].iter().all(|q| q.distance(*p) >= 0.035));
        }
        for i in 0..20 {
            for j in 0..20 {
                let q = Vec3::new((i as f32 + 0.5) / 20.0, (j as f32 + 0.5) / 20.0, 0.0);
                assert!(
                    plane.points.iter().any(|p| p.distance(q) < 0.05),
                    "gap at {q}"
                );
            }
        }
    }
}
