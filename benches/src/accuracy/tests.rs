use super::*;
use crate::peers::Found;
use crate::protocol::{ALL_CASES, cases};
use crate::stored::Measured;
use tldi::glamx::{Pose3, Quat, Vec3};

/// The cube of an edge of 2 about the origin.
fn cube() -> Model {
    let corner = |k: usize| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32);
    let quads = [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ];
    Model {
        name: "cube".to_owned(),
        points: (0..8).map(|k| 2.0 * corner(k) - Vec3::ONE).collect(),
        faces: quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
    }
}

fn exact(model: &Model) -> ExactMesh {
    ExactMesh::new(&model.points, &model.faces)
}

/// Cubes are free when one of their faces' planes parts them.
#[test]
fn ways_out_of_cubes() {
    let mesh = exact(&cube());
    for (x, y, expected) in [
        (1.5, 0.0, 0.5),
        (1.9, 1.7, 0.1),
        (0.25, 1.25, 0.75),
        (2.5, 0.0, 0.0),
    ] {
        let out = way_out(&mesh, &Pose3::translation(x, y, 0.0));
        assert!((out - expected).abs() < 2e-3, "{x}, {y}: {out}");
    }
    // Edge on, the cube reaches √2 far.
    let turned = Pose3::from_parts(
        2.0 * Vec3::X,
        Quat::from_rotation_y(0.25 * std::f32::consts::PI),
    );
    let out = way_out(&mesh, &turned);
    assert!((out - (2.0f32.sqrt() - 1.0)).abs() < 2e-3, "{out}");
}

#[test]
fn truth_is_kept_for_each_mesh() {
    let folder = std::env::temp_dir().join(format!("tldi_truth_{}", std::process::id()));
    let (near, model) = (exact(&cube()), cube());
    let some: Vec<Case> = cases(62).collect();
    let mut truth = Truth::open(&folder, &model);
    let first: Vec<bool> = some.iter().map(|case| truth.of(case, &near)).collect();
    // Whether they meet: cubes turned at will reach between 1 and √3 far.
    for (case, meets) in some.iter().zip(&first) {
        assert!(*meets || case.distance > 2.0, "{case:?}");
        assert!(!*meets || case.distance < 1.0 + 3f32.sqrt(), "{case:?}");
    }
    assert!(first.contains(&true) && first.contains(&false));
    truth
        .save()
        .expect("the folder for temporary files can be written");

    // A mesh without faces meets nothing: the answers are those that were kept.
    let nothing = ExactMesh::new(&[], &[]);
    let mut again = Truth::open(&folder, &model);
    let kept: Vec<bool> = some.iter().map(|case| again.of(case, &nothing)).collect();
    assert_eq!(kept, first);
    let mut other = cube();
    other.points[0].x -= 0.1;
    let mut of_other = Truth::open(&folder, &other);
    assert!(!some.iter().any(|case| of_other.of(case, &nothing)));

    // What was broken off is not believed.
    let file = std::fs::read_dir(&folder).expect("it is there").next();
    let file = file.expect("it was saved").expect("it can be read").path();
    std::fs::write(&file, "101").expect("it can be written");
    let mut broken = Truth::open(&folder, &model);
    assert!(!some.iter().any(|case| broken.of(case, &nothing)));
    std::fs::remove_dir_all(folder).expect("it is there");
}

/// Says that bodies collide if their middles are nearer than `reach`.
struct Oracle {
    reach: f32,
}

impl Peer for Oracle {
    fn name(&self) -> String {
        "oracle".to_owned()
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let middle = |points: &[Vec3]| points.iter().sum::<Vec3>() / points.len() as f32;
        assert_eq!(frame.radii.expect("they are given")[1].len(), frame.b.len());
        Found {
            build_seconds: 1e-3 * f64::from(middle(frame.b).x + 1.0),
            query_seconds: 1e-3,
            collides: middle(frame.a).distance(middle(frame.b)) < self.reach,
            ..Found::default()
        }
    }
}

#[test]
fn errors_are_counted_on_the_side_where_they_are() {
    let model = cube();
    let mesh = exact(&model);
    let all: Vec<Case> = cases(ALL_CASES / 90).collect();
    let truth: Vec<bool> = all
        .iter()
        .map(|c| mesh.intersects(&mesh, &c.a_from_b))
        .collect();
    let cloud = tldi::PointCloud::builder(model.points.clone())
        .radius(0.5)
        .build()
        .expect("a cube is finite");
    let copies = Copies {
        model: &model,
        clouds: [&cloud, &cloud],
        noise: 0.0,
    };
    let contender = |reach| Contender::new(Box::new(Oracle { reach }), Some(0.5));
    let mut contenders = [contender(9.0), contender(0.05), contender(2.35)];
    let mut done = 0;
    let rows = measure(&mut contenders, &copies, &mesh, &all, &truth, || done += 1);
    assert_eq!(done, all.len());
    let colliding = 100.0 * truth.iter().filter(|t| **t).count() as f64 / all.len() as f64;
    let [yes, hardly, between] = &rows[..] else {
        panic!("a row each");
    };
    for row in &rows {
        assert_eq!(row.fault(), None);
        assert!((row.colliding_pct - colliding).abs() < 1e-9);
        assert_eq!(row.by_distance.len(), 31);
        // Oracles say 1 ms more than the distance and 1 ms: the median distance is 1.5.
        assert!((row.median_ms - 3.5).abs() < 1e-3, "{}", row.median_ms);
        assert!(
            (row.upper_quartile_ms - 4.25).abs() < 0.06,
            "{}",
            row.upper_quartile_ms
        );
    }
    assert!((yes.false_positive_pct - (100.0 - colliding)).abs() < 1e-9);
    assert_eq!(yes.false_negative_pct, 0.0);
    assert_eq!(yes.worst_false_negative_mean_radii, 0.0);
    // All but those at distance 0, where both are in one place.
    let at_zero = 100.0 / 31.0;
    assert!((hardly.false_negative_pct - (colliding - at_zero)).abs() < 1e-9);
    assert_eq!(hardly.false_positive_pct, 0.0);
    // Nearly in one place, 0.1 apart, they are about 1.9 deep in each other: 3.8 radii and more.
    let worst = hardly.worst_false_negative_mean_radii;
    assert!((3.6..7.0).contains(&worst), "{worst}");
    for tally in &between.by_distance {
        let is_near = tally.distance < 2.35;
        assert!(!is_near || tally.false_negatives == 0, "{tally:?}");
        assert!(is_near || tally.false_positives == 0, "{tally:?}");
    }
    assert!(between.false_negative_pct > 0.0 && between.false_positive_pct > 0.0);
}
