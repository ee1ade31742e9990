//! What examples in the documentation begin with; readers do not see it.

/// A level scan of 2 m by 2 m with points every 10 cm.
macro_rules! example_scan {
    () => {
        "# use rapier3d::prelude::*;
# use rapier3d_tldi::prelude::*;
# let points: Vec<Vector> = (0..400)
#     .map(|i| 0.1 * Vector::new((i % 20) as f32, 0.0, (i / 20) as f32))
#     .collect();
# let scan = PointCloud::builder(&points).radius(0.1).build()?.into_owned();"
    };
}

/// The scan in a world with a ball that touches it.
macro_rules! example_world {
    () => {
        concat!(
            example_scan!(),
            "
# let mut world = PhysicsWorld::default();
# let mut tldi = TldiPipeline::new(TldiConfig::default())?;
# tldi.attach(&mut world);
# let (_, scan) = world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan));
# let ball = RigidBodyBuilder::dynamic().translation(Vector::new(1.0, 0.19, 1.0));
# let (ball, _) = world.insert(ball, ColliderBuilder::ball(0.2));"
        )
    };
}
