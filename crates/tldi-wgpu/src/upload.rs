//! What a batch uploads: its pairs, their sides, and the blocks of points in reach.

use crate::counters::Counters;
use crate::division::is_for_device;
use crate::error::numbered;
use crate::layout::{
    BatchData, CONTACT_WORDS, COUNTERS, CloudFacts, MAX_VIEWS, PAIR_WORDS, PIXEL_BYTES, PairData,
    SIDE_WORDS, SideData, TILE_BYTES, VIEW_WORDS,
};
use crate::prediction::predicted;
use crate::resident::Resident;
use crate::sources::Sources;
use crate::{Gpu, GpuError};
use std::ops::Range;
use tldi::plan::PairPlan;
use tldi::{Aabb, BLOCK, PairQuery, Surface, View};

/// The uploads of one batch, kept from batch to batch.
#[derive(Debug, Default)]
pub(crate) struct Upload {
    /// Index in the batch of each pair on the device.
    pub(crate) pairs_of: Vec<usize>,
    plans: Vec<PairPlan>,
    pub(crate) pairs: Vec<PairData>,
    /// Side and first point of each block that may have points in reach.
    pub(crate) items: Vec<[u32; 2]>,
    /// Which of them are of each side of each pair.
    items_of: Vec<[Range<usize>; 2]>,
    /// What the selected pairs will need, about.
    pub(crate) predicted: Counters,
    zone_words: u64,
    cells: u64,
}

impl Upload {
    /// Selects those of `among` (indices into the batch) that the device takes and whose bounds, and
    /// blocks, say that they may touch.
    pub(crate) fn select(&mut self, batch: &[PairQuery<'_>], among: impl Iterator<Item = usize>) {
        self.pairs_of.clear();
        self.plans.clear();
        self.items.clear();
        self.items_of.clear();
        self.predicted = Counters::default();
        for pair in among {
            let query = &batch[pair];
            if !is_for_device(query) {
                continue;
            }
            let Some(plan) = PairPlan::new(query) else {
                continue;
            };
            let first_item = self.items.len();
            let mut items_of = [0..0, 0..0];
            let is_reached = (0..2).all(|k| {
                let side = &plan.sides[k];
                let index = (2 * self.plans.len() + k) as u32;
                let is_in_reach = |block: &Aabb| {
                    let in_frame = block.transformed(&side.frame_from_surface);
                    in_frame.intersects(&side.region.overlap)
                };
                let item = |block: usize| [index, (block * BLOCK) as u32];
                let before = self.items.len();
                match [query.a, query.b][k] {
                    Surface::Cloud(cloud) => {
                        let blocks = cloud.blocks().iter().enumerate();
                        let reached = blocks.filter(|(_, block)| is_in_reach(block));
                        self.items.extend(reached.map(|(block, _)| item(block)));
                    }
                    // Bounds of its blocks are not known here.
                    Surface::Device(cloud) => {
                        self.items.extend((0..cloud.len.div_ceil(BLOCK)).map(item));
                    }
                    Surface::Exact(_) => {}
                }
                items_of[k] = before..self.items.len();
                !items_of[k].is_empty()
            });
            if is_reached {
                let blocks = [0, 1].map(|k| items_of[k].len());
                let of_pair = predicted(query, &plan, blocks);
                self.items_of.push(items_of);
                self.predicted = self.predicted.plus(&of_pair);
                self.plans.push(plan);
                self.pairs_of.push(pair);
            } else {
                self.items.truncate(first_item);
            }
        }
    }

    /// Points in the blocks in reach, at most.
    pub(crate) fn points(&self) -> usize {
        self.items.len() * BLOCK
    }

    /// Whether a cloud has no normals.
    pub(crate) fn has_bare_sides(&self) -> bool {
        self.cells > 0
    }

    /// Bytes of the cells in which neighbours are looked for.
    pub(crate) fn cell_bytes(&self) -> u64 {
        2 * 4 * self.cells
    }

    /// Puts the blocks in reach of the selected pairs on the device, and fills what tells of them.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where there is no room for the clouds, or the stages cannot number
    /// what there is of them.
    pub(crate) fn place(
        &mut self,
        batch: &[PairQuery<'_>],
        gpu: &Gpu,
        resident: &mut Resident,
        sources: &mut Sources,
    ) -> Result<(), GpuError> {
        resident.begin();
        sources.begin();
        self.pairs.clear();
        (self.zone_words, self.cells) = (0, 0);
        let selected = self.plans.iter().zip(&self.items_of);
        for ((plan, items_of), &pair) in selected.zip(&self.pairs_of) {
            let query = &batch[pair];
            let mut data = PairData::new(query, plan, self.zone_words)?;
            self.zone_words += 2 * u64::from(data.zone_words);
            for (k, surface) in [query.a, query.b].iter().enumerate() {
                let place = match surface {
                    Surface::Cloud(cloud) => {
                        let items = self.items[items_of[k].clone()].iter();
                        let blocks = items.map(|[_, first_point]| *first_point as usize / BLOCK);
                        resident.place(gpu, cloud, blocks)?
                    }
                    Surface::Device(cloud) => sources.place(gpu, cloud, resident)?,
                    Surface::Exact(_) => continue,
                };
                let Some(facts) = CloudFacts::of(surface) else {
                    continue;
                };
                let params = match query.view {
                    View::Fixed(_) => query.params,
                    View::Aim { .. } => query.params.of_surface(surface.mean_radius()),
                };
                let side = SideData::new(&facts, &plan.sides[k], &params, &place, self.cells)?;
                self.cells += side.cells();
                data.sides[k] = side;
            }
            self.pairs.push(data);
        }
        Ok(())
    }

    /// As many as `wanted`, but of what shares a buffer with other things no more than `allowed` bytes have room for beside
    /// these: what is foreseen, or was needed before, may be more than this part needs.
    pub(crate) fn fitted(&self, wanted: Counters, allowed: u64) -> Counters {
        let pairs = self.pairs.len() as u64;
        let beside = |bytes: u64, element: u64| {
            u32::try_from(allowed.saturating_sub(bytes) / element).unwrap_or(u32::MAX)
        };
        // They are read back with the counters.
        let contacts = beside(
            4 * (u64::from(COUNTERS) + u64::from(PAIR_WORDS) * pairs),
            4 * u64::from(CONTACT_WORDS),
        );
        let of_images =
            TILE_BYTES * u64::from(wanted.tiles) + PIXEL_BYTES * u64::from(wanted.pixels);
        let room = allowed.saturating_sub(4 * self.words_before_tiles());
        let share = (room as f32 / of_images.max(1) as f32).min(1.0);
        Counters {
            contacts: wanted.contacts.min(contacts),
            ..wanted.with_image_shares(share)
        }
    }

    /// Words of the arena before the tiles: counters, sides, zones, cells, views.
    fn words_before_tiles(&self) -> u64 {
        let per_pair = 2 * SIDE_WORDS + MAX_VIEWS * VIEW_WORDS;
        let pairs = u64::from(per_pair) * self.pairs.len() as u64;
        u64::from(COUNTERS) + pairs + self.zone_words + 2 * self.cells
    }

    /// Sizes of the batch and where the parts of the arena are.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where a word cannot number all of the arena, of what is found, or of
    /// the points.
    pub(crate) fn batch_data(&self, capacities: &Counters) -> Result<BatchData, GpuError> {
        let pairs = self.pairs.len() as u64;
        let sides_at = u64::from(COUNTERS);
        let zone_at = sides_at + 2 * pairs * u64::from(SIDE_WORDS);
        let cells_at = zone_at + self.zone_words;
        // From here on, a round of further views begins anew.
        let views_at = cells_at + 2 * self.cells;
        let tiles_at = self.words_before_tiles();
        let pixels_at = tiles_at + TILE_BYTES / 4 * u64::from(capacities.tiles);
        let work_words = pixels_at + PIXEL_BYTES / 4 * u64::from(capacities.pixels);
        // The stages compute places anywhere in it.
        numbered("work", work_words)?;
        let contact_words = u64::from(CONTACT_WORDS) * u64::from(capacities.contacts);
        numbered("found", u64::from(PAIR_WORDS) * pairs + contact_words)?;
        // The stages count what is culled of them.
        numbered("survivors", self.points() as u64)?;
        let of_work = |words| numbered("work", words);
        Ok(BatchData {
            pairs: numbered("pairs", pairs)?,
            items: numbered("items", self.items.len() as u64)?,
            survivors: capacities.survivors,
            tiles: capacities.tiles,
            pixels: capacities.pixels,
            splats: capacities.splats,
            fragments: capacities.fragments,
            layers: capacities.layers,
            contacts: capacities.contacts,
            cells: of_work(self.cells)?,
            sides_at: of_work(sides_at)?,
            views_at: of_work(views_at)?,
            zone_at: of_work(zone_at)?,
            cells_at: of_work(cells_at)?,
            tiles_at: of_work(tiles_at)?,
            pixels_at: of_work(pixels_at)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What comes back of contacts, with the counters and the pairs, has room in a buffer.
    #[test]
    fn contacts_have_room_where_they_are_read() {
        let wanted = Counters {
            contacts: u32::MAX,
            ..Counters::LEAST
        };
        for allowed in (1 << 16)..(1 << 16) + 48 {
            let contacts = Upload::default().fitted(wanted, allowed).contacts;
            let bytes = 4 * u64::from(COUNTERS + CONTACT_WORDS * contacts);
            assert!(
                (allowed - 47..=allowed).contains(&bytes),
                "{bytes} of {allowed}"
            );
        }
    }

    /// Places in the arena that a word cannot number are refused, whichever part makes them so.
    #[test]
    fn sizes_that_a_word_does_not_hold_are_refused() {
        let refused_buffer =
            |upload: &Upload, capacities: Counters| match upload.batch_data(&capacities) {
                Err(GpuError::TooLarge { buffer, .. }) => Some(buffer),
                _ => None,
            };
        let with = |tiles, pixels, contacts| Counters {
            tiles,
            pixels,
            contacts,
            ..Counters::LEAST
        };
        let upload = Upload::default();
        assert_eq!(refused_buffer(&upload, Counters::LEAST), None);
        // 3 * 2^31 words are 2^31 modulo 2^32.
        assert_eq!(refused_buffer(&upload, with(1 << 31, 1, 1)), Some("work"));
        assert_eq!(refused_buffer(&upload, with(1, 1 << 30, 1)), Some("work"));
        assert_eq!(refused_buffer(&upload, with(1, 1, 1 << 29)), Some("found"));
        let of_cells = Upload {
            cells: 1 << 31,
            ..Upload::default()
        };
        assert_eq!(refused_buffer(&of_cells, Counters::LEAST), Some("work"));
        let of_zones = Upload {
            zone_words: 1 << 32,
            ..Upload::default()
        };
        assert_eq!(refused_buffer(&of_zones, Counters::LEAST), Some("work"));
    }
}
