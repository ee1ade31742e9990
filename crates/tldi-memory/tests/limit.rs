//! Memory beyond the limit is refused, and counts as not held.

use tldi_memory::{Counting, allocations, held};

const LIMIT: usize = 64 << 20;
/// What the harness may take meanwhile.
const SLACK: usize = 10_000;

#[global_allocator]
static ALLOCATOR: Counting = Counting::limited(LIMIT);

#[test]
fn memory_beyond_the_limit_is_refused() {
    let before = held();
    let mut bytes: Vec<u8> = Vec::new();
    // The test itself holds something.
    assert!(bytes.try_reserve_exact(LIMIT).is_err());
    assert!(held() < before + SLACK, "{} after {before}", held());
    assert!(bytes.try_reserve_exact(LIMIT / 4).is_ok());
    assert!(held() >= before + LIMIT / 4);
    // While it moves, old and new place are held: 1/4 + 7/8.
    assert!(bytes.try_reserve_exact(7 * (LIMIT / 8)).is_err());
    assert!(held() >= before + LIMIT / 4 && held() < before + LIMIT / 4 + SLACK);
    assert!(allocations(|| bytes.reserve_exact(LIMIT / 2)) >= 1);
    drop(bytes);
    assert!(held() < before + SLACK, "{} after {before}", held());
}
