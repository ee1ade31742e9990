//! The seam between callers and implementations: a batch of pairs in, a result per pair out.

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
        /// metres: tells from which side `b` comes, where the bounds and normals do not.
        motion: Vec3,
        /// Axis of the pair's main view in the frame before, in the frame of `a`: the side that `b`
        /// was on is kept, and the axis while the zone's normals agree with it within
        /// [`AXIS_HYSTERESIS`](crate::AXIS_HYSTERESIS), so that the pixel grid does not flicker.
        last_axis: Option<Vec3>,
    },
}

impl View {
    /// Aimed at the contact zone, and where it shows no crossing, in all directions; without motion or
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
    /// Whether the views show that the surfaces cross, in more than one place, or that the solids
    /// overlap where normals tell inside from outside. Walls that cross where all views see them
    /// edge-on are missed: [`CameraPolicy::AllDirections`] leaves no such walls.
    pub collides: bool,
    /// Least signed gap in metres over all pixels that both surfaces cover (negative:
    /// penetration), or `None` where no pixel is shared within reach.
    pub gap: Option<f32>,
    /// Axes of the views that contacts are from, unit length, from `b` towards `a`; empty after an early
    /// rejection.
    pub axes: Vec<Vec3>,
    /// Pixels where the surfaces are within [`Params::prediction`] or penetrate.
    pub contacts: Vec<ContactPixel>,
    /// How many times as large as asked for the pixels of the contacts are, and the grid of their columns and rows
    /// with them: where a first look settled what is deep, where the points that are near are coarser than the cloud's mean,
    /// or where there were too many pixels for the points. `None` where they have the size of [`Params::pixel_size`].
    pub coarser: Option<f32>,
    /// The contact pixels grouped and reduced to what a solver needs, deepest patch first.
    pub patches: Vec<ContactPatch>,
    /// How much was modelled to find this; zero from the GPU.
    pub work: Work,
}

impl PairResult {
    /// Empties the result, keeping its memory.
    pub fn clear(&mut self) {
        self.collides = false;
        self.gap = None;
        self.coarser = None;
        self.axes.clear();
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
    /// A device failed. What it says, and of which device.
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

    /// Why batches are compared on the CPU though a GPU would be taken; `None` where nothing failed.
    fn fallback(&self) -> Option<&str> {
        None
    }

    /// Compares every pair of the batch; `results` gets one entry a pair, in order. Entries that
    /// are already there are reused, so that a warm caller allocates nothing.
    fn compare(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<(), BackendError>;
}
