use super::*;
use crate::peers::{Culled, Grid};
use rapier3d::math::Vector;
use rapier3d::parry::query::PointQuery;
use rapier3d::parry::shape::TriMesh;
use tldi::CpuBackend;
use tldi_tests::{DEEP_LIMIT, NORMAL_LIMIT, SHALLOW_LIMIT};

fn ours() -> Contender {
    Contender::ours(Box::new(CpuBackend::new()), 1.0, 0.0).expect("a thread can be started")
}

fn balls(radius_scale: f32) -> Contender {
    let peer = Culled::new(Grid::telling_deepest());
    Contender::new(Box::new(peer), Some(radius_scale))
}

fn plan(pairs: &[ContactPair], cases: usize) -> Plan<'_> {
    Plan {
        pairs,
        cases,
        seed: 3,
        tells_motion: true,
    }
}

/// As good as the testkit wants contacts of spheres to be, whatever the frame; deep ones by the limit
/// of the least deep.
#[test]
fn ours_is_within_the_limits_on_spheres() {
    let pairs = [ContactPair::SphereSphere, ContactPair::SpherePlane];
    let rows = measure(&mut [ours()], &plan(&pairs, 21), || ());
    assert_eq!(rows.len(), 6);
    for row in rows {
        let limit = match row.regime {
            Regime::Shallow => SHALLOW_LIMIT,
            Regime::Deep => DEEP_LIMIT * row.regime.depths()[0],
        };
        assert_eq!([row.missed_pct, row.wrong_side_pct], [0.0; 2], "{row:?}");
        let normal = row.normal_median_deg.expect("none is missed");
        let depth = row.depth_median_radii.expect("none is missed");
        assert!(normal <= f64::from(NORMAL_LIMIT), "{row:?}");
        assert!(depth <= f64::from(limit), "{row:?}");
    }
}

/// Balls much smaller than the spacing meet nothing: all is missed, and told so. Rows of all pairs hold
/// the cases of each.
#[test]
fn what_is_missed_is_infinitely_wrong() {
    let pairs = [ContactPair::SpherePlane, ContactPair::BoxPlane];
    let mut cases = 0;
    let mut contenders = [balls(1e-3), balls(1.0)];
    let rows = measure(&mut contenders, &plan(&pairs, 5), || cases += 1);
    assert_eq!((cases, rows.len()), (20, 12));
    for row in rows {
        assert_eq!(row.cases, if row.pair.is_none() { 10 } else { 5 });
        let is_tiny = row.radius_scale == Some(1e-3);
        assert_eq!(row.missed_pct, if is_tiny { 100.0 } else { 0.0 }, "{row:?}");
        assert_eq!(row.normal_median_deg.is_none(), is_tiny, "{row:?}");
        assert_eq!(row.depth_p95_radii.is_none(), is_tiny, "{row:?}");
    }
}

/// Every point of every shape lies on its mesh, but for what flat faces cut off a sphere; every vertex
/// is near a point, and the meshes are as fine as the points.
#[test]
fn meshes_are_where_the_points_are() {
    let clouds = ContactClouds::new(false);
    let mut rng = fastrand::Rng::with_seed(5);
    for pair in ContactPair::ALL {
        let case = clouds.case(pair, 0.0, &mut rng);
        let scene = Scene::new(&case, &random_pose(&mut rng, REACH), Vec3::ZERO);
        for (points, mesh) in scene.points.iter().zip(&scene.meshes) {
            let vector = |p: &Vec3| Vector::new(p.x, p.y, p.z);
            let vertices = mesh.vertices.iter().map(vector).collect();
            let surface = TriMesh::new(vertices, mesh.faces.clone()).expect("it has faces");
            for p in points {
                let off = surface.distance_to_local_point(vector(p), false) / CONTACT_SPACING;
                assert!(off < 0.03, "{pair:?}: {off} r");
            }
            let near = |v: &Vec3| {
                points
                    .iter()
                    .any(|p| p.distance(*v) < 2.0 * CONTACT_SPACING)
            };
            assert!(mesh.vertices.iter().step_by(101).all(near), "{pair:?}");
            let share = mesh.vertices.len() as f32 / points.len() as f32;
            assert!((0.5..5.0).contains(&share), "{pair:?}: {share}");
        }
    }
}
