//! The least way out decides how deep surfaces are in each other.
//!
//! A view from the side of a shallow overlap sees its width, which is more than its depth. Along the way on which such a
//! contact pixel would push the bodies apart, another view sees them overlap by much less. And no overlap is deeper than the
//! way by which one body must move for everything in a view to come apart.

use crate::contact::retain_by_index;
use crate::view::camera_policy::MAX_VIEWS;
use crate::{ContactPixel, PairResult, Params, VirtualCamera};
use arrayvec::ArrayVec;

/// The share of a contact's depth by which another view must see the surfaces overlap for the contact to count: along
/// an axis 60° from the way out an overlap seems twice as deep as it is. Half: 5 of 300 overlaps are falsely deep
/// instead of 4; twice: no row changes.
const LEAST_ELSEWHERE: f32 = 0.5;

/// Most places along a contact's ray that are looked up in another view, so that deep contacts cost no more.
/// With 4, twice as many clouds with normals are told to be much too deep. Half or twice: no row changes.
const MOST_PLACES: f32 = 16.0;

/// Memory of [`WayOut::keep_least`], kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct WayOut {
    is_wide: Vec<bool>,
}

impl WayOut {
    /// Drops the contact pixels deeper than the [least way out](PairResult::way_out), by more than a pixel: so much the images
    /// of a place differ. Then drops those deeper than a layer that lead through a place where another view sees the surfaces
    /// apart or in each other by less than half of that, and the pixels that are apart by more than contacts are asked for.
    /// Contact pixels are ordered by view, row and column.
    ///
    /// Cost: for each deep pixel and each other view up to 17 binary searches.
    pub(crate) fn keep_least(&mut self, result: &mut PairResult, params: &Params) {
        let deepest = result.way_out.map(|way| way.max(0.0) + params.pixel_size);
        let PairResult { axes, contacts, .. } = result;
        if let Some(deepest) = deepest {
            contacts.retain(|contact| -contact.gap <= deepest);
        }
        let pixel = params.pixel_size;
        let cameras: ArrayVec<_, MAX_VIEWS> = (axes.iter())
            .map(|axis| VirtualCamera::along(*axis, pixel))
            .collect();
        self.is_wide.clear();
        let is_deep = |contact: &ContactPixel| contact.gap < -params.thickness;
        self.is_wide.extend(contacts.iter().map(|contact| {
            is_deep(contact)
                && (cameras.iter().enumerate())
                    .filter(|(view, _)| *view != contact.view as usize)
                    .any(|(view, camera)| {
                        let contacts = of_view(contacts, view as u32);
                        is_less_elsewhere(contact, contacts, camera, params)
                    })
        }));
        retain_by_index(contacts, |k, contact| {
            !self.is_wide[k] && contact.gap <= params.seen_gap()
        });
    }
}

fn of_view(contacts: &[ContactPixel], view: u32) -> &[ContactPixel] {
    let start = contacts.partition_point(|c| c.view < view);
    let end = contacts.partition_point(|c| c.view <= view);
    &contacts[start..end]
}

/// Whether the contact pixels of another view, that of `camera`, show somewhere along the ray of `contact` from one
/// surface to the other that these are apart or in each other by much less.
fn is_less_elsewhere(
    contact: &ContactPixel,
    others: &[ContactPixel],
    camera: &VirtualCamera,
    params: &Params,
) -> bool {
    let [from, to] = [contact.point_a, contact.point_b].map(|p| camera.view_from_point(p));
    let steps = (from.distance(to) / params.pixel_size).ceil();
    let steps = steps.min(MOST_PLACES);
    (0..=steps as u32).any(|step| {
        let at = from.lerp(to, step as f32 / steps);
        let [i, j] = [at.x, at.y].map(|c| (c / params.pixel_size).floor() as i32);
        let place = |c: &ContactPixel| (c.pixel[1], c.pixel[0]);
        let first = others.partition_point(|c| place(c) < (j, i));
        let there = others[first..].iter().take_while(|c| place(c) == (j, i));
        there.into_iter().any(|c| {
            let [a, b] = [c.point_a, c.point_b].map(|p| camera.view_from_point(p).z);
            let reaches = a.min(b) - params.thickness..=a.max(b) + params.thickness;
            c.gap > LEAST_ELSEWHERE * contact.gap && reaches.contains(&at.z)
        })
    })
}
