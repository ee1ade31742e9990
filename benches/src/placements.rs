//! Bodies as they lie to each other in the frames that are timed. All points are new in every frame.

use crate::model::Model;
use crate::{BUMP, SHEET_EDGE, bumpy_sheet, covering_radius, random_body};
use std::f32::consts::PI;
use tldi::glamx::Vec3;
use tldi::{Aabb, CloudError, PointCloud};

/// How two bodies lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// Their bounds are six radii apart.
    NearMiss,
    /// Side by side along x, 3 % of the width in each other.
    Slight,
    /// 40 % of the width in each other.
    Deep,
    /// One is where the other is.
    Coincident,
    /// A small body, sunk by two radii into a bumpy scan of 2 m. Points are as dense on both.
    BodyOnScan,
}

impl Placement {
    /// All.
    pub const ALL: [Self; 5] = [
        Self::NearMiss,
        Self::Slight,
        Self::Deep,
        Self::Coincident,
        Self::BodyOnScan,
    ];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::NearMiss => "near-miss",
            Self::Slight => "slight",
            Self::Deep => "deep",
            Self::Coincident => "coincident",
            Self::BodyOnScan => "body on scan",
        }
    }

    /// The one of that name.
    pub fn named(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|p| p.name() == name);
        found.ok_or_else(|| format!("there is no placement {name:?}"))
    }

    /// Distance of the bodies' middles along x, in their widths; and by how many radii more.
    fn offset(self) -> [f32; 2] {
        match self {
            Self::NearMiss => [1.0, 6.0],
            Self::Slight => [0.97, 0.0],
            Self::Deep => [0.6, 0.0],
            Self::Coincident | Self::BodyOnScan => [0.0, 0.0],
        }
    }
}

/// Where points come from.
pub enum Source<'a> {
    /// A bumpy ball of about 1 m, this many random points on each.
    Generated(usize),
    /// This many random points on the faces of a model, or near its points where it has none.
    Sampled(&'a Model, usize),
    /// The vertices of a model, in their order, each moved a little.
    Vertices(&'a Model),
}

impl Source<'_> {
    /// What the points are of.
    pub fn name(&self) -> &str {
        match self {
            Self::Generated(_) => "bumpy ball (generated)",
            Self::Sampled(model, _) | Self::Vertices(model) => &model.name,
        }
    }

    /// Points of each body.
    pub fn count(&self) -> usize {
        match self {
            Self::Generated(count) | Self::Sampled(_, count) => *count,
            Self::Vertices(model) => model.points.len(),
        }
    }

    /// Mean radius of the points of both bodies, metres.
    pub fn radius(&self, placement: Placement) -> Result<f32, CloudError> {
        if placement == Placement::BodyOnScan {
            return Ok(covering_radius(self.count(), SHEET_EDGE * SHEET_EDGE));
        }
        Ok(match self {
            Self::Generated(count) => covering_radius(*count, 4.0 * PI),
            Self::Sampled(..) | Self::Vertices(_) => {
                let cloud = PointCloud::builder(self.points(0)).knn_radii(7, 0.65);
                cloud.build()?.mean_radius()
            }
        })
    }

    /// Points of a body in one frame.
    pub fn points(&self, seed: u64) -> Vec<Vec3> {
        let mut rng = fastrand::Rng::with_seed(seed);
        match self {
            Self::Generated(count) => random_body(*count, seed),
            Self::Sampled(model, count) if !model.faces.is_empty() => {
                on_faces(model, *count, &mut rng)
            }
            Self::Sampled(model, count) => {
                let jitter = 0.2 * covering_radius(model.points.len(), 8.0);
                let any = |_| model.points[rng.usize(..model.points.len())];
                let picked: Vec<Vec3> = (0..*count).map(any).collect();
                jittered(picked, jitter, &mut rng)
            }
            Self::Vertices(model) => {
                let jitter = 0.02 * covering_radius(model.points.len(), 8.0);
                jittered(model.points.clone(), jitter, &mut rng)
            }
        }
    }

    /// Both bodies in one frame, with balls of this radius, metres.
    pub fn bodies(&self, placement: Placement, radius: f32, seed: u64) -> [Vec<Vec3>; 2] {
        if placement == Placement::BodyOnScan {
            return body_on_scan(self, seed);
        }
        let a = self.points(2 * seed);
        let mut b = self.points(2 * seed + 1);
        let [widths, radii] = placement.offset();
        let width = bounds(&a).extents().x;
        let shift = (widths * width + radii * radius) * Vec3::X;
        b.iter_mut().for_each(|p| *p += shift);
        [a, b]
    }
}

/// Size of the small body, of which others are 2.
const SMALL: f32 = 0.2;

fn body_on_scan(source: &Source, seed: u64) -> [Vec<Vec3>; 2] {
    let count = source.count();
    let scan = bumpy_sheet(count, false, 2 * seed);
    // As dense as the scan, on the surface of a ball of the same size.
    let share = PI * SMALL * SMALL / (SHEET_EDGE * SHEET_EDGE);
    let small = ((share * count as f32) as usize).max(100);
    let mut body = match source {
        Source::Generated(_) => random_body(small, 2 * seed + 1),
        Source::Sampled(model, _) | Source::Vertices(model) => {
            Source::Sampled(model, small).points(2 * seed + 1)
        }
    };
    body.iter_mut().for_each(|p| *p *= 0.5 * SMALL);
    // A crest of the bumps, which are as high as `BUMP`.
    let quarter_wave = SHEET_EDGE / 12.0;
    let sunk = 2.0 * scan.mean_radius();
    let rise = BUMP - sunk - bounds(&body).min.y;
    body.iter_mut()
        .for_each(|p| *p += Vec3::new(quarter_wave, rise, 0.0));
    [scan.points().to_vec(), body]
}

/// Random points, evenly over the area.
fn on_faces(model: &Model, count: usize, rng: &mut fastrand::Rng) -> Vec<Vec3> {
    let corners = |face: &[u32; 3]| face.map(|i| model.points[i as usize]);
    let mut total = 0.0;
    let areas_up_to: Vec<f64> = model
        .faces
        .iter()
        .map(|face| {
            let [a, b, c] = corners(face);
            total += f64::from((b - a).cross(c - a).length());
            total
        })
        .collect();
    (0..count)
        .map(|_| {
            let at = total * rng.f64();
            let face = areas_up_to.partition_point(|area| *area < at);
            let [a, b, c] = corners(&model.faces[face.min(model.faces.len() - 1)]);
            let (mut u, mut v) = (rng.f32(), rng.f32());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            a + u * (b - a) + v * (c - a)
        })
        .collect()
}

fn jittered(mut points: Vec<Vec3>, jitter: f32, rng: &mut fastrand::Rng) -> Vec<Vec3> {
    let mut off = || jitter * (rng.f32() - 0.5);
    for p in &mut points {
        *p += Vec3::new(off(), off(), off());
    }
    points
}

/// Bounds of points.
pub fn bounds(points: &[Vec3]) -> Aabb {
    points.iter().fold(Aabb::EMPTY, |all, p| all.including(*p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peers::{Culled, Frame, Grid, Peer};

    /// By balls of twice the radius, which cover gaps of random points.
    fn touches(source: &Source, placement: Placement, radius: f32) -> bool {
        let [a, b] = source.bodies(placement, radius, 3);
        let frame = Frame::new(&a, &b, 2.0 * radius);
        Culled::new(Grid::default()).compare(&frame).collides
    }

    #[test]
    fn bodies_touch_where_they_should() {
        let model = Model::generated(2_000);
        let cloud = Model {
            faces: Vec::new(),
            ..Model::generated(2_000)
        };
        for source in [
            Source::Generated(5_000),
            Source::Sampled(&model, 5_000),
            Source::Sampled(&cloud, 5_000),
            Source::Vertices(&model),
        ] {
            for placement in Placement::ALL {
                let radius = source.radius(placement).expect("the points are finite");
                let expected = placement != Placement::NearMiss;
                assert_eq!(
                    touches(&source, placement, radius),
                    expected,
                    "{} {}",
                    source.name(),
                    placement.name()
                );
            }
            let [first, again, next] = [1, 1, 2].map(|seed| {
                // Its radius only decides on how far apart bodies nearly miss each other.
                source.bodies(Placement::Deep, 0.0, seed)
            });
            assert_eq!(first, again);
            assert!(first[0][0] != next[0][0] && first[0][0] != first[1][0]);
            assert_eq!(first[0].len(), source.count());
        }
    }

    /// Balls that peers are given are as large as the points of both bodies are apart.
    #[test]
    fn radii_are_those_of_the_points() {
        let source = Source::Generated(20_000);
        for placement in Placement::ALL {
            let radius = source.radius(placement).expect("the points are finite");
            for points in source.bodies(placement, radius, 1) {
                let cloud = PointCloud::builder(points).knn_radii(7, 0.65).build();
                let of_neighbours = cloud.expect("the points are finite").mean_radius();
                // Of the radius that holds 8 random points on average, that to the 7th neighbour is
                // Γ(7.5) / Γ(7) / √8 on average; bumps have a little more area.
                let share = of_neighbours / radius;
                assert!(
                    (share - 0.919).abs() < 0.02,
                    "{}: {share}",
                    placement.name()
                );
            }
        }
    }

    /// A triangle that is one and a half times larger gets as many more points; all lie in their planes.
    #[test]
    fn points_are_even_on_faces() {
        let points = [
            [0.0, 0.0, 0.0],
            [3.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 2.0, 0.0],
            [-1.0, 2.0, 0.0],
            [0.0, 2.0, 2.0],
        ];
        let model = Model {
            name: "two triangles".to_owned(),
            points: points.map(Vec3::from_array).to_vec(),
            faces: vec![[0, 1, 2], [3, 4, 5]],
        };
        let sampled = on_faces(&model, 40_000, &mut fastrand::Rng::with_seed(1));
        let large = sampled.iter().filter(|p| p.y == 0.0).count();
        // Five standard deviations of a binomial of 40,000 × 3/5.
        assert!((23_510..24_490).contains(&large), "{large}");
        for p in &sampled {
            let is_inside = match p.y {
                0.0 => p.x / 3.0 + p.z < 1.0 + 1e-5 && p.x >= 0.0,
                _ => p.y == 2.0 && 0.5 * p.z - p.x < 1.0 + 1e-5 && p.x <= 0.0,
            };
            assert!(is_inside && p.z >= 0.0, "{p}");
        }
        // The wider half of the larger one is three quarters of its area.
        let near = sampled.iter().filter(|p| p.y == 0.0 && p.x < 1.5).count();
        let share = near as f32 / large as f32;
        assert!((share - 0.75).abs() < 0.015, "{share}");
    }
}
