//! Giving clouds new points and radii.

mod cloud_support;

use cloud_support::{
    Attributes, assert_bounds, assert_holds, attributes, color_of, normal_of, radius_of,
    random_points, state,
};
use fastrand::Rng;
use std::borrow::Cow;
use tldi::glamx::Vec3;
use tldi::{CloudError, NonFinite, PointCloud, Radii, RadiusRule};

#[test]
fn new_points_replace_the_old_ones() {
    let mut rng = Rng::with_seed(6);
    let points = random_points(&mut rng, 1000);
    let normals: Vec<Vec3> = (0..1000).map(normal_of).collect();
    let mut cloud = PointCloud::builder(&points)
        .radius(0.5)
        .normals(&normals)
        .colors(vec![[9; 4]; 1000])
        .build()
        .expect("valid");

    // As many: colours stay, the normals given are taken.
    let mut moved = random_points(&mut rng, 1000);
    let reversed: Vec<Vec3> = normals.iter().map(|n| *n * -2.0).collect();
    cloud.set_points(&moved, Some(&reversed)).expect("valid");
    assert_eq!(cloud.points(), moved);
    let flipped = cloud.normals().expect("given").iter().zip(&normals);
    assert!(flipped.into_iter().all(|(a, b)| (*a + *b).length() < 1e-6));
    assert!(cloud.normals_oriented());
    assert_eq!(cloud.colors().map(<[_]>::len), Some(1000));
    assert_eq!(cloud.radii(), &Radii::Global(0.5));
    assert_bounds(&cloud);

    // No normals: the former ones do not survive.
    cloud.set_points(&moved, None).expect("valid");
    assert_eq!((cloud.normals(), cloud.normals_oriented()), (None, false));
    assert!(cloud.colors().is_some());

    // Dropped points: no telling which colour is whose.
    moved[3] = Vec3::NAN;
    cloud.set_points(&moved, Some(&normals)).expect("valid");
    assert_eq!((cloud.len(), cloud.dropped()), (999, 1));
    assert_eq!(cloud.normals().expect("given")[3], normals[4]);
    assert_eq!(cloud.colors(), None);
    assert_bounds(&cloud);

    // Fewer, more.
    for count in [1, 300, 5000] {
        let points = random_points(&mut rng, count);
        cloud.set_points(&points, None).expect("valid");
        assert_eq!(cloud.points(), points);
        assert_eq!((cloud.dropped(), cloud.colors()), (0, None));
        assert_bounds(&cloud);
    }
}

#[test]
fn radii_for_each_point_follow_points_that_move() {
    let mut rng = Rng::with_seed(7);
    let points = random_points(&mut rng, 600);
    let radii: Vec<f32> = (0..600).map(radius_of).collect();
    for ordered in [false, true] {
        let builder = PointCloud::builder(&points)
            .radii(&radii)
            .colors((0..600).map(color_of).collect::<Vec<_>>());
        let builder = if ordered {
            builder.spatial_order()
        } else {
            builder
        };
        let mut cloud = builder.build().expect("valid");
        let normals: Vec<Vec3> = (0..600).map(normal_of).collect();
        let moved = random_points(&mut rng, 600);
        cloud.set_points(&moved, Some(&normals)).expect("valid");
        let given: Vec<usize> = match cloud.order() {
            Some(order) => order.iter().map(|&i| i as usize).collect(),
            None => (0..600).collect(),
        };
        assert_eq!(cloud.order().is_some(), ordered);
        assert_holds(&cloud, &moved, &given);

        // Radii come in the same order as points.
        let doubled: Vec<f32> = radii.iter().map(|r| 2.0 * r).collect();
        cloud
            .set_radii(Radii::PerPoint(Cow::Borrowed(&doubled)))
            .expect("valid");
        assert!(
            given
                .iter()
                .enumerate()
                .all(|(i, &g)| cloud.radius(i) == doubled[g])
        );
        assert_eq!((cloud.mean_radius(), cloud.max_radius()), (601.0, 1200.0));

        // Another number of points needs another radius first.
        let before = state(&cloud);
        let error = cloud
            .set_points(&moved[..599], None)
            .expect_err("600 radii");
        let expected = CloudError::LengthMismatch {
            attribute: "radii",
            expected: 599,
            actual: 600,
        };
        assert_eq!(error, expected);
        assert_eq!(state(&cloud), before);
        cloud.set_radii(Radii::Global(0.25)).expect("valid");
        cloud.set_points(&moved[..599], None).expect("valid");
        assert_eq!(cloud.points(), &moved[..599]);
        assert_eq!((cloud.order(), cloud.max_radius()), (None, 0.25));
    }
}

/// The same points that are not finite leave the others what belongs to them, and other ones do not.
#[test]
fn radii_follow_points_among_dropped_ones() {
    let mut rng = Rng::with_seed(10);
    let (mut points, mut moved) = (random_points(&mut rng, 600), random_points(&mut rng, 600));
    for missing in [0, 17, 18, 300, 599] {
        (points[missing], moved[missing]) = (Vec3::NAN, Vec3::NAN);
    }
    let Attributes {
        radii,
        normals,
        colors,
    } = attributes(600);
    let builder = PointCloud::builder(&points).radii(&radii).colors(&colors);
    let mut cloud = builder.normals(&normals).build().expect("valid");
    let finite: Vec<usize> = (0..600).filter(|&i| moved[i].is_finite()).collect();
    cloud.set_points(&moved, Some(&normals)).expect("valid");
    assert_holds(&cloud, &moved, &finite);
    moved.swap(18, 19);
    let refused = cloud.set_points(&moved, Some(&normals));
    assert!(matches!(refused, Err(CloudError::LengthMismatch { .. })));
}

#[test]
fn a_spatial_order_ends_with_dropped_points() {
    let mut rng = Rng::with_seed(8);
    let mut points = random_points(&mut rng, 600);
    let mut cloud = PointCloud::builder(&points).radius(1.0).spatial_order();
    cloud = cloud.non_finite(NonFinite::Drop);
    let mut cloud = cloud.build().expect("valid").into_owned();
    points[100] = Vec3::NAN;
    let normals: Vec<Vec3> = (0..600).map(normal_of).collect();
    cloud.set_points(&points, Some(&normals)).expect("valid");
    points.remove(100);
    assert_eq!(cloud.points(), points, "as given");
    assert_eq!(cloud.normals().expect("given")[100], normal_of(101));
    assert_eq!(cloud.order(), None);
}

#[test]
fn failing_leaves_the_cloud_unchanged() {
    let mut rng = Rng::with_seed(9);
    for (ordered, global) in [(false, false), (false, true), (true, false), (true, true)] {
        let points = random_points(&mut rng, 600);
        let Attributes {
            radii,
            normals,
            colors,
        } = attributes(600);
        let builder = PointCloud::builder(&points)
            .normals(&normals)
            .colors(&colors)
            .non_finite(NonFinite::Refuse);
        let builder = if global {
            builder.radius(1.0)
        } else {
            builder.radii(&radii)
        };
        let builder = if ordered {
            builder.spatial_order()
        } else {
            builder
        };
        let mut cloud = builder.build().expect("valid");
        // Warm, so that the spare memory holds something to be mixed up.
        cloud.set_points(&points, Some(&normals)).expect("valid");
        let before = state(&cloud);

        let mut bad = random_points(&mut rng, 600);
        bad[20].y = f32::NAN;
        let mut refused = |points: &[Vec3], normals: Option<&[Vec3]>, expected: CloudError| {
            assert_eq!(cloud.set_points(points, normals), Err(expected));
            assert_eq!(state(&cloud), before);
        };
        let (index, count) = (20, 1);
        let not_finite = CloudError::NonFinite { index, count };
        refused(&bad, Some(&normals), not_finite);
        bad[20].y = 1e9;
        let too_large = CloudError::CoordinateTooLarge {
            index,
            coordinate: 1e9,
            radius: if global { 1.0 } else { radii[index] },
        };
        refused(&bad, Some(&normals), too_large);
        bad[20].y = 0.0;
        let one_short = CloudError::LengthMismatch {
            attribute: "normals",
            expected: 600,
            actual: 599,
        };
        refused(&bad, Some(&normals[1..]), one_short);
        let useless = CloudError::NoUsableNormal { count: 600 };
        refused(&bad, Some(&vec![Vec3::ZERO; 600]), useless);
        refused(&[], None, CloudError::Empty { dropped: 0 });
        for bad in [
            Radii::Global(0.0),
            Radii::Global(1e-9),
            Radii::PerPoint(vec![1.0; 599].into()),
            Radii::PerPoint(vec![f32::NAN; 600].into()),
        ] {
            cloud.set_radii(bad).expect_err("bad radii");
            assert_eq!(state(&cloud), before);
        }
    }
}

/// A square grid in the plane y = 0.
fn grid(n: i32, spacing: f32) -> Vec<Vec3> {
    let point = |i: i32| Vec3::new((i % n) as f32, 0.0, (i / n) as f32) * spacing;
    (0..n * n).map(point).collect()
}

/// Radii and normals that were asked for are made of other points, as many as there are: on a grid the fourth
/// neighbour is a spacing away, and the viewpoint is above.
#[test]
fn what_was_asked_for_holds_for_new_points() {
    let mut cloud = PointCloud::builder(grid(9, 1.0))
        .knn_radii(4, 0.8)
        .pca_normals(8)
        .viewpoint(Vec3::new(1.0, 9.0, 1.0))
        .noise(0.01)
        .build()
        .expect("valid");
    for (n, spacing) in [(9, 1.0), (9, 0.5), (30, 0.25), (4, 2.0), (9, 1.0)] {
        cloud.set_points(&grid(n, spacing), None).expect("valid");
        let middle = (n / 2 * n + n / 2) as usize;
        assert!((cloud.radius(middle) - 0.8 * spacing).abs() < 1e-6);
        let radii = (0..cloud.len()).map(|i| cloud.radius(i));
        assert_eq!(cloud.max_radius(), radii.clone().fold(0.0, f32::max));
        let mean = radii.sum::<f32>() / cloud.len() as f32;
        assert!((cloud.mean_radius() - mean).abs() < 1e-5 * mean);
        let normals = cloud.normals().expect("asked for");
        assert_eq!(normals.len(), (n * n) as usize);
        assert!(normals.iter().all(|normal| normal.distance(Vec3::Y) < 1e-6));
        assert!(cloud.normals_oriented());
        assert_eq!(cloud.noise(), 0.01);
        assert!(cloud.consists_of(&grid(n, spacing), None));
    }
    // Given normals count for their points only.
    let down = vec![-Vec3::Y; 81];
    cloud.set_points(&grid(9, 1.0), Some(&down)).expect("valid");
    assert_eq!(cloud.normals(), Some(&down[..]));
    assert!(!cloud.consists_of(&grid(9, 1.0), None));
    cloud.set_points(&grid(9, 1.0), None).expect("valid");
    assert!(cloud.normals().is_some_and(|normals| normals[0].y > 0.999));

    // A global radius that is set takes the place of the neighbours'.
    cloud.set_radii(Radii::Global(0.3)).expect("valid");
    assert_eq!(cloud.recipe().radii, RadiusRule::Global(0.3));
    cloud.set_points(&grid(5, 1.0), None).expect("valid");
    assert_eq!(cloud.radii(), &Radii::Global(0.3));
}

/// What `consists_of` calls the same, `set_points` leaves as it is, and the other way round.
#[test]
fn the_same_points_are_known() {
    let mut points = grid(9, 1.0);
    points.insert(4, Vec3::NAN);
    let mut normals = vec![Vec3::Y; points.len()];
    let mut cloud = PointCloud::builder(&points[..])
        .knn_radii(4, 0.8)
        .unoriented_normals(&normals[..])
        .build()
        .expect("valid")
        .into_owned();
    // As an argument normals are outward.
    assert!(!cloud.consists_of(&points, Some(&normals)));
    cloud.set_points(&points, Some(&normals)).expect("valid");
    assert!(cloud.consists_of(&points, Some(&normals)));
    // Normals count as unit vectors, those of dropped points not at all.
    normals[2] *= 3.0;
    normals[4] = Vec3::X;
    assert!(cloud.consists_of(&points, Some(&normals)));
    normals[2] = Vec3::X;
    assert!(!cloud.consists_of(&points, Some(&normals)));
    cloud.set_points(&points, None).expect("valid");
    assert!(cloud.consists_of(&points, None));
    // The dropped one is back, or another one is not finite.
    for (changed, value) in [(4, Vec3::ZERO), (5, Vec3::INFINITY)] {
        let mut others = points.clone();
        others[changed] = value;
        assert!(!cloud.consists_of(&others, None));
    }
    // Points that move keep their radii.
    let radius = cloud.mean_radius();
    let moved: Vec<Vec3> = points.iter().map(|p| 2.0 * p).collect();
    cloud.move_points(&moved, None).expect("valid");
    assert!(cloud.lies_at(&moved, None) && !cloud.consists_of(&moved, None));
    cloud.set_points(&moved, None).expect("valid");
    assert!(cloud.consists_of(&moved, None));
    assert!((cloud.mean_radius() - 2.0 * radius).abs() < 1e-5);
}

/// Equal clouds hold the same and go on alike.
#[test]
fn clouds_are_compared() {
    let points = grid(9, 1.0);
    let build = |points: &[Vec3]| {
        let builder = PointCloud::builder(points).radius(0.5);
        builder.build().expect("valid").into_owned()
    };
    let cloud = build(&points);
    assert!(cloud == build(&points) && cloud == cloud.clone());
    let mut other = build(&points);
    other.set_radii(Radii::Global(0.6)).expect("valid");
    assert!(cloud != other);
    let [small, large] = [0.5, 0.6].map(|last| {
        let mut radii = vec![0.5; points.len()];
        radii[80] = last;
        let builder = PointCloud::builder(&points[..]).radii(radii);
        builder.build().expect("valid")
    });
    assert!(small != large && small != cloud);
    let normals = vec![Vec3::Y; points.len()];
    other = build(&points);
    other.set_points(&points, Some(&normals)).expect("valid");
    assert!(cloud != other);
    let mut moved = points.clone();
    moved[80] += Vec3::Y;
    assert!(cloud != build(&moved) && cloud != build(&points[1..]));
}

/// Points that move keep their radii; without all of them they are new points.
#[test]
fn points_that_move_keep_radii_from_neighbours() {
    let mut cloud = PointCloud::builder(grid(9, 1.0)).knn_radii(4, 0.8);
    cloud = cloud.pca_normals(8).viewpoint(9.0 * Vec3::Y);
    let mut cloud = cloud.build().expect("valid");
    let radii = cloud.radii().clone();
    cloud.move_points(&grid(9, 3.0), None).expect("valid");
    assert_eq!(cloud.radii(), &radii);
    assert!(cloud.normals_oriented());
    let mut holed = grid(9, 3.0);
    holed[0] = Vec3::NAN;
    cloud.move_points(&holed, None).expect("valid");
    assert_eq!(cloud.len(), 80);
    assert!((cloud.radius(39) - 2.4).abs() < 1e-6);
}

/// Radii that neighbours tell are held to the limits that given ones are.
#[test]
fn points_too_far_apart_for_a_radius_are_refused() {
    let mut cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::X])
        .knn_radii(1, 0.65)
        .build()
        .expect("valid");
    let refused = cloud.set_points(&[Vec3::ZERO, 1e14 * Vec3::X], None);
    assert!(
        matches!(refused, Err(CloudError::BadRadius { index: 0, .. })),
        "{refused:?}"
    );
    assert_eq!(cloud.mean_radius(), 0.65);
}

/// One place has no spacing: the cloud stays as it was.
#[test]
fn points_without_a_spacing_are_refused() {
    let mut cloud = PointCloud::builder(grid(9, 1.0)).build().expect("valid");
    let before = state(&cloud);
    let refused = cloud.set_points(&[Vec3::ONE; 5], None);
    assert_eq!(refused, Err(CloudError::NoSpacing { count: 5 }));
    assert_eq!(state(&cloud), before);
}

/// Normals of which the sign says nothing are turned to a viewpoint, and count for nothing without one.
#[test]
fn unoriented_normals_have_the_side_of_the_viewpoint() {
    let normals: Vec<Vec3> = (0..81)
        .map(|i| if i % 3 == 0 { 2.0 * Vec3::Y } else { -Vec3::Y })
        .collect();
    let builder = || PointCloud::builder(grid(9, 1.0)).unoriented_normals(&normals);
    let bare = builder().build().expect("valid");
    assert!(!bare.normals_oriented());
    assert_eq!(
        bare.normals().map(|n| [n[0], n[1]]),
        Some([Vec3::Y, -Vec3::Y])
    );
    for side in [Vec3::Y, -Vec3::Y] {
        let seen = builder().viewpoint(3.0 * side).build().expect("valid");
        assert!(seen.normals_oriented());
        assert!(
            seen.normals()
                .is_some_and(|normals| normals.iter().all(|n| *n == side))
        );
    }
    let outward = PointCloud::builder(grid(9, 1.0)).normals(&normals);
    let outward = outward.viewpoint(3.0 * Vec3::Y).build().expect("valid");
    assert_eq!(outward.normals().map(|n| n[1]), Some(-Vec3::Y));
}

/// Errors name points by the index that the caller knows, dropped ones included.
#[test]
fn errors_count_dropped_points() {
    let mut rng = Rng::with_seed(12);
    let mut cloud = PointCloud::builder(random_points(&mut rng, 100))
        .radius(0.5)
        .build()
        .expect("valid");
    let mut points = random_points(&mut rng, 100);
    for index in [3, 50, 51] {
        points[index] = Vec3::NAN;
    }
    for index in [0, 4, 49, 52, 99] {
        let mut points = points.clone();
        points[index].y = 1e9;
        let found = cloud.set_points(&points, None).expect_err("too far");
        let expected = CloudError::CoordinateTooLarge {
            index,
            coordinate: 1e9,
            radius: 0.5,
        };
        assert_eq!(found, expected);
    }
}
