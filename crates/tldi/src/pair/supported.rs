//! Which pairs can be compared, and why others cannot.

use crate::cloud::radii;
use crate::pair::pixels::{least_pixel, least_pixel_within};
use crate::pair::plan::DepthScale;
use crate::paper::MAX_PIXELS;
use crate::{
    DeviceCloud, ImpactQuery, PairQuery, Params, Penetration, Projection, Surface, Variant, View,
    VirtualCamera,
};
use glamx::{Pose3, Vec3};
use std::ops::RangeInclusive;

/// Why the CPU does not compare what lives on a device.
const ON_A_DEVICE: &str = "the points live on a device: only its backend compares them, with clouds, \
                           oriented splats and an orthographic view";

impl PairQuery<'_> {
    /// Whether the CPU can compare the pair, and with it every backend; if not, why, and what to do
    /// instead.
    pub fn check(&self) -> Result<(), &'static str> {
        self.check_numbers()?;
        supported_surfaces(self.a, self.b)
    }

    /// Like [`check`](Self::check), but also accepts clouds on a device: checks only the numbers.
    pub fn check_numbers(&self) -> Result<(), &'static str> {
        self.params.check()?;
        for surface in [self.a, self.b] {
            if let Surface::Device(cloud) = surface {
                cloud.check()?;
            }
        }
        let is_view_finite = match self.view {
            View::Aim {
                motion, last_axis, ..
            } => motion.is_finite() && last_axis.is_none_or(Vec3::is_finite),
            View::Fixed(_) => true,
        };
        if !is_view_finite {
            return Err("motion and last_axis must be finite");
        }
        if !is_rigid(&self.a_from_b) {
            return Err(NOT_RIGID);
        }
        match self.view {
            View::Aim { .. } => is_countable(&[self.a, self.b], self.params.pixel_size)?,
            View::Fixed(camera) => camera.check(&[self.a, self.b])?,
        }
        let exact = matches!(self.a, Surface::Exact(_)) || matches!(self.b, Surface::Exact(_));
        if exact && self.params.variant() == Variant::Paper {
            return Err("the paper's variant compares clouds only: use Variant::Oriented");
        }
        if let View::Fixed(camera) = self.view
            && exact
            && matches!(camera.projection, Projection::Perspective { .. })
        {
            return Err("exact surfaces need an orthographic camera");
        }
        if let View::Fixed(camera) = self.view
            && camera.size.is_none()
            && matches!(camera.projection, Projection::Perspective { .. })
        {
            return Err("a perspective camera needs an image of fixed size");
        }
        if self.params.variant() == Variant::Paper
            && (most_pixels_and_fragments(self).into_iter()).any(|most| most > MAX_PIXELS as f64)
        {
            return Err(
                "the paper's image may have more than 2^28 pixels or fragments: use a larger pixel_size, \
             a smaller image or smaller clouds",
            );
        }
        Ok(())
    }
}

/// Why a pose of a query is refused.
const NOT_RIGID: &str = "a_from_b must be finite, with a unit quaternion: normalise it";

fn is_rigid(pose: &Pose3) -> bool {
    pose.is_finite() && pose.rotation.is_normalized()
}

impl DeviceCloud {
    /// Whether what is told of the points can be true of a cloud; if not, why.
    ///
    /// ```
    /// use tldi::{Aabb, DeviceCloud, glamx::Vec3};
    /// let told = DeviceCloud {
    ///     id: 0,
    ///     len: 1000,
    ///     bounds: Aabb { min: -Vec3::ONE, max: Vec3::ONE },
    ///     mean_radius: 0.01,
    ///     max_radius: 0.02,
    /// };
    /// assert!(told.check().is_ok());
    /// assert!(DeviceCloud { max_radius: 0.005, ..told }.check().is_err());
    /// ```
    pub fn check(&self) -> Result<(), &'static str> {
        let Self { bounds, len, .. } = self;
        if !(1..=u32::MAX as usize).contains(len) {
            return Err("a cloud on a device must have 1 to 2^32 - 1 points");
        }
        if bounds.is_empty() || !(bounds.min.is_finite() && bounds.max.is_finite()) {
            return Err("the bounds of a cloud on a device must be finite, and not empty");
        }
        let are_valid = [self.mean_radius, self.max_radius].map(radii::is_valid);
        if are_valid != [true; 2] || self.mean_radius > self.max_radius {
            return Err(
                "the radii of a cloud on a device must be 1e-12 to 1e12, the mean at most the largest",
            );
        }
        Ok(())
    }
}

pub(crate) fn supported_surfaces(a: Surface, b: Surface) -> Result<(), &'static str> {
    match (a, b) {
        (Surface::Device(_), _) | (_, Surface::Device(_)) => Err(ON_A_DEVICE),
        (Surface::Exact(_), Surface::Exact(_)) => {
            Err("both surfaces are exact: leave this pair to the physics engine")
        }
        _ => Ok(()),
    }
}

fn is_countable(surfaces: &[Surface], pixel_size: f32) -> Result<(), &'static str> {
    let is_less = |surface: &Surface| match surface {
        Surface::Cloud(cloud) => pixel_size < least_pixel(cloud),
        Surface::Device(cloud) => pixel_size < least_pixel_within(cloud.bounds, cloud.max_radius),
        Surface::Exact(_) => false,
    };
    match surfaces.iter().any(is_less) {
        true => {
            Err("pixel_size is less than 2^-28 of the farthest coordinate: choose a larger one")
        }
        false => Ok(()),
    }
}

impl VirtualCamera {
    /// Whether it shows these surfaces in pixels that can be counted; if not, why.
    pub(crate) fn check(&self, surfaces: &[Surface]) -> Result<(), &'static str> {
        if !is_rigid(&self.view_from_frame) {
            return Err("view_from_frame must be finite, with a unit quaternion: normalise it");
        }
        let is_counted = |n: u32| (1..=i32::MAX as u32).contains(&n);
        if !self
            .size
            .is_none_or(|size| size.into_iter().all(is_counted))
        {
            return Err("the camera's size must be 1 to 2^31 - 1 columns and rows");
        }
        let pixels = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        if self.size.is_some_and(|size| pixels(size) > MAX_PIXELS) {
            return Err("the camera's image may have at most 2^28 pixels: use fewer");
        }
        match self.projection {
            Projection::Orthographic { pixel_size } if !Params::LENGTHS.contains(&pixel_size) => {
                Err("the camera's pixel_size must be 1e-14 to 1e14: choose another")
            }
            Projection::Orthographic { pixel_size } => is_countable(surfaces, pixel_size),
            Projection::Perspective {
                focal_px,
                near,
                far,
            } => match [focal_px, near, far].map(|c| c.is_finite() && c > 0.0) {
                [true, true, true] if near < far => Ok(()),
                _ => Err("focal_px, near and far must be finite and above 0, near less than far"),
            },
        }
    }
}

impl ImpactQuery<'_> {
    /// Whether the CPU can find the impact; if not, why, and what to do instead.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        supported_surfaces(self.a, self.b)?;
        self.params.check()?;
        if !is_rigid(&self.a_from_b) {
            return Err(NOT_RIGID);
        }
        if !(self.motion.is_finite() && self.touching.is_finite()) {
            return Err("motion and touching must be finite");
        }
        let is_finite = |p: Penetration| p.normal.is_finite() && p.depth.is_finite();
        if !self.penetration.is_none_or(is_finite) {
            return Err("normal and depth of the penetration must be finite");
        }
        if !self.turned.iter().all(Pose3::is_finite) {
            return Err("the poses of turned must be finite");
        }
        is_countable(&[self.a, self.b], self.params.pixel_size)
    }
}

impl Params {
    /// What [`pixel_size`](Self::pixel_size) and the other lengths may be, metres: squares and quotients of two
    /// of them stay within `f32`.
    pub const LENGTHS: RangeInclusive<f32> = 1e-14..=1e14;

    /// Whether a backend can use them; if not, why.
    pub fn check(&self) -> Result<(), &'static str> {
        let lengths = [self.pixel_size, self.merge_gap, self.thickness];
        let are_valid = lengths.iter().all(|length| Self::LENGTHS.contains(length));
        if !(are_valid && (0.0..=*Self::LENGTHS.end()).contains(&self.prediction)) {
            return Err(
                "pixel_size, merge_gap and thickness must be 1e-14 to 1e14, prediction 0 to 1e14: choose others, \
                 or another unit of length",
            );
        }
        if self.prediction > DepthScale::reach(self) {
            return Err(
                "prediction must be at most 2^17 times the thickness: depths farther apart are not told apart",
            );
        }
        let are_shares = [self.slope_damping, self.rho].map(|share| (0.0..=1.0).contains(&share));
        match are_shares {
            [true, true] => Ok(()),
            _ => Err("slope_damping and rho are shares: they must be 0 to 1"),
        }
    }
}

/// At least the number of pixels and the number of fragments that the paper's image of either cloud has, where it follows
/// the clouds. Images of fixed size are checked with their camera.
fn most_pixels_and_fragments(query: &PairQuery) -> [f64; 2] {
    let pixel_size = f64::from(match query.view {
        View::Fixed(camera) if camera.size.is_some() => return [0.0; 2],
        View::Fixed(camera) => camera.pixel_size_at(0.0),
        View::Aim { .. } => query.params.pixel_size,
    });
    // Two pixels for rounding outward.
    let square = |size: f32| (f64::from(size) / pixel_size + 2.0).powi(2);
    let [a, b] = [query.a, query.b].map(|surface| match surface {
        Surface::Cloud(cloud) => [
            // As seen from any side.
            square(cloud.bounds().extents().length() + 2.0 * cloud.max_radius()),
            (0..cloud.len())
                .map(|i| square(2.0 * cloud.radius(i)))
                .sum(),
        ],
        Surface::Exact(_) | Surface::Device(_) => [0.0; 2],
    });
    [a[0].max(b[0]), a[1].max(b[1])]
}
