//! The one definition of every tuning parameter, shared by all backends.

use crate::cloud::reach::coarsening;
use bytemuck::{Pod, Zeroable};

/// The merge gap in mean radii of a surface's points. Points of rough or bent surfaces differ in depth by about a radius.
/// Half: no row changes; twice: two bare sheets 1.5 radii apart become one, and bodies on them sink in by 0.7 radii.
const MERGED: f32 = 1.2;

/// Which construction of the layers and which comparison a pair uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Variant {
    /// The method of Radwan, Ohrhallinger and Wimmer (Graphics Interface 2014), kept as the
    /// baseline: flat cylinders, stacks, Gaussian blending, range overlap with compression ρ.
    Paper,
    /// Oriented splats and sign change. It is an order of magnitude sharper and needs no closed
    /// surface.
    #[default]
    Oriented,
}

/// Parameters of one pair, as plain bytes with the same layout in Rust and in WGSL.
///
/// Lengths are in metres (more exactly, in the unit of the coordinates); "radius" means the mean
/// point radius r̄ of the pair's coarser cloud. A pair with a body that is smaller than that is modelled at the scale of
/// [`largest_pixel`](crate::plan::largest_pixel), as if this were r̄.
///
/// ```
/// use tldi::Params;
/// let params = Params::for_radius(0.01);
/// assert_eq!(params.pixel_size, 0.01);
/// assert_eq!(bytemuck::bytes_of(&params).len(), 32);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Edge of a pixel at the surface, in metres. Larger pixels than r̄ lose detail. Smaller ones
    /// cost time and let noise through. r̄ was best.
    pub pixel_size: f32,
    /// Largest distance in depth between successive fragments of one layer, in metres. It is larger
    /// for clouds with given noise, and a thickness where the surface is steep. Sheets farther
    /// apart than this are two layers.
    pub merge_gap: f32,
    /// Thickness of a surface, in metres. Layers of neighbouring pixels continue each other if
    /// their depths differ by no more than this. A body that is no deeper than this in a surface
    /// touches it. Two balls of radius r̄ overlap in depth up to 2 r̄.
    pub thickness: f32,
    /// Contacts with a gap up to this are reported, in metres (rapier's prediction distance). At most 2¹⁷ thicknesses.
    pub prediction: f32,
    /// Share of a splat's slope that extrapolates its depth to the pixel centre, 0 to 1.
    pub slope_damping: f32,
    /// Compression of depth ranges before they are compared (paper, section 5), 0 to 1 of their
    /// length. Only [`Variant::Paper`] reads it.
    pub rho: f32,
    /// Depth segments in a stack's occupancy mask (paper, section 4.2). Only [`Variant::Paper`]
    /// reads it.
    pub stack_segments: u32,
    /// The [`Variant`]: 0 is `Paper`, 1 is `Oriented`.
    pub variant: u32,
}

impl Params {
    /// The default variant for a mean point radius in metres.
    pub fn for_radius(radius: f32) -> Self {
        Self {
            pixel_size: radius,
            merge_gap: MERGED * radius,
            thickness: 2.0 * radius,
            prediction: 2.0 * radius,
            slope_damping: 0.7,
            rho: 0.05,
            stack_segments: 128,
            variant: 1,
        }
    }

    /// The paper's variant for a mean point radius in metres.
    pub fn paper(radius: f32) -> Self {
        Self {
            variant: 0,
            ..Self::for_radius(radius)
        }
    }

    /// The variant these parameters select.
    pub fn variant(&self) -> Variant {
        if self.variant == 0 {
            Variant::Paper
        } else {
            Variant::Oriented
        }
    }

    /// Gap up to which surfaces are seen, in metres. What lies beyond [`prediction`](Self::prediction) is no contact, but
    /// tells the shape of contacts beside it: of a ball that comes near, the pixels within the prediction are few. Twice as
    /// far, up to a thickness. If it were a thickness always, bodies with narrow feet would sink into coarse clouds.
    pub(crate) fn seen_gap(&self) -> f32 {
        self.prediction
            .max(self.thickness.min(2.0 * self.prediction))
    }

    /// The same parameters with another prediction distance in metres.
    pub fn with_prediction(self, prediction: f32) -> Self {
        Self { prediction, ..self }
    }

    /// The same parameters for one surface of a pair, whose points have this mean radius, metres. Fragments of a surface
    /// that is coarser than the pair is modelled at are farther apart in depth, so they merge farther, by whole octaves.
    ///
    /// ```
    /// use tldi::Params;
    /// let params = Params::for_radius(0.01);
    /// assert_eq!(params.of_surface(0.001), params);
    /// assert_eq!(params.of_surface(0.08).merge_gap, 8.0 * params.merge_gap);
    /// ```
    pub fn of_surface(self, mean_radius: f32) -> Self {
        let merge_gap = coarsening(MERGED * mean_radius, self.merge_gap) * self.merge_gap;
        Self { merge_gap, ..self }
    }

    /// The same parameters with another pixel edge in metres.
    pub fn with_pixel_size(self, pixel_size: f32) -> Self {
        Self { pixel_size, ..self }
    }
}
