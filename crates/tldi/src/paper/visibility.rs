//! Pass `visibility`: where the next layer of a pixel begins.

use super::fragments::Fragment;

/// The front of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Front {
    /// Front depth of the frontmost cylinder, metres.
    pub(super) depth: f32,
    /// Height of a depth segment of the layer: that of the frontmost cylinder, metres.
    pub(super) segment_height: f32,
}

impl Front {
    /// The depth segment that a cylinder begins in; segment 0 begins at the front depth.
    pub(super) fn first_segment(&self, fragment: &Fragment) -> u32 {
        ((fragment.near - self.depth) / self.segment_height) as u32
    }

    /// The depth segment that a cylinder ends in. A cylinder that ends where a segment begins
    /// does not reach into it: the frontmost one fills segment 0 alone.
    pub(super) fn last_segment(&self, fragment: &Fragment) -> u32 {
        let end = ((fragment.far - self.depth) / self.segment_height).ceil() as u32;
        end.saturating_sub(1).max(self.first_segment(fragment))
    }
}

/// The front of the next layer of a pixel, whose remaining cylinders `rest` are in order of front
/// depth and at least one. Of cylinders that begin at the same depth the first counts as frontmost.
pub(super) fn visibility(rest: &[Fragment]) -> Front {
    let frontmost = &rest[0];
    Front {
        depth: frontmost.near,
        segment_height: frontmost.far - frontmost.near,
    }
}
