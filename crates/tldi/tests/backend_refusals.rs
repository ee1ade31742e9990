//! What the CPU backend cannot compare it refuses with an error, and does not try.

use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{
    Backend, BackendError, CpuBackend, ImpactQuery, PairQuery, Params, Penetration, PointCloud,
    Projection, Surface, View, VirtualCamera, build,
};

/// Two points, 1 m apart with radii of 1 cm.
fn two_points() -> PointCloud<'static> {
    let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::X]).radius(0.01);
    cloud.build().expect("the points are valid")
}

/// The reason why two clouds of two points are not compared.
fn refusal(view: View, params: Params) -> Option<&'static str> {
    let cloud = two_points();
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

/// Of an image of few pixels many large splats do not fit.
#[test]
fn paper_images_of_more_than_2_to_the_28_fragments() {
    let points: Vec<Vec3> = (0..400).map(|k| 0.01 * k as f32 * Vec3::X).collect();
    let cloud = PointCloud::builder(points).radius(0.5).build();
    let cloud = cloud.expect("valid");
    let params = |pixels: f32| Params::paper(0.5).with_pixel_size(1.0 / pixels);
    let query = |pixels: f32| PairQuery {
        a: Surface::Cloud(&cloud),
        b: Surface::Cloud(&cloud),
        a_from_b: Pose3::IDENTITY,
        view: aim(),
        params: params(pixels),
    };
    // 400 splats of 1,000² pixels, in an image of 5,000².
    assert!(
        query(1_000.0)
            .check()
            .is_err_and(|reason| reason.contains("2^28"))
    );
    assert_eq!(query(500.0).check(), Ok(()));
}

/// A splat just in front of a perspective camera reaches over more pixels than there are numbers for; its image is drawn.
#[test]
fn splats_larger_than_any_image() {
    let near = 1e-4;
    let camera =
        VirtualCamera::perspective(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0, [1024, 1024], near, 9e3);
    let cloud = PointCloud::builder(vec![4e-4 * Vec3::X, 5e3 * Vec3::X])
        .radius(1e3)
        .build();
    let cloud = cloud.expect("valid");
    let image = build(&cloud, &Pose3::IDENTITY, &camera, &Params::for_radius(1e3));
    assert!(image.max_layers() > 0);
}

/// Only what is seen in parallel has a size of its own.
#[test]
fn perspective_images_without_a_size() {
    let mut camera =
        VirtualCamera::perspective(2.0 * Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0, [64, 64], 0.1, 9.0);
    assert_eq!(refusal(View::Fixed(camera), Params::for_radius(0.01)), None);
    camera.size = None;
    for params in [Params::for_radius(0.01), Params::paper(0.01)] {
        refused(refusal(View::Fixed(camera), params), "fixed size");
    }
}

fn refused(reason: Option<&str>, word: &str) {
    let is_meant = reason.is_some_and(|r| r.contains(word));
    assert!(is_meant, "{word}: {reason:?}");
}

#[test]
fn fixed_cameras_that_show_nothing() {
    let of_camera = |camera| refusal(View::Fixed(camera), Params::for_radius(0.01));
    let camera = VirtualCamera::along(Vec3::Z, 0.01);
    assert_eq!(of_camera(camera), None);
    for pixel_size in [0.0, -0.01, f32::NAN, f32::INFINITY, 1e-20] {
        let projection = Projection::Orthographic { pixel_size };
        let camera = VirtualCamera {
            projection,
            ..camera
        };
        refused(of_camera(camera), "pixel_size");
        let params = Params::for_radius(0.01);
        let image = build(&two_points(), &Pose3::IDENTITY, &camera, &params);
        assert_eq!(image.pixel_count(), 0);
    }
    for pose in [
        Pose3::from_translation(f32::NAN * Vec3::X),
        Pose3::from_rotation(Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0)),
        Pose3::from_rotation(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        Pose3::from_rotation(Quat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
    ] {
        let view_from_frame = pose;
        let of_pose = of_camera(VirtualCamera {
            view_from_frame,
            ..camera
        });
        refused(of_pose, "unit quaternion");
    }
    for size in [[0, 64], [64, 0], [64, u32::MAX]] {
        let of_size = of_camera(VirtualCamera {
            size: Some(size),
            ..camera
        });
        refused(of_size, "size must be");
    }
    let of_pixels = |width, height| {
        of_camera(VirtualCamera {
            size: Some([width, height]),
            ..camera
        })
    };
    refused(of_pixels(1 << 14, (1 << 14) + 1), "2^28 pixels");
    assert_eq!(of_pixels(1 << 14, 4), None);
    let perspective = |focal_px, near, far| VirtualCamera {
        projection: Projection::Perspective {
            focal_px,
            near,
            far,
        },
        size: Some([64, 64]),
        ..camera
    };
    assert_eq!(of_camera(perspective(50.0, 0.1, 9.0)), None);
    let [inf, nan] = [f32::INFINITY, f32::NAN];
    for [focal_px, near, far] in [
        [0.0, 0.1, 9.0],
        [-50.0, 0.1, 9.0],
        [nan, 0.1, 9.0],
        [inf, 0.1, 9.0],
        [50.0, 0.0, 9.0],
        [50.0, nan, 9.0],
        [50.0, 9.0, 0.1],
        [50.0, 0.1, nan],
        [50.0, 0.1, inf],
    ] {
        refused(of_camera(perspective(focal_px, near, far)), "focal_px");
    }
}

#[test]
fn shares_are_from_0_to_1() {
    let params = Params::for_radius(0.01);
    for share in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
        let damped = Params {
            slope_damping: share,
            ..params
        };
        refused(refusal(aim(), damped), "slope_damping");
        let compressed = Params {
            rho: share,
            ..params
        };
        refused(refusal(aim(), compressed), "rho");
    }
    let ends = Params {
        slope_damping: 0.0,
        rho: 1.0,
        ..params
    };
    assert_eq!(refusal(aim(), ends), None);
}

/// Poses that scale, of pairs and of casts.
#[test]
fn poses_that_are_not_rigid() {
    let cloud = two_points();
    let (a, b) = (Surface::Cloud(&cloud), Surface::Cloud(&cloud));
    let params = Params::for_radius(0.01);
    for w in [1.001, 0.0, f32::NAN] {
        let a_from_b = Pose3::from_rotation(Quat::from_xyzw(0.0, 0.0, 0.0, w));
        let pair = PairQuery {
            a,
            b,
            a_from_b,
            view: aim(),
            params,
        };
        refused(pair.check().err(), "a_from_b must");
        let cast = CpuBackend::new().impact(&ImpactQuery {
            a,
            b,
            a_from_b,
            motion: Vec3::X,
            touching: 0.0,
            core_only: false,
            penetration: None,
            turned: &[],
            params,
        });
        let Err(BackendError::Unsupported { reason, .. }) = cast else {
            panic!("{cast:?}");
        };
        refused(Some(reason), "a_from_b must");
    }
}

#[test]
fn penetrations_and_later_poses_are_finite() {
    let cloud = two_points();
    let cast = |normal, depth, later| {
        let query = ImpactQuery {
            a: Surface::Cloud(&cloud),
            b: Surface::Cloud(&cloud),
            a_from_b: Pose3::IDENTITY,
            motion: Vec3::X,
            touching: 0.0,
            core_only: false,
            penetration: Some(Penetration { normal, depth }),
            turned: &[Pose3::IDENTITY, Pose3::from_translation(later)],
            params: Params::for_radius(0.01),
        };
        match CpuBackend::new().impact(&query) {
            Ok(_) => None,
            Err(BackendError::Unsupported { reason, .. }) => Some(reason),
            Err(other) => panic!("{other}"),
        }
    };
    assert_eq!(cast(Vec3::Y, 0.1, Vec3::X), None);
    refused(cast(Vec3::NAN, 0.1, Vec3::X), "penetration");
    refused(cast(Vec3::Y, f32::INFINITY, Vec3::X), "penetration");
    refused(cast(Vec3::Y, 0.1, Vec3::NAN), "turned");
}

/// Farther apart, depths would all count as the last one that can be told.
#[test]
fn predictions_of_more_than_2_to_the_17_thicknesses() {
    let params = Params::for_radius(0.01);
    let most = 131_072.0 * params.thickness;
    assert_eq!(refusal(aim(), params.with_prediction(0.999 * most)), None);
    refused(refusal(aim(), params.with_prediction(1.001 * most)), "2^17");
}
