//! Rows as files and as a table.

use super::args::Args;
use super::host::RunInfo;
use super::known::{KNOWN_FAILURES, KnownFailure};
use super::method::Method;
use super::row::Row;
use super::runner::Timings;
use super::scenes::SCENES;
use anyhow::{Context, bail};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// What stands before and after the table in a document that contains it.
const BEGIN: &str = "<!-- results: begin (written by the stability suite) -->";
const END: &str = "<!-- results: end -->";

/// How many cases of a scene a method passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    /// Rows that passed.
    pub(crate) passed: usize,
    /// Rows that passed or failed; the rest are not applicable.
    pub(crate) applicable: usize,
    /// Rows.
    pub(crate) rows: usize,
}

/// All results of a run.
pub(crate) struct Report {
    run: RunInfo,
    rows: Vec<Row>,
    timings: Timings,
}

impl Report {
    /// A report of these rows.
    pub(crate) fn new(run: RunInfo, rows: Vec<Row>, timings: Timings) -> Self {
        Self { run, rows, timings }
    }

    /// Methods that have rows, in the order of tables.
    pub(crate) fn methods(&self) -> Vec<Method> {
        let has_rows = |m: &Method| self.rows.iter().any(|row| row.method == m.name());
        Method::ALL.into_iter().filter(has_rows).collect()
    }

    /// Names of the scenes that have rows.
    pub(crate) fn scenes(&self) -> Vec<&'static str> {
        let has_rows = |name: &&str| self.rows.iter().any(|row| row.scene == *name);
        SCENES
            .iter()
            .map(|scene| scene.name)
            .filter(has_rows)
            .collect()
    }

    /// How a method did in a scene.
    pub(crate) fn tally(&self, scene: &str, method: Method) -> Tally {
        let mut tally = Tally::default();
        for row in &self.rows {
            if row.scene == scene && row.method == method.name() {
                tally.rows += 1;
                tally.applicable += usize::from(row.passed.is_some());
                tally.passed += usize::from(row.passed == Some(true));
            }
        }
        tally
    }

    /// Failures of ours that are not declared.
    pub(crate) fn undeclared_failures(&self) -> Vec<&Row> {
        (self.rows.iter())
            .filter(|row| row.is_undeclared_failure())
            .collect()
    }

    /// Declared failures of ours that are more frequent than chance makes them, in words.
    pub(crate) fn frequent_failures(&self) -> Vec<String> {
        let ours = || {
            self.rows
                .iter()
                .filter(|row| row.method == Method::Tldi.name())
        };
        let told = |known: &KnownFailure| {
            let [failed, of] = known.excess(ours())?;
            let (scene, case) = (known.scene, known.case_prefix);
            Some(format!(
                "{scene} / {case}: {failed} of {of}, declared are {known}"
            ))
        };
        KNOWN_FAILURES.iter().filter_map(told).collect()
    }

    /// One line that says when, where and of what.
    pub(crate) fn provenance(&self) -> String {
        let run = &self.run;
        let seeds: Vec<String> = run.seeds.iter().map(u64::to_string).collect();
        format!(
            "{}, commit {}, {} cores of {}, seeds {}, {} version, {} drops",
            run.host.date,
            run.host.commit,
            run.host.cores,
            run.host.cpu,
            seeds.join(" "),
            if run.long { "long" } else { "short" },
            run.drops,
        )
    }

    /// The summary, and what else does not pass: of ours what is not applicable, of others folded.
    fn markdown(&self) -> String {
        let mut text = self.summary();
        for method in self.methods() {
            let mut rows = String::new();
            if method != Method::Tldi {
                self.list(&mut rows, method, "fails", Some(false));
            }
            self.list(&mut rows, method, "is not applicable to", None);
            if !rows.is_empty() {
                let _infallible = write!(
                    text,
                    "\n<details><summary>More about {method}</summary>\n{rows}\n</details>\n"
                );
            }
        }
        text
    }

    /// The table of passes, and what of ours fails.
    pub(crate) fn summary(&self) -> String {
        let methods = self.methods();
        let mut text = format!("{}.\n\n| scene |", self.provenance());
        for method in &methods {
            let _infallible = write!(text, " {method} |");
        }
        text.push_str(" seconds of one core |\n|---|");
        text.push_str(&"---|".repeat(methods.len() + 1));
        text.push('\n');
        for scene in self.scenes() {
            let _infallible = write!(text, "| {scene} |");
            for method in &methods {
                let cell = match self.tally(scene, *method) {
                    tally if tally.applicable == 0 => "n/a".into(),
                    tally => format!("{} of {}", tally.passed, tally.applicable),
                };
                let _infallible = write!(text, " {cell} |");
            }
            let seconds: Vec<String> = (methods.iter())
                .map(|m| format!("{:.1}", self.timings.get(&(scene, *m)).unwrap_or(&0.0)))
                .collect();
            let _infallible = writeln!(text, " {} |", seconds.join(" / "));
        }
        self.list(&mut text, Method::Tldi, "fails", Some(false));
        let passed = self.declared_but_passed();
        if !passed.is_empty() {
            let _infallible = writeln!(
                text,
                "\nKnown failures of `tldi` that passed in this run: {}.",
                passed.join("; ")
            );
        }
        text
    }

    /// Declared failures none of whose cases failed in this run.
    fn declared_but_passed(&self) -> Vec<String> {
        KNOWN_FAILURES
            .iter()
            .filter(|known| {
                let about_it = |row: &&Row| {
                    row.method == Method::Tldi.name() && known.is_about(row.scene, &row.case)
                };
                let mut rows = self.rows.iter().filter(about_it).peekable();
                rows.peek().is_some() && rows.all(|row| row.passed == Some(true))
            })
            .map(|known| format!("{} / {}", known.scene, known.case_prefix))
            .collect()
    }

    /// The cases in which a method had this outcome: one line for all seeds of a case, with the
    /// reason of the first; one line for all cases of a scene that are not applicable for one
    /// reason.
    fn list(&self, text: &mut String, method: Method, title: &str, passed: Option<bool>) {
        let is_meant = |row: &&Row| row.method == method.name() && row.passed == passed;
        let mut groups: BTreeMap<(usize, &str), Vec<&Row>> = BTreeMap::new();
        for row in self.rows.iter().filter(is_meant) {
            let scene = SCENES.iter().position(|s| s.name == row.scene);
            let what = match passed {
                Some(_) => row.case.as_str(),
                None => row.reason.as_deref().unwrap_or_default(),
            };
            let key = (scene.unwrap_or(usize::MAX), what);
            groups.entry(key).or_default().push(row);
        }
        if groups.is_empty() {
            return;
        }
        let _infallible = writeln!(text, "\n`{method}` {title}:\n");
        for rows in groups.values() {
            let row = rows[0];
            let reason = row.reason.as_deref().unwrap_or_default();
            let cases = match passed {
                Some(_) => {
                    let seeds: Vec<String> = rows.iter().map(|row| row.seed.to_string()).collect();
                    format!("{}, seeds {}", row.case, seeds.join(" "))
                }
                None => format!("{} rows, as {}", rows.len(), row.case),
            };
            let _infallible = write!(text, "- {} / {cases}: {reason}", row.scene);
            if let Some(cause) = &row.known_cause {
                let _infallible = write!(text, ". **Known:** {cause}");
            }
            text.push('\n');
        }
    }

    /// What each scene is, and what passes, folded.
    fn scenes_text(&self) -> String {
        let mut text = String::from(
            "<details><summary>What each scene is, and what passes</summary>\n\n\
             | scene | what happens | what passes |\n|---|---|---|\n",
        );
        for scene in SCENES {
            let _infallible = writeln!(
                text,
                "| {} | {} | {} |",
                scene.name, scene.about, scene.rule
            );
        }
        text.push_str("\n</details>\n");
        text
    }

    /// Writes what the command line asks for, but for the chart.
    pub(crate) fn write_files(&self, args: &Args) -> anyhow::Result<()> {
        if let Some(file) = &args.json {
            self.write_json(file)?;
        }
        if let Some(folder) = &args.out {
            self.write_json(&folder.join("stability.json"))?;
            write(&folder.join("stability.md"), &self.markdown())?;
        }
        if let Some(file) = &args.docs {
            self.fill_in(file)?;
        }
        Ok(())
    }

    /// Rows into the file, one a line, and the run's circumstances into a `.run.json` beside it: equal seeds
    /// then give equal files of rows.
    fn write_json(&self, file: &Path) -> anyhow::Result<()> {
        let rows: Vec<String> = (self.rows.iter())
            .map(serde_json::to_string)
            .collect::<Result<_, _>>()?;
        write(file, &format!("[\n{}\n]\n", rows.join(",\n")))?;
        let run = serde_json::to_string_pretty(&self.run)? + "\n";
        write(&file.with_extension("run.json"), &run)
    }

    fn fill_in(&self, file: &Path) -> anyhow::Result<()> {
        let text = std::fs::read_to_string(file)
            .with_context(|| format!("cannot read {}", file.display()))?;
        let (Some((before, _)), Some((_, after))) = (text.split_once(BEGIN), text.split_once(END))
        else {
            bail!("{} has no place marked {BEGIN} … {END}", file.display());
        };
        let (scenes, table) = (self.scenes_text(), self.summary());
        write(
            file,
            &format!("{before}{BEGIN}\n\n{table}\n{scenes}\n{END}{after}"),
        )
    }
}

/// Writes a file, and makes the folder for it.
fn write(file: &Path, text: &str) -> anyhow::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    std::fs::write(file, text).with_context(|| format!("cannot write {}", file.display()))
}
