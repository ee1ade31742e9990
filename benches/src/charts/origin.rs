//! Where the numbers of a chart come from.

use crate::stored::Provenance;

/// Dates, commits and machines of the runs, in a line.
pub(super) fn origin<'a>(runs: impl IntoIterator<Item = &'a Provenance>) -> String {
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
