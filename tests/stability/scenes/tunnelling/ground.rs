//! How high the surface is that a body must not pass, whatever a method makes of its points.

use std::f32::consts::TAU;
use tldi::glamx::{Vec2, Vec3, Vec3Swizzles};

/// Frequency of waves in Hz; amplitude and wavelength in mean radii of the sheet.
const WAVE_FREQUENCY: f32 = 2.0;
pub(super) const WAVE_AMPLITUDE: f32 = 2.0;
const WAVE_LENGTH: f32 = 14.0;

/// Points of a scan this near, in mean radii, tell its height together: about a dozen.
const AROUND: f32 = 2.0;

/// Places on a step's way between which a surface may be passed.
const WAY_SAMPLES: u32 = 256;

/// A surface about the plane y = 0, its points `radius` metres large.
pub(super) enum Ground {
    /// The plane.
    Flat,
    /// A travelling wave.
    Waves { radius: f32, phase: f32 },
    /// What the points of a scan are samples of.
    Scan { radius: f32, points: Vec<Vec3> },
}

impl Ground {
    /// Height at a place (x, z) in metres and a time in seconds.
    pub(super) fn height(&self, at: Vec2, seconds: f32) -> f32 {
        match self {
            Self::Flat => 0.0,
            Self::Waves { radius, phase } => {
                let number = TAU / (WAVE_LENGTH * radius);
                let phase = phase + TAU * WAVE_FREQUENCY * seconds;
                WAVE_AMPLITUDE * radius * (number * at.x + phase).sin() * (number * at.y).cos()
            }
            Self::Scan { radius, points } => {
                let reach = AROUND * radius;
                let near = points.iter().filter(|p| p.xz().distance(at) <= reach);
                let (sum, count) = near.fold((0.0, 0.0), |(sum, n), p| (sum + p.y, n + 1.0));
                if count > 0.0 { sum / count } else { 0.0 }
            }
        }
    }

    /// How far a place in space is over it, metres.
    pub(super) fn over(&self, at: Vec3, seconds: f32) -> f32 {
        at.y - self.height(at.xz(), seconds)
    }

    /// How far it is from the plane at most, metres.
    fn relief(&self) -> f32 {
        match self {
            Self::Flat => 0.0,
            Self::Waves { radius, .. } => WAVE_AMPLITUDE * radius,
            Self::Scan { points, .. } => points.iter().fold(0.0, |m, p| p.y.abs().max(m)),
        }
    }

    /// The first place on the straight way between two that is under the surface.
    pub(super) fn crossing(&self, from: Vec3, to: Vec3, seconds: f32) -> Option<Vec3> {
        let rise = to.y - from.y;
        // Where the surface may be as high as the way; a plane is not met to the bit.
        let relief = self.relief().max(1e-3 * rise.abs());
        let [mut start, mut end] = match rise {
            0.0 => [0.0, 1.0],
            _ => [relief, -relief].map(|y| ((y - from.y) / rise).clamp(0.0, 1.0)),
        };
        if start > end {
            (start, end) = (end, start);
        }
        let share = |k: u32| start + (end - start) * k as f32 / WAY_SAMPLES as f32;
        (0..=WAY_SAMPLES)
            .map(|k| from.lerp(to, share(k)))
            .chain([to])
            .find(|place| self.over(*place, seconds) < 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that dives through a crest and comes out behind it is under the wave at the crest, not
    /// where its heights over the wave before and after make it.
    #[test]
    fn a_wave_is_passed_where_it_first_is_higher() {
        let waves = Ground::Waves {
            radius: 1.0,
            phase: 0.0,
        };
        // The first crest is at a quarter of the wavelength.
        let from = Vec3::new(-3.5, 1.0, 0.0);
        let crossing = waves.crossing(from, Vec3::new(10.5, -2.5, 0.0), 0.0);
        let at = crossing.expect("it ends under the wave's trough");
        assert!(at.x > 0.0 && at.x < 1.0, "{at}");
        assert!(waves.over(at, 0.0).abs() < 0.1, "{at}");
        assert!(waves.crossing(from, from + 5.0 * Vec3::Y, 0.0).is_none());
    }

    #[test]
    fn a_plane_is_passed_where_it_is() {
        let (from, to) = (Vec3::new(-1.0, 0.3, 0.0), Vec3::new(6.0, -1.8, 7.0));
        let at = Ground::Flat.crossing(from, to, 0.0).expect("it ends under");
        assert!((at - Vec3::new(0.0, 0.0, 1.0)).length() < 0.02, "{at}");
    }

    /// In a dent of a scan a body's middle may be lower than the scan is on average.
    #[test]
    fn a_scan_is_as_low_as_its_points() {
        let dent = |p: Vec2| -2.0 * (-p.length_squared() / 18.0).exp();
        let points = (0..900).map(|k| Vec2::new((k % 30) as f32, (k / 30) as f32) - 14.5);
        let scan = Ground::Scan {
            radius: 1.0,
            points: points.map(|p| Vec3::new(p.x, dent(p), p.y)).collect(),
        };
        assert!(scan.over(Vec3::new(0.0, -1.0, 0.0), 0.0) > 0.5);
        assert!(scan.over(Vec3::new(12.0, -1.0, 0.0), 0.0) < -0.9);
        let fall = scan.crossing(Vec3::new(0.0, 3.0, 0.0), Vec3::new(0.0, -3.0, 0.0), 0.0);
        let at = fall.expect("it ends under the scan");
        assert!((at.y + 1.9).abs() < 0.3, "{at}");
    }
}
