//! Charts from stored results alone: nothing is measured here.

mod canvas;
mod contact_quality;
mod figure;
mod frames;
mod front;
pub(crate) mod gpu_day;
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
            } else if kind != crate::gpu_day::KIND {
                // Charts of that kind were drawn by its run.
                return Err(StoredError::Kind { path, kind }.into());
            }
        }
        Ok(all)
    }
}

/// What became of the charts.
#[derive(Debug, Default)]
pub struct Drawn {
    /// SVG and PNG of each.
    pub files: Vec<PathBuf>,
    /// Of those that stored rows do not tell enough for: what is missing.
    pub skipped: Vec<String>,
}

/// Draws all charts for which the folder `results` holds rows into `out`, as SVG and PNG.
pub fn draw_all(results: &Path, out: &Path) -> Result<Drawn, ChartError> {
    let all = Results::read(results)?;
    std::fs::create_dir_all(out).map_err(|source| StoredError::File {
        path: out.to_owned(),
        source,
    })?;
    let mut figures = speed_accuracy::figures(&all.accuracy);
    figures.extend(sweeps::figures(&all.accuracy));
    figures.extend(contact_quality::figures(&all.contacts));
    figures.extend(frames::figures(&all.frames));
    let mut drawn = Drawn::default();
    match work::figures(&all.frames) {
        Ok(work) => figures.extend(work),
        Err(missing) => drawn.skipped.push(missing),
    }
    for figure in figures {
        drawn.files.extend(paint::save(&figure, out)?);
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
