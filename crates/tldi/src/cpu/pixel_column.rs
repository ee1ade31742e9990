//! What the ray of a pixel passes of one surface: part of the stage `compare`.

use super::rims::End;
use super::sweep::{is_edge_on, share_of};
use crate::{Facing, Layer, Params};
use glamx::Vec3;

/// Depths between which a body lies, by its bounds, where its size says that it is one.
///
/// Where a layer is missing, the smaller surface of a pair counts as a body: it reaches at least to the middle of its bounds,
/// and at most to their end if oriented normals tell that its inside begins there. The larger one counts as a sheet without
/// a volume or, with such normals, as a solid without an end.
#[derive(Clone, Copy)]
pub(crate) struct Span {
    pub(crate) near: f32,
    pub(crate) far: f32,
}

impl Span {
    fn middle(self) -> f32 {
        0.5 * (self.near + self.far)
    }
}

/// The layers of one surface in one pixel, in order of depth.
#[derive(Clone, Copy)]
pub(super) struct PixelColumn<'a> {
    layers: &'a [Layer],
    body: Option<Span>,
    /// Where the surface ends in its rim, if it does: the outermost layer there stands for it.
    rim: Option<End>,
    /// A sheet seen from behind: what its layers face says nothing.
    is_turned: bool,
}

impl<'a> PixelColumn<'a> {
    pub(super) fn new(layers: &'a [Layer], body: Option<Span>) -> Self {
        Self {
            layers,
            body,
            rim: None,
            is_turned: false,
        }
    }

    /// As the body that the other one meets at this `end`.
    pub(super) fn met_at(self, end: End, from_behind: bool, ends_in_rim: bool) -> Self {
        let column = Self {
            rim: ends_in_rim.then_some(end),
            ..self
        };
        let is_turned = from_behind && column.all().all(|layer| layer.facing != end.met());
        Self {
            is_turned,
            ..column
        }
    }

    pub(super) fn len(&self) -> usize {
        self.layers.len()
    }

    /// The rim of a surface is where it ends, across the view.
    pub(super) fn layer(&self, k: usize) -> Layer {
        let layer = self.layers[k];
        match self.rim_at(k) {
            Some(end) => Layer {
                depth: end.depth(&layer),
                normal: Vec3::Z,
                facing: Facing::Unknown,
                ..layer
            },
            None => layer,
        }
    }

    fn rim_at(&self, k: usize) -> Option<End> {
        self.rim.filter(|end| end.outermost(self.len()) == k)
    }

    /// Whether the surface ends in its rim at layer `k`.
    pub(super) fn is_rim(&self, k: usize) -> bool {
        self.rim_at(k).is_some()
    }

    /// Weight of the normal of layer `k`: see [`share_of`]. A rim has none.
    pub(super) fn share_of(&self, k: usize, side: f32) -> f32 {
        match self.is_rim(k) {
            true => 0.0,
            false => share_of(&self.layers[k], side),
        }
    }

    fn all(&self) -> impl DoubleEndedIterator<Item = Layer> + ExactSizeIterator {
        (0..self.len()).map(|k| self.layer(k))
    }

    pub(super) fn facing(&self, layer: &Layer) -> Facing {
        match self.is_turned {
            true => Facing::Unknown,
            false => layer.facing,
        }
    }

    /// Whether layer `k` of unknown facing is where the ray enters the surface: the first one, and more of the surface comes
    /// before the ray leaves the other body, whose inside is known, at depth `left`. So it is not an exit in that body. A box
    /// on a table, its front a little behind the table's edge, is not in the side of the table.
    pub(super) fn is_entered_at(&self, k: usize, left: f32) -> bool {
        self.facing(&self.layer(k)) == Facing::Unknown
            && self.all().take(k).all(|layer| is_edge_on(&layer))
            && (self.all().nth(k + 1)).is_some_and(|next| next.depth <= left)
    }

    /// The same of where it is left: the last one, and more of the surface comes after the ray entered the other body.
    pub(super) fn is_left_at(&self, k: usize, entered: f32) -> bool {
        self.facing(&self.layer(k)) == Facing::Unknown
            && self.all().skip(k + 1).all(|layer| is_edge_on(&layer))
            && (self.all().take(k).next_back()).is_some_and(|last| last.depth >= entered)
    }

    /// Depth at which the ray entered the body that it leaves at layer `k`. If the entry is missing, the body's bounds decide.
    /// Two exits in a row mean that a layer was missed: only one thickness counts.
    pub(super) fn entered_at(&self, k: usize, params: &Params) -> f32 {
        let exit = self.layer(k);
        let thin = exit.depth - params.thickness;
        let before = self.all().take(k).rfind(|layer| !is_edge_on(layer));
        match (self.facing(&exit), before) {
            (Facing::Exit, None) => thin.min(self.body.map_or(f32::NEG_INFINITY, |body| body.near)),
            (Facing::Exit, Some(l)) if l.facing != Facing::Entry => thin,
            (_, Some(l)) => l.depth,
            (_, None) => thin.min(self.body.map_or(f32::INFINITY, Span::middle)),
        }
    }

    /// Depth at which the ray leaves the part of a body that it enters through layer `k`.
    pub(super) fn left_at(&self, k: usize, params: &Params) -> f32 {
        let entry = self.layer(k);
        let thin = entry.depth + params.thickness;
        let behind = self.all().skip(k + 1).find(|layer| !is_edge_on(layer));
        match (self.facing(&entry), behind) {
            (Facing::Entry, None) => thin.max(self.body.map_or(f32::INFINITY, |body| body.far)),
            (Facing::Entry, Some(l)) if l.facing != Facing::Exit => thin,
            (_, Some(l)) => l.depth,
            (_, None) => thin.max(self.body.map_or(f32::NEG_INFINITY, Span::middle)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(depth: f32, facing: Facing) -> Layer {
        Layer {
            near: depth,
            far: depth,
            depth,
            normal: Vec3::Z,
            agreement: 1.0,
            facing,
            color: [0; 4],
        }
    }

    /// Where a ray entered what it leaves last, and left what it enters first, for a thickness of 2.
    #[test]
    fn rays_that_missed_a_layer_tell_nothing_of_the_inside() {
        let params = Params::for_radius(1.0);
        let entry = |depth| layer(depth, Facing::Entry);
        let exit = |depth| layer(depth, Facing::Exit);
        let unknown = |depth| layer(depth, Facing::Unknown);
        let entered_in = |layers: &[Layer], body| {
            PixelColumn::new(layers, body).entered_at(layers.len() - 1, &params)
        };
        let left_in = |layers: &[Layer], body| PixelColumn::new(layers, body).left_at(0, &params);
        let entered = |layers: &[Layer]| entered_in(layers, None);
        assert_eq!(entered(&[entry(1.0), exit(9.0)]), 1.0);
        assert_eq!(entered(&[exit(9.0)]), f32::NEG_INFINITY);
        // The entry belongs to the first exit.
        assert_eq!(entered(&[entry(1.0), exit(3.0), exit(9.0)]), 7.0);
        assert_eq!(entered(&[unknown(1.0), unknown(9.0)]), 1.0);
        let left = |layers: &[Layer]| left_in(layers, None);
        assert_eq!(left(&[entry(1.0), exit(9.0)]), 9.0);
        assert_eq!(left(&[entry(1.0)]), f32::INFINITY);
        assert_eq!(left(&[entry(1.0), entry(5.0), exit(9.0)]), 3.0);
        // What is seen edge-on is passed over.
        let mut edge_on = exit(5.0);
        edge_on.normal = Vec3::X;
        assert_eq!(left(&[entry(1.0), edge_on, exit(9.0)]), 9.0);
        // A body ends with its bounds, but holds at least its layer.
        let body = Some(Span {
            near: -2.0,
            far: 12.0,
        });
        assert_eq!(entered_in(&[exit(9.0)], body), -2.0);
        assert_eq!(left_in(&[entry(1.0)], body), 12.0);
        assert_eq!(entered_in(&[unknown(9.0)], body), 5.0);
        assert_eq!(left_in(&[unknown(1.0)], body), 5.0);
        assert_eq!(entered_in(&[exit(-3.0)], body), -5.0);
        assert_eq!(left_in(&[entry(13.0)], body), 15.0);
    }
}
