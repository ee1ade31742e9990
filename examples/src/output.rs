//! Files, folders and progress on a terminal.

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fs::OpenOptions;
use std::io::{self, IsTerminal, StdoutLock, Write};
use std::path::Path;
use tldi::glamx::DVec3;
use tldi_pictures::{Picture, animation};

/// A progress bar over `length` of `things` (a plural) on a terminal; hidden elsewhere.
pub fn progress_bar(length: usize, things: &str) -> ProgressBar {
    let bar = if io::stderr().is_terminal() {
        ProgressBar::new(length as u64)
    } else {
        ProgressBar::hidden()
    };
    let template = format!("{{bar:40}} {{pos}}/{{len}} {things}, {{eta}} left");
    // Only a broken template fails; the bar then keeps its own.
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}

/// Makes a folder and those above it.
///
/// # Errors
/// Those of the file system, with the path.
pub fn make_folder(path: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(path)
        .with_context(|| format!("cannot make the folder {}", path.display()))
}

/// Writes a file.
///
/// # Errors
/// Those of the file system, with the path.
pub fn write_file(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Draws pictures one after the other, and writes them to `motion.png` of a folder, each shown for so many seconds.
///
/// # Errors
/// Those of drawing, and of the file system, with the path.
pub fn write_animation(
    folder: &Path,
    seconds: f32,
    pictures: impl Iterator<Item = anyhow::Result<Picture>>,
) -> anyhow::Result<()> {
    let bar = progress_bar(pictures.size_hint().0, "pictures");
    let pictures: Vec<Picture> = pictures.inspect(|_| bar.inc(1)).collect::<Result<_, _>>()?;
    bar.finish_and_clear();
    write_file(
        &folder.join("motion.png"),
        &animation::to_apng(&pictures, seconds)?,
    )
}

/// Makes sure that a file can be written later: makes its folder, and opens the file for writing. Its content stays, and
/// a file that was not there is not there afterwards either.
///
/// # Errors
/// Those of the file system, with the path.
pub fn check_writable(path: &Path) -> anyhow::Result<()> {
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    let is_new = !path.exists();
    (OpenOptions::new().create(true).append(true).open(path))
        .with_context(|| format!("cannot write {}", path.display()))?;
    if is_new {
        // An empty file that stays does no harm.
        std::fs::remove_file(path).ok();
    }
    Ok(())
}

/// Results whose places are relative to an origin: that of the file.
#[derive(Serialize)]
struct WithOrigin<'a, R> {
    #[serde(flatten)]
    report: &'a R,
    /// Left out where it is zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    origin: Option<[f64; 3]>,
}

/// Writes the results of a run, whose places are relative to `origin`: the table for people to the standard output, then
/// JSON. If one cannot be written, the other still is.
///
/// # Errors
/// Those of writing, with the path.
pub fn publish(
    report: &impl Serialize,
    origin: DVec3,
    write_table: impl FnOnce(&mut StdoutLock<'_>) -> io::Result<()>,
    json: Option<&Path>,
) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    let origin = Some(origin.to_array()).filter(|origin| *origin != [0.0; 3]);
    let write_origin = |out: &mut StdoutLock<'_>| match origin {
        Some([x, y, z]) => writeln!(out, "places are relative to {x} {y} {z} in the file"),
        None => Ok(()),
    };
    let told = write_table(&mut out)
        .and_then(|()| write_origin(&mut out))
        .and_then(|()| out.flush());
    if let Some(path) = json {
        let report = WithOrigin { report, origin };
        write_file(path, &serde_json::to_vec_pretty(&report)?)?;
    }
    told.context("cannot write the table")
}
