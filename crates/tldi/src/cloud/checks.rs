//! Checks of what a cloud is given, before its values are read.

use crate::{CloudError, NonFinite};

/// Most points of a cloud: indices, and counts of up to 64 pixels for each point, fit 32 bits.
const MAX_POINTS: usize = (u32::MAX / 64) as usize;

/// Fails for more points than a cloud can have.
pub(crate) fn check_count(count: usize) -> Result<(), CloudError> {
    if count > MAX_POINTS {
        return Err(CloudError::TooManyPoints {
            count,
            limit: MAX_POINTS,
        });
    }
    Ok(())
}

/// Fails if an attribute does not have one entry for each point.
pub(crate) fn check_length(
    attribute: &'static str,
    actual: usize,
    expected: usize,
) -> Result<(), CloudError> {
    if actual != expected {
        return Err(CloudError::LengthMismatch {
            attribute,
            expected,
            actual,
        });
    }
    Ok(())
}

/// Fails if the policy refuses the non-finite points, or no other is left of `count`.
pub(crate) fn check_dropped(
    policy: NonFinite,
    count: usize,
    dropped: &[u32],
) -> Result<(), CloudError> {
    match dropped.first() {
        Some(&first) if policy == NonFinite::Refuse => Err(CloudError::NonFinite {
            index: first as usize,
            count: dropped.len(),
        }),
        _ if dropped.len() == count => Err(CloudError::Empty {
            dropped: dropped.len(),
        }),
        _ => Ok(()),
    }
}
