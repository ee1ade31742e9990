//! Pairs of clouds to compare, as a sensor could have handed them over this very frame.

use crate::placements::{Placement, Source};
use tldi::glamx::{Pose3, Vec3};
use tldi::{CloudError, PairQuery, Params, PointCloud, Surface};
use tldi_tests::{aimed, standard_normal};

/// What is told of the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Positions alone.
    Bare,
    /// With outward normals.
    Normals,
    /// Positions with noise of half a mean radius, which is told.
    Noisy,
}

impl Kind {
    /// All.
    pub const ALL: [Self; 3] = [Self::Bare, Self::Normals, Self::Noisy];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bare => "bare",
            Self::Normals => "normals",
            Self::Noisy => "noisy",
        }
    }
}

/// Two bodies with new points.
pub struct Scene {
    /// Positions of each, metres, in one frame.
    pub points: [Vec<Vec3>; 2],
    normals: Option<[Vec<Vec3>; 2]>,
    radius: f32,
    noise: f32,
    clouds: [PointCloud<'static>; 2],
}

/// Neighbours for normals: those of the smallest usual number, since there is no noise.
const NEIGHBOURS: usize = 8;

impl Scene {
    /// Generated bodies with so many points (the scan, of a body on a scan).
    pub fn new(
        placement: Placement,
        count: usize,
        kind: Kind,
        seed: u64,
    ) -> Result<Self, CloudError> {
        let source = Source::Generated(count);
        let radius = source.radius(placement)?;
        let mut points = source.bodies(placement, radius, seed);
        let noise = match kind {
            Kind::Noisy => 0.5 * radius,
            Kind::Bare | Kind::Normals => 0.0,
        };
        let normals = match kind {
            Kind::Normals => {
                let is_sheet = placement == Placement::BodyOnScan;
                let [a, b] = &points;
                Some([outward(a, radius, is_sheet)?, outward(b, radius, false)?])
            }
            Kind::Bare | Kind::Noisy => None,
        };
        if noise > 0.0 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let mut off = || noise * standard_normal(&mut rng);
            for p in points.iter_mut().flatten() {
                *p += Vec3::new(off(), off(), off());
            }
        }
        let clouds = clouds(&points, normals.as_ref(), radius, noise)?;
        Ok(Self {
            points,
            normals,
            radius,
            noise,
            clouds,
        })
    }

    /// The same points as a new frame: nothing is known of them.
    pub fn renew(&mut self) -> Result<(), CloudError> {
        self.clouds = clouds(&self.points, self.normals.as_ref(), self.radius, self.noise)?;
        Ok(())
    }

    /// Both bodies.
    pub fn query(&self) -> PairQuery<'_> {
        let [a, b] = self.clouds.each_ref().map(Surface::Cloud);
        aimed(a, b, Pose3::IDENTITY, Params::for_radius(self.radius))
    }
}

fn clouds(
    points: &[Vec<Vec3>; 2],
    normals: Option<&[Vec<Vec3>; 2]>,
    radius: f32,
    noise: f32,
) -> Result<[PointCloud<'static>; 2], CloudError> {
    let cloud = |k: usize| {
        let builder = PointCloud::builder(points[k].clone());
        let builder = builder.radius(radius).noise(noise);
        match normals {
            Some(normals) => builder.normals(normals[k].clone()).build(),
            None => builder.build(),
        }
    };
    Ok([cloud(0)?, cloud(1)?])
}

/// Normals of the planes through neighbours, away from the middle, or upwards.
fn outward(points: &[Vec3], radius: f32, is_sheet: bool) -> Result<Vec<Vec3>, CloudError> {
    let builder = PointCloud::builder(points.to_vec()).radius(radius);
    let cloud = builder.pca_normals(NEIGHBOURS).build()?;
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    let normals = cloud.normals().unwrap_or_default().iter().zip(points);
    let turned = normals.map(|(normal, point)| {
        let outside = if is_sheet { Vec3::Y } else { *point - middle };
        match normal.dot(outside) < 0.0 {
            true => -*normal,
            false => *normal,
        }
    });
    Ok(turned.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normals of both bodies of each placement point outwards; noise is as large as is told.
    #[test]
    fn scenes_are_what_they_say() {
        for placement in Placement::ALL {
            let plain = Scene::new(placement, 2_000, Kind::Bare, 3).expect("valid points");
            let scene = Scene::new(placement, 2_000, Kind::Normals, 3).expect("valid points");
            assert_eq!(plain.points, scene.points);
            let normals = scene.normals.as_ref().expect("it has normals");
            for (points, normals) in scene.points.iter().zip(normals) {
                assert_eq!(points.len(), normals.len());
            }
            // A ball's bumps are flat: no normal is more than 60° off its ray from the middle.
            let body = &scene.points[1];
            let middle = body.iter().sum::<Vec3>() / body.len() as f32;
            let outside = |(p, n): (&Vec3, &Vec3)| n.dot((*p - middle).normalize()) > 0.5;
            let share = body
                .iter()
                .zip(&normals[1])
                .filter(|of| outside(*of))
                .count() as f32
                / body.len() as f32;
            assert!(share > 0.98, "{}: {share}", placement.name());

            let noisy = Scene::new(placement, 2_000, Kind::Noisy, 3).expect("valid points");
            let off = plain.points[0].iter().zip(&noisy.points[0]);
            let squares: f32 = off.map(|(p, q)| p.distance_squared(*q)).sum();
            let deviation = (squares / (3.0 * 2_000.0)).sqrt() / noisy.radius;
            // Four standard deviations of 6000 squares.
            assert!((deviation - 0.5).abs() < 0.02, "{deviation}");
        }
    }
}
