//! Points of one frame of a depth sensor.

use tldi::glamx::Vec3;
use tldi::{CloudBuilder, PointCloud};

/// Points of one frame, with an entry for each in all lists.
#[derive(Clone, Debug, Default)]
pub struct DepthCloud {
    /// Positions, metres.
    pub points: Vec<Vec3>,
    /// Radii: what a pixel covers at its range and the deviation of its depth, together, metres.
    pub radii: Vec<f32>,
    /// Unit normals towards the camera.
    pub normals: Vec<Vec3>,
    /// Pixels without a measurement, or out of the sensor's range.
    pub empty: usize,
    /// Pixels left out because they are on no surface: at jumps in depth, where a sensor mixes what is
    /// before and behind, or with too few pixels around on the same surface to tell its normal.
    pub flying: usize,
}

impl DepthCloud {
    /// Takes all points out; the memory stays.
    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.radii.clear();
        self.normals.clear();
        (self.empty, self.flying) = (0, 0);
    }

    /// Keeps the points that `keeps` says.
    pub(super) fn retain(&mut self, keeps: impl Fn(Vec3) -> bool) {
        let mut kept = 0;
        for k in 0..self.points.len() {
            if keeps(self.points[k]) {
                self.points[kept] = self.points[k];
                self.radii[kept] = self.radii[k];
                self.normals[kept] = self.normals[k];
                kept += 1;
            }
        }
        self.points.truncate(kept);
        self.radii.truncate(kept);
        self.normals.truncate(kept);
    }

    /// Hands the points to a builder.
    pub fn into_builder(self) -> CloudBuilder<'static> {
        PointCloud::builder(self.points)
            .radii(self.radii)
            .normals(self.normals)
    }
}

/// One list of all parts together.
pub(super) fn gathered<T: Copy>(
    rows: &[DepthCloud],
    list: impl Fn(&DepthCloud) -> &Vec<T>,
) -> Vec<T> {
    let mut all = Vec::with_capacity(rows.iter().map(|row| list(row).len()).sum());
    for row in rows {
        all.extend_from_slice(list(row));
    }
    all
}
