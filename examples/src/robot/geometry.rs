//! The surfaces of a URDF's geometries as triangles.

use rapier3d::geometry::{Ball, Capsule, Cuboid, Cylinder};
use rapier3d_meshloader::mesh_loader;
use rapier3d_urdf::urdf_rs::Geometry;
use std::f32::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use tldi::glamx::{Pose3, Quat, Vec3};

/// Segments of a full turn around a cylinder, a sphere or a capsule.
const SEGMENTS: u32 = 48;

/// Triangles in metres; corners anticlockwise when seen from outside.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Corners.
    pub points: Vec<Vec3>,
    /// Indices of corners, all in range.
    pub faces: Vec<[u32; 3]>,
}

impl Mesh {
    /// Adds another mesh, moved by `pose`.
    pub fn append(&mut self, other: &Self, pose: &Pose3) {
        let first = self.points.len() as u32;
        self.points.extend(other.points.iter().map(|p| *pose * *p));
        let shifted = other.faces.iter().map(|face| face.map(|i| first + i));
        self.faces.extend(shifted);
    }

    /// Bounds of the finite corners.
    pub fn bounds(&self) -> tldi::Aabb {
        let corners = self.points.iter().copied().filter(|p| p.is_finite());
        corners.fold(tldi::Aabb::EMPTY, tldi::Aabb::including)
    }
}

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
            return read_mesh(&path, scale);
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

fn read_mesh(path: &Path, scale: Vec3) -> Result<Mesh, String> {
    let bad = |reason: String| format!("its mesh {} cannot be read: {reason}", path.display());
    if tldi_sources::Format::from_extension(path) == Some(tldi_sources::Format::Ply) {
        let raw = tldi_sources::read(path, &tldi_sources::ReadOptions::default())
            .map_err(|error| bad(error.kind.to_string()))?;
        if raw.faces.is_empty() {
            return Err(bad("it has no faces".to_owned()));
        }
        return Ok(Mesh {
            points: raw.points.iter().map(|p| *p * scale).collect(),
            faces: raw.faces,
        });
    }
    let scene = mesh_loader::Loader::default()
        .load(path)
        .map_err(|error| bad(error.to_string()))?;
    let mut mesh = Mesh::default();
    for part in scene.meshes {
        let points: Vec<Vec3> = part
            .vertices
            .iter()
            .map(|p| Vec3::from(*p) * scale)
            .collect();
        let in_range = |face: &[u32; 3]| face.iter().all(|i| (*i as usize) < points.len());
        let faces = part.faces.iter().copied().filter(in_range).collect();
        mesh.append(&Mesh { points, faces }, &Pose3::IDENTITY);
    }
    if mesh.faces.is_empty() {
        return Err(bad("it has no faces".to_owned()));
    }
    Ok(mesh)
}
