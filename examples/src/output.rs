//! Files, folders and progress on a terminal.

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{self, IsTerminal};
use std::path::Path;

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

/// Writes a value as JSON.
///
/// # Errors
/// Those of the file system, with the path.
pub fn write_json(path: &Path, value: &impl Serialize) -> anyhow::Result<()> {
    write_file(path, &serde_json::to_vec_pretty(value)?)
}
