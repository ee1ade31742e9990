//! Real scans and models, where they are at hand.

use std::path::PathBuf;
use tldi::PointCloud;

/// The path of a file of the test data, or `None` (said loudly) where the data is absent. The
/// folder is named by the environment variable `TLDI_DATA`, else it is `shared/data` beside the
/// checkout.
#[allow(
    clippy::print_stderr,
    reason = "a test that is skipped for want of data must say so"
)]
pub fn data_file(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("TLDI_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: {name} is not in the test data folder (set TLDI_DATA)");
    None
}

/// A cloud of the test data with radii from 7 neighbours, scaled so that its largest extent is
/// `size` metres; normals of the mesh where it has faces.
pub fn load_cloud(name: &str, size: f32) -> Option<PointCloud<'static>> {
    let path = data_file(name)?;
    let mut raw = tldi_sources::read(&path, &tldi_sources::ReadOptions::default())
        .expect("the test data can be read");
    let (lo, hi) = raw.points.iter().fold(
        (tldi::glamx::Vec3::INFINITY, tldi::glamx::Vec3::NEG_INFINITY),
        |(lo, hi), p| (lo.min(*p), hi.max(*p)),
    );
    let scale = size / (hi - lo).max_element();
    let middle = 0.5 * (lo + hi);
    for p in &mut raw.points {
        *p = (*p - middle) * scale;
    }
    Some(
        raw.into_builder()
            .knn_radii(7, 0.65)
            .build()
            .expect("the test data is valid"),
    )
}
