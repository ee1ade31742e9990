//! Files, folders and progress on a terminal.

use anyhow::Context;
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use serde::Serialize;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use tldi::glamx::DVec3;
use tldi_pictures::{Picture, animation};

/// Goes through `things`, a progress bar on a terminal meanwhile; `plural` is what they are called.
pub fn with_progress<T>(things: impl Iterator<Item = T>, plural: &str) -> impl Iterator<Item = T> {
    let bar = ProgressBar::new(things.size_hint().0 as u64).with_finish(ProgressFinish::AndClear);
    let template = format!("{{bar:40}} {{pos}}/{{len}} {plural}, {{eta}} left");
    // Only a broken template fails; the bar then keeps its own.
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar.wrap_iter(things)
}

fn make_folder(path: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(path)
        .with_context(|| format!("cannot make the folder {}", path.display()))
}

fn write_file(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Writes pictures to a folder, which is made.
///
/// # Errors
/// Those of drawing, and of the file system, with the path.
pub fn write_pictures<'a>(
    folder: &Path,
    pictures: impl IntoIterator<Item = (&'a str, anyhow::Result<Picture>)>,
) -> anyhow::Result<()> {
    make_folder(folder)?;
    for (name, picture) in pictures {
        write_file(&folder.join(name), &picture?.to_png()?)?;
    }
    Ok(())
}

/// Pictures of an animation, about: all of them are held in memory until it is written. Half: long runs jerk; twice: no more
/// is seen, in twice the memory.
const MOST_PICTURES: usize = 150;

/// Steps from one picture of an animation to the next, where it has so many in all: `least`, or more if they would be too
/// many pictures.
pub fn picture_interval(steps: usize, least: usize) -> usize {
    least.max(steps.div_ceil(MOST_PICTURES))
}

/// Draws pictures one after the other, and writes them to `motion.png` of a folder, each shown for so many seconds; the
/// last one stays for `held` pictures more.
///
/// # Errors
/// Those of drawing, and of the file system, with the path.
pub fn write_animation(
    folder: &Path,
    seconds: f32,
    held: usize,
    pictures: impl Iterator<Item = anyhow::Result<Picture>>,
) -> anyhow::Result<()> {
    let mut pictures: Vec<Picture> =
        with_progress(pictures, "pictures").collect::<Result<_, _>>()?;
    let last = pictures.last().cloned();
    pictures.extend(std::iter::repeat_n(last, held).flatten());
    let bytes = animation::to_apng(&pictures, seconds)?;
    write_file(&folder.join("motion.png"), &bytes)
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

/// Results of a run; its fields are those of the JSON.
pub trait Report: Serialize {
    /// Writes the results as a table for people.
    ///
    /// # Errors
    /// Those of writing.
    fn write_table(&self, out: &mut dyn Write) -> io::Result<()>;
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
pub fn publish(report: &impl Report, origin: DVec3, json: Option<&Path>) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    let origin = Some(origin.to_array()).filter(|origin| *origin != [0.0; 3]);
    let told = report.write_table(&mut out).and_then(|()| {
        if let Some([x, y, z]) = origin {
            writeln!(
                out,
                "places are relative to {x} {y} {z} in the file, in metres"
            )?;
        }
        out.flush()
    });
    if let Some(path) = json {
        let report = WithOrigin { report, origin };
        write_file(path, &serde_json::to_vec_pretty(&report)?)?;
    }
    told.context("cannot write the table")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_runs_have_no_more_pictures() {
        assert_eq!(picture_interval(195, 3), 3);
        assert_eq!(picture_interval(30_000, 3), 30_000 / MOST_PICTURES);
    }
}
