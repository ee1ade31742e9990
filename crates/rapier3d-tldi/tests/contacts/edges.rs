//! Bodies whose sides are nearly flush with those of what they stand on.

use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::{prelude::*, sample_shape};

const SPACING: f32 = 0.02;

fn box_of(half: Vector) -> PointCloud<'static> {
    let shape = SharedShape::cuboid(half.x, half.y, half.z);
    sample_shape(&*shape, SPACING).expect("it has a surface")
}

/// Nothing pushes a box aside that stands on a table with its front up to three radii behind the table's edge. Without
/// normals of the box, its front and the side of the table were told to be in each other. Of 60 boxes, 38 were pushed; three
/// still are, at less than half the speed.
#[test]
fn boxes_at_the_edge_of_a_table_are_not_pushed_off() {
    let mut rng = Rng::with_seed(7);
    let mut pushed = 0;
    for _ in 0..60 {
        let mut between = |from: f32, to: f32| SPACING * (from + (to - from) * rng.f32());
        let table = Vector::new(between(20.0, 22.0), 4.0 * SPACING, 20.0 * SPACING);
        let half = Vector::new(between(5.0, 13.0), between(5.0, 13.0), between(5.0, 13.0));
        let inset = between(0.0, 3.0);
        let mut world = PhysicsWorld::default();
        let mut tldi = TldiPipeline::new(TldiConfig::default()).expect("the settings are valid");
        tldi.attach(&mut world);
        let below = RigidBodyBuilder::fixed().translation(-table.y * Vector::Y);
        world.insert(below, tldi.collider(box_of(table)));
        let bare = PointCloud::builder(box_of(half).points().to_vec()).radius(SPACING);
        let place = Vector::new(table.x - half.x - inset, half.y, 0.0);
        let body = RigidBodyBuilder::dynamic().translation(place);
        let bare = tldi.collider(bare.build().expect("valid points"));
        let (body, _) = world.insert(body, bare);
        let mut fastest = 0.0_f32;
        for _ in 0..3 {
            tldi.step(&mut world).expect("nothing fails");
            fastest = fastest.max(world.bodies[body].linvel().x);
        }
        // A radius in a second. The roughness of the top tilts a box by fractions of a degree.
        pushed += usize::from(fastest > SPACING);
    }
    assert!(pushed <= 4, "{pushed}");
}

/// The contacts of a box on a floor are under its edges, to within half a pixel or a little more on average (a pixel is a
/// radius). Farther inside it would tip and turn too easily.
#[test]
fn contacts_reach_the_edges_of_boxes() {
    let half = Vector::new(6.0, 5.0, 4.0) * SPACING;
    let floor = box_of(Vector::new(25.0, 2.0, 25.0) * SPACING);
    let exact = ColliderBuilder::cuboid(half.x, half.y, half.z);
    for (kind, body) in [exact, cloud_collider(PointCloudShape::new(box_of(half)))]
        .into_iter()
        .enumerate()
    {
        let mut rng = Rng::with_seed(8);
        let (mut inside, mut count) = (Vector::ZERO, 0.0);
        for _ in 0..40 {
            let mut world = PhysicsWorld::default();
            let mut tldi =
                TldiPipeline::new(TldiConfig::default()).expect("the settings are valid");
            tldi.attach(&mut world);
            let below = RigidBodyBuilder::fixed().translation(-2.0 * SPACING * Vector::Y);
            world.insert(below, tldi.collider(floor.clone()));
            let place = Vector::new(rng.f32() * SPACING, half.y, rng.f32() * SPACING);
            let on_it = RigidBodyBuilder::dynamic()
                .translation(place)
                .rotation(Vector::Y * rng.f32());
            let (on_it, _) = world.insert(on_it, body.clone());
            tldi.step(&mut world).expect("nothing fails");
            let pose = *world.bodies[on_it].position();
            for contact in tldi.contacts(&world.narrow_phase, &world.colliders) {
                inside += half - (pose.inverse() * contact.point).abs();
                count += 1.0;
            }
        }
        let inside = inside / (count * SPACING);
        assert_eq!(count, 160.0);
        assert!(
            inside.x.abs() < 0.7 && inside.z.abs() < 0.7,
            "box {kind}: {inside}"
        );
    }
}
