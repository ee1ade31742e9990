//! The interface of a backend: a batch of pairs goes in, one result for each pair comes out.

use crate::{CameraPolicy, ContactPatch, ContactPixel, Params, Surface, VirtualCamera, Work};
use glamx::{Pose3, Vec3};
use thiserror::Error;

/// How the camera of a pair is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// This camera, in the frame of the first surface. One view.
    Fixed(VirtualCamera),
    /// Aimed by a policy.
    Aim {
        /// What decides the axes.
        policy: CameraPolicy,
        /// Motion of `b` relative to `a` over the step, gravity included, in the frame of `a`,
        /// metres. It tells from which side `b` comes if bounds and normals do not.
        motion: Vec3,
        /// Axis of the pair's main view in the last frame, in the frame of `a`. `b` stays on its
        /// side. The axis is kept while the normals of the contact zone agree with it within
        /// [`AXIS_HYSTERESIS`](crate::AXIS_HYSTERESIS), so that the pixel grid does not flicker.
        last_axis: Option<Vec3>,
    },
}

impl View {
    /// Aimed at the contact zone and, if it shows no crossing, in all directions. Without motion or
    /// memory.
    pub fn aimed() -> Self {
        Self::Aim {
            policy: CameraPolicy::AllDirections,
            motion: Vec3::ZERO,
            last_axis: None,
        }
    }
}

/// One pair to be compared.
#[derive(Clone, Copy)]
pub struct PairQuery<'a> {
    /// First surface, in its own frame, which is the frame of all results.
    pub a: Surface<'a>,
    /// Second surface, in its own frame.
    pub b: Surface<'a>,
    /// From the frame of `b` into the frame of `a`.
    pub a_from_b: Pose3,
    /// Where to look from.
    pub view: View,
    /// Parameters of the comparison.
    pub params: Params,
}

/// What the comparison of one pair found. All vectors are in the frame of the first surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PairResult {
    /// Whether the surfaces cross in more than one place, as far as the views show, or, if normals
    /// tell inside from outside, the solids overlap. Walls that all views see edge-on are missed.
    /// [`CameraPolicy::AllDirections`] leaves no such walls.
    pub collides: bool,
    /// Least signed gap in metres over all pixels that both surfaces cover (negative:
    /// penetration), or `None` where no pixel is shared within reach.
    pub gap: Option<f32>,
    /// Unit axes of the views in which contacts were looked for, from `b` towards `a`. Empty after an
    /// early rejection.
    pub axes: Vec<Vec3>,
    /// The least distance in metres by which `b` has to be moved against one of `axes` until the images show both surfaces apart;
    /// negative where they are, and `None` if no pixel shows both. No contact is deeper.
    pub way_out: Option<f32>,
    /// Pixels where the surfaces are within [`Params::prediction`] or penetrate.
    pub contacts: Vec<ContactPixel>,
    /// The factor by which the pixels of the contacts, and their grid of columns and rows, are
    /// larger than [`Params::pixel_size`]. There are three reasons: a first look settled a deep
    /// contact, the near points are coarser than the cloud's mean, or there were too many pixels
    /// for the points. `None` if the pixels have the size that was asked for.
    pub coarser: Option<f32>,
    /// The contact pixels grouped and reduced to what a solver needs, deepest patch first.
    pub patches: Vec<ContactPatch>,
    /// How much was drawn to find this. The GPU leaves it at zero.
    pub work: Work,
}

impl PairResult {
    /// Turns the axis of a view round: `b` is on the other side of `a`. The rows of the pixel grid along the opposite axis
    /// ([`VirtualCamera::along`](crate::VirtualCamera::along)) run the other way.
    ///
    /// ```
    /// use tldi::{ContactPixel, PairResult, glamx::Vec3};
    /// let contact = ContactPixel { pixel: [3, 4], ..Default::default() };
    /// let mut result = PairResult { axes: vec![Vec3::Z], contacts: vec![contact], ..Default::default() };
    /// result.turn_view(0);
    /// assert_eq!((result.axes[0], result.contacts[0].pixel), (-Vec3::Z, [3, -5]));
    /// ```
    pub fn turn_view(&mut self, view: usize) {
        self.axes[view] *= -1.0;
        let of_view = |contact: &&mut ContactPixel| contact.view as usize == view;
        for contact in self.contacts.iter_mut().filter(of_view) {
            contact.pixel[1] = -1 - contact.pixel[1];
        }
    }

    /// Empties the result, keeping its memory.
    pub fn clear(&mut self) {
        self.collides = false;
        self.gap = None;
        self.coarser = None;
        self.axes.clear();
        self.way_out = None;
        self.contacts.clear();
        self.patches.clear();
        self.work = Work::default();
    }
}

/// Why a backend could not finish a batch.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum BackendError {
    /// A pair cannot be compared in the way asked for.
    #[error("pair {pair} of the batch: {reason}")]
    Unsupported {
        /// Index into the batch.
        pair: usize,
        /// What is not supported, and what to do instead.
        reason: &'static str,
    },
    /// A device failed. The text names the device and gives its message.
    #[error("{0}")]
    Device(String),
}

/// Compares batches of pairs. All implementations give the same results (integer stages equal
/// exactly, float ones within a stated bound).
pub trait Backend: Send {
    /// Short name for reports of what compared the last batch: "cpu", "gpu", …
    fn name(&self) -> &str;

    /// Name of the device that compared the last batch, where it was not the CPU.
    fn adapter(&self) -> Option<&str> {
        None
    }

    /// Why the CPU compares batches although a GPU was wanted. `None` if nothing failed.
    fn fallback(&self) -> Option<&str> {
        None
    }

    /// Compares every pair of the batch. `results` gets one entry for each pair, in order. Existing
    /// entries are reused, so a warm caller allocates nothing.
    fn compare(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<(), BackendError>;
}
