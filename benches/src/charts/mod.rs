//! Charts from stored results alone: nothing is measured here.

mod canvas;
mod contact_quality;
mod figure;
mod frames;
mod front;
mod looks;
mod paint;
mod speed_accuracy;
mod sweeps;
mod ticks;

use crate::stored::{
    self, AccuracyRow, ContactRow, FrameRow, Measured, Provenance, Stored, StoredError,
};
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

/// Results of all files of a folder.
#[derive(Default)]
struct Results {
    accuracy: Vec<Stored<AccuracyRow>>,
    contacts: Vec<Stored<ContactRow>>,
    frames: Vec<Stored<FrameRow>>,
}

impl Results {
    fn read(folder: &Path) -> Result<Self, ChartError> {
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
            } else {
                return Err(StoredError::Kind { path, kind }.into());
            }
        }
        Ok(all)
    }
}

/// Draws all charts for which the folder `results` holds rows into `out`, as SVG and PNG; returns the
/// files.
pub fn draw_all(results: &Path, out: &Path) -> Result<Vec<PathBuf>, ChartError> {
    let all = Results::read(results)?;
    std::fs::create_dir_all(out).map_err(|source| StoredError::File {
        path: out.to_owned(),
        source,
    })?;
    let mut figures = speed_accuracy::figures(&all.accuracy);
    figures.extend(sweeps::figures(&all.accuracy));
    figures.extend(contact_quality::figures(&all.contacts));
    figures.extend(frames::figures(&all.frames));
    let mut files = Vec::new();
    for figure in figures {
        files.extend(paint::save(&figure, out)?);
    }
    Ok(files)
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
