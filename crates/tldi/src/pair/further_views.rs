//! Views beyond the first ones of a pair: spare ones, which only one surface faces, and those across all others. Stage
//! `further` of the GPU.
//!
//! Spare views are looked at where the others show a contact that seems too deep. Where the rim of a sheet is in the side of a
//! box, a view along the sheet's normal sees the box's height and takes it for the depth. The view along the normal of the side
//! tells better. It would tell nothing of a box that stands on a floor.

use crate::cpu::ways_out::WaysOut;
use crate::view::camera_policy::MAX_VIEWS;
use crate::{PairResult, Params};
use arrayvec::ArrayVec;
use glamx::Vec3;

/// Whether spare views are asked for: the least way out of the others, metres, exceeds a layer and four times `moved`. That is
/// the length of `b`'s motion, metres, if it was along the axis of the first view, and else 0: a body that came deep in this
/// step is where its motion says.
///
/// ```
/// use tldi::{Params, plan::asks_for_spare};
/// let params = Params::for_radius(0.01);
/// assert!(asks_for_spare(Some(0.1), 0.0, &params));
/// assert!(!asks_for_spare(Some(0.1), 0.05, &params));
/// ```
pub fn asks_for_spare(way_out: Option<f32>, moved: f32, params: &Params) -> bool {
    way_out.is_some_and(|back| WaysOut { back, on: 0.0 }.is_beyond(moved, params))
}

/// Takes the contacts and axes of the views from `first` on, which are spare, out of `result`, unless `way_out`, that of the
/// others, exceeds a layer and four times their least way out and `moved`. `result` has the way out of the spare ones, and
/// afterwards that of all that are left.
///
/// ```
/// use tldi::{PairResult, Params, glamx::Vec3, plan::settle_spare};
/// let spare = PairResult { axes: vec![Vec3::X, Vec3::Y], way_out: Some(0.01), ..Default::default() };
/// let axes_left = |way_out| {
///     let mut result = spare.clone();
///     settle_spare(&mut result, 1, Some(way_out), 0.0, &Params::for_radius(0.01));
///     result.axes.len()
/// };
/// assert_eq!([0.1, 0.02].map(axes_left), [2, 1]);
/// ```
pub fn settle_spare(
    result: &mut PairResult,
    first: usize,
    way_out: Option<f32>,
    moved: f32,
    params: &Params,
) {
    let is_less = |(back, on)| WaysOut { back, on }.is_beyond(moved, params);
    if !way_out.zip(result.way_out).is_some_and(is_less) {
        result.axes.truncate(first);
        result.contacts.retain(|c| (c.view as usize) < first);
        result.way_out = way_out;
    }
}

/// Unit vectors across `axes` and each other, which are themselves (nearly) so: together with them three.
pub(crate) fn further_axes(axes: &[Vec3]) -> ArrayVec<Vec3, MAX_VIEWS> {
    let mut further = ArrayVec::new();
    match axes {
        [axis] => further.extend(<[Vec3; 2]>::from(axis.any_orthonormal_pair())),
        [first, second] => further.extend(first.cross(*second).try_normalize()),
        _ => (),
    }
    further
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ContactPixel;

    /// Of two views, the second one spare: which ones are left, and the way out. A layer is 2 m, what is far longer 4 times.
    #[test]
    fn spare_views_count_where_their_way_out_is_far_shorter() {
        let params = Params::for_radius(1.0);
        let settled = |way_out: Option<f32>, of_spare: Option<f32>, moved: f32| {
            let of_view = |view| ContactPixel {
                view,
                ..Default::default()
            };
            let mut result = PairResult {
                axes: vec![Vec3::X, Vec3::Y],
                contacts: [1, 0, 1].map(of_view).to_vec(),
                way_out: of_spare,
                ..Default::default()
            };
            settle_spare(&mut result, 1, way_out, moved, &params);
            let left = (result.axes.len(), result.contacts.len());
            assert!(left == (2, 3) || left == (1, 1), "{left:?}");
            (left.0, result.way_out)
        };
        assert_eq!(settled(Some(9.0), Some(1.0), 0.0), (2, Some(1.0)));
        assert_eq!(settled(Some(9.0), Some(2.0), 0.0), (1, Some(9.0)));
        assert_eq!(settled(Some(9.0), Some(1.0), 2.0), (1, Some(9.0)));
        assert_eq!(settled(Some(9.0), None, 0.0), (1, Some(9.0)));
        assert_eq!(settled(None, Some(1.0), 0.0), (1, None));
        let asks = |way_out, moved| asks_for_spare(way_out, moved, &params);
        assert!(asks(Some(2.1), 0.0) && !asks(Some(1.9), 0.0));
        assert!(!asks(Some(5.0), 1.0) && asks(Some(6.1), 1.0) && !asks(None, 0.0));
    }

    #[test]
    fn further_axes_span_what_is_left() {
        let first = Vec3::new(0.6, 0.0, 0.8);
        let second = first.any_orthonormal_vector();
        for axes in [
            vec![first],
            vec![first, second],
            vec![first, second, first.cross(second)],
        ] {
            let all: Vec<Vec3> = axes.iter().copied().chain(further_axes(&axes)).collect();
            assert_eq!(all.len(), 3);
            let volume = all[0].dot(all[1].cross(all[2]));
            assert!((volume.abs() - 1.0).abs() < 1e-5, "{all:?}");
        }
    }
}
