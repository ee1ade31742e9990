//! Gaussian splats as points of a surface.
//!
//! A splat is a Gaussian ellipsoid (Kerbl et al. 2023, doi:10.1145/3592433). Files store the logarithms of its
//! standard deviations, a quaternion that turns it, the logit of its opacity, and the constant term of its
//! colour in spherical harmonics.

use tldi::glamx::{Quat, Vec3};

/// Values of a splat: three of size, four of rotation, opacity, three of colour.
pub(crate) const PARTS: usize = 11;

/// The third size, along the normal of a flat splat (Huang et al. 2024, doi:10.1145/3641519.3657428), whose files lack it.
const THICKNESS: usize = 2;
const ROTATION: usize = 3;
const OPACITY: usize = 7;
const COLOR: usize = 8;

/// The constant spherical harmonic, 1 / (2 √π).
const CONSTANT_HARMONIC: f32 = 0.282_094_8;

/// Values of a splat of which the file has none: it is flat.
pub(crate) const EMPTY: [f32; PARTS] = {
    let mut parts = [0.0; PARTS];
    parts[THICKNESS] = f32::NEG_INFINITY;
    parts
};

/// Values that a splat cannot do without.
pub(crate) fn is_needed(part: usize) -> bool {
    part < COLOR && part != THICKNESS
}

/// Values of its colour.
pub(crate) fn is_color(part: usize) -> bool {
    part >= COLOR
}

/// The part that a property of the name, in lower case, stands for.
pub(crate) fn part_from_name(name: &str) -> Option<usize> {
    let names = [
        "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",
        "f_dc_1", "f_dc_2",
    ];
    names.iter().position(|known| *known == name)
}

/// What a splat is as a point.
pub(crate) struct SplatPoint {
    /// Unit length, of either sign.
    pub(crate) normal: [f32; 3],
    /// In units of the file.
    pub(crate) radius: f32,
    /// Red, green, blue, alpha, 0 to 255.
    pub(crate) color: [f32; 4],
}

/// The point of a splat with these `parts`, or `None` if it has less than the least opacity, or no extent or
/// direction.
pub(crate) fn point(parts: &[f32; PARTS], least_opacity: f32) -> Option<SplatPoint> {
    let opacity = 1.0 / (1.0 + (-parts[OPACITY]).exp());
    let sigmas = Vec3::new(parts[0], parts[1], parts[2]).exp();
    let [w, x, y, z] = std::array::from_fn(|k| parts[ROTATION + k]);
    let rotation = Quat::from_xyzw(x, y, z, w);
    let length = rotation.length();
    let shortest = sigmas.min_position();
    // Of the disc with the area of the two longer axes' ellipse.
    let radius = (sigmas[(shortest + 1) % 3] * sigmas[(shortest + 2) % 3]).sqrt();
    let is_sound = length.is_finite() && length > 0.0 && sigmas.is_finite() && radius > 0.0;
    let channel = |k: usize| 255.0 * (0.5 + CONSTANT_HARMONIC * parts[COLOR + k]);
    (is_sound && opacity >= least_opacity).then(|| SplatPoint {
        normal: (rotation.normalize() * Vec3::AXES[shortest]).to_array(),
        radius,
        color: [channel(0), channel(1), channel(2), 255.0 * opacity],
    })
}
