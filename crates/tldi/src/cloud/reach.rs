//! How far points reach: each by its own radius.
//!
//! A scan is coarse far from its sensor. With the mean radius, a body smaller than the distance of
//! the points around it would meet none of them. With the largest radius, most of the scan would be
//! near. In an even cloud, all points reach as far as the mean radius. In an
//! [uneven](PointCloud::is_uneven) one, they reach at least that far.

use crate::pair::pixels::largest_pixel;
use crate::pair::surface::first_is_smaller;
use crate::{Params, PointCloud, Radii, Surface};

/// How many times as large as `expected` a mean radius is where surfaces are near: the nearest
/// power of two, at least 1. It moves in octaves: the near points change with each motion, and gaps
/// would otherwise change with them.
pub(crate) fn coarsening(near: f32, expected: f32) -> f32 {
    (near / expected).max(1.0).log2().round().exp2()
}

/// The radii of a cloud whose points do not all reach equally far.
#[derive(Clone, Copy)]
pub(crate) struct Uneven<'a> {
    radii: &'a [f32],
    mean: f32,
}

impl<'a> Uneven<'a> {
    pub(crate) fn of(cloud: &'a PointCloud) -> Option<Self> {
        match cloud.radii() {
            Radii::PerPoint(radii) if cloud.is_uneven() => Some(Self {
                radii,
                mean: cloud.mean_radius(),
            }),
            _ => None,
        }
    }

    pub(crate) fn radius(&self, i: usize) -> f32 {
        self.radii[i]
    }

    /// The largest radius of some points.
    pub(crate) fn largest(&self, points: std::ops::Range<usize>) -> f32 {
        self.radii[points].iter().fold(0.0, |a: f32, &b| a.max(b))
    }

    /// By how much a point reaches farther than the mean radius, metres.
    pub(crate) fn further(&self, i: usize) -> f32 {
        (self.radii[i] - self.mean).max(0.0)
    }
}

/// The greatest reach of a surface's points, metres: 0 for an exact one; by their mean for those on a device.
pub(crate) fn farthest(surface: &Surface) -> f32 {
    match surface {
        Surface::Cloud(cloud) if cloud.is_uneven() => cloud.max_radius(),
        _ => surface.mean_radius(),
    }
}

/// The points of a side that reach about equally far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Class {
    number: u8,
    /// By how much they reach farther than the cloud's mean radius at most, metres.
    pub(crate) further: f32,
}

impl Class {
    /// Whether the class holds a point whose reach exceeds that of the `mean` radius by `further`; metres.
    pub(crate) fn holds(&self, further: f32, mean: f32) -> bool {
        number(further, mean) == self.number
    }
}

/// Number of a point's class: 0 for the mean radius, from 1 on the octaves above it.
fn number(further: f32, mean: f32) -> u8 {
    if further <= 0.0 {
        return 0;
    }
    let exponent = ((1.0 + further / mean).to_bits() >> 23) as i32 - 127;
    1 + exponent.clamp(0, 126) as u8
}

/// The classes of the points, ascending. `further` says by how much each point reaches farther than the mean radius,
/// metres; if it is empty, there is a single class.
pub(crate) fn classes(further: &[f32], mean: f32) -> impl Iterator<Item = Class> {
    let mut most = [-1.0f32; 128];
    for &further in further {
        let most = &mut most[usize::from(number(further, mean))];
        *most = most.max(further);
    }
    if further.is_empty() {
        most[0] = 0.0;
    }
    let all = (0..).zip(most);
    all.filter(|(_, further)| *further >= 0.0)
        .map(|(number, further)| Class { number, further })
}

/// How far beyond what can touch points are culled.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ring {
    /// In reaches of the point.
    reaches: f32,
    /// Mean and largest radius of the cloud, metres.
    mean: f32,
    largest: f32,
}

impl Ring {
    /// A ring as wide as `reaches` times the reach of each point.
    pub(crate) fn new(surface: &Surface, reaches: f32) -> Self {
        Self {
            reaches,
            mean: surface.mean_radius(),
            largest: farthest(surface),
        }
    }

    /// Width for the points that reach least, beside another surface whose points may reach farthest; metres.
    pub(crate) fn beside(&self, other: &Self) -> f32 {
        self.of(self.mean).max(other.widest())
    }

    /// Of all points, metres.
    pub(crate) fn widest(&self) -> f32 {
        self.of(self.largest)
    }

    /// By how much the ring of a point of this `radius` is wider than the width `included` for all points, metres.
    pub(crate) fn beyond(&self, included: f32, radius: f32) -> f32 {
        (self.of(radius) - included).max(0.0)
    }

    fn of(&self, radius: f32) -> f32 {
        self.reaches * radius.max(self.mean).min(self.largest)
    }
}

/// How coarse two surfaces are where they are near each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalScale {
    /// How many times as large as the parameters say pixels are there, and with them the thickness and the merge gap.
    pub(crate) coarser: f32,
    /// Mean radii of the near points of both, metres.
    near: [f32; 2],
}

impl Default for LocalScale {
    fn default() -> Self {
        Self::AS_TOLD
    }
}

impl LocalScale {
    /// That of the parameters.
    pub(crate) const AS_TOLD: Self = Self {
        coarser: 1.0,
        near: [0.0; 2],
    };

    /// From the mean radii in metres of the points of both that are near; 0 of an exact surface.
    /// Pixels follow the coarser side, as far as they resolve the smaller surface. Each side's
    /// merge gap follows its own points, too.
    pub(crate) fn new(params: &Params, surfaces: [&Surface; 2], near: [f32; 2]) -> Self {
        let [a, b] = surfaces;
        let [near_a, near_b] = near;
        let expected = a.mean_radius().max(b.mean_radius());
        let extents = surfaces.map(|surface| surface.bounds().extents());
        let smaller = usize::from(!first_is_smaller(extents));
        let resolving = largest_pixel(extents[smaller], near[smaller]);
        let coarser = coarsening(near_a.max(near_b), expected.max(params.pixel_size))
            .min(resolving / params.pixel_size)
            .max(1.0);
        Self { coarser, near }
    }

    /// The parameters there.
    pub(crate) fn params(&self, params: &Params) -> Params {
        Params {
            pixel_size: self.coarser * params.pixel_size,
            thickness: self.coarser * params.thickness,
            merge_gap: self.coarser * params.merge_gap,
            ..*params
        }
    }

    /// These parameters for each surface.
    pub(crate) fn of_sides(&self, params: &Params) -> [Params; 2] {
        self.near.map(|near| params.of_surface(near))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_octaves_above_the_mean() {
        let mut rng = fastrand::Rng::with_seed(1);
        let mean = 0.03;
        let radii: Vec<f32> = (0..1000)
            .map(|_| mean * 40.0f32.powf(rng.f32() - 0.3))
            .collect();
        let further: Vec<f32> = radii.iter().map(|r| (r - mean).max(0.0)).collect();
        let mut held = 0;
        for class in classes(&further, mean) {
            let of_class = |further: &&f32| class.holds(**further, mean);
            let farthest = further
                .iter()
                .filter(of_class)
                .fold(0.0, |a: f32, &b| a.max(b));
            assert_eq!(class.further, farthest);
            let least = further
                .iter()
                .filter(of_class)
                .fold(f32::INFINITY, |a, &b| a.min(b));
            assert!(
                mean + farthest < 2.0001 * (mean + least),
                "{least} to {farthest}"
            );
            held += further.iter().filter(of_class).count();
        }
        assert_eq!(held, 1000);
        // To 13.3 times the mean: 0, and four octaves.
        assert_eq!(classes(&further, mean).count(), 5);
        assert_eq!(classes(&[], mean).count(), 1);
    }

    #[test]
    fn parameters_grow_by_octaves() {
        for (near, expected) in [(0.5, 1.0), (1.4, 1.0), (1.42, 2.0), (2.8, 2.0), (2.9, 4.0)] {
            assert_eq!(coarsening(0.01 * near, 0.01), expected, "{near}");
        }
    }
}
