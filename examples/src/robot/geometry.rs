//! The surfaces of a URDF's geometries as triangles.

use crate::mesh::{Mesh, read_mesh};
use rapier3d::geometry::{Ball, Capsule, Cuboid, Cylinder};
use rapier3d_urdf::urdf_rs::Geometry;
use std::f32::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use tldi::glamx::{Pose3, Quat, Vec3};

/// Segments of a full turn around a cylinder, a sphere or a capsule.
const SEGMENTS: u32 = 48;

/// The surface of a geometry in its own frame; what is wrong with it, for people, if it has none.
pub(super) fn mesh_of(geometry: &Geometry, folder: &Path) -> Result<Mesh, String> {
    let positive = |what: &str, sizes: &[f64]| {
        if sizes.iter().all(|size| size.is_finite() && *size > 0.0) {
            Ok(())
        } else {
            Err(format!("its {what} has a size that is not above 0"))
        }
    };
    // The axes of rapier's round shapes are y, those of URDF z.
    let upright = Pose3::from_rotation(Quat::from_rotation_x(FRAC_PI_2));
    let (shape, pose) = match geometry {
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
            let path = find_mesh(filename, folder)?;
            let mesh = read_mesh(&path).map_err(|error| format!("its {error}"))?;
            return Ok(mesh.scaled(scale));
        }
    };
    let mut mesh = Mesh::default();
    let (points, faces) = shape;
    mesh.append(&Mesh { points, faces }, &pose);
    Ok(mesh)
}

/// The file that a mesh's name stands for.
fn find_mesh(name: &str, folder: &Path) -> Result<PathBuf, String> {
    let candidates: Vec<PathBuf> = if let Some(rest) = name.strip_prefix("package://") {
        // The package's folder has its name, or the URDF lies in it.
        let inside = rest.split_once('/').map_or(rest, |(_, inside)| inside);
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let above: Vec<PathBuf> = folder.ancestors().map(Path::to_owned).collect();
        (above.iter())
            .flat_map(|folder| [folder.join(rest), folder.join(inside)])
            .collect()
    } else {
        let path = name.strip_prefix("file://").unwrap_or(name);
        vec![folder.join(path)]
    };
    let found = candidates.into_iter().find(|path| path.is_file());
    found.ok_or_else(|| format!("its mesh {name} was not found near {}", folder.display()))
}
