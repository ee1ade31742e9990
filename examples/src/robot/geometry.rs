//! The surfaces of a URDF's geometries as triangles.

use super::packages::MeshFolders;
use crate::mesh::{Mesh, read_mesh};
use rapier3d::geometry::{Ball, Capsule, Cuboid, Cylinder};
use rapier3d_urdf::urdf_rs::Geometry;
use std::f32::consts::FRAC_PI_2;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Segments of a full turn around a cylinder, a sphere or a capsule.
const SEGMENTS: u32 = 48;

/// Why a geometry has no surface.
pub(super) enum Problem {
    /// The mesh of this name was not found.
    Missing(String),
    /// Something else, for people.
    Unusable(String),
}

/// The surface of a geometry in its own frame.
pub(super) fn mesh_of(geometry: &Geometry, folders: &MeshFolders) -> Result<Mesh, Problem> {
    let positive = |what: &str, sizes: &[f64]| {
        if sizes.iter().all(|size| size.is_finite() && *size > 0.0) {
            Ok(())
        } else {
            let reason = format!("its {what} has a size that is not above 0");
            Err(Problem::Unusable(reason))
        }
    };
    // The axes of rapier's round shapes are y, those of URDF z.
    let upright = Pose3::from_rotation(Quat::from_rotation_x(FRAC_PI_2));
    let (shape, pose) = match geometry {
        // What an empty geometry was completed to.
        Geometry::Box { size } if size.0 == [0.0; 3] => return Ok(Mesh::default()),
        Geometry::Box { size } => {
            positive("box", &size.0)?;
            let half = 0.5 * Vec3::from(size.0.map(|c| c as f32));
            (Cuboid::new(half).to_trimesh(), Pose3::IDENTITY)
        }
        Geometry::Cylinder { radius, length } => {
            positive("cylinder", &[*radius, *length])?;
            let cylinder = Cylinder::new(0.5 * *length as f32, *radius as f32);
            (cylinder.to_trimesh(SEGMENTS), upright)
        }
        Geometry::Capsule { radius, length } => {
            positive("capsule", &[*radius, *length])?;
            let capsule = Capsule::new_y(0.5 * *length as f32, *radius as f32);
            (capsule.to_trimesh(SEGMENTS, SEGMENTS / 4), upright)
        }
        Geometry::Sphere { radius } => {
            positive("sphere", &[*radius])?;
            let ball = Ball::new(*radius as f32);
            (ball.to_trimesh(SEGMENTS, SEGMENTS / 2), upright)
        }
        Geometry::Mesh { filename, scale } => {
            let scale = scale.map_or(Vec3::ONE, |s| Vec3::from(s.0.map(|c| c as f32)));
            let path = folders.find(filename);
            let path = path.ok_or_else(|| Problem::Missing(filename.clone()))?;
            let mesh = read_mesh(&path);
            let mesh = mesh.map_err(|error| Problem::Unusable(format!("its {error}")))?;
            return Ok(mesh.scaled(scale));
        }
    };
    let mut mesh = Mesh::default();
    let (points, faces) = shape;
    mesh.append(&Mesh { points, faces }, &pose);
    Ok(mesh)
}
