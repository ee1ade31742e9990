//! Charts from stored results alone: nothing is measured here.

mod canvas;
mod contact_quality;
mod error;
mod figure;
mod frames;
mod front;
pub(crate) mod gpu_day;
mod gpu_figure;
mod gpu_layers;
mod looks;
mod origin;
mod paint;
mod speed_accuracy;
mod stages;
mod sweeps;
mod ticks;
mod work;

use crate::stored::{self, AccuracyRow, ContactRow, FrameRow, Measured, Stored, StoredError};
pub use error::ChartError;
use std::path::{Path, PathBuf};

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
        if path.extension().is_some_and(|kind| kind == "json") {
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
    for told in [work::figures(&all.frames), stages::figures(&all.frames)] {
        match told {
            Ok(figures) => frames.extend(figures),
            Err(missing) => drawn.skipped.push(missing),
        }
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

#[cfg(test)]
mod tests;
