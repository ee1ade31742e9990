//! The methods that are compared.

use std::fmt;

/// Who detects the collisions.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Method {
    /// Clouds through [`TldiPipeline`](rapier3d_tldi::TldiPipeline).
    Tldi,
    /// Rapier's `Voxels` made of the same points, edges of 2 mean radii.
    Voxels,
    /// Rapier's `TriMesh` of the same geometry.
    Trimesh,
    /// Rapier's own shapes: the truth, where there is one.
    Primitive,
}

impl Method {
    /// All methods, in the order of tables.
    pub(crate) const ALL: [Self; 4] = [Self::Tldi, Self::Voxels, Self::Trimesh, Self::Primitive];

    /// Name in rows and on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Tldi => "tldi",
            Self::Voxels => "voxels",
            Self::Trimesh => "trimesh",
            Self::Primitive => "primitive",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
