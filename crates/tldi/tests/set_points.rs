//! Giving clouds new points and radii.

mod cloud_support;

use cloud_support::{
    Attributes, assert_bounds, assert_holds, attributes, color_of, normal_of, radius_of,
    random_points, state,
};
use fastrand::Rng;
use std::borrow::Cow;
use tldi::glamx::Vec3;
use tldi::{CloudError, NonFinite, PointCloud, Radii};

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
    assert!(cloud.points().eq(moved.iter().copied()));
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
        assert!(cloud.points().eq(points.iter().copied()));
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
        assert!(cloud.points().eq(moved[..599].iter().copied()));
        assert_eq!((cloud.order(), cloud.max_radius()), (None, 0.25));
    }
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
    assert!(cloud.points().eq(points.iter().copied()), "as given");
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
        let error = cloud.set_points(&bad, Some(&normals)).expect_err("refused");
        assert_eq!(
            error,
            CloudError::NonFinite {
                index: 20,
                count: 1
            }
        );
        assert_eq!(state(&cloud), before);

        bad[20].y = 1e9;
        let error = cloud
            .set_points(&bad, Some(&normals))
            .expect_err("too large");
        assert!(
            matches!(error, CloudError::CoordinateTooLarge { index: 20, .. }),
            "{error}"
        );
        assert_eq!(state(&cloud), before);

        bad[20].y = 0.0;
        let error = cloud
            .set_points(&bad, Some(&normals[1..]))
            .expect_err("one short");
        assert!(matches!(
            error,
            CloudError::LengthMismatch {
                attribute: "normals",
                ..
            }
        ));
        assert_eq!(state(&cloud), before);
        let useless = vec![Vec3::ZERO; 600];
        let error = cloud
            .set_points(&bad, Some(&useless))
            .expect_err("no normal");
        assert_eq!(error, CloudError::NoUsableNormal { count: 600 });
        assert_eq!(state(&cloud), before);

        let error = cloud.set_points(&[], None).expect_err("empty");
        assert_eq!(error, CloudError::Empty { dropped: 0 });
        assert_eq!(state(&cloud), before);
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
