//! Where the meshes of a URDF lie.

use std::path::{Path, PathBuf};

/// Folders in which meshes are looked for.
#[derive(Clone, Debug)]
pub struct MeshFolders {
    /// That of the URDF.
    urdf: PathBuf,
    /// Folders with packages: given ones.
    given: Vec<PathBuf>,
    /// Those that ROS knows.
    of_ros: Vec<PathBuf>,
}

impl MeshFolders {
    /// Meshes lie beside the URDF. Those of `package://NAME/…` lie in a folder `NAME` of one of the `given` folders, of the
    /// URDF's folder and those above it, of `ROS_PACKAGE_PATH`, or of `share` in one of `AMENT_PREFIX_PATH`; a folder
    /// may also be the package itself.
    pub fn new(urdf: &Path, given: &[PathBuf]) -> Self {
        let listed = |variable: &str| -> Vec<PathBuf> {
            let paths = std::env::var_os(variable).unwrap_or_default();
            let paths = std::env::split_paths(&paths);
            paths.filter(|path| !path.as_os_str().is_empty()).collect()
        };
        let mut of_ros = listed("ROS_PACKAGE_PATH");
        let prefixes = listed("AMENT_PREFIX_PATH");
        of_ros.extend(prefixes.iter().map(|prefix| prefix.join("share")));
        let here = if urdf.as_os_str().is_empty() {
            Path::new(".")
        } else {
            urdf
        };
        Self {
            urdf: here.canonicalize().unwrap_or_else(|_| here.to_owned()),
            given: given.to_vec(),
            of_ros,
        }
    }

    /// The file that a mesh's name stands for.
    pub(super) fn find(&self, name: &str) -> Option<PathBuf> {
        let Some(rest) = name.strip_prefix("package://") else {
            let path = name.strip_prefix("file://").unwrap_or(name);
            return Some(self.urdf.join(path)).filter(|path| path.is_file());
        };
        let (package, inside) = rest.split_once('/').unwrap_or((rest, ""));
        let in_packages = |folder: &PathBuf| {
            let itself = Some(folder.join(inside)).filter(|_| folder.ends_with(package));
            std::iter::once(folder.join(rest)).chain(itself)
        };
        // The URDF may lie in a package whose folder has another name.
        let above = (self.urdf.ancestors()).flat_map(|f| [f.join(rest), f.join(inside)]);
        (self.given.iter().flat_map(in_packages))
            .chain(above)
            .chain(self.of_ros.iter().flat_map(in_packages))
            .find(|path| path.is_file())
    }

    /// What to tell about meshes that were not found, if there are any.
    pub(super) fn missing(&self, names: &[String]) -> Option<String> {
        /// Names that are listed: a robot of 30 links has as many meshes, in one folder.
        const MOST: usize = 3;
        if names.is_empty() {
            return None;
        }
        let listed = names[..names.len().min(MOST)].join(", ");
        let more = if names.len() > MOST { ", …" } else { "" };
        Some(format!(
            "meshes that were not found ({}): {listed}{more}; the URDF is in {}: put them there or, for \
             package://NAME/…, give the folder that holds NAME with --packages DIR",
            names.len(),
            self.urdf.display()
        ))
    }
}
