//! What the comparison of a pair had to do.

use std::ops::AddAssign;

/// How much of two clouds a comparison had to model: sums over all that it did, also over what it gave up on the way.
///
/// Counts depend on the pair alone, not on threads or the machine. The CPU backend fills them. The GPU backend leaves
/// them at zero, but for the pairs that it leaves to the CPU. Cost: a few additions a view.
///
/// ```
/// use tldi::{Backend, CpuBackend, PairQuery, Params, PointCloud, Surface, View};
/// use tldi::glamx::{Pose3, Vec3};
///
/// // Two sheets of 1 m and 441 points, 2 cm apart, of which a corner of 25 cm is above each other.
/// let points: Vec<Vec3> = (0..441)
///     .map(|i| Vec3::new((i % 21) as f32 * 0.05, 0.0, (i / 21) as f32 * 0.05))
///     .collect();
/// let sheet = PointCloud::builder(&points).radius(0.05).build()?;
/// let mut results = Vec::new();
/// CpuBackend::default().compare(
///     &[PairQuery {
///         a: Surface::Cloud(&sheet),
///         b: Surface::Cloud(&sheet),
///         a_from_b: Pose3::translation(0.75, 0.02, 0.75),
///         view: View::aimed(),
///         params: Params::for_radius(0.05),
///     }],
///     &mut results,
/// )?;
/// let work = results[0].work;
/// // Of the 882 points that were given, those at the corner; each view models some of them.
/// assert!(work.culled < 441 && work.fine.points > 0);
/// // Too shallow for large pixels.
/// assert_eq!(work.large.points, 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Points of both clouds that passed a cull to where the surfaces may meet, of all culls: a point counts in each
    /// that it passed.
    pub culled: usize,
    /// Looks with large pixels at a part of the points.
    pub large: Looked,
    /// Looks through small windows, which prove what large pixels show.
    pub windows: Looked,
    /// Looks with pixels of [`Params::pixel_size`](crate::Params::pixel_size) at all of the contact zone.
    pub fine: Looked,
}

impl Work {
    /// Of all kinds of looks.
    pub fn looked(&self) -> Looked {
        let mut all = self.large;
        all += self.windows;
        all += self.fine;
        all
    }
}

/// What looks of one kind had to do, over all views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Looked {
    /// Points of the clouds that were modelled: that got a normal and a splat, or that were added to a cell. A point
    /// counts in each view that models it. Points that only decide normals of others are not among them.
    pub points: usize,
    /// Pixels of the rectangles of both images, empty ones too.
    pub pixels: usize,
    /// Layers of both images.
    pub layers: usize,
}

impl AddAssign for Looked {
    fn add_assign(&mut self, other: Self) {
        self.points += other.points;
        self.pixels += other.pixels;
        self.layers += other.layers;
    }
}
