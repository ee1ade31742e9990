//! How many elements a batch needs, and how many a device takes.

use crate::GpuError;
use crate::layout::{
    CONTACT_WORDS, FRAGMENT_BYTES, LAYER_BYTES, MOST_SPLATS, MOST_SURVIVORS, PIXEL_BYTES,
    SPLAT_BYTES, SURVIVOR_BYTES, TILE_BYTES,
};
use bytemuck::{Pod, Zeroable};

/// Bytes of an element of each counter, in its buffer, and what the element is.
const ELEMENT_BYTES: [u64; 7] = [
    SURVIVOR_BYTES,
    TILE_BYTES,
    PIXEL_BYTES,
    SPLAT_BYTES,
    FRAGMENT_BYTES,
    LAYER_BYTES,
    4 * CONTACT_WORDS as u64,
];
const ELEMENT_NAMES: [&str; 7] = [
    "survivors",
    "tiles",
    "pixels",
    "splats",
    "fragments",
    "layers",
    "contacts",
];

/// Elements that a batch needs of each buffer whose size is not known before. In the order of the stages' counters, from
/// [`SURVIVORS`](tldi_shaders::numbers::SURVIVORS) to [`CONTACTS`](tldi_shaders::numbers::CONTACTS).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Counters {
    pub(crate) survivors: u32,
    pub(crate) tiles: u32,
    pub(crate) pixels: u32,
    pub(crate) splats: u32,
    pub(crate) fragments: u32,
    pub(crate) layers: u32,
    pub(crate) contacts: u32,
}

impl Counters {
    /// Enough for a small scene.
    pub(crate) const LEAST: Self = Self {
        survivors: 1 << 15,
        tiles: 1 << 14,
        pixels: 1 << 15,
        splats: 1 << 15,
        fragments: 1 << 18,
        layers: 1 << 16,
        contacts: 1 << 11,
    };

    /// With so many times the tiles and pixels, rounded down.
    pub(crate) fn with_image_shares(self, share: f32) -> Self {
        let times = |count: u32| (f64::from(share) * f64::from(count)) as u32;
        Self {
            tiles: times(self.tiles),
            pixels: times(self.pixels),
            ..self
        }
    }

    /// How many times the tiles, or the pixels, of `other` there are.
    pub(crate) fn image_shares(&self, other: &Self) -> f32 {
        let share = |own: u32, other: u32| own as f32 / other.max(1) as f32;
        share(self.tiles, other.tiles).max(share(self.pixels, other.pixels))
    }

    fn words(&self) -> [u32; 7] {
        bytemuck::cast(*self)
    }

    fn zip(&self, other: &Self, op: impl Fn(u32, u32) -> u32) -> Self {
        let (own, other) = (self.words(), other.words());
        let all: [u32; 7] = std::array::from_fn(|k| op(own[k], other[k]));
        bytemuck::cast(all)
    }

    /// Each with its name.
    pub(crate) fn named(&self) -> [(&'static str, u32); 7] {
        std::array::from_fn(|k| (ELEMENT_NAMES[k], self.words()[k]))
    }

    /// Whether buffers of this size are large enough.
    pub(crate) fn holds(&self, needed: &Self) -> bool {
        self.max(needed) == *self
    }

    /// The most that a device takes whose buffers have at most `allowed` bytes, and that the
    /// stages can number.
    pub(crate) fn most(allowed: u64) -> Self {
        // The last number says that more were counted than a word holds.
        let within = |bytes: u64| {
            u32::try_from(allowed / bytes)
                .unwrap_or(u32::MAX)
                .min(u32::MAX - 1)
        };
        let most = ELEMENT_BYTES.map(within);
        let mut most: Self = bytemuck::cast(most);
        most.survivors = most.survivors.min(MOST_SURVIVORS);
        most.splats = most.splats.min(MOST_SPLATS);
        most
    }

    /// The sum of each, or the largest word.
    pub(crate) fn plus(self, other: &Self) -> Self {
        self.zip(other, u32::saturating_add)
    }

    /// The greater of each.
    pub(crate) fn max(&self, other: &Self) -> Self {
        self.zip(other, u32::max)
    }

    /// The lesser of each.
    pub(crate) fn min(self, other: &Self) -> Self {
        self.zip(other, u32::min)
    }

    /// What is too small is grown by doubling, to at most `most`.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where more than `most` is needed.
    pub(crate) fn grown(self, needed: &Self, most: &Self) -> Result<Self, GpuError> {
        let (mut own, needed, most) = (self.words(), needed.words(), most.words());
        for k in 0..own.len() {
            let bytes = |count: u32| ELEMENT_BYTES[k] * u64::from(count);
            if needed[k] > most[k] {
                return Err(GpuError::TooLarge {
                    buffer: ELEMENT_NAMES[k],
                    needed: bytes(needed[k]),
                    allowed: bytes(most[k]),
                });
            }
            if needed[k] > own[k] {
                let doubled = needed[k].checked_next_power_of_two();
                own[k] = doubled.unwrap_or(u32::MAX).min(most[k]);
            }
        }
        Ok(bytemuck::cast(own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a device has no room for, or a stage no number, is refused; all else is had by doubling.
    #[test]
    fn counters_grow_up_to_what_can_be_numbered() {
        // More than any device: only the numbers bound it.
        let most = Counters::most(u64::MAX);
        assert_eq!(most.splats, 1 << 24);
        assert_eq!(most.fragments, u32::MAX - 1);
        let with = |splats| Counters {
            splats,
            ..Counters::LEAST
        };
        let grown = |splats| Counters::LEAST.grown(&with(splats), &most);
        assert_eq!(grown(40_000), Ok(with(1 << 16)));
        assert_eq!(grown(1 << 24), Ok(with(1 << 24)));
        let refused = GpuError::TooLarge {
            buffer: "splats",
            needed: 64 * ((1 << 24) + 1),
            allowed: 64 << 24,
        };
        assert_eq!(grown((1 << 24) + 1), Err(refused));
        // Doubled, it would be more than a small device allows.
        let small = Counters::most(1 << 20);
        let needed = Counters {
            splats: small.splats - 1,
            ..Counters::default()
        };
        let grown = Counters::default().grown(&needed, &small);
        assert_eq!(grown.map(|c| c.splats), Ok(small.splats));
    }
}
