//! Clouds whose attributes tell which point they belong to.

use fastrand::Rng;
use tldi::glamx::Vec3;
use tldi::{Aabb, BLOCK, PointCloud};

pub(crate) fn random_points(rng: &mut Rng, count: usize) -> Vec<Vec3> {
    let mut coordinate = || 2.0 * rng.f32() - 1.0;
    (0..count)
        .map(|_| Vec3::new(coordinate(), coordinate(), coordinate()))
        .collect()
}

/// A radius, normal and colour that tell which point they belong to.
pub(crate) fn radius_of(i: usize) -> f32 {
    1.0 + i as f32
}
pub(crate) fn normal_of(i: usize) -> Vec3 {
    Vec3::new((i as f32).cos(), (i as f32).sin(), 0.0)
}
pub(crate) fn color_of(i: usize) -> [u8; 4] {
    (i as u32).to_le_bytes()
}
pub(crate) struct Attributes {
    pub(crate) radii: Vec<f32>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) colors: Vec<[u8; 4]>,
}
pub(crate) fn attributes(count: usize) -> Attributes {
    Attributes {
        radii: (0..count).map(radius_of).collect(),
        normals: (0..count).map(normal_of).collect(),
        colors: (0..count).map(color_of).collect(),
    }
}

pub(crate) fn bounds_of(points: &[Vec3]) -> Aabb {
    points.iter().fold(Aabb::EMPTY, |b, p| b.including(*p))
}

/// Asserts that point `i` of the cloud is, with its attributes, point `given[i]` of `points`, and
/// that all bounds are right.
pub(crate) fn assert_holds(cloud: &PointCloud<'_>, points: &[Vec3], given: &[usize]) {
    assert_eq!(cloud.len(), given.len());
    for (i, &g) in given.iter().enumerate() {
        assert_eq!(cloud.point(i), points[g], "point {i}");
        assert_eq!(cloud.given_index(i), g);
        assert_eq!(cloud.radius(i), radius_of(g), "radius {i}");
        assert_eq!(
            cloud.normals().expect("given")[i],
            normal_of(g),
            "normal {i}"
        );
        assert_eq!(cloud.colors().expect("given")[i], color_of(g), "colour {i}");
    }
    let largest = given.iter().map(|&g| radius_of(g)).fold(0.0, f32::max);
    assert_eq!(cloud.max_radius(), largest);
    assert_bounds(cloud);
}

pub(crate) fn assert_bounds(cloud: &PointCloud<'_>) {
    let points: Vec<Vec3> = cloud.points().to_vec();
    assert_eq!(cloud.bounds(), bounds_of(&points));
    let blocks: Vec<Aabb> = points.chunks(BLOCK).map(bounds_of).collect();
    assert_eq!(cloud.blocks(), blocks);
}

/// Everything that can be seen of a cloud, for comparing.
pub(crate) fn state(cloud: &PointCloud<'_>) -> String {
    format!(
        "{:?} {:?} {:?} {} {:?} {:?} {:?} {} {} {} {:?}",
        cloud.points(),
        cloud.radii(),
        cloud.normals(),
        cloud.normals_oriented(),
        cloud.colors(),
        cloud.bounds(),
        cloud.blocks(),
        cloud.mean_radius(),
        cloud.max_radius(),
        cloud.dropped(),
        cloud.order(),
    )
}
