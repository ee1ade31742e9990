//! Stages of the CPU backend as spans, so that a subscriber of `tracing` can see where the time of a step goes.
//!
//! `points` (a cloud takes points), `cull`, `zone`, `aim`, `columns`, `normals`, `splat`, `sweep`, `cast`, `compare`,
//! `patches`; `cells` and `windows` of the first look; `impact`. A stage may run within another: the proof by windows
//! splats, too. A span is of the thread that opens it.

/// Opens the span of a stage, which ends with the scope of what this returns. Does nothing without the feature
/// `tracing`.
#[cfg(feature = "tracing")]
macro_rules! stage {
    ($name:literal) => {
        tracing::trace_span!($name).entered()
    };
}

/// The same without the feature `tracing`.
#[cfg(not(feature = "tracing"))]
macro_rules! stage {
    ($name:literal) => {
        $crate::stage::Untold
    };
}

pub(crate) use stage;

/// In place of a span.
#[cfg(not(feature = "tracing"))]
pub(crate) struct Untold;
