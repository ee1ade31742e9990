//! Why charts could not be drawn.

use crate::stored::StoredError;
use std::path::PathBuf;
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
