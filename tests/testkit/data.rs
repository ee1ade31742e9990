//! Real scans and models, where they are at hand.

use crate::skip::test_data;
use std::path::PathBuf;
use tldi::glamx::Vec3;
use tldi::{Aabb, PointCloud};

/// The path of a file of the test data, or `None` (said loudly) where it is absent: see [`test_data`].
///
/// # Panics
/// There, if the variable `TLDI_REQUIRE_DATA` is set.
pub fn data_file(name: &str) -> Option<PathBuf> {
    test_data(concat!(env!("CARGO_MANIFEST_DIR"), "/.."), name)
}

/// A cloud of the test data with radii from 7 neighbours, scaled so that its largest extent is
/// `size` metres; normals of the mesh where it has faces.
pub fn load_cloud(name: &str, size: f32) -> Option<PointCloud<'static>> {
    let path = data_file(name)?;
    let mut raw = tldi_sources::read(&path, &tldi_sources::ReadOptions::default())
        .expect("the test data can be read");
    scale_to(&mut raw.points, size);
    Some(
        raw.into_builder()
            .knn_radii(7, 0.65)
            .build()
            .expect("the test data is valid"),
    )
}

/// Moves points so that the middle of their bounds is the origin, and scales them so that their largest extent is `size`
/// metres.
pub fn scale_to(points: &mut [Vec3], size: f32) {
    let bounds = (points.iter()).fold(Aabb::EMPTY, |all, p| all.including(*p));
    let (middle, scale) = (bounds.center(), size / bounds.extents().max_element());
    for p in points {
        *p = (*p - middle) * scale;
    }
}
