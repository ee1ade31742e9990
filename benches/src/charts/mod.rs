//! Charts from stored results.
