//! Building clouds.

mod cloud_support;

use cloud_support::{
    Attributes, assert_bounds, assert_holds, attributes, bounds_of, random_points, state,
};
use fastrand::Rng;
use std::borrow::Cow;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{Aabb, CloudError, NonFinite, PointCloud, Radii};

/// Makes about one point in `rarity` non-finite.
fn spoil(rng: &mut Rng, points: &mut [Vec3], rarity: usize) {
    for p in points {
        if rng.usize(..rarity) == 0 {
            p[rng.usize(..3)] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][rng.usize(..3)];
        }
    }
}

#[test]
fn non_finite_points_are_dropped_with_their_attributes() {
    let mut rng = Rng::with_seed(1);
    for count in [1, 2, 255, 256, 257, 511, 512, 513, 3000] {
        for rarity in [usize::MAX, 300, 3] {
            let mut points = random_points(&mut rng, count);
            spoil(&mut rng, &mut points, rarity);
            if rarity == 300 && count == 3000 {
                points[256..1024].fill(Vec3::NAN); // whole blocks
            }
            let given: Vec<usize> = (0..count).filter(|&i| points[i].is_finite()).collect();
            if given.is_empty() {
                continue;
            }
            let Attributes {
                mut radii,
                normals,
                colors,
            } = attributes(count);
            for (radius, p) in radii.iter_mut().zip(&points) {
                if !p.is_finite() {
                    *radius = f32::NAN; // what does not count is not refused
                }
            }
            for given_points in [Cow::Borrowed(&points[..]), Cow::Owned(points.clone())] {
                let cloud = PointCloud::builder(given_points)
                    .radii(&radii)
                    .normals(&normals)
                    .colors(&colors)
                    .build()
                    .expect("valid");
                assert_holds(&cloud, &points, &given);
                assert_eq!(cloud.dropped(), count - given.len());
                assert!(cloud.normals_oriented());
                assert_eq!(state(&cloud), state(&cloud.clone().into_owned()));
            }
        }
    }
}

#[test]
fn finite_slices_are_borrowed() {
    let mut rng = Rng::with_seed(2);
    let points = random_points(&mut rng, 1000);
    let Attributes { radii, colors, .. } = attributes(1000);
    let cloud = PointCloud::builder(&points)
        .radii(&radii)
        .colors(&colors)
        .build()
        .expect("valid");
    assert_eq!(cloud.points().as_ptr(), points.as_ptr());
    assert!(matches!(cloud.radii(), Radii::PerPoint(r) if r.as_ptr() == radii.as_ptr()));
    assert_eq!(cloud.colors().map(<[_]>::as_ptr), Some(colors.as_ptr()));
    assert_bounds(&cloud);
    assert_eq!(cloud.order(), None);
}

#[test]
fn the_last_radius_counts() {
    let points = [Vec3::ZERO, Vec3::X];
    let radii = [2.0, 3.0];
    let builder = || {
        PointCloud::builder(&points[..])
            .radius(5.0)
            .radii(&radii[..])
    };
    let per_point = builder().build().expect("valid");
    assert_eq!((per_point.radius(1), per_point.mean_radius()), (3.0, 2.5));
    let knn = builder().knn_radii(1, 0.5).build().expect("valid");
    assert_eq!(knn.radius(1), 0.5);
    let global = builder().radius(7.0).build().expect("valid");
    assert_eq!(global.radii(), &Radii::Global(7.0));
    assert_eq!((global.mean_radius(), global.max_radius()), (7.0, 7.0));
}

/// The error of building `points` after `setup`.
fn error_of<'a>(
    points: &'a [Vec3],
    setup: impl FnOnce(tldi::CloudBuilder<'a>) -> tldi::CloudBuilder<'a>,
) -> CloudError {
    let error = setup(PointCloud::builder(points))
        .build()
        .expect_err("invalid");
    assert!(error.to_string().len() > 30, "says what to do: {error}");
    error
}

#[test]
fn empty_clouds_are_refused() {
    assert_eq!(
        error_of(&[], |b| b.radius(1.0)),
        CloudError::Empty { dropped: 0 }
    );
    assert_eq!(error_of(&[], |b| b), CloudError::Empty { dropped: 0 });
    let nothing = [Vec3::NAN; 300];
    let error = error_of(&nothing, |b| b.radius(1.0));
    assert_eq!(error, CloudError::Empty { dropped: 300 });
}

#[test]
fn non_finite_points_are_refused_on_request() {
    let mut points = vec![Vec3::ZERO; 700];
    points[300].y = f32::NAN;
    points[600].x = f32::INFINITY;
    let error = error_of(&points, |b| b.radius(1.0).non_finite(NonFinite::Refuse));
    let expected = CloudError::NonFinite {
        index: 300,
        count: 2,
    };
    assert_eq!(error, expected);
    let error = error_of(&points[300..301], |b| b.non_finite(NonFinite::Refuse));
    assert_eq!(error, CloudError::NonFinite { index: 0, count: 1 });
}

#[test]
fn bad_radii_are_refused() {
    let points = [Vec3::ZERO, Vec3::NAN, Vec3::X, Vec3::ZERO];
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-13, 1e13] {
        let error = error_of(&points, |b| b.radius(radius));
        let is_expected = |error, i| {
            matches!(error, CloudError::BadRadius { index, radius: r }
                if index == i && r.to_bits() == radius.to_bits())
        };
        assert!(is_expected(error, 0), "{radius}");
        // The index is that of the point given, whatever was dropped or reordered before it.
        let radii = vec![1.0, 1.0, radius, 1.0];
        let error = error_of(&points, |b| b.radii(radii.clone()));
        assert!(is_expected(error, 2), "{radius}");
        let error = error_of(&points, |b| b.radii(radii).spatial_order());
        assert!(is_expected(error, 2), "{radius}");
    }
    // Radii from neighbours of tiny or huge clouds, too.
    let tiny = [Vec3::ZERO, 1e-20 * Vec3::X];
    assert!(matches!(
        error_of(&tiny, |b| b),
        CloudError::BadRadius { .. }
    ));
    let huge = [Vec3::ZERO, 3e38 * Vec3::X, -3e38 * Vec3::Y];
    assert!(matches!(
        error_of(&huge, |b| b),
        CloudError::BadRadius { .. }
    ));
}

/// Radii are looked at in blocks of points. The first fault counts, and faults of radii before those of coordinates.
#[test]
fn faults_are_found_anywhere() {
    for at in [0, 1, 255, 256, 511, 512, 698] {
        for bad in [
            0.0,
            -0.0,
            -1.0,
            -1e13,
            f32::NAN,
            -f32::NAN,
            f32::INFINITY,
            1e13,
        ] {
            let mut points: Vec<Vec3> = (0..700).map(|i| i as f32 * Vec3::X).collect();
            let mut radii: Vec<f32> = (0..700).map(|i| 1.0 + i as f32).collect();
            (radii[at], radii[699]) = (bad, 1e-20);
            let error = error_of(&points, |b| b.radii(radii.clone()));
            let is_first = matches!(error, CloudError::BadRadius { index, radius }
                if index == at && radius.to_bits() == bad.to_bits());
            assert!(is_first, "{bad} at {at}: {error}");
            // A place that suits the radii of others.
            (radii[at], radii[699]) = (1e-3, 1.0);
            (points[at].y, points[699].y) = (-600.0, 1e6);
            let error = error_of(&points, |b| b.radii(radii));
            let is_first = matches!(error, CloudError::CoordinateTooLarge { index, coordinate, radius }
                if index == at && coordinate == if at < 600 { -600.0 } else { at as f32 } && radius == 1e-3);
            assert!(is_first, "{at}: {error}");
        }
    }
}

#[test]
fn lengths_must_agree() {
    let points = [Vec3::ZERO, Vec3::NAN, Vec3::X];
    let mismatch = |attribute, actual| CloudError::LengthMismatch {
        attribute,
        expected: 3,
        actual,
    };
    // Two is the number of finite points: still not one for each point given.
    let error = error_of(&points, |b| b.radii(vec![1.0; 2]));
    assert_eq!(error, mismatch("radii", 2));
    let error = error_of(&points, |b| b.radius(1.0).normals(vec![Vec3::X; 2]));
    assert_eq!(error, mismatch("normals", 2));
    let error = error_of(&points, |b| b.radius(1.0).colors(vec![[0; 4]; 4]));
    assert_eq!(error, mismatch("colors", 4));
}

#[test]
fn too_many_points_are_refused_unread() {
    // Zeroed memory that is never touched.
    let limit = u32::MAX as usize / 64;
    let zeros = vec![[0.0f32; 3]; limit + 1];
    let points: &[Vec3] = bytemuck::cast_slice(&zeros);
    let error = PointCloud::builder(points).radius(1.0).build();
    let count = limit + 1;
    assert_eq!(
        error.err(),
        Some(CloudError::TooManyPoints { count, limit })
    );
}

#[test]
fn coordinates_must_suit_the_radius() {
    let radius = 0.01;
    let limit = radius * 524_288.0;
    let at = |x| [Vec3::NAN, Vec3::ZERO, Vec3::new(1.0, x, -1.0)];
    for sign in [1.0, -1.0] {
        let points = at(sign * limit);
        assert!(
            PointCloud::builder(&points[..])
                .radius(radius)
                .build()
                .is_ok()
        );
        let coordinate = sign * limit.next_up();
        let points = at(coordinate);
        let expected = CloudError::CoordinateTooLarge {
            index: 2,
            coordinate,
            radius,
        };
        assert_eq!(error_of(&points, |b| b.radius(radius)), expected);
        assert_eq!(error_of(&points, |b| b.radii(vec![radius; 3])), expected);
        // A step of f32 there is a sixteenth of the radius.
        let step = limit.next_up() - limit;
        assert!((step - radius / 16.0).abs() <= radius / 32.0, "{step}");
    }
}

#[test]
fn parameters_are_checked() {
    let points = [Vec3::ZERO, Vec3::X];
    let name = |error| match error {
        CloudError::BadParameter { parameter, .. } => parameter,
        other => panic!("{other}"),
    };
    assert_eq!(
        name(error_of(&points, |b| b.knn_radii(0, 0.65))),
        "knn_radii: k"
    );
    for scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = error_of(&points, |b| b.knn_radii(7, scale));
        assert_eq!(name(error), "knn_radii: scale");
    }
    for sigma in [-1.0, f32::NAN, f32::INFINITY, 2e12] {
        assert_eq!(name(error_of(&points, |b| b.noise(sigma))), "noise");
    }
    for k in [0, 1] {
        assert_eq!(
            name(error_of(&points, |b| b.pca_normals(k))),
            "pca_normals: k"
        );
    }
    let error = error_of(&points, |b| b.pca_normals(8).viewpoint(Vec3::NAN));
    assert_eq!(name(error), "viewpoint");
    // A huge number of neighbours just means all.
    assert!(
        PointCloud::builder(&points[..])
            .knn_radii(usize::MAX, 1.0)
            .pca_normals(usize::MAX)
            .build()
            .is_ok()
    );
}

#[test]
fn spatial_order_keeps_points_with_their_attributes() {
    let mut rng = Rng::with_seed(5);
    let count = 5000;
    let mut points = random_points(&mut rng, count);
    spoil(&mut rng, &mut points, 20);
    points[7] = points[8]; // equal points keep their order
    let Attributes {
        radii,
        normals,
        colors,
    } = attributes(count);
    let build = |ordered: bool| {
        let builder = PointCloud::builder(&points)
            .radii(&radii)
            .normals(&normals)
            .colors(&colors);
        let builder = if ordered {
            builder.spatial_order()
        } else {
            builder
        };
        builder.build().expect("valid")
    };
    let plain = build(false);
    let ordered = build(true);
    let finite: Vec<usize> = (0..count).filter(|&i| points[i].is_finite()).collect();
    let order = ordered.order().expect("asked for");
    let given: Vec<usize> = order.iter().map(|&i| finite[i as usize]).collect();
    assert_holds(&ordered, &points, &given);
    let mut sorted = given;
    sorted.sort_unstable();
    assert_eq!(sorted, finite, "each point once");

    // What it is for: blocks become small. 5000 points of a cube of volume 8 fill 20 blocks.
    let volume = |cloud: &PointCloud<'_>| -> f32 {
        cloud
            .blocks()
            .iter()
            .map(|b| b.extents().element_product())
            .sum()
    };
    assert!(volume(&plain) > 120.0);
    assert!(volume(&ordered) < 40.0, "{}", volume(&ordered));
}

#[test]
fn spatial_order_is_a_morton_curve() {
    let mut rng = Rng::with_seed(6);
    // From 1 down to 10⁻⁶ in size, so that all bits of the code matter.
    let mut points = random_points(&mut rng, 3000);
    for (i, p) in points.iter_mut().enumerate() {
        *p *= 10f32.powi(-((i % 7) as i32));
    }
    let cloud = PointCloud::builder(&points).radius(1.0).spatial_order();
    let cloud = cloud.build().expect("valid");

    // Bit by bit: cells of the longest edge / 2²¹, x before y before z.
    let origin = cloud.bounds().min.as_dvec3();
    let edge = (cloud.bounds().max.as_dvec3() - origin).max_element();
    let code = |i: u32| {
        let cell = (points[i as usize].as_dvec3() - origin) * (f64::from((1 << 21) - 1) / edge);
        let cell = cell.to_array().map(|c| c as u64);
        let bits = (0..21).rev().flat_map(|bit| cell.map(|c| c >> bit & 1));
        bits.fold(0u64, |code, bit| code << 1 | bit)
    };
    let mut expected: Vec<u32> = (0..3000).collect();
    expected.sort_by_key(|&i| (code(i), i));
    assert_eq!(cloud.order(), Some(&expected[..]));
}

#[test]
fn spatial_order_of_degenerate_clouds() {
    for points in [
        vec![Vec3::ONE],
        vec![Vec3::ONE; 600],
        (0..600).map(|i| Vec3::Y * (600 - i) as f32).collect(),
    ] {
        let cloud = PointCloud::builder(&points).radius(1.0).spatial_order();
        let cloud = cloud.build().expect("valid");
        assert_bounds(&cloud);
        let order = cloud.order().expect("asked for");
        let expected: Vec<u32> = if points.len() > 1 && points[0] != points[1] {
            (0..600).rev().collect()
        } else {
            (0..points.len() as u32).collect()
        };
        assert_eq!(order, expected);
    }
}

#[test]
fn boxes_hold_what_they_should() {
    let mut rng = Rng::with_seed(10);
    for _ in 0..100 {
        let points = random_points(&mut rng, 8);
        let bounds = bounds_of(&points);
        assert!(points.iter().all(|p| bounds.contains(*p)));
        let axis = random_points(&mut rng, 1)[0].normalize_or(Vec3::X);
        let pose = Pose3::from_parts(axis, Quat::from_axis_angle(axis, 3.0 * rng.f32()));
        let moved = bounds.transformed(&pose);
        // The corners touch all sides: the box is tight, up to rounding of coordinates near 2.
        let corners: Vec<Vec3> = (0..8)
            .map(|i| {
                let pick = |c: usize| {
                    if i >> c & 1 == 0 {
                        bounds.min[c]
                    } else {
                        bounds.max[c]
                    }
                };
                pose * Vec3::new(pick(0), pick(1), pick(2))
            })
            .collect();
        let expected = bounds_of(&corners);
        assert!((moved.min - expected.min).abs().max_element() < 1e-6);
        assert!((moved.max - expected.max).abs().max_element() < 1e-6);
    }
    let unit = Aabb {
        min: Vec3::ZERO,
        max: Vec3::ONE,
    };
    let apart = Aabb {
        min: Vec3::splat(2.0),
        max: Vec3::splat(3.0),
    };
    assert!(!unit.intersects(&apart) && unit.loosened(1.0).intersects(&apart));
    assert_eq!(unit.merged(apart).extents(), Vec3::splat(3.0));
    assert!(Aabb::EMPTY.is_empty() && !Aabb::EMPTY.intersects(&unit));
    assert!(Aabb::EMPTY.transformed(&Pose3::IDENTITY).is_empty());
    let nan = Aabb {
        min: Vec3::NAN,
        max: Vec3::ONE,
    };
    assert!(nan.is_empty() && !nan.contains(Vec3::ZERO));
}
