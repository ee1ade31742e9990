//! How far a value is beyond a threshold.

/// How far, by the ratio of a value to its threshold: 0 up to the threshold, 1 from one and a half times the threshold on, and
/// even in between. So a decision by a threshold does not jump from frame to frame.
pub(crate) fn beyond(ratio: f32) -> f32 {
    (2.0 * (ratio - 1.0)).clamp(0.0, 1.0)
}
