//! What to read and how.

use std::fmt;
use std::path::Path;
use tldi::glamx::DVec3;

/// A family of file formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Polygon file format (Stanford): ascii, binary of either byte order.
    Ply,
    /// Point cloud data (PCL): ascii, binary, binary_compressed.
    Pcd,
    /// Sweeps of KITTI's laser scanner: x, y, z, intensity; any `.bin` but those of nuScenes.
    Kitti,
    /// Sweeps of nuScenes' laser scanner, `.pcd.bin`: x, y, z, intensity, ring.
    NuScenes,
    /// One point a line, in columns: XYZ, TXT, CSV, ASC, PTS.
    Text,
    /// Open3D's XYZRGB: as [`Text`](Self::Text); columns that no line names are x, y, z, red, green, blue.
    XyzRgb,
    /// Open3D's XYZN: as [`Text`](Self::Text); columns that no line names are x, y, z and the normal.
    XyzNormals,
    /// ASPRS LAS and LAZ (feature `las`).
    Las,
    /// ASTM E57 (feature `e57`).
    E57,
}

impl Format {
    /// The format that a file's extension stands for; `.gz` at its end is passed over.
    ///
    /// ```
    /// use tldi_sources::Format;
    /// assert_eq!(Format::from_extension("scan.PLY.gz"), Some(Format::Ply));
    /// assert_eq!(Format::from_extension("scan.csv"), Some(Format::Text));
    /// assert_eq!(Format::from_extension("0001.bin"), Some(Format::Kitti));
    /// assert_eq!(Format::from_extension("0001.pcd.bin"), Some(Format::NuScenes));
    /// assert_eq!(Format::from_extension("scan"), None);
    /// ```
    pub fn from_extension(path: impl AsRef<Path>) -> Option<Self> {
        let path = path.as_ref();
        match extension(path)?.as_str() {
            "ply" => Some(Self::Ply),
            "pcd" => Some(Self::Pcd),
            "bin" if unpacked_name(path).ends_with(".pcd.bin") => Some(Self::NuScenes),
            "bin" => Some(Self::Kitti),
            "xyz" | "txt" | "csv" | "asc" | "pts" => Some(Self::Text),
            "xyzrgb" => Some(Self::XyzRgb),
            "xyzn" => Some(Self::XyzNormals),
            "las" | "laz" => Some(Self::Las),
            "e57" => Some(Self::E57),
            _ => None,
        }
    }

    /// The format that the first bytes of an uncompressed file give away. Columns of text and sweeps
    /// have no mark of their own.
    ///
    /// ```
    /// use tldi_sources::Format;
    /// assert_eq!(Format::from_magic(b"ply\nformat ascii 1.0\n"), Some(Format::Ply));
    /// assert_eq!(Format::from_magic(b"1.0 2.0 3.0\n"), None);
    /// ```
    pub fn from_magic(start: &[u8]) -> Option<Self> {
        if start.starts_with(b"ply\n") || start.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        if start.starts_with(b"LASF") {
            return Some(Self::Las);
        }
        if start.starts_with(b"ASTM-E57") {
            return Some(Self::E57);
        }
        let first_entry = start
            .split(|b| *b == b'\n')
            .map(<[u8]>::trim_ascii)
            .find(|line| !line.is_empty() && !line.starts_with(b"#"))?;
        let is_pcd = [&b"VERSION "[..], b"FIELDS ", b"COLUMNS "]
            .iter()
            .any(|key| first_entry.starts_with(key));
        is_pcd.then_some(Self::Pcd)
    }
}

/// The name of a file in lower case, without `.gz` at its end.
fn unpacked_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    let name = name.to_string_lossy().to_ascii_lowercase();
    name.strip_suffix(".gz").unwrap_or(&name).to_owned()
}

/// The extension of a file in lower case, of what is packed if it ends in `.gz`.
pub(crate) fn extension(path: &Path) -> Option<String> {
    let name = unpacked_name(path);
    let extension = Path::new(&name).extension()?;
    Some(extension.to_str()?.to_owned())
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "PLY",
            Self::Pcd => "PCD",
            Self::Kitti => "KITTI",
            Self::NuScenes => "nuScenes",
            Self::Text => "XYZ/CSV",
            Self::XyzRgb => "XYZRGB",
            Self::XyzNormals => "XYZN",
            Self::Las => "LAS/LAZ",
            Self::E57 => "E57",
        })
    }
}

/// Most points that a cloud can have.
pub(crate) const MOST_POINTS: u64 = u32::MAX as u64 / 64;

/// How to read.
///
/// ```
/// use tldi_sources::ReadOptions;
/// let options = ReadOptions { max_points: 5_000_000, ..Default::default() };
/// assert_eq!(options.origin, None);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// More points than this are an error, found before memory is taken for them. As many as a cloud can have:
    /// 67,108,863. Raise it only if you thin what is read before you build a cloud.
    pub max_points: u64,
    /// What is subtracted from every coordinate before it is narrowed to `f32`, in units of the
    /// file. `None`: chosen per file as [`RawCloud::origin`](crate::RawCloud::origin) tells. Give
    /// the same for several files whose clouds belong together.
    pub origin: Option<DVec3>,
    /// Opacity, of 0 to 1, from which on a Gaussian splat is a point: 0.5, where it hides more than it lets
    /// through. What is fainter is no surface; [`RawCloud::left_out`](crate::RawCloud::left_out)
    /// counts it.
    pub least_opacity: f32,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            max_points: MOST_POINTS,
            origin: None,
            least_opacity: 0.5,
        }
    }
}

/// How far reading has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Bytes read from the source, before decompression. Of LAS and E57 files, which are not read
    /// in order, the part of all that corresponds to the points read.
    pub bytes_read: u64,
    /// Bytes in the source, before decompression, where known.
    pub total_bytes: Option<u64>,
    /// Points read.
    pub points_read: u64,
}
