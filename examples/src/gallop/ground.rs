//! WavyGround that oscillates: a wave runs through a sheet of points.

use std::f32::consts::TAU;
use tldi::glamx::Vec3;

/// A sheet of points about the origin, y up. Lengths in metres, times in seconds.
#[derive(Clone, Copy, Debug)]
pub struct WavyGround {
    /// Half the length along x and half the width along z.
    pub half_size: [f32; 2],
    /// Distance of neighbouring points.
    pub spacing: f32,
    /// Height of the waves over the middle.
    pub amplitude: f32,
    /// Length of the waves.
    pub wavelength: f32,
    /// Time of one oscillation.
    pub period: f32,
}

impl WavyGround {
    /// Number of points along x and z.
    fn counts(&self) -> [usize; 2] {
        self.half_size
            .map(|half| 1 + (2.0 * half / self.spacing) as usize)
    }

    /// The surface over a place at a time, and its normal.
    pub fn surface(&self, x: f32, z: f32, time: f32) -> (Vec3, Vec3) {
        let wave = TAU / self.wavelength;
        let (sin, cos) = (wave * x - TAU * time / self.period).sin_cos();
        let (side_sin, side_cos) = (0.7 * wave * z).sin_cos();
        let height = self.amplitude * sin * side_cos;
        let slopes = self.amplitude * wave * Vec3::new(cos * side_cos, 0.0, -0.7 * sin * side_sin);
        (Vec3::new(x, height, z), (Vec3::Y - slopes).normalize())
    }

    /// The points and their normals at a time; always as many, in the same order. They move up and
    /// down only.
    pub fn at(&self, time: f32) -> (Vec<Vec3>, Vec<Vec3>) {
        let [columns, rows] = self.counts();
        let place = |k: usize| {
            let x = (k % columns) as f32 * self.spacing - self.half_size[0];
            let z = (k / columns) as f32 * self.spacing - self.half_size[1];
            self.surface(x, z, time)
        };
        (0..columns * rows).map(place).unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normals are across the differences of neighbouring points.
    #[test]
    fn normals_are_across_the_surface() {
        let ground = WavyGround {
            half_size: [1.0, 0.6],
            spacing: 0.01,
            amplitude: 0.05,
            wavelength: 0.8,
            period: 1.0,
        };
        let (points, normals) = ground.at(0.3);
        let columns = ground.counts()[0];
        for k in columns + 1..points.len() - columns - 1 {
            if k % columns == 0 || k % columns == columns - 1 {
                continue;
            }
            let along = (points[k + 1] - points[k - 1]).normalize();
            let across = (points[k + columns] - points[k - columns]).normalize();
            assert!(normals[k].dot(along).abs() < 1e-3 && normals[k].dot(across).abs() < 1e-3);
            assert!(normals[k].y > 0.5);
        }
    }
}
