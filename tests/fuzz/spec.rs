//! What is generated: few numbers that shrink, from which clouds and poses are made.

use proptest::collection::vec;
use proptest::prelude::*;
use tldi::glamx::{Pose3, Rot3, Vec3};
use tldi::{CloudError, NonFinite, PointCloud};
use tldi_tests::random_unit;

/// How points lie, in units of the cloud's scale.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Layout {
    Sheet,
    Sphere,
    Block,
    Line,
    Place,
    /// A sheet of which one half is ten times as coarse.
    Uneven,
}

/// What is done to one of the points.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Spoil {
    Nan,
    Infinite,
    /// As far as this power of ten of the scale.
    Outlier(i32),
    /// At the place of the first point.
    Double,
    /// Not zero, but with a square that is.
    Tiny,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum RadiusSpec {
    /// Of this share of the spacing.
    Even(f32),
    /// Any number, as a user may give it.
    Any(f32),
    Neighbors(usize, f32),
    /// Between the spacing and so many times as much.
    PerPoint(f32),
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum NormalSpec {
    None,
    Pca(usize, bool),
    Random,
    Zero,
    Outward,
}

#[derive(Clone, Debug)]
pub(crate) struct CloudSpec {
    pub(crate) layout: Layout,
    pub(crate) count: usize,
    /// Power of ten of the size in metres.
    pub(crate) exponent: i32,
    pub(crate) radius: RadiusSpec,
    pub(crate) normals: NormalSpec,
    pub(crate) spoils: Vec<(usize, Spoil)>,
    pub(crate) noise: f32,
    pub(crate) ordered: bool,
    pub(crate) refuses: bool,
    pub(crate) seed: u64,
}

/// Numbers that code forgets.
pub(crate) fn any_number() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => (-6..=6i32).prop_map(|e| 10f32.powi(e)),
        1 => any::<f32>(),
        1 => Just(0.0),
        1 => Just(-1.0),
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
        1 => Just(f32::MAX),
        1 => Just(1e-40),
    ]
}

fn radius(hostile: bool) -> BoxedStrategy<RadiusSpec> {
    let sound = prop_oneof![
        4 => (0.6..3.0f32).prop_map(RadiusSpec::Even),
        2 => Just(RadiusSpec::Neighbors(7, 0.65)),
        1 => (1.0..30.0f32).prop_map(RadiusSpec::PerPoint),
    ];
    match hostile {
        false => sound.boxed(),
        true => prop_oneof![
            4 => sound,
            1 => any_number().prop_map(RadiusSpec::Any),
            1 => (0..40usize, any_number()).prop_map(|(k, s)| RadiusSpec::Neighbors(k, s)),
        ]
        .boxed(),
    }
}

fn spoil(hostile: bool) -> BoxedStrategy<Spoil> {
    let sound = prop_oneof![
        Just(Spoil::Nan),
        Just(Spoil::Infinite),
        (0..=3i32).prop_map(Spoil::Outlier),
        Just(Spoil::Double),
    ];
    match hostile {
        false => sound.boxed(),
        true => prop_oneof![
            2 => sound,
            1 => (4..=38i32).prop_map(Spoil::Outlier),
            1 => Just(Spoil::Tiny),
        ]
        .boxed(),
    }
}

/// Clouds of this size in metres, a power of ten. `hostile`: with settings and points that should be refused.
pub(crate) fn cloud(
    exponent: impl Strategy<Value = i32>,
    hostile: bool,
) -> impl Strategy<Value = CloudSpec> {
    let layout = prop_oneof![
        3 => Just(Layout::Sheet),
        3 => Just(Layout::Sphere),
        2 => Just(Layout::Block),
        1 => Just(Layout::Line),
        1 => Just(Layout::Place),
        1 => Just(Layout::Uneven),
    ];
    let normals = prop_oneof![
        2 => Just(NormalSpec::None),
        2 => (2..20usize, any::<bool>()).prop_map(|(k, seen)| NormalSpec::Pca(k, seen)),
        1 => Just(NormalSpec::Random),
        1 => Just(NormalSpec::Zero),
        2 => Just(NormalSpec::Outward),
    ];
    let points = (layout, 1..400usize, exponent);
    let told = (
        radius(hostile),
        normals,
        vec((any::<prop::sample::Index>(), spoil(hostile)), 0..4),
    );
    let rest = (
        prop_oneof![4 => Just(0.0), 1 => any_number()],
        any::<[bool; 2]>(),
        any::<u64>(),
    );
    (points, told, rest).prop_map(
        move |((layout, count, exponent), (radius, normals, spoils), (noise, flags, seed))| {
            CloudSpec {
                layout,
                count,
                exponent,
                radius,
                normals,
                spoils: spoils
                    .into_iter()
                    .map(|(i, s)| (i.index(count), s))
                    .collect(),
                noise: if hostile { noise } else { 0.0 },
                ordered: flags[0],
                refuses: hostile && flags[1],
                seed,
            }
        },
    )
}

impl CloudSpec {
    pub(crate) fn scale(&self) -> f32 {
        10f32.powi(self.exponent)
    }

    /// Distance of the points, about, metres.
    pub(crate) fn spacing(&self) -> f32 {
        let along = match self.layout {
            Layout::Line => self.count as f32,
            _ => (self.count as f32).sqrt(),
        };
        self.scale() / along.max(1.0)
    }

    pub(crate) fn points(&self) -> Vec<Vec3> {
        let mut rng = fastrand::Rng::with_seed(self.seed);
        let edge = (self.count as f32).sqrt().ceil().max(2.0);
        let mut unit = |k: usize| {
            let (i, j) = (k as f32 % edge, (k as f32 / edge).floor());
            let at = Vec3::new(i / (edge - 1.0) - 0.5, 0.0, j / (edge - 1.0) - 0.5);
            match self.layout {
                Layout::Sheet => at,
                Layout::Sphere => 0.5 * random_unit(&mut rng),
                Layout::Block => Vec3::from_array(std::array::from_fn(|_| rng.f32() - 0.5)),
                Layout::Line => Vec3::splat(k as f32 / self.count as f32 - 0.5),
                Layout::Place => Vec3::new(0.1, 0.2, 0.3),
                Layout::Uneven if !k.is_multiple_of(2) => 10.0 * at,
                Layout::Uneven => at,
            }
        };
        let mut points: Vec<Vec3> = (0..self.count).map(|k| self.scale() * unit(k)).collect();
        for (i, spoil) in &self.spoils {
            points[*i] = match spoil {
                Spoil::Nan => Vec3::new(0.0, f32::NAN, 0.0),
                Spoil::Infinite => Vec3::splat(f32::NEG_INFINITY),
                Spoil::Outlier(power) => {
                    10f32.powi(*power) * self.scale() * Vec3::new(0.6, 0.8, 0.1)
                }
                Spoil::Double => points[0],
                Spoil::Tiny => Vec3::splat(1e-30),
            };
        }
        points
    }

    pub(crate) fn build(&self) -> Result<PointCloud<'static>, CloudError> {
        let points = self.points();
        let mut rng = fastrand::Rng::with_seed(self.seed ^ 1);
        let mut builder = PointCloud::builder(points.clone()).noise(self.noise);
        builder = match self.radius {
            RadiusSpec::Even(share) => builder.radius(share * self.spacing()),
            RadiusSpec::Any(radius) => builder.radius(radius),
            RadiusSpec::Neighbors(k, scale) => builder.knn_radii(k, scale),
            RadiusSpec::PerPoint(most) => {
                let mut radius = || self.spacing() * (1.0 + (most - 1.0) * rng.f32());
                builder.radii(points.iter().map(|_| radius()).collect::<Vec<_>>())
            }
        };
        let normals =
            |of: &mut dyn FnMut(Vec3) -> Vec3| points.iter().map(|p| of(*p)).collect::<Vec<_>>();
        builder = match self.normals {
            NormalSpec::None => builder,
            NormalSpec::Pca(k, false) => builder.pca_normals(k),
            NormalSpec::Pca(k, true) => builder
                .pca_normals(k)
                .viewpoint(3.0 * self.scale() * Vec3::Y),
            NormalSpec::Random => builder.normals(normals(&mut |_| random_unit(&mut rng))),
            NormalSpec::Zero => {
                let mut some = |_| {
                    if rng.bool() {
                        Vec3::ZERO
                    } else {
                        1e30 * random_unit(&mut rng)
                    }
                };
                builder.normals(normals(&mut some))
            }
            NormalSpec::Outward => builder.normals(normals(&mut |p| p.normalize_or(Vec3::Y))),
        };
        if self.ordered {
            builder = builder.spatial_order();
        }
        if self.refuses {
            builder = builder.non_finite(NonFinite::Refuse);
        }
        builder.build()
    }
}

/// A rotation, and a translation of so many sizes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PoseSpec {
    pub(crate) axis: [f32; 3],
    pub(crate) translation: [f32; 3],
}

pub(crate) fn pose() -> impl Strategy<Value = PoseSpec> {
    let axis = prop_oneof![Just([0.0; 3]), [-3.0..3.0f32, -3.0..3.0f32, -3.0..3.0f32]];
    let near = [-1.0..1.0f32, -1.0..1.0f32, -1.0..1.0f32];
    let translation = prop_oneof![
        1 => Just([0.0; 3]),
        6 => near.clone(),
        1 => near.prop_map(|t| t.map(|c| 1e4 * c)),
    ];
    (axis, translation).prop_map(|(axis, translation)| PoseSpec { axis, translation })
}

impl PoseSpec {
    /// For things of this size, metres.
    pub(crate) fn at(&self, size: f32) -> Pose3 {
        let rotation = Rot3::from_scaled_axis(Vec3::from_array(self.axis));
        Pose3::from_parts(size * Vec3::from_array(self.translation), rotation)
    }
}
