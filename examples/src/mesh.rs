//! Triangle meshes, and their files.

use crate::collada;
use rapier3d_meshloader::mesh_loader;
use std::panic;
use std::path::{Path, PathBuf};
use thiserror::Error;
use tldi::glamx::{DAffine3, DVec3, Pose3, Vec3};
use tldi_sources::{Format, ReadOptions};

/// Triangles; corners anticlockwise when seen from outside.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Corners.
    pub points: Vec<Vec3>,
    /// Indices of corners, all in range.
    pub faces: Vec<[u32; 3]>,
}

/// A file of which no mesh can be made.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("mesh {path} cannot be read: {reason}")]
pub struct MeshError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub reason: String,
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

    /// The same, larger along each axis.
    pub fn scaled(self, scale: Vec3) -> Self {
        self.transformed(DAffine3::from_scale(scale.as_dvec3()))
    }

    /// The same in another frame. A mirrored mesh winds the other way, so that its outside stays outside.
    pub(crate) fn transformed(mut self, frame: DAffine3) -> Self {
        for point in &mut self.points {
            *point = frame.transform_point3(point.as_dvec3()).as_vec3();
        }
        if frame.matrix3.determinant() < 0.0 {
            for face in &mut self.faces {
                face.swap(1, 2);
            }
        }
        self
    }

    /// The first corner of each face, in ascending order along x.
    #[cfg(test)]
    pub(crate) fn first_corners(&self) -> Vec<Vec3> {
        let corners = self.faces.iter().map(|face| self.points[face[0] as usize]);
        let mut corners: Vec<Vec3> = corners.collect();
        corners.sort_by(|a, b| a.x.total_cmp(&b.x));
        corners
    }
}

/// Whether a file holds a mesh and nothing else, by its name. A PLY file may be a mesh or a cloud.
pub fn is_mesh_file(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    ["stl", "obj", "dae"]
        .iter()
        .any(|known| extension.eq_ignore_ascii_case(known))
}

/// Reads STL, OBJ, DAE or PLY (also `.gz`), in the unit and from the zero of the file.
///
/// # Errors
/// [`MeshError`], also where there are no faces.
pub fn read_mesh(path: &Path) -> Result<Mesh, MeshError> {
    let bad = |reason: String| MeshError {
        path: path.to_owned(),
        reason,
    };
    let mesh = if Format::from_extension(path) == Some(Format::Ply) {
        let options = ReadOptions {
            origin: Some(DVec3::ZERO),
            ..ReadOptions::default()
        };
        let raw =
            tldi_sources::read(path, &options).map_err(|error| bad(error.kind.to_string()))?;
        Mesh {
            points: raw.points,
            faces: raw.faces,
        }
    } else {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        // The loader tells files apart by an extension of small letters.
        let named = path.with_extension(&extension);
        let bytes = || std::fs::read(path).map_err(|error| error.to_string());
        let mesh = match extension.to_str() {
            Some("dae") => bytes().and_then(|b| collada::placed(&b, |b| load(b, &named))),
            Some("stl" | "obj") => {
                let parts = bytes().and_then(|bytes| load(&with_named_solid(bytes), &named));
                parts.map(|parts| {
                    let mut mesh = Mesh::default();
                    for (_, part) in parts {
                        mesh.append(&part, &Pose3::IDENTITY);
                    }
                    mesh
                })
            }
            _ => Err("only STL, OBJ, DAE and PLY are read: save it as one of these".to_owned()),
        };
        mesh.map_err(bad)?
    };
    if mesh.faces.is_empty() {
        return Err(bad("it has no faces".to_owned()));
    }
    Ok(mesh)
}

/// The parts of a file with their names.
fn load(bytes: &[u8], path: &Path) -> Result<Vec<(String, Mesh)>, String> {
    // Damaged files, and parts of COLLADA that it does not know, make the loader panic.
    let loaded =
        panic::catch_unwind(|| mesh_loader::Loader::default().load_from_slice(bytes, path));
    let scene = match loaded {
        Ok(Ok(scene)) => scene,
        Ok(Err(error)) => return Err(error.to_string()),
        Err(_) => {
            return Err(
                "it is damaged, or has parts that are not known: save it as STL, OBJ or PLY"
                    .to_owned(),
            );
        }
    };
    let parts = scene.meshes.into_iter().map(|part| {
        let points: Vec<Vec3> = part.vertices.iter().map(|p| Vec3::from(*p)).collect();
        let in_range = |face: &[u32; 3]| face.iter().all(|i| (*i as usize) < points.len());
        let faces = part.faces.iter().copied().filter(in_range).collect();
        (part.name, Mesh { points, faces })
    });
    Ok(parts.collect())
}

/// STL as text whose first line is a bare `solid` gets a name for its solid: the loader wants one.
fn with_named_solid(mut bytes: Vec<u8>) -> Vec<u8> {
    const SOLID: &[u8] = b"solid";
    let text = bytes.trim_ascii_start();
    let start = bytes.len() - text.len();
    let is_bare = text.strip_prefix(SOLID).is_some_and(|rest| {
        rest.first()
            .is_some_and(|byte| matches!(byte, b'\n' | b'\r'))
            && rest.trim_ascii_start().starts_with(b"facet")
    });
    if is_bare {
        let end = start + SOLID.len();
        bytes.splice(end..end, *b" unnamed");
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn read_text(name: &str, text: &[u8]) -> Result<Mesh, MeshError> {
        let path = std::env::temp_dir().join(format!("tldi_mesh_{}_{name}", std::process::id()));
        fs::write(&path, text).unwrap();
        let mesh = read_mesh(&path);
        fs::remove_file(&path).unwrap();
        mesh
    }

    #[test]
    fn only_known_kinds_of_meshes_are_read() {
        let text = format!("solid a\n{FACET}endsolid\n");
        assert_eq!(read_text("a.Stl", text.as_bytes()).unwrap().faces.len(), 1);
        let triangle = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        assert_eq!(read_text("a.Obj", triangle).unwrap().faces.len(), 1);
        let error = read_text("a.glb", b"glTF\x02\0\0\0").unwrap_err();
        assert!(error.reason.contains("save it as one of these"), "{error}");
    }

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";

    #[test]
    fn a_solid_needs_no_name() {
        for (k, line) in ["solid\n", "\n solid\r\n", "solid a\n"].iter().enumerate() {
            let text = format!("{line}{FACET}endsolid\n");
            let mesh = read_text(&format!("{k}.stl"), text.as_bytes()).unwrap();
            assert_eq!(mesh.points, [Vec3::ZERO, Vec3::X, Vec3::Y], "{line}");
        }
    }

    /// A mirrored triangle faces where its mirror image does.
    #[test]
    fn a_mirrored_mesh_keeps_its_outside() {
        let mesh = read_text(
            "mirror.stl",
            format!("solid a\n{FACET}endsolid\n").as_bytes(),
        )
        .unwrap();
        for (scale, up) in [
            (Vec3::new(1.0, -1.0, 1.0), 1.0),
            (Vec3::new(-1.0, -1.0, 2.0), 1.0),
            (Vec3::new(1.0, 1.0, -1.0), -1.0),
        ] {
            let scaled = mesh.clone().scaled(scale);
            let [a, b, c] = scaled.faces[0].map(|i| scaled.points[i as usize]);
            assert_eq!((b - a).cross(c - a).z.signum(), up, "{scale}");
        }
    }

    /// In centimetres, the same triangle twice, each moved: through the loader.
    #[test]
    fn nodes_of_collada_place_its_geometries() {
        let nodes = [200, -300].map(|x| {
            format!("<node><matrix>1 0 0 {x} 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url=\"#g\"/></node>")
        });
        let dae = collada(&nodes.concat(), "0 1 2")
            .replace("<up_axis>", "<unit meter=\"0.01\"/><up_axis>");
        let mesh = read_text("placed.dae", dae.as_bytes()).unwrap();
        assert_eq!(mesh.first_corners(), [-3.0 * Vec3::X, 2.0 * Vec3::X]);
        assert!((mesh.points[1].distance(mesh.points[0]) - 0.01).abs() < 1e-6);
    }

    /// A triangle with these corners as the geometry `g`, and a scene.
    fn collada(nodes: &str, corners: &str) -> String {
        format!(
            r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
<accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
        )
    }

    /// COLLADA with an index that no position has: the loader panics at it.
    #[test]
    fn a_panic_of_the_loader_is_an_error() {
        let dae = collada("", "0 1 9");
        let error = read_text("broken.dae", dae.as_bytes()).unwrap_err();
        assert!(
            error.to_string().contains("broken.dae cannot be read"),
            "{error}"
        );
        assert!(error.reason.contains("damaged"), "{error}");
    }
}
