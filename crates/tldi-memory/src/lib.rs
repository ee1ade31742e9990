//! Counts the memory of a process: how often all its threads ask for some, and how many bytes they hold.
//!
//! A test binary or program makes [`Counting`] its global allocator. The numbers are those of the process, so only one
//! thing may be measured at a time.
//!
//! ```
//! use tldi_memory::{Counting, allocations, held, most_held};
//!
//! #[global_allocator]
//! static ALLOCATOR: Counting = Counting::new();
//!
//! let before = held();
//! let (most, kept) = most_held(|| {
//!     drop(vec![0u8; 5000]);
//!     vec![0u8; 1000]
//! });
//! assert!(most >= 5000 && most < 6000);
//! assert_eq!(held() - before, 1000);
//! assert!(allocations(|| drop(kept.clone())) >= 1);
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);
static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, which counts.
#[derive(Debug)]
pub struct Counting {
    limit: usize,
}

impl Counting {
    /// Counts, and gives out whatever the system has.
    #[allow(
        clippy::new_without_default,
        reason = "an allocator is a constant, which no default can be"
    )]
    pub const fn new() -> Self {
        Self::limited(usize::MAX)
    }

    /// Refuses memory beyond so many bytes held at once: a test that asks for too much ends, and not the machine.
    pub const fn limited(limit: usize) -> Self {
        Self { limit }
    }

    /// What `ask` gives if so many bytes more may be held; counts them if it gives any.
    fn taken(&self, bytes: usize, ask: impl FnOnce() -> *mut u8) -> *mut u8 {
        let held = HELD.fetch_add(bytes, Relaxed).saturating_add(bytes);
        let memory = if held > self.limit {
            std::ptr::null_mut()
        } else {
            ask()
        };
        if memory.is_null() {
            HELD.fetch_sub(bytes, Relaxed);
        } else {
            ALLOCATIONS.fetch_add(1, Relaxed);
            MOST.fetch_max(held, Relaxed);
        }
        memory
    }
}

// SAFETY: memory comes from the system's allocator unchanged, or is refused with a null pointer.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise is the one that the system's allocator asks for.
        self.taken(layout.size(), || unsafe { System.alloc(layout) })
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the memory came from the system's allocator with this layout.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // While memory moves, both places are held.
        // SAFETY: the memory came from the system's allocator with this layout.
        let moved = self.taken(size, || unsafe { System.realloc(memory, layout, size) });
        if !moved.is_null() {
            HELD.fetch_sub(layout.size(), Relaxed);
        }
        moved
    }
}

/// How often `run` asks for memory.
pub fn allocations(run: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.load(Relaxed);
    run();
    ALLOCATIONS.load(Relaxed) - before
}

/// Bytes that are held now.
pub fn held() -> usize {
    HELD.load(Relaxed)
}

/// Most bytes that are held while `run` runs, beyond those held before, and its outcome.
pub fn most_held<T>(run: impl FnOnce() -> T) -> (usize, T) {
    let before = held();
    MOST.store(before, Relaxed);
    let outcome = run();
    (MOST.load(Relaxed) - before, outcome)
}
