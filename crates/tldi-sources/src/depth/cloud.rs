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

    /// The points of all parts, one after the other, and the sums of their counts.
    pub(super) fn gathered(parts: &[Self]) -> Self {
        let (points, (normals, radii)) = rayon::join(
            || concat(parts, |part| &part.points),
            || {
                (
                    concat(parts, |part| &part.normals),
                    concat(parts, |part| &part.radii),
                )
            },
        );
        Self {
            points,
            radii,
            normals,
            empty: parts.iter().map(|part| part.empty).sum(),
            flying: parts.iter().map(|part| part.flying).sum(),
        }
    }

    /// Adds the points of another frame; the counts stay.
    pub(super) fn append(&mut self, other: &Self) {
        self.points.extend_from_slice(&other.points);
        self.radii.extend_from_slice(&other.radii);
        self.normals.extend_from_slice(&other.normals);
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
fn concat<T: Copy>(parts: &[DepthCloud], list: impl Fn(&DepthCloud) -> &[T]) -> Vec<T> {
    parts.iter().map(list).collect::<Vec<_>>().concat()
}
