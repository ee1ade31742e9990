//! One surface as each method sees it: points, a mesh, shapes of rapier's.

use super::case::Stop;
use super::method::Method;
use rapier3d::parry::utils::Array2;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use tldi::glamx::{Vec2, Vec3};
use tldi_tests::{Samples, Sheet, sampled_box, sampled_sphere};

/// Mass per volume of all bodies in kg/m³: wood.
const DENSITY: f32 = 500.0;

/// What the normals of a cloud are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Normals {
    /// The true ones, outward.
    Given,
    /// None: the pipeline estimates what it needs, without a side.
    Absent,
    /// Estimated from 16 neighbours when the cloud is built, towards this viewpoint (metres, in
    /// the cloud's frame).
    Seen(Vec3),
}

impl Normals {
    /// With true normals and without, and how cases are named then.
    pub(crate) const GIVEN_OR_NOT: [(Self, &'static str); 2] =
        [(Self::Given, "oriented"), (Self::Absent, "bare")];
}

/// A body as wide as it is high and deep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Solid {
    /// A cube.
    Box,
    /// A sphere.
    Ball,
}

impl Solid {
    /// Both.
    pub(crate) const ALL: [Self; 2] = [Self::Box, Self::Ball];

    /// Name in cases.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Ball => "ball",
        }
    }

    /// Its surface about the origin, `half` its size in metres, with points `spacing` metres apart.
    pub(crate) fn surface(self, half: f32, spacing: f32, rng: &mut fastrand::Rng) -> Surface {
        match self {
            Self::Box => Surface::cuboid(Vec3::splat(half), spacing, rng),
            Self::Ball => Surface::ball(half, spacing),
        }
    }
}

/// What the radii of a cloud are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Radius {
    /// One for all points, metres.
    Global(f32),
    /// 0.65 × the distance to the 7th neighbour.
    Neighbors,
}

/// Vertices and triangles, anticlockwise from outside.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    /// Corners, metres.
    pub(crate) vertices: Vec<Vec3>,
    /// Indices of corners.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Whether bodies come only from outside: what is behind is solid.
    pub(crate) one_sided: bool,
}

/// A part of a primitive: where it is in the body's frame, and its shape.
pub(crate) type Part = (Pose, SharedShape);

/// How thick a rapier primitive stands for a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Backing {
    /// Solid below, as a floor is.
    Solid,
    /// A film around the sheet, as thin as 0.1 spacings: there is something on both sides.
    Film,
}

/// A surface in its own frame, as each method sees it.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// Points as a sensor gives them, and true outward normals.
    pub(crate) samples: Samples,
    /// Which radii the cloud is given.
    pub(crate) radius: Radius,
    /// Which normals the cloud is given.
    pub(crate) normals: Normals,
    /// Where its voxels' grid lies: shift in voxels, so that sheets are centred in a voxel and
    /// flat faces never lie on the border between two.
    pub(crate) voxel_shift: f32,
    /// Edge of its voxels, metres.
    pub(crate) voxel_edge: f32,
    /// The mesh, or why there is none.
    pub(crate) mesh: Result<Mesh, &'static str>,
    /// Rapier's shapes, or why there are none.
    pub(crate) primitive: Result<Vec<Part>, &'static str>,
    /// Mass properties of the solid, the same for all methods; `None` for what is fixed.
    pub(crate) mass: Option<MassProperties>,
}

impl Surface {
    /// A box about the origin with points `spacing` metres apart.
    pub(crate) fn cuboid(half: Vec3, spacing: f32, rng: &mut fastrand::Rng) -> Self {
        let (vertices, triangles) = Cuboid::new(half).to_trimesh();
        Self {
            mass: Some(MassProperties::from_cuboid(DENSITY, half)),
            ..Self::solid(
                sampled_box(half, spacing, rng),
                spacing,
                (vertices, triangles),
                SharedShape::cuboid(half.x, half.y, half.z),
            )
        }
    }

    /// A ball about the origin with points `spacing` metres apart.
    pub(crate) fn ball(radius: f32, spacing: f32) -> Self {
        let around = (std::f32::consts::TAU * radius / spacing).ceil() as u32;
        Self {
            mass: Some(MassProperties::from_ball(DENSITY, radius)),
            ..Self::solid(
                sampled_sphere(radius, spacing),
                spacing,
                Ball::new(radius).to_trimesh(around, around.div_ceil(2)),
                SharedShape::ball(radius),
            )
        }
    }

    /// A closed body: its mesh and its primitive enclose the same volume.
    fn solid(
        samples: Samples,
        spacing: f32,
        (vertices, triangles): (Vec<Vec3>, Vec<[u32; 3]>),
        primitive: SharedShape,
    ) -> Self {
        Self {
            samples,
            radius: Radius::Global(spacing),
            normals: Normals::Given,
            voxel_shift: 0.25,
            voxel_edge: 2.0 * spacing,
            mesh: Ok(Mesh {
                vertices,
                triangles,
                one_sided: true,
            }),
            primitive: Ok(vec![(Pose::IDENTITY, primitive)]),
            mass: None,
        }
    }

    /// A closed mesh whose points are `samples`; rapier's convex hull stands for it.
    pub(crate) fn model(samples: Samples, spacing: f32, mesh: Mesh) -> Self {
        let solid = SharedShape::trimesh(mesh.vertices.clone(), mesh.triangles.clone());
        let mass = solid.map(|shape| shape.mass_properties(DENSITY));
        let hull = SharedShape::convex_hull(&mesh.vertices)
            .map(|hull| vec![(Pose::IDENTITY, hull)])
            .ok_or("the mesh has no convex hull");
        Self {
            samples,
            radius: Radius::Global(spacing),
            normals: Normals::Given,
            voxel_shift: 0.25,
            voxel_edge: 2.0 * spacing,
            mass: mass.ok(),
            mesh: Ok(mesh),
            primitive: hull,
        }
    }

    /// A flat rectangle of `size` metres (x, z) in y = 0, facing up.
    pub(crate) fn flat(
        size: Vec2,
        spacing: f32,
        backing: Backing,
        rng: &mut fastrand::Rng,
    ) -> Self {
        let sheet = Sheet::sampled(size, spacing, rng, |_| 0.0);
        Self {
            mesh: Ok(rectangle_mesh(size, backing)),
            ..Self::of_sheet(sheet, size, spacing, backing)
        }
    }

    /// The same rectangle with range noise of `deviation` metres along the normal; its mesh joins
    /// the noisy points.
    pub(crate) fn noisy(
        size: Vec2,
        spacing: f32,
        deviation: f32,
        backing: Backing,
        rng: &mut fastrand::Rng,
    ) -> Self {
        let sheet = Sheet::sampled(size, spacing, rng, |_| 0.0).with_noise(deviation, rng);
        Self::of_sheet(sheet, size, spacing, backing)
    }

    /// The height field `y = height(x, z)`; rapier's `HeightField` stands for it.
    pub(crate) fn terrain(
        size: Vec2,
        spacing: f32,
        rng: &mut fastrand::Rng,
        height: impl Fn(Vec2) -> f32,
    ) -> Self {
        let sheet = Sheet::sampled(size, spacing, rng, &height);
        let [columns, rows] = [size.x, size.y].map(|edge| (edge / spacing).ceil() as usize + 1);
        // Rows run along z, columns along x.
        let heights = Array2::new(
            rows,
            columns,
            (0..rows * columns)
                .map(|k| {
                    let [i, j] = [k / rows, k % rows];
                    let at = Vec2::new(i as f32, j as f32)
                        / Vec2::new(columns as f32 - 1.0, rows as f32 - 1.0)
                        - Vec2::splat(0.5);
                    height(at * size)
                })
                .collect(),
        );
        let field = SharedShape::heightfield(heights, Vec3::new(size.x, 1.0, size.y));
        Self {
            primitive: Ok(vec![(Pose::IDENTITY, field)]),
            ..Self::of_sheet(sheet, size, spacing, Backing::Film)
        }
    }

    fn of_sheet(sheet: Sheet, size: Vec2, spacing: f32, backing: Backing) -> Self {
        let triangles = sheet.triangles();
        let mesh = Mesh {
            vertices: sheet.samples.points.clone(),
            triangles,
            one_sided: backing == Backing::Solid,
        };
        Self {
            samples: sheet.samples,
            radius: Radius::Global(spacing),
            normals: Normals::Given,
            voxel_shift: 0.5,
            voxel_edge: 2.0 * spacing,
            mesh: Ok(mesh),
            primitive: Ok(vec![slab(Vec2::ZERO, size, spacing, backing)]),
            mass: None,
        }
    }

    /// The same surface with other normals for the cloud.
    #[must_use]
    pub(crate) fn with_normals(self, normals: Normals) -> Self {
        Self { normals, ..self }
    }

    /// The same surface in another frame.
    #[must_use]
    pub(crate) fn moved(&self, pose: &Pose) -> Self {
        let mut moved = self.clone();
        moved.samples = self.samples.moved(pose);
        if let Ok(mesh) = &mut moved.mesh {
            for vertex in &mut mesh.vertices {
                *vertex = *pose * *vertex;
            }
        }
        if let Ok(parts) = &mut moved.primitive {
            for (part, _) in parts {
                *part = *pose * *part;
            }
        }
        moved
    }

    /// Both surfaces as one cloud, one mesh, one set of shapes; radii and normals as those of the
    /// first.
    #[must_use]
    pub(crate) fn joined(mut self, other: &Self) -> Self {
        self.samples.extend(&other.samples);
        if let (Ok(mesh), Ok(more)) = (&mut self.mesh, &other.mesh) {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(&more.vertices);
            mesh.triangles
                .extend(more.triangles.iter().map(|t| t.map(|i| first + i)));
            mesh.one_sided &= more.one_sided;
        }
        if let (Ok(parts), Ok(more)) = (&mut self.primitive, &other.primitive) {
            parts.extend(more.iter().cloned());
        }
        self
    }

    /// How far what the method makes of the surface reaches beyond the points, downwards and
    /// upwards, metres: voxels do.
    fn overhang(&self, method: Method) -> [f32; 2] {
        if method != Method::Voxels {
            return [0.0; 2];
        }
        let heights = self.samples.points.iter().map(|p| p.y);
        let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), y| {
            (low.min(y), high.max(y))
        });
        let cell = |y: f32| (y / self.voxel_edge + self.voxel_shift).floor() - self.voxel_shift;
        [
            low - cell(low) * self.voxel_edge,
            (cell(high) + 1.0) * self.voxel_edge - high,
        ]
    }

    /// How much higher than its true height this body must start on an upright `floor` so that the
    /// method does not see it start inside: 0 but for voxels.
    pub(crate) fn lift_on(&self, floor: &Self, method: Method) -> f32 {
        let lift = self.overhang(method)[0] + floor.overhang(method)[1];
        // Touching is not inside.
        if lift > 0.0 {
            lift + 0.01 * self.voxel_edge
        } else {
            0.0
        }
    }

    /// Radius that stands for the points: the global one, or half a voxel.
    pub(crate) fn mean_radius(&self) -> f32 {
        match self.radius {
            Radius::Global(radius) => radius,
            Radius::Neighbors => 0.5 * self.voxel_edge,
        }
    }

    /// The normals that a pipeline is given with new points.
    pub(crate) fn given_normals(&self) -> Option<&[Vec3]> {
        (self.normals == Normals::Given).then_some(&self.samples.normals)
    }

    /// The cloud.
    pub(crate) fn cloud(&self) -> Result<PointCloud<'static>, CloudError> {
        let builder = PointCloud::builder(self.samples.points.clone());
        let builder = match self.radius {
            Radius::Global(radius) => builder.radius(radius),
            Radius::Neighbors => builder.knn_radii(7, 0.65),
        };
        match self.normals {
            Normals::Given => builder.normals(self.samples.normals.clone()),
            Normals::Absent => builder,
            Normals::Seen(viewpoint) => builder.pca_normals(16).viewpoint(viewpoint),
        }
        .build()
    }

    /// What the method makes of the surface.
    pub(crate) fn parts(&self, method: Method) -> Result<Vec<Part>, Stop> {
        match method {
            Method::Tldi => {
                let cloud = self
                    .cloud()
                    .map_err(|error| Stop::Failed(error.to_string()))?;
                let shape = SharedShape::new(PointCloudShape::new(cloud));
                Ok(vec![(Pose::IDENTITY, shape)])
            }
            Method::Voxels => {
                let shift = Vec3::splat(self.voxel_shift * self.voxel_edge);
                let points: Vec<Vec3> = self.samples.points.iter().map(|p| *p + shift).collect();
                let voxels = SharedShape::voxels_from_points(Vec3::splat(self.voxel_edge), &points);
                Ok(vec![(Pose::from_translation(-shift), voxels)])
            }
            Method::Trimesh => {
                let mesh = self.mesh.as_ref().map_err(|why| Stop::Unfit(why))?;
                let flags = if mesh.one_sided {
                    TriMeshFlags::FIX_INTERNAL_EDGES
                } else {
                    TriMeshFlags::FIX_INTERNAL_EDGES_TWO_SIDED
                };
                let shape = SharedShape::trimesh_with_flags(
                    mesh.vertices.clone(),
                    mesh.triangles.clone(),
                    flags,
                )
                .map_err(|error| Stop::Failed(error.to_string()))?;
                Ok(vec![(Pose::IDENTITY, shape)])
            }
            Method::Primitive => self.primitive.clone().map_err(Stop::Unfit),
        }
    }
}

/// The box that stands for a rectangle of `size` about `middle` in y = 0.
pub(crate) fn slab(middle: Vec2, size: Vec2, spacing: f32, backing: Backing) -> Part {
    let (half_height, y) = match backing {
        Backing::Solid => {
            let half = 0.25 * size.max_element();
            (half, -half)
        }
        Backing::Film => (0.05 * spacing, 0.0),
    };
    (
        Pose::from_translation(Vec3::new(middle.x, y, middle.y)),
        SharedShape::cuboid(0.5 * size.x, half_height, 0.5 * size.y),
    )
}

/// Two triangles over a rectangle in y = 0, facing up.
fn rectangle_mesh(size: Vec2, backing: Backing) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(x * size.x, 0.0, z * size.y);
    Mesh {
        vertices: vec![
            corner(-0.5, -0.5),
            corner(-0.5, 0.5),
            corner(0.5, 0.5),
            corner(0.5, -0.5),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        one_sided: backing == Backing::Solid,
    }
}
