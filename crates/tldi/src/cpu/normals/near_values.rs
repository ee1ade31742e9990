//! Values of the points around a cell, side by side in whole lanes.

use crate::cpu::normals::planes::LANES;
use crate::cpu::normals::sorted::{MAX_CANDIDATES, RUN};
use std::ops::Range;

/// `N` values of each point.
pub(super) struct NearValues<const N: usize> {
    /// With room for a run of no meaning.
    values: [[f32; MAX_CANDIDATES + RUN]; N],
    /// A multiple of [`LANES`].
    count: usize,
}

impl<const N: usize> Default for NearValues<N> {
    fn default() -> Self {
        Self {
            values: [[0.0; MAX_CANDIDATES + RUN]; N],
            count: 0,
        }
    }
}

impl<const N: usize> NearValues<N> {
    /// Copies the `rows` of `from`, which ends with [`RUN`] values of no meaning: all, or of more than [`MAX_CANDIDATES`] an
    /// even selection. Lanes that are left get `nothing`.
    pub(super) fn gather(
        &mut self,
        rows: [Range<usize>; 9],
        from: &[Vec<f32>; N],
        nothing: [f32; N],
    ) {
        let total: usize = rows.iter().map(|row| row.len()).sum();
        let mut n = 0;
        if total <= MAX_CANDIDATES {
            for row in rows {
                for first in row.clone().step_by(RUN) {
                    let at = n + (first - row.start);
                    for (to, from) in self.values.iter_mut().zip(from) {
                        to[at..at + RUN].copy_from_slice(&from[first..first + RUN]);
                    }
                }
                n += row.len();
            }
        } else {
            for k in (rows.into_iter().flatten()).step_by(total.div_ceil(MAX_CANDIDATES)) {
                for (to, from) in self.values.iter_mut().zip(from) {
                    to[n] = from[k];
                }
                n += 1;
            }
        }
        self.count = n.next_multiple_of(LANES);
        for (to, nothing) in self.values.iter_mut().zip(nothing) {
            to[n..self.count].fill(nothing);
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Each of the values, [`LANES`] points at a time.
    #[inline(always)]
    pub(super) fn lanes(&self) -> [&[[f32; LANES]]; N] {
        let chunks = self.count / LANES;
        (self.values.each_ref()).map(|values| &values.as_chunks().0[..chunks])
    }
}
