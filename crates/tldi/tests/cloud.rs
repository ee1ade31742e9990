//! Building clouds and giving them new points.

use fastrand::Rng;
use std::borrow::Cow;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{Aabb, BLOCK, CloudError, NonFinite, PointCloud, Positions, Radii};

fn random_points(rng: &mut Rng, count: usize) -> Vec<Vec3> {
    let mut coordinate = || 2.0 * rng.f32() - 1.0;
    (0..count)
        .map(|_| Vec3::new(coordinate(), coordinate(), coordinate()))
        .collect()
}

/// Makes about one point in `rarity` non-finite.
fn spoil(rng: &mut Rng, points: &mut [Vec3], rarity: usize) {
    for p in points {
        if rng.usize(..rarity) == 0 {
            p[rng.usize(..3)] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][rng.usize(..3)];
        }
    }
}

/// A radius, normal and colour that tell which point they belong to.
fn radius_of(i: usize) -> f32 {
    1.0 + i as f32
}
fn normal_of(i: usize) -> Vec3 {
    Vec3::new((i as f32).cos(), (i as f32).sin(), 0.0)
}
fn color_of(i: usize) -> [u8; 4] {
    (i as u32).to_le_bytes()
}
struct Attributes {
    radii: Vec<f32>,
    normals: Vec<Vec3>,
    colors: Vec<[u8; 4]>,
}
fn attributes(count: usize) -> Attributes {
    Attributes {
        radii: (0..count).map(radius_of).collect(),
        normals: (0..count).map(normal_of).collect(),
        colors: (0..count).map(color_of).collect(),
    }
}

fn bounds_of(points: &[Vec3]) -> Aabb {
    points.iter().fold(Aabb::EMPTY, |b, p| b.including(*p))
}

/// Asserts that point `i` of the cloud is, with its attributes, point `given[i]` of `points`, and
/// that all bounds are right.
fn assert_holds(cloud: &PointCloud<'_>, points: &[Vec3], given: &[usize]) {
    assert_eq!(cloud.len(), given.len());
    for (i, &g) in given.iter().enumerate() {
        assert_eq!(cloud.point(i), points[g], "point {i}");
        assert_eq!(cloud.radius(i), radius_of(g), "radius {i}");
        assert_eq!(
            cloud.normals().expect("given")[i],
            normal_of(g),
            "normal {i}"
        );
        assert_eq!(cloud.colors().expect("given")[i], color_of(g), "colour {i}");
    }
    let largest = given.iter().map(|&g| radius_of(g)).fold(0.0, f32::max);
    assert_eq!(cloud.max_radius(), largest);
    assert_bounds(cloud);
}

fn assert_bounds(cloud: &PointCloud<'_>) {
    let points: Vec<Vec3> = cloud.points().collect();
    assert_eq!(cloud.bounds(), bounds_of(&points));
    let blocks: Vec<Aabb> = points.chunks(BLOCK).map(bounds_of).collect();
    assert_eq!(cloud.blocks(), blocks);
}

/// Everything that can be seen of a cloud, for comparing.
fn state(cloud: &PointCloud<'_>) -> String {
    format!(
        "{:?} {:?} {:?} {} {:?} {:?} {:?} {} {} {} {:?}",
        cloud.coordinates(),
        cloud.radii(),
        cloud.normals(),
        cloud.normals_oriented(),
        cloud.colors(),
        cloud.bounds(),
        cloud.blocks(),
        cloud.mean_radius(),
        cloud.max_radius(),
        cloud.dropped(),
        cloud.order(),
    )
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
            let [x, y, z] = [0, 1, 2].map(|c| points.iter().map(|p| p[c]).collect::<Vec<f32>>());
            for positions in [
                Positions::from(&points),
                Positions::from(points.clone()),
                Positions::from([&x[..], &y, &z]),
                Positions::from([x.clone(), y.clone(), z.clone()]),
            ] {
                let cloud = PointCloud::builder(positions)
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
    let [x, y, z] = [0, 1, 2].map(|c| points.iter().map(|p| p[c]).collect::<Vec<f32>>());
    let Attributes { radii, colors, .. } = attributes(1000);
    let cloud = PointCloud::builder([&x[..], &y, &z])
        .radii(&radii)
        .colors(&colors)
        .build()
        .expect("valid");
    let pointers = cloud.coordinates().map(<[f32]>::as_ptr);
    assert_eq!(pointers, [x.as_ptr(), y.as_ptr(), z.as_ptr()]);
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
    let (three, two) = ([0.0; 3], [0.0; 2]);
    for (y, z, name) in [(&two[..], &three[..], "y"), (&three, &two, "z")] {
        let soa = PointCloud::builder([&three[..], y, z]).radius(1.0).build();
        assert_eq!(soa.err(), Some(mismatch(name, 2)));
    }
}

#[test]
fn too_many_points_are_refused_unread() {
    // Zeroed memory that is never touched.
    let limit = u32::MAX as usize / 64;
    let zeros = vec![0.0f32; limit + 1];
    let error = PointCloud::builder([&zeros[..], &zeros, &zeros])
        .radius(1.0)
        .build();
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
