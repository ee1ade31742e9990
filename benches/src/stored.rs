//! Results as they are stored and read again: where and when they were measured, and rows.

mod rows;

pub use rows::{AccuracyRow, ContactRow, DistanceTally, FrameRow, LookedRow, StageRow, WorkRow};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use thiserror::Error;
use tldi_tests::Host;

/// Results of one run.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Stored<R> {
    /// What the rows are: [`Measured::KIND`].
    pub kind: String,
    /// The machine and the code.
    #[serde(flatten)]
    pub provenance: Provenance,
    /// What was measured.
    pub rows: Vec<R>,
}

/// The machine and the code of a run.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Provenance {
    /// Day, UTC, as in 2026-01-31.
    pub date: String,
    /// Processor's model.
    pub cpu: String,
    /// Cores that the run could use.
    pub cores: usize,
    /// Commit of the code; `-dirty` if files were changed since.
    pub commit: String,
    /// Features of the build, the instruction sets that were found at run time, and what all code was compiled for.
    pub features: Vec<String>,
    /// Name of the GPU, where one took part.
    pub adapter: Option<String>,
}

impl Provenance {
    /// Here and now; `adapter` is the name of the GPU, where one took part.
    pub fn now(adapter: Option<String>) -> Self {
        let host = Host::now();
        Self {
            date: host.date,
            cpu: host.cpu,
            cores: host.cores,
            commit: host.commit,
            features: features(),
            adapter,
        }
    }
}

/// What decides the speed of a build.
fn features() -> Vec<String> {
    let mut all = vec![if cfg!(debug_assertions) {
        "debug".to_owned()
    } else {
        "release".to_owned()
    }];
    #[cfg(target_arch = "x86_64")]
    for (is_there, name) in [
        (is_x86_feature_detected!("avx2"), "avx2"),
        (is_x86_feature_detected!("fma"), "fma"),
        (is_x86_feature_detected!("avx512f"), "avx512f"),
    ] {
        if is_there {
            all.push(name.to_owned());
        }
    }
    for (is_assumed, name) in [
        (cfg!(target_feature = "avx2"), "avx2"),
        (cfg!(target_feature = "avx512f"), "avx512f"),
    ] {
        if is_assumed {
            all.push(format!("compiled for {name}"));
        }
    }
    all
}

/// A kind of rows.
pub trait Measured: Serialize + DeserializeOwned {
    /// Name of the kind in stored results.
    const KIND: &'static str;

    /// What is wrong with the row's numbers, if anything is.
    fn fault(&self) -> Option<String>;
}

/// Why stored results cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoredError {
    /// A file or folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Not the JSON that a bench writes.
    #[error(
        "{}: not results of a bench ({source}); write it again with the bench's --json",
        path.display()
    )]
    Format {
        /// Which file.
        path: PathBuf,
        /// What does not fit, with line and column.
        source: serde_json::Error,
    },
    /// A kind of results that no chart is known for.
    #[error("{}: results of the kind \"{kind}\", for which there is no chart", path.display())]
    Kind {
        /// Which file.
        path: PathBuf,
        /// What it says to be.
        kind: String,
    },
    /// No results.
    #[error("{}: no rows; measure again", path.display())]
    Empty {
        /// Which file.
        path: PathBuf,
    },
    /// A number that cannot be.
    #[error("{}: row {row}: {fault}; measure again", path.display())]
    Row {
        /// Which file.
        path: PathBuf,
        /// Its number, from 0.
        row: usize,
        /// What is wrong.
        fault: String,
    },
}

/// Only what tells which rows follow.
#[derive(Deserialize)]
struct Head {
    kind: String,
}

/// Of which kind the results in a file are.
pub fn kind(path: &Path) -> Result<String, StoredError> {
    parse::<Head>(path, &text(path)?).map(|head| head.kind)
}

/// Results from a file: at least one row, all of them possible.
pub fn read<R: Measured>(path: &Path) -> Result<Stored<R>, StoredError> {
    let stored: Stored<R> = parse(path, &text(path)?)?;
    if stored.kind != R::KIND {
        return Err(StoredError::Kind {
            path: path.to_owned(),
            kind: stored.kind,
        });
    }
    if stored.rows.is_empty() {
        return Err(StoredError::Empty {
            path: path.to_owned(),
        });
    }
    for (row, measured) in stored.rows.iter().enumerate() {
        if let Some(fault) = measured.fault() {
            return Err(StoredError::Row {
                path: path.to_owned(),
                row,
                fault,
            });
        }
    }
    Ok(stored)
}

/// Results into a file.
pub fn write<R: Measured>(
    path: &Path,
    provenance: Provenance,
    rows: Vec<R>,
) -> Result<(), StoredError> {
    let stored = Stored {
        kind: R::KIND.to_owned(),
        provenance,
        rows,
    };
    write_json(path, &stored)
}

/// Anything as JSON into a file.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), StoredError> {
    let text = serde_json::to_string_pretty(value).map_err(|source| StoredError::Format {
        path: path.to_owned(),
        source,
    })?;
    std::fs::write(path, text + "\n").map_err(|source| StoredError::File {
        path: path.to_owned(),
        source,
    })
}

fn text(path: &Path) -> Result<String, StoredError> {
    std::fs::read_to_string(path).map_err(|source| StoredError::File {
        path: path.to_owned(),
        source,
    })
}

fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, StoredError> {
    serde_json::from_str(text).map_err(|source| StoredError::Format {
        path: path.to_owned(),
        source,
    })
}

#[cfg(test)]
pub(crate) mod tests;
