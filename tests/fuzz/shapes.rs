//! Rapier's own shapes of any size, some without width.

use proptest::prelude::*;
use rapier3d::parry::shape::HalfSpace;
use rapier3d::prelude::*;

/// Kind, three sizes (powers of ten, relative; -9: zero) and a seed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShapeSpec {
    pub(crate) kind: u8,
    pub(crate) sizes: [i32; 3],
    pub(crate) seed: u64,
}

pub(crate) fn shape() -> impl Strategy<Value = ShapeSpec> {
    let size = || prop_oneof![8 => -1..=0i32, 1 => -4..=2i32, 1 => Just(-9)];
    (0..16u8, [size(), size(), size()], any::<u64>()).prop_map(|(kind, sizes, seed)| ShapeSpec {
        kind,
        sizes,
        seed,
    })
}

impl ShapeSpec {
    pub(crate) fn is_half_space(&self) -> bool {
        self.kind == 10
    }

    /// For a scene of this size in metres; `None` where rapier has no such shape.
    pub(crate) fn build(&self, scale: f32) -> Option<SharedShape> {
        let mut rng = fastrand::Rng::with_seed(self.seed);
        let [x, y, z] = self.sizes.map(|e| match e {
            -9 => 0.0,
            e => scale * 10f32.powi(e),
        });
        let half = Vector::new(x, y, z);
        let mut corner =
            || Vector::from_array(std::array::from_fn(|_| 2.0 * rng.f32() - 1.0)) * half;
        let corners: Vec<Vector> = (0..8).map(|_| corner()).collect();
        let [a, b, c] = [corners[0], corners[1], corners[2]];
        let faces = vec![[0, 1, 2], [1, 2, 3], [4, 5, 6], [0, 0, 1]];
        Some(match self.kind {
            0 => SharedShape::ball(x),
            1 => SharedShape::cuboid(x, y, z),
            2 => SharedShape::capsule(a, b, z),
            3 => SharedShape::cylinder(x, y),
            4 => SharedShape::cone(x, y),
            5 => SharedShape::convex_hull(&corners)?,
            6 => SharedShape::round_cuboid(x, y, z, 0.1 * x),
            7 => SharedShape::round_cylinder(x, y, 0.1 * x),
            8 => SharedShape::triangle(a, b, c),
            9 => SharedShape::segment(a, b),
            10 => SharedShape::new(HalfSpace::new(a.normalize_or(Vector::Y))),
            11 => SharedShape::polyline(corners, None),
            12 => SharedShape::trimesh(corners, faces).ok()?,
            13 => {
                let heights: Vec<f32> = corners.iter().chain(&[c]).map(|p| p.y).collect();
                SharedShape::heightfield(Array2::new(3, 3, heights), 2.0 * half)
            }
            14 => SharedShape::voxels_from_points(half.max(Vector::splat(1e-3 * scale)), &corners),
            _ => SharedShape::compound(vec![
                (Pose::from_translation(a), SharedShape::ball(x)),
                (Pose::from_translation(b), SharedShape::cuboid(x, y, z)),
                (Pose::IDENTITY, SharedShape::convex_hull(&corners)?),
            ]),
        })
    }
}
