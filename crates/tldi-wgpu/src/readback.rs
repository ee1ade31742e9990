//! What a batch found, as it is read back.

use crate::layout::{
    CONTACT_WORDS, COUNTERS, ENTRY_BYTES, FRAGMENT_BYTES, LAYER_BYTES, PAIR_WORDS, PLANE_BYTES,
    SAMPLE_SLOTS, SPLAT_BYTES, SURVIVOR_BYTES,
};
use crate::upload::Upload;
use bytemuck::{Pod, Zeroable};
use tldi::glamx::Vec3;
use tldi::{ContactPixel, PairQuery, PairResult, View, VirtualCamera, plan};

/// Elements that a batch needs of each buffer whose size is not known before.
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

    /// What each stage that runs must read and write at least, bytes.
    pub(crate) fn bytes(&self, upload: &Upload) -> Vec<(&'static str, u64)> {
        let times = |count: u32, bytes: u64| u64::from(count) * bytes;
        let survivors = times(self.survivors, SURVIVOR_BYTES);
        let tiles = times(self.tiles, 4);
        // Both sides' begins and ends.
        let pixels = times(self.pixels, 2 * 8);
        let fragments = times(self.fragments, FRAGMENT_BYTES);
        let splats = times(self.splats, SPLAT_BYTES);
        let layers = times(self.layers, LAYER_BYTES);
        let bare = upload.has_bare_sides();
        let entries = times(if bare { self.survivors } else { 0 }, ENTRY_BYTES);
        let normals = times(self.survivors, if bare { PLANE_BYTES } else { 12 });
        let all = [
            ("cull", 16 * upload.points() as u64 + survivors),
            ("zone", 2 * survivors),
            ("normals_alloc", upload.cell_bytes()),
            ("normals_sort", survivors + entries),
            ("sample", survivors),
            ("aim", 2 * 16 * SAMPLE_SLOTS * upload.pairs.len() as u64),
            ("columns_bounds", survivors),
            ("columns_tiles", 0),
            ("columns_depths", survivors + 2 * tiles),
            ("columns_touch", 3 * tiles),
            ("columns_pixels", 0),
            ("normals", survivors + entries + normals),
            ("normals_sharpen", survivors + entries + 2 * normals),
            ("normals_settle", survivors + entries + 2 * normals),
            ("mark", survivors + normals + splats + pixels),
            ("alloc", 2 * pixels),
            ("splat", splats + fragments),
            ("sweep", fragments + splats + layers + pixels),
            (
                "compare",
                layers + pixels + times(self.contacts, 4 * u64::from(CONTACT_WORDS)),
            ),
        ];
        let runs = |stage: &(&str, u64)| bare || !stage.0.starts_with("normals");
        all.into_iter().filter(runs).collect()
    }

    /// Whether buffers of this size are large enough.
    pub(crate) fn holds(&self, needed: &Self) -> bool {
        let words = |c| -> [u32; 7] { bytemuck::cast(c) };
        let mut all = words(*self).into_iter().zip(words(*needed));
        all.all(|(own, needed)| needed <= own)
    }

    /// Grows what is too small, by doubling.
    pub(crate) fn grow(&mut self, needed: &Self) {
        let needed: [u32; 7] = bytemuck::cast(*needed);
        let own: &mut [u32; 7] = bytemuck::cast_mut(self);
        for (own, needed) in own.iter_mut().zip(needed) {
            if needed > *own {
                *own = needed.checked_next_power_of_two().unwrap_or(u32::MAX);
            }
        }
    }
}

/// The words that were read back: counters, pairs, contacts.
pub(crate) struct Readback<'a> {
    counters: &'a [u32],
    pairs: &'a [[u32; PAIR_WORDS as usize]],
    contacts: &'a [[u32; CONTACT_WORDS as usize]],
}

const CROSSINGS: usize = 0;
const GAP: usize = 1;
const CROWDED: usize = 2;
const VIEWS: usize = 3;
const AXES: usize = 4;

impl<'a> Readback<'a> {
    pub(crate) fn new(words: &'a [u32], pairs: usize) -> Self {
        let (counters, rest) = words.split_at(COUNTERS as usize);
        let (pairs, contacts) = rest.split_at(pairs * PAIR_WORDS as usize);
        Self {
            counters,
            pairs: pairs.as_chunks().0,
            contacts: contacts.as_chunks().0,
        }
    }

    pub(crate) fn counters(&self) -> Counters {
        let words: [u32; 7] = std::array::from_fn(|k| self.counters[k]);
        bytemuck::cast(words)
    }

    /// Whether the `k`-th pair on the device has a pixel with too many fragments.
    pub(crate) fn is_crowded(&self, k: usize) -> bool {
        self.pairs[k][CROWDED] != 0
    }

    /// Fills all but the contacts of the `k`-th pair on the device.
    pub(crate) fn fill(&self, k: usize, query: &PairQuery, result: &mut PairResult) {
        let words = &self.pairs[k];
        result.collides = words[CROSSINGS] >= plan::CROSSED;
        result.gap = (words[GAP] != 0).then(|| -unordered(words[GAP]));
        result.axes.clear();
        let axes = words[AXES..].as_chunks::<3>().0;
        let views = axes.iter().take(words[VIEWS] as usize);
        result.axes.extend(views.map(|axis| match query.view {
            View::Fixed(camera) => camera.axis(),
            View::Aim { .. } => Vec3::from_array(axis.map(f32::from_bits)),
        }));
        result.contacts.clear();
    }

    /// Adds the contacts of all pairs but crowded ones to their results.
    pub(crate) fn fill_contacts(
        &self,
        pairs_of: &[usize],
        batch: &[PairQuery],
        results: &mut [PairResult],
    ) {
        let count = self.counters().contacts as usize;
        for words in &self.contacts[..count] {
            let (k, view) = ((words[0] / 3) as usize, words[0] % 3);
            if self.is_crowded(k) {
                continue;
            }
            let query = &batch[pairs_of[k]];
            let result = &mut results[pairs_of[k]];
            let camera = match query.view {
                View::Fixed(camera) => camera,
                View::Aim { .. } => {
                    VirtualCamera::along(result.axes[view as usize], query.params.pixel_size)
                }
            };
            let number = |at: usize| f32::from_bits(words[at]);
            let vector = |at: usize| Vec3::new(number(at), number(at + 1), number(at + 2));
            let pixel = [words[1] as i32, words[2] as i32];
            let [u, v] = pixel.map(|c| c as f32 + 0.5);
            let frame_from_view = camera.view_from_frame.rotation.inverse();
            result.contacts.push(ContactPixel {
                pixel,
                view,
                point_a: camera.point_at(u, v, number(4)),
                point_b: camera.point_at(u, v, number(5)),
                normal_a: frame_from_view * vector(7),
                normal_b: frame_from_view * vector(10),
                gap: number(6),
            });
        }
    }
}

/// The inverse of `ordered` in WGSL.
fn unordered(key: u32) -> f32 {
    f32::from_bits(if key >= 1 << 31 {
        key & !(1 << 31)
    } else {
        !key
    })
}
