//! Random numbers for generated scenes.

use fastrand::Rng;

/// A number of nearly normal distribution, of mean 0 and standard deviation 1: a sum of three uniform ones has a
/// variance of 1/4.
pub(crate) fn normal(rng: &mut Rng) -> f32 {
    2.0 * (rng.f32() + rng.f32() + rng.f32() - 1.5)
}

/// A number of even distribution.
pub(crate) fn between(rng: &mut Rng, [low, high]: [f32; 2]) -> f32 {
    low + (high - low) * rng.f32()
}
