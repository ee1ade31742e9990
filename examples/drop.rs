//! Drop.
fn main() {}
