//! Where a surface ends in its rim: part of the stage `compare`.
//!
//! A ray that passes a wall along itself meets no face of it. Of a closed body, a face follows where the wall ends. An open
//! one, as a card, a scan without its bottom or a dome, touches with the end of the wall.

use super::crossings::neighbors_toward;
use super::cull::Region;
use super::splat::STEEP;
use super::sweep::is_edge_on;
use crate::{Facing, Layer, Params, Tldi};
use glamx::Vec2;

/// One of the two ends of what a pixel shows of a surface.
#[derive(Clone, Copy)]
pub(super) enum End {
    /// Where rays enter it first. The other surface is in front.
    Near,
    /// Where rays leave it last. The other surface is behind.
    Far,
}

impl End {
    /// Depth at which a layer ends there, metres.
    pub(super) fn depth(self, layer: &Layer) -> f32 {
        match self {
            Self::Near => layer.near,
            Self::Far => layer.far,
        }
    }

    /// 1 if depths grow towards it, else -1.
    fn sign(self) -> f32 {
        match self {
            Self::Near => -1.0,
            Self::Far => 1.0,
        }
    }

    /// Of a pixel with so many layers, the outermost one.
    pub(super) fn outermost(self, layers: usize) -> usize {
        match self {
            Self::Near => 0,
            Self::Far => layers.saturating_sub(1),
        }
    }

    /// What a layer faces that the other surface can meet.
    pub(super) fn met(self) -> Facing {
        match self {
            Self::Near => Facing::Entry,
            Self::Far => Facing::Exit,
        }
    }
}

/// A pixel in the image of one surface.
#[derive(Clone, Copy)]
pub(super) struct SurfacePixel<'a> {
    pub(super) image: &'a Tldi,
    /// Column and row in the image.
    pub(super) at: [u32; 2],
    /// The same in the view's pixel grid.
    pub(super) in_view: [i32; 2],
    /// Which points of the surface are in the image; `None` where an image does not show rims.
    pub(super) region: Option<&'a Region>,
}

impl SurfacePixel<'_> {
    /// Whether the outermost layer is a rim. It is steep, and nothing of the surface goes on beyond it: down the slope at the
    /// far end, up at the near one. Neither in this pixel nor beside it is a face at its end, nor anything whose outward normal
    /// says that the other surface can meet it: a silhouette of a closed body, where rays miss a layer now and then, is no rim.
    ///
    /// What was not culled is missing from the image, too. But that is more than a thickness beyond what can touch.
    pub(super) fn ends_in_rim(&self, end: End, params: &Params) -> bool {
        let Self { image, at, .. } = *self;
        let layers = image.layers_at(at[0], at[1]);
        let Some((region, layer)) = self.region.zip(layers.get(end.outermost(layers.len()))) else {
            return false;
        };
        if !is_steep(layer) {
            return false;
        }
        let beyond = |other: &Layer| end.sign() * (end.depth(other) - end.depth(layer));
        let is_met = |other: &Layer| {
            other.facing == end.met() || !is_steep(other) && beyond(other) > -params.thickness
        };
        let goes_on = |other: &Layer| is_steep(other) && beyond(other) > 0.0;
        let here_or_beside = |side: Vec2| {
            let beside = neighbors_toward(image, at, side).flatten();
            beside.chain([layers]).flatten()
        };
        let down = -end.sign() * layer.normal.z.signum() * layer.normal.truncate();
        if here_or_beside(Vec2::ZERO).any(is_met)
            || here_or_beside(down).any(goes_on)
            // A wall that is seen edge-on may lean to either side.
            || is_edge_on(layer) && here_or_beside(-down).any(goes_on)
        {
            return false;
        }
        let [u, v] = self.in_view.map(|c| c as f32 + 0.5);
        let place = image.camera.point_at(u, v, end.depth(layer));
        region.loosened(-params.thickness).contains(place)
    }
}

/// Whether depths vary so much within a pixel that a layer is no face that the other surface meets there.
fn is_steep(layer: &Layer) -> bool {
    layer.normal.z.abs() < STEEP
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use glamx::Vec3;

    /// Rays go along z, and the slope falls along x by `fall` per metre.
    fn layer(near: f32, far: f32, fall: f32, facing: Facing) -> Layer {
        Layer {
            near,
            far,
            depth: 0.5 * (near + far),
            normal: Vec3::new(fall, 0.0, -1.0).normalize(),
            agreement: 1.0,
            facing,
            color: [0; 4],
        }
    }

    /// Whether what the middle one of three columns shows ends in a rim, far away and near. The first and the last point that
    /// can touch have these depths.
    fn rims(columns: [&[Layer]; 3], [first, last]: [f32; 2]) -> [bool; 2] {
        let image = Tldi::of_rows(3, &columns);
        let region = Region::of_box(Aabb {
            min: Vec3::new(-9.0, -9.0, first),
            max: Vec3::new(9.0, 9.0, last),
        });
        let params = Params::for_radius(1.0);
        let pixel = SurfacePixel {
            image: &image,
            at: [1, 1],
            in_view: [1, 1],
            region: Some(&region.loosened(params.thickness)),
        };
        [End::Far, End::Near].map(|end| pixel.ends_in_rim(end, &params))
    }

    const ALL: [f32; 2] = [-99.0, 99.0];

    #[test]
    fn a_wall_ends_where_nothing_goes_on() {
        let wall = |near, far| layer(near, far, 99.0, Facing::Unknown);
        let card = [wall(0.0, 20.0)];
        assert_eq!(rims([&[], &card, &[]], ALL), [true, true]);
        // Beyond what can touch, points were not culled.
        assert_eq!(rims([&[], &card, &[]], [-1.0, 19.0]), [false, true]);
        assert_eq!(rims([&[], &card, &[]], [1.0, 21.0]), [true, false]);
        // It leans, or its points lie in two columns: only the outermost ones are its rim.
        let further = [wall(5.0, 21.0)];
        assert_eq!(rims([&further, &card, &[]], ALL), [false, true]);
        assert_eq!(rims([&[], &card, &further], ALL), [false, true]);
        let upper = [wall(-1.0, 3.0)];
        assert_eq!(rims([&upper, &card, &[]], ALL), [true, false]);
        // The bottom of a box, and its top: exact or with the splats of two faces in them.
        let bottom = [layer(19.0, 19.0, 0.0, Facing::Exit)];
        assert_eq!(rims([&bottom, &card, &[]], ALL), [false, true]);
        assert_eq!(rims([&[], &[card[0], bottom[0]], &[]], ALL), [false, true]);
        let top = [layer(1.0, 1.0, 0.0, Facing::Unknown)];
        assert_eq!(rims([&[], &card, &top], ALL), [true, false]);
    }

    /// A slope of 63° that falls along x: from where it is above to where it ends below.
    #[test]
    fn a_slope_ends_below_where_it_does_not_go_on() {
        let slope = |depth: f32, facing| [layer(depth - 1.0, depth + 1.0, 2.0, facing)];
        for facing in [Facing::Unknown, Facing::Entry] {
            let [above, here, below] = [8.0, 10.0, 12.0].map(|depth| slope(depth, facing));
            let is_near = facing == Facing::Unknown;
            assert_eq!(rims([&above, &here, &below], ALL), [false, false]);
            assert_eq!(rims([&above, &here, &[]], ALL), [true, false]);
            assert_eq!(rims([&[], &here, &below], ALL), [false, is_near]);
        }
        // What rays leave there they meet.
        let [above, here] = [8.0, 10.0].map(|depth| slope(depth, Facing::Exit));
        assert_eq!(rims([&above, &here, &[]], ALL), [false, false]);
        // A slope of less than 37° is a face.
        let face = [layer(9.0, 11.0, 0.7, Facing::Unknown)];
        assert_eq!(rims([&[], &face, &[]], ALL), [false, false]);
    }
}
