//! All code of the README and of the pages in `docs` is compiled: `src/doc_examples.rs` names every page that has some.

use std::fs::read_to_string;
use std::path::Path;

/// A line that opens a block of code in the language of this library.
fn opens_rust(line: &str) -> bool {
    line.trim_start().starts_with("```rust")
}

#[test]
fn every_page_with_code_is_compiled() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let compiled =
        read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/doc_examples.rs"))
            .expect("the list of compiled pages is beside the library");
    let pages =
        std::fs::read_dir(repository.join("docs")).expect("the folder of the pages is there");
    let mut paths = vec!["README.md".to_owned()];
    for page in pages {
        let name = page.expect("the folder can be listed").file_name();
        paths.push(format!("docs/{}", name.to_string_lossy()));
    }
    let mut with_code = 0;
    for path in paths.iter().filter(|path| path.ends_with(".md")) {
        let text = read_to_string(repository.join(path)).expect("the page can be read");
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
