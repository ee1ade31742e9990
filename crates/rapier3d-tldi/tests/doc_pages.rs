//! All code of the README and of the pages in `docs` is compiled: `src/doc_examples.rs` names every page that has some.
//! Their links and pictures lead to what is there.

use std::fs::read_to_string;
use std::path::{Path, PathBuf};

/// A line that opens a block of code in the language of this library.
fn opens_rust(line: &str) -> bool {
    line.trim_start().starts_with("```rust")
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The README, how to contribute, and the pages in `docs`.
fn pages() -> Vec<String> {
    let listed = std::fs::read_dir(repository().join("docs")).expect("the folder is there");
    let names = listed.map(|page| page.expect("the folder can be listed").file_name());
    let mut paths = vec!["README.md".to_owned(), "CONTRIBUTING.md".to_owned()];
    paths.extend(names.map(|name| format!("docs/{}", name.to_string_lossy())));
    paths.retain(|path| path.ends_with(".md"));
    paths
}

fn text_of(path: &str) -> String {
    read_to_string(repository().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// The name by which a heading is linked: lower case, words joined by hyphens.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    let lower = heading.trim_start_matches('#').trim().to_lowercase();
    lower
        .chars()
        .filter(kept)
        .collect::<String>()
        .replace(' ', "-")
}

#[test]
fn links_lead_somewhere() {
    let mut checked = 0;
    for path in pages() {
        let text = text_of(&path);
        let folder = repository().join(&path);
        let folder = folder.parent().expect("a file is in a folder");
        for link in text.split("](").skip(1) {
            let link = link.split([')', ' ']).next().expect("a first part");
            if link.contains("://") || link.is_empty() {
                continue;
            }
            let (file, part) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => repository().join(&path),
                file => folder.join(file),
            };
            assert!(target.exists(), "{path}: {link} is not there");
            if !part.is_empty() {
                let linked = read_to_string(&target).expect("a page with headings");
                let mut headings = linked.lines().filter(|line| line.starts_with('#'));
                assert!(
                    headings.any(|line| anchor(line) == part),
                    "{path}: {link} has no heading"
                );
            }
            checked += 1;
        }
    }
    assert!(checked > 100, "only {checked} links were found");
}

#[test]
fn every_page_with_code_is_compiled() {
    let compiled = text_of("crates/rapier3d-tldi/src/doc_examples.rs");
    let mut with_code = 0;
    for path in pages().iter().filter(|path| *path != "CONTRIBUTING.md") {
        let text = text_of(path);
        if !text.lines().any(opens_rust) {
            continue;
        }
        with_code += 1;
        assert!(
            compiled.contains(&format!("\"../../../{path}\"")),
            "{path} has code that no test compiles: add it to src/doc_examples.rs"
        );
        // Fences that rustdoc passes over would hide code again.
        let hidden = text
            .lines()
            .find(|line| opens_rust(line) && (line.contains("ignore") || line.contains("text")));
        assert_eq!(hidden, None, "{path}");
    }
    assert!(
        with_code >= 9,
        "only {with_code} pages with code were found"
    );
}
