//! Memory that the system does not have counts as not held.

use tldi_memory::{Counting, held, most_held};

/// More than the addresses of a process.
const TOO_MUCH: usize = isize::MAX as usize;
const SOME: usize = 1 << 20;
/// What the harness may take meanwhile.
const SLACK: usize = 10_000;

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

#[test]
fn memory_that_the_system_refuses_is_not_held() {
    let mut bytes: Vec<u8> = Vec::new();
    for kept in [0, SOME] {
        bytes.reserve_exact(kept);
        let before = held();
        let (most, outcome) = most_held(|| bytes.try_reserve_exact(TOO_MUCH));
        assert!(outcome.is_err() && bytes.capacity() == kept);
        assert!(most < SLACK, "{most}");
        let after = held();
        assert!(before.abs_diff(after) < SLACK, "{after} after {before}");
    }
}
