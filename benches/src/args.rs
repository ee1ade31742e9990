//! Arguments that several benches take.

use crate::stored::{self, Measured, Provenance, StoredError};
use std::path::PathBuf;

/// Of benches that store rows.
#[derive(clap::Args)]
pub struct RunArgs {
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Write the rows to this file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl RunArgs {
    /// Writes the rows to the file, if one was asked for.
    pub fn store<R: Measured>(
        &self,
        provenance: Provenance,
        rows: Vec<R>,
    ) -> Result<(), StoredError> {
        match &self.json {
            Some(path) => stored::write(path, provenance, rows),
            None => Ok(()),
        }
    }
}

/// Which methods a bench takes, by words of their names.
#[derive(clap::Args)]
pub struct NameArgs {
    /// Only methods with one of these words in their names, several by commas
    #[arg(long, value_name = "WORD,WORD", value_delimiter = ',')]
    only: Vec<String>,
    /// No methods with one of these words in their names, several by commas
    #[arg(long, value_name = "WORD,WORD", value_delimiter = ',')]
    without: Vec<String>,
}

impl NameArgs {
    /// Whether the method of that name is taken.
    pub fn take(&self, name: &str) -> bool {
        let has = |word: &String| name.contains(word.as_str());
        (self.only.is_empty() || self.only.iter().any(has)) && !self.without.iter().any(has)
    }
}
