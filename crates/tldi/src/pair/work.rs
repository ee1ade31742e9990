//! The work of a comparison.

use std::ops::AddAssign;

/// How much of two clouds a comparison drew. Sums over everything it did, including looks that it
/// gave up.
///
/// The counts depend only on the pair, not on threads or the machine. The CPU backend fills them.
/// The GPU backend leaves them at zero, except for pairs that it leaves to the CPU. Cost: a few
/// additions for each view.
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
    /// Points of both clouds that passed the cull to where the surfaces may meet. A point counts
    /// once for each cull that it passed.
    pub culled: usize,
    /// Looks with large pixels at a part of the points.
    pub large: Looked,
    /// Looks through small windows, which prove crossings that large pixels show.
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

/// The work of all looks of one kind, over all views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Looked {
    /// Points that were drawn: they got a normal and a splat, or were added to a cell. A point
    /// counts once for each view that draws it. Points that only decide the normals of others do
    /// not count.
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
