//! The gap between two surfaces around a contact pixel: a paraboloid through its neighbours.
//!
//! A mean over neighbours would lift the middle of a curved contact (a ball's, over 3 × 3 pixels,
//! by 1.3 pixel² / 2 R) and jump where neighbours drop out at the rim. A fit does neither, and over
//! 5 × 5 pixels it averages noise as well as that mean.

use crate::ContactPixel;
use crate::links::Links;
use arrayvec::ArrayVec;
use glamx::{Mat4, Vec4};

/// Neighbours of a pixel in 5 × 5 pixels, and room for some with two layers.
const MOST_NEIGHBORS: usize = 48;

/// What neighbours must tell of the slope and of the curvature before they are believed, in squares
/// of pixels: a row or a corner of them leaves the rest of the paraboloid open.
const LEAST_SLOPE_WEIGHT: f32 = 0.5;
const LEAST_BEND_WEIGHT: f32 = 2.0;

/// The gap at contact pixel `k`, in metres, by a fit to it and its neighbours up to two links away.
pub(crate) fn fitted_gap(k: u32, contacts: &[ContactPixel], links: &Links) -> f32 {
    let mut ring = ArrayVec::<u32, MOST_NEIGHBORS>::new();
    ring.push(k);
    let push_neighbors = |ring: &mut ArrayVec<u32, MOST_NEIGHBORS>, of: u32| {
        for &l in links.neighbors(of) {
            if !ring.is_full() && !ring.contains(&l) {
                ring.push(l);
            }
        }
    };
    push_neighbors(&mut ring, k);
    for near in 1..ring.len() {
        let of = ring[near];
        push_neighbors(&mut ring, of);
    }
    let at = contacts[k as usize].pixel;
    let mut normal_matrix = Mat4::from_diagonal(Vec4::new(
        0.0,
        LEAST_SLOPE_WEIGHT,
        LEAST_SLOPE_WEIGHT,
        LEAST_BEND_WEIGHT,
    ));
    let mut moments = Vec4::ZERO;
    for contact in ring.iter().map(|&l| &contacts[l as usize]) {
        let [u, v] = [0, 1].map(|axis| (contact.pixel[axis] - at[axis]) as f32);
        let basis = Vec4::new(1.0, u, v, u * u + v * v);
        normal_matrix += Mat4::from_cols(
            basis * basis.x,
            basis * basis.y,
            basis * basis.z,
            basis * basis.w,
        );
        moments += basis * contact.gap;
    }
    (normal_matrix.inverse() * moments).x
}
