//! Giving a warm cloud new points allocates nothing. A binary of its own with one test, since the
//! allocations of all threads are counted.

use fastrand::Rng;
use tldi::PointCloud;
use tldi::glamx::Vec3;
use tldi_memory::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

#[test]
fn a_warm_cloud_allocates_nothing() {
    let mut rng = Rng::with_seed(1);
    let mut frame = |count: usize| -> Vec<Vec3> {
        let mut point = || {
            Vec3::new(
                rng.f32(),
                rng.f32(),
                if rng.u8(..9) > 0 { 1.0 } else { f32::NAN },
            )
        };
        (0..count).map(|_| point()).collect()
    };
    let frames = [frame(3000), frame(2500), frame(3000), frame(10)];
    let whole: Vec<Vec3> = (0..3000).map(|i| Vec3::splat(i as f32)).collect();
    let normals = vec![2.0 * Vec3::Y; 3000];
    let mut plain = PointCloud::builder(&whole)
        .radius(0.1)
        .build()
        .expect("valid");
    let mut ordered = PointCloud::builder(&whole)
        .radius(0.1)
        .spatial_order()
        .build()
        .expect("valid");
    let mut alternating = ordered.clone();
    assert!(
        allocations(|| drop(frames[0].clone())) > 0,
        "the counter works"
    );

    let mut round = || {
        for frame in &frames {
            plain.set_points(frame, None).expect("valid");
        }
        plain.set_points(&whole, None).expect("valid");
        for _ in 0..3 {
            ordered.set_points(&whole, Some(&normals)).expect("valid");
            alternating
                .set_points(&whole, Some(&normals))
                .expect("valid");
            alternating.set_points(&whole, None).expect("valid");
        }
    };
    // The memory that is filled and the memory that is replaced take turns: both must have grown. Workers allocate when
    // they start, which on a busy machine may be late.
    round();
    rayon::broadcast(|_| ());
    round();
    assert_eq!(allocations(&mut round), 0);
}
