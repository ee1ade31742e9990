//! Passes `blending` and `normalisation`: from the connected cylinders of a layer to its depths
//! and colour.

use super::back_visibility::back_visibility;
use super::fragments::Fragment;
use crate::{Facing, Layer};
use glamx::Vec3;

/// Blends the connected cylinders of one layer, at least one and in order of front depth, by their
/// weights.
///
/// Where all of them overlap each other in depth, both near and far blend all of them. Otherwise
/// the layer is stacked: near blends the frontmost cylinder and those that overlap it, far the
/// backmost and those that overlap it. Colour blends what near blends: the side that is seen.
/// The near depth is never behind the far depth: what far blends beyond near's cylinders lies
/// behind the frontmost, and what near blends beyond far's lies before the backmost. Rounding is
/// kept from breaking this, and from moving a depth outside of those it blends.
///
/// `colors` are those of the cloud's points; alpha is 0 without. Cost: linear in the cylinders.
pub(super) fn blending(members: &[Fragment], colors: Option<&[[u8; 4]]>) -> Layer {
    let frontmost = &members[0];
    let backmost = &members[back_visibility(members)];
    let last_near = members[members.len() - 1].near;
    let first_far = members.iter().fold(f32::INFINITY, |far, f| far.min(f.far));
    let stacked = last_near > first_far;

    // Depths are summed as offsets from the front, so that rounding is that of the layer's extent,
    // not of its distance from the camera.
    let base = frontmost.near;
    let mut near = Blend::default();
    let mut far = Blend::default();
    let mut color = [0.0; 4];
    for fragment in members {
        if !stacked || fragment.overlaps(frontmost) {
            near.add(fragment.weight, fragment.near - base);
            if let Some(colors) = colors {
                for (sum, c) in color.iter_mut().zip(colors[fragment.point as usize]) {
                    *sum += fragment.weight * f32::from(c);
                }
            }
        }
        if !stacked || fragment.overlaps(backmost) {
            far.add(fragment.weight, fragment.far - base);
        }
    }
    let near_depth = (base + near.normalised()).min(last_near);
    let far_depth = (base + far.normalised()).min(backmost.far).max(near_depth);
    Layer {
        near: near_depth,
        far: far_depth,
        depth: 0.5 * (near_depth + far_depth),
        normal: Vec3::ZERO,
        agreement: 1.0,
        facing: Facing::Unknown,
        color: color.map(|sum| (sum / near.weight).round() as u8),
    }
}

/// A weighted sum on its way to a mean.
#[derive(Default)]
struct Blend {
    weight: f32,
    sum: f32,
}

impl Blend {
    fn add(&mut self, weight: f32, value: f32) {
        self.weight += weight;
        self.sum += weight * value;
    }

    fn normalised(&self) -> f32 {
        self.sum / self.weight
    }
}
