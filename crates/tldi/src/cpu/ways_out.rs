//! First half of the stage `compare`: how far the surfaces have to be moved along a view's axis to be apart.

use super::compare::FARTHEST;
use super::sweep::is_edge_on;
use crate::{Layer, Params, Tldi};

/// How far `b` has to be moved along a view's axis until no pixel shows it and `a` in each other, metres; negative where they
/// are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WaysOut {
    /// Against the axis, to the side of `a` where `b` is, as the axis says.
    pub(crate) back: f32,
    /// Along the axis, to the other side.
    pub(crate) on: f32,
}

impl WaysOut {
    /// By all that two images of one camera and rectangle show; `None` if no pixel shows both surfaces.
    pub(super) fn of_all(a: &Tldi, b: &Tldi) -> Option<Self> {
        Self::of(a, b, |_| true)
    }

    /// By what faces the view. A wall that is seen edge-on is beside `b`, on neither side.
    pub(super) fn of_faces(a: &Tldi, b: &Tldi) -> Option<Self> {
        Self::of(a, b, |layer| !is_edge_on(layer))
    }

    fn of(a: &Tldi, b: &Tldi, counts: impl Fn(&Layer) -> bool) -> Option<Self> {
        let span = |image: &Tldi, k| {
            let mut layers = image.layers_of(k).iter().filter(|layer| counts(layer));
            let first = layers.next()?;
            Some([first.near, layers.next_back().unwrap_or(first).far])
        };
        let in_pixel = |k| {
            let ([near_a, far_a], [near_b, far_b]) = (span(a, k)?, span(b, k)?);
            Some(Self {
                back: far_b - near_a,
                on: far_a - near_b,
            })
        };
        let pixels = (0..a.pixel_count()).filter_map(in_pixel);
        pixels.reduce(|ways, way| Self {
            back: ways.back.max(way.back),
            on: ways.on.max(way.on),
        })
    }

    /// Whether `b` is on the other side of `a` than the axis says, if nothing but a guess told that: the way back is by far the
    /// longer one, and by far longer than `b` moved in this step. `moved` is the length of that motion, metres, if it was along
    /// the axis, and else 0. With half of `FARTHEST` here, or twice, no test fails.
    pub(crate) fn is_beyond(self, moved: f32, params: &Params) -> bool {
        self.back > FARTHEST * self.on.max(moved) + params.thickness
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Facing;
    use glamx::Vec3;

    fn layer(near: f32, far: f32, normal: Vec3) -> Layer {
        Layer {
            near,
            far,
            depth: 0.5 * (near + far),
            normal,
            agreement: 1.0,
            facing: Facing::Unknown,
            color: [0; 4],
        }
    }

    /// `a` is from 10 to 20, `b` from 6 to 13: it goes back by 3 and on by 14. A wall in another pixel, from 0 to 30, is only in
    /// the way of all layers.
    #[test]
    fn ways_are_the_longest_of_all_pixels() {
        let face = |depth: f32| layer(depth, depth, Vec3::Z);
        let wall = layer(0.0, 30.0, Vec3::X);
        let (a, b) = ([face(10.0), face(20.0)], [face(6.0), face(13.0)]);
        let lower = [face(8.0), face(11.0)];
        let image_a = Tldi::of_rows(1, &[&a, &a, &[wall], &a, &[]]);
        let image_b = Tldi::of_rows(1, &[&lower, &b, &b, &[], &b]);
        let faces = WaysOut {
            back: 3.0,
            on: 14.0,
        };
        assert_eq!(WaysOut::of_faces(&image_a, &image_b), Some(faces));
        let all = WaysOut {
            back: 13.0,
            on: 24.0,
        };
        assert_eq!(WaysOut::of_all(&image_a, &image_b), Some(all));
        assert_eq!(
            WaysOut::of_all(&Tldi::of_rows(1, &[&a, &[]]), &Tldi::of_rows(1, &[&[], &b])),
            None
        );
    }

    /// By far the shorter way counts, but not against the motion, and not for less than a layer.
    #[test]
    fn a_body_is_where_its_way_out_is_less() {
        let params = Params::for_radius(1.0);
        let is_beyond = |back, on, moved| WaysOut { back, on }.is_beyond(moved, &params);
        let layer = params.thickness;
        assert!(is_beyond(9.0, 1.0, 0.0) && is_beyond(9.0, -1.0, 0.0));
        assert!(!is_beyond(1.0, 9.0, 0.0));
        assert!(!is_beyond(9.0, 3.0, 0.0) && !is_beyond(9.0, 1.0, 3.0));
        assert!(!is_beyond(0.9 * layer, -9.0, 0.0) && is_beyond(1.1 * layer, -9.0, 0.0));
    }
}
