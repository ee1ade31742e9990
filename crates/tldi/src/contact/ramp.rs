//! How far a value has come between two bounds.

/// 0 up to `start`, 1 from `end` on.
pub(crate) fn ramp(value: f32, [start, end]: [f32; 2]) -> f32 {
    ((value - start) / (end - start)).clamp(0.0, 1.0)
}
