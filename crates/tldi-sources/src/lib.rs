//! Point clouds from files, messages and cameras.
//!
//! | format | extensions | read |
//! |---|---|---|
//! | PLY | `ply` | ascii, binary little and big endian; faces |
//! | Gaussian splats | `ply` | as PLY, told by their properties; see below |
//! | PCD | `pcd` | ascii, binary, binary_compressed |
//! | sweeps: KITTI | `bin` | x, y, z, intensity as little-endian `f32`, seen from the origin |
//! | sweeps: nuScenes | `pcd.bin` | x, y, z, intensity, ring likewise |
//! | columns of text | `xyz`, `txt`, `csv`, `asc`, `pts`, `xyzrgb`, `xyzn` | see below |
//! | LAS, LAZ | `las`, `laz` | feature `las` |
//! | E57 | `e57` | feature `e57` |
//!
//! Columns of text: one point a line, columns separated by semicolons (then a comma may be the
//! decimal mark), else commas, else blanks, as the first line of data shows. Lines that start with
//! `#` or `//` are comments. Columns are named by a header line, which may be a comment: `x y z`,
//! and any of `nx ny nz`, `r g b a` (or `red` …), `radius`; others are skipped. A header names every
//! column: a comment with another number of words is ignored, and any other such line is refused. A first line with
//! nothing but the count is passed over, before the header or behind it. Without a header, `xyzrgb`
//! files have the columns x y z r g b, and `xyzn` files x y z nx ny nz, as Open3D writes them. In
//! all others, number and values decide:
//!
//! | columns | meaning |
//! |---|---|
//! | 3 | x y z |
//! | 4 | x y z, one ignored (intensity) |
//! | 6 | x y z nx ny nz if nearly all of the last three have length 1; x y z r g b if they are whole numbers from 0 to 255 |
//! | 7 | x y z, one ignored, r g b (the PTS layout) |
//! | 9 | x y z r g b nx ny nz, or x y z nx ny nz r g b, told alike |
//!
//! All else is refused ([`SourceErrorKind::UnnamedColumns`]): a guess could take colours for normals.
//!
//! PLY files of Gaussian splats have the properties `scale_0` to `scale_2` (logarithms of standard
//! deviations; flat splats lack the last one), `rot_0` to `rot_3` (quaternion, w first), `opacity` (logit) and `f_dc_0` to `f_dc_2`. A
//! splat of at least [`ReadOptions::least_opacity`] becomes a point: its radius is √(σ₁ σ₂) of its two
//! longer axes, its normal the shortest one, of either sign, and its colour ½ + `f_dc` / (2 √π).
//!
//! Files of sweeps have no header: `.bin` means four numbers a point and `.pcd.bin` five, whatever is in them.
//!
//! Besides, [`PointCloud2`] reads messages of ROS, [`depth`] has folders of depth frames, and [`MovingPoints`] deforming meshes as NumPy arrays
//! or folders of clouds.
//!
//! Any file may be packed with gzip (`.gz`), which its content shows. Positions, normals, colours
//! and radii are kept, whatever their order and type in the file; all else is skipped. Units are
//! those of the file: scale, where it is not in metres, before you build a cloud.
//!
//! Files are read as a stream, with [`Progress`], and nothing in them is trusted: a damaged or
//! hostile one gives a [`SourceError`] that says what is wrong and where, and no count in a header
//! makes the reader allocate more than the data that really follows could fill.
//!
//! ```no_run
//! use tldi_sources::{ReadOptions, read};
//! let scan = read("scan.ply.gz", &ReadOptions::default())?;
//! let cloud = scan.into_builder().knn_radii(7, 0.65).build()?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod collector;
pub mod depth;
#[cfg(feature = "e57")]
mod e57;
mod error;
mod header;
mod input;
#[cfg(feature = "las")]
mod las;
mod moving;
mod normal_signs;
mod numbered;
mod options;
mod origin;
mod pcd;
mod ply;
mod point_cloud2;
mod poses;
mod raw_cloud;
mod read;
mod scalar;
#[cfg(any(feature = "las", feature = "e57"))]
mod seekable;
mod slot;
mod splat;
mod sweep;
mod text;

pub use error::{Position, SourceError, SourceErrorKind};
pub use moving::{MovingError, MovingPoints};
pub use numbered::numbered_order;
pub use options::{Format, Progress, ReadOptions};
pub use point_cloud2::{PointCloud2, PointField};
pub use poses::{PoseError, near_origin, parse_pose};
pub use raw_cloud::RawCloud;
pub use read::{read, read_from, read_with_progress};
