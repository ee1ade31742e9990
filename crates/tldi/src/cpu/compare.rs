//! Stage `compare`: two images of one camera, pixel by pixel.
//!
//! `crossings` tells whether the surfaces cross. Contact pixels pair a layer through which rays leave the second body with
//! one through which they enter the first; and the other way round where the normals of both tell what is outside.

use super::crossings::{Crossings, best_seen};
use super::cull::Region;
use super::fold::ViewFold;
use super::pixel_column::{PixelColumn, Span};
use super::rims::{End, SurfacePixel};
use super::sweep::{is_edge_on, share_of};
use super::ways_out::WaysOut;
use crate::stage::stage;
use crate::view::camera_policy::MAX_VIEWS;
use crate::{ContactPixel, Facing, Layer, PairResult, Params, Tldi, VirtualCamera};
use arrayvec::ArrayVec;
use glamx::{Pose3, Vec3};

/// What is known of a view beside its images.
#[derive(Clone, Copy, Default)]
pub(crate) struct Seen<'a> {
    /// Of this view and of all that it shares the surfaces with, unit vectors from `b` to `a`.
    pub(crate) axes: &'a [Vec3],
    /// Index of this view's axis.
    pub(crate) view: usize,
    /// Of `a` and `b`.
    pub(crate) bodies: [Option<Span>; 2],
    /// Whether the outward normals of `a`, and of `b`, say that the view looks at it from behind.
    pub(crate) from_behind: [bool; 2],
    /// Whether normals tell the outsides of both. Then contacts on the other side of `a` are looked for, too: the layers
    /// say which of them can touch.
    pub(crate) tells_facing: bool,
    /// How far `b` moved in this step, metres, if along the axis, and else 0; if nothing but a guess tells on which side of `a`
    /// it is.
    pub(crate) moved: Option<f32>,
    /// Of the columns and rows of both images, if they are folded.
    pub(crate) fold: Option<&'a ViewFold>,
    /// Which points of `a`, and of `b`, are in the images; `None` where an image does not show rims.
    pub(crate) regions: [Option<&'a Region>; 2],
}

impl Seen<'_> {
    /// Axes of the other views, in the frame of this one's `camera`.
    pub(super) fn others(&self, camera: &VirtualCamera) -> ArrayVec<Vec3, MAX_VIEWS> {
        let axes = self.axes.iter().enumerate();
        let others = axes.filter(|(k, _)| *k != self.view);
        others
            .map(|(_, axis)| camera.view_from_frame.rotation * *axis)
            .collect()
    }
}

/// Adds what a view sees of crossings to `crossings`, if these are asked for, and of contacts, if it is one of the
/// result's views, to `result`. Both images have the same camera and rectangle. The axis of a view in which `b` is on the
/// other side of `a` turns round: see [`WaysOut::is_beyond`].
pub(crate) fn compare(
    a: &Tldi,
    b: &Tldi,
    seen: &Seen,
    params: &Params,
    mut crossings: Option<&mut Crossings>,
    result: &mut PairResult,
) {
    let _stage = stage!("compare");
    debug_assert_eq!((a.origin, a.size), (b.origin, b.size));
    let [width, height] = a.size;
    let frame_from_view = a.camera.view_from_frame.inverse();
    let others = seen.others(&a.camera);
    let shows_contacts = seen.view < result.axes.len();
    let ways = shows_contacts.then(|| WaysOut::of_all(a, b)).flatten();
    let is_beyond = shows_contacts
        && seen.moved.is_some_and(|moved| {
            WaysOut::of_faces(a, b).is_some_and(|ways| ways.is_beyond(moved, params))
        });
    for j in 0..height {
        for i in 0..width {
            let k = (j * width + i) as usize;
            let (la, lb) = (a.layers_of(k), b.layers_of(k));
            if la.is_empty() || lb.is_empty() {
                continue;
            }
            if let Some(crossings) = &mut crossings {
                crossings.count([a, b], [i, j], &others, params);
            }
            if !shows_contacts {
                continue;
            }
            let at = PixelView {
                pixel: match ([a.origin[0] + i as i32, a.origin[1] + j as i32], seen.fold) {
                    (pixel, Some(fold)) => fold.unfolded(pixel),
                    (pixel, None) => pixel,
                },
                camera: &a.camera,
                frame_from_view: &frame_from_view,
                view: seen.view,
                others: &others,
                is_beyond,
            };
            let column = |side: usize, end: End, from_behind: bool| {
                let pixel = SurfacePixel {
                    image: [a, b][side],
                    at: [i, j],
                    in_view: at.pixel,
                    region: seen.regions[side],
                };
                let ends_in_rim = pixel.ends_in_rim(end, params);
                let column = PixelColumn::new([la, lb][side], seen.bodies[side]);
                column.met_at(end, from_behind, ends_in_rim)
            };
            let [front, back] = if is_beyond { [0, 1] } else { [1, 0] };
            let columns = [(front, End::Far), (back, End::Near)]
                .map(|(side, end)| column(side, end, seen.from_behind[side]));
            contact_pixels(columns, Order::OfAxis, &at, params, result);
            if seen.tells_facing {
                let columns = [(0, End::Far), (1, End::Near)];
                let columns = columns.map(|(side, end)| column(side, end, false));
                contact_pixels(columns, Order::Reversed, &at, params, result);
            }
        }
    }
    if is_beyond {
        result.turn_view(seen.view);
    }
    let way_out = ways.map(|ways| if is_beyond { ways.on } else { ways.back });
    result.way_out = result.way_out.into_iter().chain(way_out).reduce(f32::min);
}

/// In which order rays pass two surfaces that touch.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    /// As the axis says.
    OfAxis,
    /// The other way round, as in a slot.
    Reversed,
}

/// Where a pixel is.
struct PixelView<'a> {
    pixel: [i32; 2],
    camera: &'a VirtualCamera,
    frame_from_view: &'a Pose3,
    view: usize,
    /// Axes of the other views, in the frame of this one.
    others: &'a [Vec3],
    /// Whether `a` is in front of `b`.
    is_beyond: bool,
}

/// Contacts in a pixel, where the ray leaves the body in `front` and enters the one in `back`. If there are other views,
/// surfaces that are apart by more than contacts are asked for count, too, until
/// [`WayOut::keep_least`](crate::contact::way_out::WayOut::keep_least).
fn contact_pixels(
    [front, back]: [PixelColumn; 2],
    order: Order,
    at: &PixelView,
    params: &Params,
    result: &mut PairResult,
) {
    for kf in 0..front.len() {
        let exit = &front.layer(kf);
        if front.facing(exit) == Facing::Entry || is_edge_on(exit) {
            continue;
        }
        let entered = front.entered_at(kf, params);
        // What `front` has left behind altogether it does not touch.
        let entry = (0..back.len())
            .map(|kb| (kb, back.layer(kb)))
            .filter(|(_, layer)| back.facing(layer) != Facing::Exit && !is_edge_on(layer))
            // Where two rims cross, neither tells a normal.
            .filter(|(kb, _)| !(front.is_rim(kf) && back.is_rim(*kb)))
            .map(|(kb, layer)| (kb, layer, back.left_at(kb, params)))
            .filter(|(_, _, left)| entered <= *left)
            .find(|(kb, layer, left)| {
                let depth = exit.depth - layer.depth;
                let other_way = left - entered;
                match order {
                    Order::OfAxis => {
                        let is_sure = front.facing(exit) == Facing::Exit
                            && back.facing(layer) == Facing::Entry;
                        let is_met = depth <= params.thickness
                            || opposed(layer, exit)
                                && !(is_sure && is_far_longer(depth, other_way, params));
                        let is_within = depth > 0.0
                            && (back.facing(layer) == Facing::Entry
                                && front.is_entered_at(kf, *left)
                                || front.facing(exit) == Facing::Exit
                                    && back.is_left_at(*kb, entered));
                        is_met && !is_within
                    }
                    // The least way out counts.
                    Order::Reversed => {
                        depth <= params.thickness
                            && (depth <= 0.0 || is_far_longer(other_way, depth, params))
                    }
                }
            });
        let Some((kb, ref entry, _)) = entry else {
            continue;
        };
        // Outward normals in the view frame: the ray leaves the front body and enters the other.
        let normal_back = facing_camera(entry.normal, -1.0);
        let normal_front = facing_camera(exit.normal, 1.0);
        let normal = (normal_back - normal_front).normalize_or(-Vec3::Z);
        let along_view = entry.depth - exit.depth;
        let gap = along_view * normal.z.abs();
        if !best_seen(normal, at.others) {
            continue;
        }
        if gap > params.prediction {
            result.gap = Some(result.gap.map_or(gap, |g| g.min(gap)));
            // It is no contact, but tells the shape of contacts beside it, and other views how deep theirs can be.
            if order == Order::Reversed || at.others.is_empty() && gap > params.seen_gap() {
                continue;
            }
        }
        let in_frame = |v: Vec3| at.frame_from_view.rotation * v;
        let [u, v] = at.pixel.map(|c| c as f32 + 0.5);
        let point = |layer: &Layer| *at.frame_from_view * at.camera.view_at(u, v, layer.depth);
        let of_back = (
            point(entry),
            back.share_of(kb, -1.0) * in_frame(normal_back),
        );
        let of_front = (
            point(exit),
            front.share_of(kf, 1.0) * in_frame(normal_front),
        );
        let ((point_a, normal_a), (point_b, normal_b)) =
            match at.is_beyond || order == Order::Reversed {
                false => (of_back, of_front),
                true => (of_front, of_back),
            };
        result.contacts.push(ContactPixel {
            pixel: at.pixel,
            view: at.view as u32,
            point_a,
            point_b,
            normal_a,
            normal_b,
            gap,
        });
    }
}

/// |n·v| from which the depth along the view tells the distance of surfaces that are deep in each
/// other (60°), and likewise the least cosine between the normals of such surfaces. A wall that a
/// body stands beside has points in the body's columns, but does not face its bottom. Half the angle:
/// normals are 14 times and depths 2.8 times as wrong, and two balls at 80 % fail with every seed,
/// but no overlap of 300 is falsely deep instead of 4; twice: depths of deep edges twice as wrong.
const FACING: f32 = 0.5;

/// How many times as long one way out of an overlap must be until the other one counts: the side is that of the axis. A body
/// that was pushed most of the way through a wall, or the rim of one that came through a plate, goes out where it came from.
/// But where a ray passes both bodies at their rims, the other side is a layer away, and the axis has the wrong sign there.
/// Half: the rim of a cone is pushed further through a plate in half of 300 poses; twice: links of a chain that touch are deep.
pub(super) const FARTHEST: f32 = 4.0;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 2] =
    [("FACING", FACING as f64), ("FARTHEST", FARTHEST as f64)];

/// Whether one way out is so much longer than the other that the other one counts.
fn is_far_longer(way: f32, other: f32, params: &Params) -> bool {
    way > FARTHEST * other.max(params.thickness)
}

/// Whether two layers face each other and the view, as surfaces do that push bodies apart. At an edge a surface faces
/// everything between its faces.
fn opposed(entry: &Layer, exit: &Layer) -> bool {
    let (n, m) = (
        facing_camera(entry.normal, -1.0),
        facing_camera(exit.normal, 1.0),
    );
    let is_edge = [share_of(entry, -1.0), share_of(exit, 1.0)].map(|share| share < 1.0);
    (is_edge[0] || n.z <= -FACING)
        && (is_edge[1] || m.z >= FACING)
        && (is_edge.contains(&true) || n.dot(m) <= -FACING)
}

/// `normal` or its opposite, such that its z has the given sign.
fn facing_camera(normal: Vec3, sign: f32) -> Vec3 {
    if normal.z * sign < 0.0 {
        -normal
    } else {
        normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::crossings::pierces;

    fn layer(depth: f32, facing: Facing) -> Layer {
        let normal = match facing {
            Facing::Exit => Vec3::Z,
            _ => -Vec3::Z,
        };
        Layer {
            near: depth,
            far: depth,
            depth,
            normal,
            agreement: 1.0,
            facing,
            color: [0; 4],
        }
    }

    /// So many equal rows of three pixels.
    fn image_of(rows: u32, columns: [Option<Layer>; 3]) -> Tldi {
        Tldi::of_rows(rows, &columns.each_ref().map(Option::as_slice))
    }

    /// A sheet that falls through a level one from the first column to the second, or is where it is.
    #[test]
    fn surfaces_cross_where_they_swap_in_more_than_one_place() {
        let params = Params::for_radius(1.0);
        let sheet = |depths: [f32; 3]| depths.map(|depth| Some(layer(depth, Facing::Unknown)));
        let falling = [9.0, 10.5, 11.0];
        for (rows, other, enough) in [
            (1, falling, false),
            (2, falling, true),
            (1, [10.0; 3], true),
            (2, [10.1; 3], false),
        ] {
            let level = image_of(rows, sheet([10.0; 3]));
            let other = image_of(rows, sheet(other));
            let seen = Seen {
                axes: &[Vec3::Z],
                ..Seen::default()
            };
            let look = |crossings: Option<&mut Crossings>, result: &mut PairResult| {
                compare(&level, &other, &seen, &params, crossings, result);
            };
            let mut crossings = Crossings::default();
            // A view that is none of the result's sees no contacts.
            let mut result = PairResult::default();
            look(Some(&mut crossings), &mut result);
            assert_eq!(crossings.are_enough(), enough, "{rows}");
            assert_eq!(result, PairResult::default());
            result.axes.push(Vec3::Z);
            look(None, &mut result);
            assert!(!result.contacts.is_empty());
        }
    }

    /// A wall seen edge-on in the middle of three columns, and a sheet in some of them.
    #[test]
    fn a_sheet_pierces_a_wall_that_it_goes_on_behind() {
        let params = Params::for_radius(1.0);
        let image = |columns| image_of(3, columns);
        let wall = Layer {
            near: 0.0,
            far: 20.0,
            normal: Vec3::X,
            ..layer(10.0, Facing::Unknown)
        };
        let in_middle = image([None, Some(wall), None]);
        let sheet = Some(layer(10.0, Facing::Unknown));
        let apart = Some(layer(15.0, Facing::Unknown));
        for (columns, expected) in [
            ([sheet, sheet, sheet], true),
            ([sheet, sheet, None], false),
            ([None, sheet, sheet], false),
            ([sheet, sheet, apart], false),
        ] {
            let sheet = image(columns);
            for (a, b) in [(&in_middle, &sheet), (&sheet, &in_middle)] {
                assert_eq!(pierces(a, b, [1, 1], &params), expected, "{columns:?}");
            }
        }
        // Another wall beside it does not.
        let beside = Some(Layer {
            near: 5.0,
            far: 15.0,
            ..wall
        });
        let beside = image([beside, beside, beside]);
        assert!(!pierces(&in_middle, &beside, [1, 1], &params));
        // What is beyond the image's edge is not known.
        let at_edge = image([None, None, Some(wall)]);
        let sheet = image([None, sheet, sheet]);
        assert!(pierces(&at_edge, &sheet, [2, 1], &params));
    }
}
