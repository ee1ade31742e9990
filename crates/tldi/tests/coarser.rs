//! Pixels that are larger than asked for: results say how large they are.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Backend, ContactPixel, CpuBackend, PairQuery, PairResult, Params, PointCloud, Room, Surface,
    View, VirtualCamera,
};

/// Spacing and radius of the coarse points, metres.
const COARSE: f32 = 0.05;

/// Of the fine ones, metres.
const FINE: f32 = 0.01;

/// How far the plate is above the floor, metres.
const GAP: f32 = 0.01;

/// Points of a level square.
fn sheet(edge: i32, spacing: f32, corner: Vec3) -> impl Iterator<Item = Vec3> {
    let place = move |k| Vec3::new((k % edge) as f32, 0.0, (k / edge) as f32);
    (0..edge * edge).map(move |k| spacing * place(k) + corner)
}

/// Images of a perspective camera take no more of a room than their fragments: many share one.
#[test]
fn images_of_fixed_size_share_a_room() {
    let points: Vec<Vec3> = sheet(21, COARSE, Vec3::new(-0.5, 0.0, -0.5)).collect();
    let cloud = PointCloud::builder(points).radius(COARSE).build();
    let cloud = cloud.expect("valid");
    let (from, to, size) = (3.0 * Vec3::Y, Vec3::ZERO, [200, 200]);
    let camera = VirtualCamera::perspective(from, to, Vec3::Z, 1.0, size, 0.1, 10.0);
    let query = PairQuery {
        a: Surface::Cloud(&cloud),
        b: Surface::Cloud(&cloud),
        a_from_b: Pose3::translation(0.0, 0.02, 0.0),
        view: View::Fixed(camera),
        params: Params::for_radius(COARSE),
    };
    let (mut result, mut room) = (PairResult::default(), Room::default());
    let backend = CpuBackend::new();
    for _ in 0..8 {
        let compared = backend.compare_within(&query, &mut room, &mut result);
        compared.expect("the pair is supported");
        assert!(!result.contacts.is_empty());
    }
    assert!(!room.is_used_up());
}

/// A plate of fine points over the coarse part of a floor, which has so many sheets, 0.1 m apart. Fine points elsewhere
/// make its mean radius a third of the coarse ones.
fn plate_on_floor(sheets: i32, pixel_size: f32) -> PairResult {
    let mut points: Vec<Vec3> = sheet(120, FINE, 5.0 * Vec3::X).collect();
    let mut radii = vec![FINE; points.len()];
    for k in 0..sheets {
        points.extend(sheet(40, COARSE, -0.1 * k as f32 * Vec3::Y));
    }
    radii.resize(points.len(), COARSE);
    let floor = PointCloud::builder(points).radii(radii).build();
    let floor = floor.expect("valid");
    let plate: Vec<Vec3> = sheet(150, FINE, Vec3::new(0.2, 0.0, 0.2)).collect();
    let plate = PointCloud::builder(plate).radius(FINE).build();
    let query = PairQuery {
        a: Surface::Cloud(&floor),
        b: Surface::Cloud(&plate.expect("valid")),
        a_from_b: Pose3::translation(0.0, GAP, 0.0),
        view: View::aimed(),
        params: Params::for_radius(floor.mean_radius()).with_pixel_size(pixel_size),
    };
    let mut results = Vec::new();
    let compared = CpuBackend::new().compare(&[query], &mut results);
    compared.expect("supported");
    results.remove(0)
}

/// The edge of a pixel, metres, by two contact pixels that are far apart in one level view.
fn measured_pixel(contacts: &[ContactPixel]) -> f32 {
    let first = &contacts[0];
    let apart = |c: &ContactPixel| [0, 1].map(|k| (c.pixel[k] - first.pixel[k]) as f32);
    let pixels = |c: &ContactPixel| apart(c)[0].hypot(apart(c)[1]);
    let of_view = contacts.iter().filter(|c| c.view == first.view);
    let last = of_view.max_by(|c, d| pixels(c).total_cmp(&pixels(d)));
    let last = last.expect("the first one is there");
    (last.point_a - first.point_a).with_y(0.0).length() / pixels(last)
}

/// Near coarse points of an uneven cloud pixels are coarser; where these are too many, coarser again.
#[test]
fn results_tell_how_large_pixels_are() {
    for pixel_size in [0.02, 0.002, 3e-4, 1e-4] {
        let result = plate_on_floor(1, pixel_size);
        let told = result.coarser.expect("coarser") * pixel_size;
        let measured = measured_pixel(&result.contacts);
        assert!(
            (told - measured).abs() < 1e-3 * measured,
            "{told} {measured}"
        );
    }
}

/// The sheets of a floor that are farther apart than the coarse points' merge gap stay two, however many pixels there
/// would be.
#[test]
fn larger_pixels_do_not_merge_sheets() {
    for pixel_size in [0.02, 3e-4, 1e-4] {
        let result = plate_on_floor(2, pixel_size);
        let gap = result.gap.expect("near");
        // Half a coarse radius: bare planes of both sheets are uncertain. In the middle of both it would be a whole one.
        assert!(
            (gap - GAP).abs() < 0.5 * COARSE,
            "{pixel_size}: {gap}, coarser {:?}",
            result.coarser
        );
    }
}
