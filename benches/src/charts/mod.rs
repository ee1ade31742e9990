//! Charts from stored results alone: nothing is measured here.

mod canvas;
mod contact_quality;
mod figure;
mod frames;
mod front;
pub(crate) mod gpu_day;
mod gpu_layers;
mod looks;
mod paint;
mod speed_accuracy;
mod sweeps;
mod ticks;
mod work;

use crate::stored::{
    self, AccuracyRow, ContactRow, FrameRow, Measured, Provenance, Stored, StoredError,
};
use figure::Figure;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why charts could not be drawn.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ChartError {
    /// The results cannot be used.
    #[error(transparent)]
    Stored(#[from] StoredError),
    /// There are none.
    #[error("{}: no results of benches (*.json); measure with --json first", .0.display())]
    NoResults(PathBuf),
    /// A picture cannot be written.
    #[error("{}: cannot be drawn: {reason}", path.display())]
    Picture {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// Folders of the charts below that of all results. Each holds the rows that its charts are drawn from, too:
/// wrong answers against time, against one setting, contacts, frames of new points.
const ROOMS: [&str; 4] = ["accuracy", "sweeps", "contacts", "frames"];

/// Results of all files of a folder.
#[derive(Default)]
struct Results {
    accuracy: Vec<Stored<AccuracyRow>>,
    contacts: Vec<Stored<ContactRow>>,
    frames: Vec<Stored<FrameRow>>,
}

impl Results {
    /// The rows in the charts' folders below `folder` or, if there are none, in `folder` itself.
    fn read(folder: &Path) -> Result<Self, ChartError> {
        let mut files = Vec::new();
        for room in ROOMS.map(|room| folder.join(room)) {
            if room.is_dir() {
                files.extend(json_files(&room)?);
            }
        }
        if files.is_empty() {
            files = json_files(folder)?;
        }
        if files.is_empty() {
            return Err(ChartError::NoResults(folder.to_owned()));
        }
        // The same charts whatever the order in the folder.
        files.sort();
        let mut all = Self::default();
        for path in files {
            let kind = stored::kind(&path)?;
            if kind == AccuracyRow::KIND {
                all.accuracy.push(stored::read(&path)?);
            } else if kind == ContactRow::KIND {
                all.contacts.push(stored::read(&path)?);
            } else if kind == FrameRow::KIND {
                all.frames.push(stored::read(&path)?);
            } else if kind != crate::gpu_day::KIND {
                // Charts of that kind were drawn by its run.
                return Err(StoredError::Kind { path, kind }.into());
            }
        }
        Ok(all)
    }
}

/// The results in a folder, not below it.
fn json_files(folder: &Path) -> Result<Vec<PathBuf>, ChartError> {
    let unreadable = |source| StoredError::File {
        path: folder.to_owned(),
        source,
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path
            .extension()
            .is_some_and(|extension| extension == "json")
        {
            files.push(path);
        }
    }
    Ok(files)
}

/// What became of the charts.
#[derive(Debug, Default)]
pub struct Drawn {
    /// SVG and PNG of each.
    pub files: Vec<PathBuf>,
    /// Of those that stored rows do not tell enough for: what is missing.
    pub skipped: Vec<String>,
}

/// Draws all charts for which `results` holds rows, as SVG and PNG, each into its own folder below `out`.
pub fn draw_all(results: &Path, out: &Path) -> Result<Drawn, ChartError> {
    let all = Results::read(results)?;
    let mut drawn = Drawn::default();
    let mut frames = frames::figures(&all.frames);
    match work::figures(&all.frames) {
        Ok(work) => frames.extend(work),
        Err(missing) => drawn.skipped.push(missing),
    }
    let figures = [
        speed_accuracy::figures(&all.accuracy),
        sweeps::figures(&all.accuracy),
        contact_quality::figures(&all.contacts),
        frames,
    ];
    for (room, figures) in ROOMS.iter().zip(figures) {
        if figures.is_empty() {
            continue;
        }
        let folder = out.join(room);
        std::fs::create_dir_all(&folder).map_err(|source| StoredError::File {
            path: folder.clone(),
            source,
        })?;
        for figure in figures {
            drawn.files.extend(paint::save(&figure, &folder)?);
        }
    }
    Ok(drawn)
}

/// `figure` with a number where others have its name: of two runs of one model.
fn numbered(others: &[Figure], figure: Figure) -> Figure {
    let is_alike = |other: &&Figure| other.name.starts_with(&figure.name);
    let name = match others.iter().filter(is_alike).count() {
        0 => figure.name.clone(),
        count => format!("{}_{}", figure.name, count + 1),
    };
    Figure { name, ..figure }
}

/// Where the numbers of a chart come from, in a line.
fn origin<'a>(runs: impl IntoIterator<Item = &'a Provenance>) -> String {
    let mut lines: Vec<String> = runs
        .into_iter()
        .map(|run| {
            let device = match &run.adapter {
                Some(adapter) => format!(", {adapter}"),
                None => String::new(),
            };
            format!(
                "{}, commit {}, {} cores of {}{device} ({})",
                run.date,
                run.commit,
                run.cores,
                run.cpu,
                run.features.join(", ")
            )
        })
        .collect();
    lines.sort();
    lines.dedup();
    lines.join("; ")
}

#[cfg(test)]
mod tests;
