//! Points on height fields: floors, ramps, waves, noisy scans of them.

use crate::Samples;
use tldi::glamx::{Vec2, Vec3};

/// A height field over a rectangle about the origin, sampled on a jittered grid that is known, so
/// that the same points can be meshed.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Points, row by row (x runs fastest), and true upward normals.
    pub samples: Samples,
    /// Points of a row.
    pub columns: usize,
}

impl Sheet {
    /// Samples `y = height(x, z)` over a rectangle of `size` metres (x, z), points about `spacing`
    /// metres apart and moved at random by up to 0.3 `spacing` along the sheet, the rim's only
    /// along the rim.
    pub fn sampled(
        size: Vec2,
        spacing: f32,
        rng: &mut fastrand::Rng,
        height: impl Fn(Vec2) -> f32,
    ) -> Self {
        let cells = (size / spacing).ceil().max(Vec2::ONE);
        let step = size / cells;
        let mut samples = Samples::default();
        for j in 0..=cells.y as usize {
            for i in 0..=cells.x as usize {
                let p = Vec2::new(i as f32, j as f32) * step - 0.5 * size;
                let jitter = 0.6 * step * Vec2::new(rng.f32() - 0.5, rng.f32() - 0.5);
                let p = (p + jitter).clamp(-0.5 * size, 0.5 * size);
                let h = 1e-2 * spacing;
                let slope = |d: Vec2| (height(p + d) - height(p - d)) / (2.0 * h);
                let normal = Vec3::new(-slope(Vec2::X * h), 1.0, -slope(Vec2::Y * h)).normalize();
                samples.points.push(Vec3::new(p.x, height(p), p.y));
                samples.normals.push(normal);
            }
        }
        Self {
            samples,
            columns: cells.x as usize + 1,
        }
    }

    /// Moves every point along its normal by a normally distributed distance, as range noise does.
    #[must_use]
    pub fn with_noise(mut self, deviation: f32, rng: &mut fastrand::Rng) -> Self {
        for (p, n) in self.samples.points.iter_mut().zip(&self.samples.normals) {
            *p += *n * (deviation * standard_normal(rng));
        }
        self
    }

    /// Two triangles for each cell of the grid, seen anticlockwise from above.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let rows = self.samples.points.len() / self.columns;
        let index = |i: usize, j: usize| (j * self.columns + i) as u32;
        (1..rows)
            .flat_map(|j| (1..self.columns).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b] = [index(i - 1, j - 1), index(i, j - 1)];
                let [c, d] = [index(i - 1, j), index(i, j)];
                [[a, c, b], [b, c, d]]
            })
            .collect()
    }
}

/// A normally distributed number of mean 0 and deviation 1 (Box and Muller).
pub fn standard_normal(rng: &mut fastrand::Rng) -> f32 {
    let radius = (-2.0 * (1.0 - rng.f64()).ln()).sqrt();
    (radius * (std::f64::consts::TAU * rng.f64()).cos()) as f32
}
