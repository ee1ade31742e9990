//! Where coordinates count from, so that they fit into `f32`.

use tldi::glamx::DVec3;

/// Farther than this from zero, in units of the file, coordinates are moved: there, steps of `f32`
/// reach 2⁻¹¹ (half a millimetre in metres).
pub(crate) const FAR: f64 = 4096.0;

/// The origin for these places: on each axis the median, rounded, if it is farther than [`FAR`] from zero; zero if not.
pub(crate) fn near(places: &[DVec3]) -> DVec3 {
    let axis = |axis: usize| {
        let coordinates = places.iter().map(|place| place[axis]);
        let mut coordinates: Vec<f64> = coordinates.filter(|c| c.is_finite()).collect();
        coordinates.sort_unstable_by(f64::total_cmp);
        let median = coordinates.get(coordinates.len() / 2).copied();
        median.filter(|m| m.abs() > FAR).map_or(0.0, f64::round)
    };
    DVec3::new(axis(0), axis(1), axis(2))
}
