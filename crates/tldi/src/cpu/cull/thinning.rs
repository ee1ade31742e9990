//! Every n-th point of each block of a cloud.

use crate::BLOCK;
use crate::pair::sampling::first_taken;

/// Which points are taken.
pub(super) struct Thinning {
    stride: usize,
    /// 1 for every `stride`-th, else 0.
    taken: [u8; 2 * BLOCK],
}

impl Thinning {
    pub(super) fn new(stride: usize) -> Self {
        let mut taken = [0; 2 * BLOCK];
        taken
            .iter_mut()
            .step_by(stride)
            .for_each(|taken| *taken = 1);
        Self { stride, taken }
    }

    /// 1 for the points of a block that are taken, else 0.
    pub(super) fn of_block(&self, block: usize) -> &[u8; BLOCK] {
        let first = first_taken(block, self.stride);
        let from = (self.stride - first) % self.stride;
        self.taken[from..]
            .first_chunk()
            .expect("a stride is no longer than a block")
    }
}
