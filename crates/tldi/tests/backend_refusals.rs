//! What the CPU backend cannot compare it refuses with an error, and does not try.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Backend, BackendError, CpuBackend, PairQuery, Params, PointCloud, Surface, View, VirtualCamera,
};

/// The reason why two clouds of two points, 1 m apart with radii of 1 cm, are not compared.
fn refusal(view: View, params: Params) -> Option<&'static str> {
    let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::X])
        .radius(0.01)
        .build()
        .expect("the points are valid");
    let query = PairQuery {
        a: Surface::Cloud(&cloud),
        b: Surface::Cloud(&cloud),
        a_from_b: Pose3::IDENTITY,
        view,
        params,
    };
    match CpuBackend::new().compare(&[query], &mut Vec::new()) {
        Ok(()) => None,
        Err(BackendError::Unsupported { pair: 0, reason }) => Some(reason),
        Err(other) => panic!("{other}"),
    }
}

fn aim() -> View {
    View::aimed()
}

/// Of an image of too many pixels not even the offsets would fit in memory.
#[test]
fn paper_images_of_more_than_2_to_the_28_pixels() {
    let tiny = 1.02 / 16_400.0; // 2^14 and a little over the clouds' size
    let too_large = |reason: Option<&str>| reason.is_some_and(|r| r.contains("2^28"));
    assert!(too_large(refusal(
        aim(),
        Params::paper(0.01).with_pixel_size(tiny)
    )));
    let fine = VirtualCamera::along(Vec3::Z, tiny);
    assert!(too_large(refusal(View::Fixed(fine), Params::paper(0.01))));
    let mut camera = VirtualCamera::along(Vec3::Z, 0.01);
    camera.size = Some([1 << 14, (1 << 14) + 1]);
    assert!(too_large(refusal(View::Fixed(camera), Params::paper(0.01))));

    camera.size = Some([64, 64]);
    assert_eq!(refusal(View::Fixed(camera), Params::paper(0.01)), None);
    assert_eq!(refusal(aim(), Params::paper(0.01)), None);
}

/// Only what is seen in parallel has a size of its own.
#[test]
fn perspective_images_without_a_size() {
    let mut camera =
        VirtualCamera::perspective(2.0 * Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0, [64, 64], 0.1, 9.0);
    assert_eq!(refusal(View::Fixed(camera), Params::for_radius(0.01)), None);
    camera.size = None;
    for params in [Params::for_radius(0.01), Params::paper(0.01)] {
        let reason = refusal(View::Fixed(camera), params);
        assert!(
            reason.is_some_and(|r| r.contains("fixed size")),
            "{reason:?}"
        );
    }
}
