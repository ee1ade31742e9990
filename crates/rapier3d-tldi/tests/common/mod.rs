//! Clouds of simple solids, for the tests of this crate.

#![allow(dead_code, reason = "each test binary uses a part")]

pub(crate) mod worlds;

use rapier3d::glamx::Vec3Swizzles;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Largest spacing of the points, metres.
pub(crate) const SPACING: f32 = 0.04;

/// A horizontal square with edges of `2 · half` metres and its middle at the origin.
pub(crate) fn square(half: f32) -> Vec<Vector> {
    let n = (half / SPACING).ceil() as i32;
    let at = move |i: i32| half * i as f32 / n as f32;
    (-n..=n)
        .flat_map(|i| (-n..=n).map(move |j| Vector::new(at(i), 0.0, at(j))))
        .collect()
}

/// The surface of a cube with edges of `2 · half` metres and its middle at the origin.
pub(crate) fn cube(half: f32) -> Vec<Vector> {
    let top = square(half).into_iter().map(|p| p + Vector::Y * half);
    top.flat_map(|p| [p, p.yzx(), p.zxy()])
        .flat_map(|p| [p, -p])
        .collect()
}

pub(crate) fn cloud(points: &[Vector]) -> PointCloud<'static> {
    PointCloud::builder(points)
        .radius(SPACING)
        .build()
        .expect("a valid cloud")
        .into_owned()
}

pub(crate) fn shape(points: &[Vector]) -> PointCloudShape {
    PointCloudShape::new(cloud(points))
}
