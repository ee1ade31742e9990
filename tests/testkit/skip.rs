//! What a test lacks: said, or a failure where a variable demands it. Other packages include this file by its path.

use std::io::Write;
use std::path::PathBuf;

/// Set where a missing GPU, or missing test data, is a failure.
pub const REQUIRE_GPU: &str = "TLDI_REQUIRE_GPU";
/// See [`REQUIRE_GPU`].
pub const REQUIRE_DATA: &str = "TLDI_REQUIRE_DATA";

/// Says that a test is left out, or a part of it.
///
/// # Panics
/// If the environment variable `required` is set.
pub fn skip(why: &str, required: &str) {
    assert!(
        std::env::var_os(required).is_none(),
        "{why}, and {required} is set"
    );
    say_skipped(&format!("{why} (with {required} set, this is a failure)"));
}

/// The same where nothing can demand it. Not by `eprintln`: the test harness shows what that prints only where a test fails.
pub fn say_skipped(why: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a part");
    let text = format!("SKIPPED {test}: {why}\n");
    // Where nobody listens nothing can be said.
    let _nobody = std::io::stderr().write_all(text.as_bytes());
}

/// The folder of test data: the environment variable `TLDI_DATA` names it, else it is `shared/data` beside the checkout.
/// `checkout` is the path of the checkout.
pub fn data_folder(checkout: &str) -> PathBuf {
    std::env::var_os("TLDI_DATA").map_or_else(
        || PathBuf::from(checkout).join("../shared/data"),
        PathBuf::from,
    )
}

/// The path of a file in the [folder of test data](data_folder), or `None` (said) where it is absent.
///
/// # Panics
/// There, if the variable [`REQUIRE_DATA`] is set.
pub fn test_data(checkout: &str, name: &str) -> Option<PathBuf> {
    let path = data_folder(checkout).join(name);
    if path.exists() {
        return Some(path);
    }
    skip(
        &format!("{name} is not in the folder of test data that TLDI_DATA names"),
        REQUIRE_DATA,
    );
    None
}

#[cfg(test)]
mod tests {
    use super::skip;

    /// A variable that cargo sets for every test.
    const SET: &str = "CARGO_MANIFEST_DIR";

    #[test]
    #[should_panic(expected = "no such thing, and CARGO_MANIFEST_DIR is set")]
    fn what_is_demanded_is_not_skipped() {
        skip("no such thing", SET);
    }
}
