//! The entry points: opens, unpacks, tells the format, and calls its parser.

use crate::error::Result;
use crate::input::{Counted, GZIP_START, Input, is_gzip};
use crate::options::extension;
use crate::{Format, Position, Progress, RawCloud, ReadOptions, SourceError, SourceErrorKind};
use flate2::bufread::MultiGzDecoder;
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;

/// Bytes looked at to tell the format: comments may precede the first entry of a PCD file.
const MAGIC_LENGTH: usize = 1024;

/// Reads the file at `path`, packed with gzip or not.
///
/// The format is the one that its content gives away, else the one its extension stands for.
///
/// # Errors
/// Any [`SourceErrorKind`], with the file and the place in it.
///
/// ```no_run
/// use tldi_sources::{ReadOptions, read};
/// let bunny = read("bunny.ply.gz", &ReadOptions::default())?;
/// assert!(!bunny.points.is_empty());
/// # Ok::<(), tldi_sources::SourceError>(())
/// ```
pub fn read(
    path: impl AsRef<Path>,
    options: &ReadOptions,
) -> std::result::Result<RawCloud, SourceError> {
    read_with_progress(path, options, &mut |_| {})
}

/// Like [`read()`], and calls `progress` for about every 100 KiB, and at the end.
///
/// # Errors
/// As [`read()`].
pub fn read_with_progress(
    path: impl AsRef<Path>,
    options: &ReadOptions,
    progress: &mut dyn FnMut(Progress),
) -> std::result::Result<RawCloud, SourceError> {
    let path = path.as_ref();
    let mut read = || {
        let io_error = |error| SourceError::from(SourceErrorKind::Io(error));
        let file = File::open(path).map_err(io_error)?;
        let metadata = file.metadata().map_err(io_error)?;
        let total_bytes = metadata.is_file().then_some(metadata.len());
        let format = Format::from_extension(path);
        let input = open(file, total_bytes, progress)?;
        dispatch(input, format, Some(path), options)
    };
    read().map_err(|error| error.in_file(path))
}

/// Reads a stream, packed with gzip or not. Its format is the one that its content gives away,
/// else `format`.
///
/// LAS and E57 need random access: of these, a stream may have at most 1 GiB.
///
/// # Errors
/// As [`read()`], without the file.
///
/// ```
/// use tldi_sources::{Format, ReadOptions, read_from};
/// let text = b"x y z\n0 0 0\n1 0 0\n";
/// let cloud = read_from(&text[..], Format::Text, &ReadOptions::default(), &mut |_| {})?;
/// assert_eq!(cloud.points.len(), 2);
/// # Ok::<(), tldi_sources::SourceError>(())
/// ```
pub fn read_from(
    reader: impl Read,
    format: Format,
    options: &ReadOptions,
    progress: &mut dyn FnMut(Progress),
) -> std::result::Result<RawCloud, SourceError> {
    let input = open(reader, None, progress)?;
    dispatch(input, Some(format), None, options)
}

/// The stream of uncompressed bytes of `reader`.
fn open<'a>(
    reader: impl Read + 'a,
    total_bytes: Option<u64>,
    progress: &'a mut dyn FnMut(Progress),
) -> Result<Input<'a>> {
    let counted = Counted::new(reader);
    let counter = counted.counter();
    let mut buffered = BufReader::new(counted);
    // A pipe may give less at first.
    let mut start = Vec::new();
    (buffered.by_ref().take(GZIP_START as u64))
        .read_to_end(&mut start)
        .map_err(|e| SourceErrorKind::Io(e).at(Position::Byte(0)))?;
    let gzip = is_gzip(&start);
    let buffered = Cursor::new(start).chain(buffered);
    let source: Box<dyn Read + 'a> = if gzip {
        Box::new(MultiGzDecoder::new(buffered))
    } else {
        Box::new(buffered)
    };
    Ok(Input::new(source, gzip, counter, total_bytes, progress))
}

/// Calls the parser of the stream's format. Those that need random access open `path` anew, if
/// there is one and it is not packed.
fn dispatch(
    mut input: Input<'_>,
    named: Option<Format>,
    path: Option<&Path>,
    options: &ReadOptions,
) -> Result<RawCloud> {
    let magic = Format::from_magic(input.peek(MAGIC_LENGTH)?);
    let format = magic.or(named).ok_or_else(|| unknown(path))?;
    let mut cloud = match format {
        Format::Ply => crate::ply::parse(&mut input, options)?,
        Format::Pcd => crate::pcd::parse(&mut input, options)?,
        Format::Kitti => crate::sweep::parse(&mut input, options, 4)?,
        Format::NuScenes => crate::sweep::parse(&mut input, options, 5)?,
        Format::Text => crate::text::parse(&mut input, options, &[])?,
        Format::XyzRgb => crate::text::parse(&mut input, options, &["x", "y", "z", "r", "g", "b"])?,
        Format::XyzNormals => {
            crate::text::parse(&mut input, options, &["x", "y", "z", "nx", "ny", "nz"])?
        }
        #[cfg(feature = "las")]
        Format::Las => crate::las::parse(&mut input, path, options)?,
        #[cfg(not(feature = "las"))]
        Format::Las => return disabled(format, "las"),
        #[cfg(feature = "e57")]
        Format::E57 => crate::e57::parse(&mut input, path, options)?,
        #[cfg(not(feature = "e57"))]
        Format::E57 => return disabled(format, "e57"),
    };
    input.points_read = cloud.points.len() as u64;
    input.finish()?;
    cloud.has_unsigned_normals = cloud.has_unsigned_normals || cloud.normals_disagree();
    Ok(cloud)
}

/// Why a file without a format is refused.
fn unknown(path: Option<&Path>) -> SourceErrorKind {
    const MESHES: [&str; 7] = ["stl", "obj", "gltf", "glb", "dae", "off", "fbx"];
    let extension = path.and_then(extension);
    match extension.filter(|extension| MESHES.contains(&extension.as_str())) {
        Some(extension) => SourceErrorKind::Mesh { extension },
        None => SourceErrorKind::UnknownFormat,
    }
}

#[cfg(not(all(feature = "las", feature = "e57")))]
fn disabled(format: Format, feature: &'static str) -> Result<RawCloud> {
    Err(SourceErrorKind::FormatDisabled { format, feature }.into())
}
