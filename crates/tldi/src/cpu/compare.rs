//! Stage `compare`: two images of one camera, pixel by pixel.
//!
//! The surfaces cross where the order in depth of two layers swaps between neighbouring pixels of
//! the same continuous layers (a sign change): sharper than overlapping depth ranges, and it needs
//! no closed surface. Contact pixels pair a layer through which rays leave the second body with
//! one through which they enter the first.

use super::sweep::is_edge_on;
use crate::{ContactPixel, Facing, Layer, PairResult, Params, Tldi};
use glamx::{Pose3, Vec3};

/// Adds what the view `view` (index into `axes`, unit vectors from `b` to `a`) sees to `result`.
/// Both images have the same camera and rectangle.
pub(crate) fn compare(
    a: &Tldi,
    b: &Tldi,
    axes: &[Vec3],
    view: usize,
    params: &Params,
    result: &mut PairResult,
) {
    debug_assert_eq!((a.origin, a.size), (b.origin, b.size));
    let [width, height] = a.size;
    let frame_from_view = a.camera.view_from_frame.inverse();
    for j in 0..height {
        for i in 0..width {
            let k = (j * width + i) as usize;
            let (la, lb) = (a.layers_of(k), b.layers_of(k));
            if la.is_empty() || lb.is_empty() {
                continue;
            }
            if !result.collides {
                let crossing = |k: usize| crosses(la, lb, a.layers_of(k), b.layers_of(k), params);
                result.collides = pierces(la, lb, params)
                    || (i + 1 < width && crossing(k + 1))
                    || (j + 1 < height && crossing(k + width as usize));
            }
            let pixel = [a.origin[0] + i as i32, a.origin[1] + j as i32];
            contact_pixels(
                la,
                lb,
                &PixelView { pixel, tldi: a, frame_from_view: &frame_from_view, axes, view },
                params,
                result,
            );
        }
    }
}

/// Whether a layer of `a` and one of `b` swap their order between two neighbouring pixels.
fn crosses(a: &[Layer], b: &[Layer], a_next: &[Layer], b_next: &[Layer], params: &Params) -> bool {
    let continuous = |from: &Layer, to: &[Layer]| {
        let next = to
            .iter()
            .filter(|l| l.facing == from.facing && !is_edge_on(l))
            .min_by(|l, m| {
                (l.depth - from.depth)
                    .abs()
                    .total_cmp(&(m.depth - from.depth).abs())
            })?;
        ((next.depth - from.depth).abs() <= params.merge_gap).then_some(next.depth)
    };
    a.iter().filter(|l| !is_edge_on(l)).any(|la| {
        continuous(la, a_next).is_some_and(|na| {
            b.iter().filter(|l| !is_edge_on(l)).any(|lb| {
                (la.depth - lb.depth).abs() <= 2.0 * params.merge_gap
                    && continuous(lb, b_next)
                        .is_some_and(|nb| (la.depth - lb.depth) * (na - nb) < 0.0)
            })
        })
    })
}

/// Whether a layer of one lies well within a thick layer of the other: a surface seen edge-on
/// that the other one passes through.
fn pierces(a: &[Layer], b: &[Layer], params: &Params) -> bool {
    let rim = 0.5 * params.merge_gap;
    let through = |thick: &Layer, other: &Layer| {
        thick.near + rim < other.depth && other.depth < thick.far - rim
    };
    a.iter()
        .any(|la| b.iter().any(|lb| through(la, lb) || through(lb, la)))
}

/// Where a pixel is.
struct PixelView<'a> {
    pixel: [i32; 2],
    tldi: &'a Tldi,
    frame_from_view: &'a Pose3,
    axes: &'a [Vec3],
    view: usize,
}

fn contact_pixels(
    a: &[Layer],
    b: &[Layer],
    at: &PixelView,
    params: &Params,
    result: &mut PairResult,
) {
    for (kb, exit) in b.iter().enumerate() {
        if exit.facing == Facing::Entry || is_edge_on(exit) {
            continue;
        }
        // Where the ray entered the part of b that it leaves here.
        let entered = match exit.facing {
            Facing::Exit => b[..kb]
                .iter()
                .rfind(|l| l.facing == Facing::Entry)
                .map_or(f32::NEG_INFINITY, |l| l.depth),
            _ => b[..kb]
                .iter()
                .rfind(|l| !is_edge_on(l))
                .map_or(exit.depth - params.merge_gap, |l| l.depth),
        };
        let deepest = a
            .iter()
            .enumerate()
            .filter(|(ka, la)| {
                la.facing != Facing::Exit
                    && !is_edge_on(la)
                    && (entered <= la.depth || holds(&a[*ka..], entered))
            })
            .map(|(_, la)| la)
            .min_by(|l, m| l.depth.total_cmp(&m.depth));
        let Some(entry) = deepest else { continue };
        // Outward normals in the view frame: the camera sees a from outside, b from inside.
        let normal_a = facing_camera(entry.normal, -1.0);
        let normal_b = facing_camera(exit.normal, 1.0);
        let normal = (normal_a - normal_b).normalize_or(-Vec3::Z);
        let along_view = entry.depth - exit.depth;
        let gap = along_view * normal.z.abs();
        // Another view that sees this contact less steeply owns it.
        let in_frame = |v: Vec3| at.frame_from_view.rotation * v;
        let seen = |axis: &Vec3| axis.dot(in_frame(normal)).abs();
        let own = seen(&at.axes[at.view]);
        if at.axes.iter().any(|axis| seen(axis) > own) {
            continue;
        }
        result.gap = Some(result.gap.map_or(gap, |g| g.min(gap)));
        // Solids that overlap by more than a layer's thickness intersect, even if their surfaces
        // cross where this view sees them edge-on.
        let solid = exit.facing == Facing::Exit && entry.facing == Facing::Entry;
        result.collides |= solid && along_view < -params.merge_gap;
        if gap > params.prediction {
            continue;
        }
        let [u, v] = at.pixel.map(|c| c as f32 + 0.5);
        result.contacts.push(ContactPixel {
            pixel: at.pixel,
            view: at.view as u32,
            point_a: *at.frame_from_view * at.tldi.camera.view_at(u, v, entry.depth),
            point_b: *at.frame_from_view * at.tldi.camera.view_at(u, v, exit.depth),
            normal_a: in_frame(normal_a),
            normal_b: in_frame(normal_b),
            gap,
        });
    }
}

/// Whether `depth` is inside the solid that the ray enters at the first of `layers`.
fn holds(layers: &[Layer], depth: f32) -> bool {
    layers[0].facing == Facing::Entry
        && layers[1..]
            .iter()
            .find(|l| l.facing == Facing::Exit)
            .is_some_and(|exit| layers[0].depth < depth && depth < exit.depth)
}

/// `normal` or its opposite, such that its z has the given sign.
fn facing_camera(normal: Vec3, sign: f32) -> Vec3 {
    if normal.z * sign < 0.0 { -normal } else { normal }
}
