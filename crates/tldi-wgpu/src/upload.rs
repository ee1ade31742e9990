//! What a batch uploads: its pairs, their sides, and the blocks of points in reach.

use crate::layout::{
    BatchData, COUNTERS, CloudFacts, PairData, SIDE_WORDS, SideData, VIEW_WORDS, is_for_device,
};
use crate::readback::Counters;
use crate::resident::Resident;
use crate::sources::Sources;
use crate::{Gpu, GpuError};
use tldi::plan::PairPlan;
use tldi::{Aabb, BLOCK, PairQuery, Surface};

/// The uploads of one batch, kept from batch to batch.
#[derive(Debug, Default)]
pub(crate) struct Upload {
    /// Index in the batch of each pair on the device.
    pub(crate) pairs_of: Vec<usize>,
    plans: Vec<PairPlan>,
    pub(crate) pairs: Vec<PairData>,
    pub(crate) sides: Vec<SideData>,
    /// Side and first point of each block that may have points in reach.
    pub(crate) items: Vec<[u32; 2]>,
    zone_words: u32,
    cells: u32,
}

impl Upload {
    /// Selects the pairs that the device takes and whose bounds, and blocks, say that they may
    /// touch.
    pub(crate) fn select(&mut self, batch: &[PairQuery<'_>]) {
        self.pairs_of.clear();
        self.plans.clear();
        self.items.clear();
        for (pair, query) in batch.iter().enumerate() {
            if !is_for_device(query) {
                continue;
            }
            let Some(plan) = PairPlan::new(query) else {
                continue;
            };
            let first_item = self.items.len();
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
                self.items.len() > before
            });
            if is_reached {
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
        2 * 4 * u64::from(self.cells)
    }

    /// Puts the clouds of the selected pairs on the device, and fills what tells of them.
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
        self.sides.clear();
        (self.zone_words, self.cells) = (0, 0);
        for (plan, &pair) in self.plans.iter().zip(&self.pairs_of) {
            let query = &batch[pair];
            let data = PairData::new(query, plan, self.zone_words);
            self.zone_words += 2 * data.zone_words;
            self.pairs.push(data);
            for (surface, side) in [query.a, query.b].iter().zip(&plan.sides) {
                let place = match surface {
                    Surface::Cloud(cloud) => resident.place(gpu, cloud)?,
                    Surface::Device(cloud) => [sources.place(gpu, cloud, resident)?, 0],
                    Surface::Exact(_) => continue,
                };
                let Some(facts) = CloudFacts::of(surface) else {
                    continue;
                };
                let side = SideData::new(&facts, side, &query.params, place, self.cells);
                self.cells += side.cells();
                self.sides.push(side);
            }
        }
        Ok(())
    }

    /// Sizes of the batch and where the parts of the arena are.
    pub(crate) fn batch_data(&self, capacities: &Counters) -> BatchData {
        let pairs = self.pairs.len() as u32;
        let sides_at = COUNTERS;
        let views_at = sides_at + 2 * pairs * SIDE_WORDS;
        let zone_at = views_at + 3 * pairs * VIEW_WORDS;
        let cells_at = zone_at + self.zone_words;
        let tiles_at = cells_at + 2 * self.cells;
        BatchData {
            pairs,
            items: self.items.len() as u32,
            survivors: capacities.survivors,
            tiles: capacities.tiles,
            pixels: capacities.pixels,
            splats: capacities.splats,
            fragments: capacities.fragments,
            layers: capacities.layers,
            contacts: capacities.contacts,
            cells: self.cells,
            sides_at,
            views_at,
            zone_at,
            cells_at,
            tiles_at,
            pixels_at: tiles_at + 3 * capacities.tiles,
        }
    }
}
