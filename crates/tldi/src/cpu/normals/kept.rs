//! The normals of all points of a cloud that stays as it is.

use crate::PointCloud;
use crate::cloud::reach::{Uneven, classes};
use crate::cpu::normals::estimate::{NormalScratch, estimate};
use crate::cpu::normals::planes::{Neighborhood, SUPPORT};
use crate::cpu::normals::sharpen::{SharpenScratch, sharpen};
use glamx::Vec3;

/// What the stage `normals` finds at each point of a cloud, in the cloud's frame. Zero where a point stands out from the
/// surface.
#[derive(Clone, Debug)]
pub(crate) struct KeptNormals {
    pub(crate) estimated: Vec<Vec3>,
    pub(crate) sharpened: Vec<Vec3>,
}

impl KeptNormals {
    /// In an uneven cloud, the neighbourhood of a point is as large as the points of its octave reach on average.
    ///
    /// Cost: that of [`estimate`] and [`sharpen`] for all points, and a sort of all for each octave.
    pub(crate) fn of(cloud: &PointCloud) -> Self {
        let (points, mean) = (cloud.points(), cloud.mean_radius());
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let further: Vec<f32> = Uneven::of(cloud).map_or_else(Vec::new, |uneven| {
            all.iter().map(|&i| uneven.further(i as usize)).collect()
        });
        let none = vec![Vec3::ZERO; points.len()];
        let [mut estimated, mut sharpened] = [none.clone(), none];
        let (mut scratch, mut sharpening) = (NormalScratch::default(), SharpenScratch::default());
        let (mut targets, mut normals) = (Vec::new(), Vec::new());
        for class in classes(&further, mean) {
            let is_of_class = |i: usize| {
                let further = further.get(i);
                further.is_none_or(|further| class.holds(*further, mean))
            };
            let of_class = further
                .iter()
                .filter(|further| class.holds(**further, mean));
            let (sum, count) = of_class.fold((0.0, 0.0), |(sum, count), &further| {
                (sum + f64::from(further), count + 1.0)
            });
            let around = Neighborhood {
                radius: SUPPORT * (mean + (sum / f64::max(count, 1.0)) as f32),
                noise: cloud.noise(),
            };
            estimate(
                &all,
                |i| points[i as usize],
                is_of_class,
                &around,
                &mut scratch,
                &mut targets,
                &mut normals,
            );
            put(&targets, &normals, &mut estimated);
            sharpen(&around, &mut scratch, &mut sharpening, &mut normals);
            put(&targets, &normals, &mut sharpened);
        }
        Self {
            estimated,
            sharpened,
        }
    }
}

impl PointCloud<'_> {
    /// Estimates the normals of all points now, and keeps them until points or radii change. This is for a cloud without
    /// normals that is compared many times as it is: the CPU backend otherwise estimates, in every comparison, those of the
    /// points that it looks at, which takes a third of its time. The normals are not oriented, and
    /// [`normals`](Self::normals) stays `None`. A cloud with normals is left as it is.
    ///
    /// Cost: half a microsecond and 24 bytes a point.
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let square: Vec<Vec3> = (0..400)
    ///     .map(|i| Vec3::new((i % 20) as f32, 0.0, (i / 20) as f32))
    ///     .collect();
    /// let mut floor = PointCloud::builder(&square).radius(1.0).build()?;
    /// floor.keep_normals();
    /// assert_eq!(floor.normals(), None);
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn keep_normals(&mut self) {
        if self.normals.is_none() && self.kept_normals.is_none() {
            self.kept_normals = Some(KeptNormals::of(self));
        }
    }

    /// The normals of all points that need not be estimated: the cloud's own, or kept ones, `sharpened` or not. Kept ones are
    /// zero where a point stands out.
    pub(crate) fn known_normals(&self, sharpened: bool) -> Option<&[Vec3]> {
        let kept = self.kept_normals.as_ref().map(|kept| match sharpened {
            true => &kept.sharpened[..],
            false => &kept.estimated,
        });
        self.normals().or(kept)
    }
}

/// Puts the normals of the points with these indices among those of all.
fn put(indices: &[u32], normals: &[Vec3], all: &mut [Vec3]) {
    for (&i, normal) in indices.iter().zip(normals) {
        all[i as usize] = *normal;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glamx::Quat;

    /// On a slope of which one part is seven times as coarse as the other, all normals are those of the slope. With the mean
    /// radius for all, many coarse points would have no two neighbours.
    #[test]
    fn coarse_parts_have_neighbors_of_their_own() {
        let mut rng = fastrand::Rng::with_seed(6);
        let turn = Quat::from_scaled_axis(Vec3::new(0.4, -1.1, 0.7));
        let (mut points, mut radii) = (Vec::new(), Vec::new());
        for (first, count, spacing) in [(-20, 20, 0.01), (0, 7, 0.07)] {
            for k in 0..count * count {
                let [i, j] = [first + k % count, k / count].map(|c| c as f32 + 0.6 * rng.f32());
                points.push(turn * (spacing * Vec3::new(i, 0.0, j)));
                radii.push(spacing);
            }
        }
        let cloud = PointCloud::builder(points).radii(radii).build();
        let cloud = cloud.expect("valid points");
        assert!(cloud.is_uneven());
        let kept = KeptNormals::of(&cloud);
        for normal in kept.estimated.iter().chain(&kept.sharpened) {
            assert!((turn.inverse() * *normal).y.abs() > 0.9999, "{normal}");
        }
    }
}
