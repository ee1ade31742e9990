//! The buffers of a batch: what each holds, how large it is, and which binding is its own.

use crate::buffers::Growable;
use crate::layout::{
    BatchData, CONTACT_WORDS, COUNTERS, ENTRY_BYTES, FRAGMENT_BYTES, LAYER_BYTES, MAX_VIEWS,
    PAIR_WORDS, PIXEL_BYTES, PLANE_BYTES, SAMPLE_BYTES, SAMPLE_SLOTS, SPLAT_BYTES, SURVIVOR_BYTES,
    VIEW_BYTES,
};
use crate::resident::Resident;
use crate::upload::Upload;
use crate::{Gpu, GpuError};
use wgpu::BufferUsages;

/// The buffers of a batch, kept and grown from batch to batch.
#[derive(Debug)]
pub(crate) struct BatchBuffers {
    pub(crate) batch: Growable,
    pub(crate) pairs: Growable,
    pub(crate) items: Growable,
    pub(crate) survivors: Growable,
    pub(crate) views: Growable,
    pub(crate) work: Growable,
    pub(crate) entries: Growable,
    pub(crate) planes: Growable,
    pub(crate) adopted: Growable,
    pub(crate) samples: Growable,
    pub(crate) splats: Growable,
    pub(crate) fragments: Growable,
    pub(crate) layers: Growable,
    pub(crate) found: Growable,
    pub(crate) groups: Growable,
    pub(crate) splat_groups: Growable,
    pub(crate) readback: Growable,
}

impl Default for BatchBuffers {
    fn default() -> Self {
        let (storage, to) = (BufferUsages::STORAGE, BufferUsages::COPY_DST);
        let from = BufferUsages::COPY_SRC;
        Self {
            batch: Growable::new("batch", BufferUsages::UNIFORM | to),
            pairs: Growable::new("pairs", storage | to),
            items: Growable::new("items", storage | to),
            survivors: Growable::new("survivors", storage),
            views: Growable::new("views", storage),
            work: Growable::new("work", storage | to | from),
            entries: Growable::new("entries", storage),
            planes: Growable::new("planes", storage),
            adopted: Growable::new("adopted planes", storage),
            samples: Growable::new("samples", storage),
            splats: Growable::new("splats", storage),
            fragments: Growable::new("fragments", storage),
            layers: Growable::new("layers", storage),
            found: Growable::new("found", storage | from),
            groups: Growable::new("groups", storage | BufferUsages::INDIRECT),
            splat_groups: Growable::new("splat groups", storage | BufferUsages::INDIRECT),
            readback: Growable::new("readback", BufferUsages::MAP_READ | to),
        }
    }
}

impl BatchBuffers {
    /// Grows the buffers to the batch and writes what is uploaded.
    pub(crate) fn fit(
        &mut self,
        gpu: &Gpu,
        data: &BatchData,
        upload: &Upload,
    ) -> Result<(), GpuError> {
        self.batch.write(gpu, std::slice::from_ref(data))?;
        self.pairs.write(gpu, &upload.pairs)?;
        self.items.write(gpu, &upload.items)?;
        let pairs = u64::from(data.pairs);
        let contact_words = u64::from(CONTACT_WORDS) * u64::from(data.contacts);
        let found = 4 * (u64::from(PAIR_WORDS) * pairs + contact_words);
        let bare = if data.cells > 0 { data.survivors } else { 1 };
        for (buffer, bytes) in [
            (
                &mut self.survivors,
                SURVIVOR_BYTES * u64::from(data.survivors),
            ),
            (&mut self.views, u64::from(MAX_VIEWS) * VIEW_BYTES * pairs),
            (
                &mut self.work,
                4 * u64::from(data.pixels_at) + PIXEL_BYTES * u64::from(data.pixels),
            ),
            (&mut self.entries, ENTRY_BYTES * u64::from(bare)),
            (&mut self.planes, PLANE_BYTES * u64::from(bare)),
            (&mut self.adopted, PLANE_BYTES * u64::from(bare)),
            (&mut self.samples, 2 * SAMPLE_BYTES * SAMPLE_SLOTS * pairs),
            (&mut self.splats, SPLAT_BYTES * u64::from(data.splats)),
            (
                &mut self.fragments,
                FRAGMENT_BYTES * u64::from(data.fragments),
            ),
            (&mut self.layers, LAYER_BYTES * u64::from(data.layers)),
            (&mut self.found, found),
            (&mut self.groups, 64),
            (&mut self.splat_groups, 64),
            (&mut self.readback, 4 * u64::from(COUNTERS) + found),
        ] {
            buffer.ensure(gpu, bytes)?;
        }
        Ok(())
    }

    /// The buffer of each binding, by its number.
    pub(crate) fn bound(&self, resident: &Resident) -> Vec<Option<wgpu::Buffer>> {
        let grown = |buffer: &Growable| buffer.get().cloned();
        vec![
            grown(&self.batch),
            grown(&self.pairs),
            grown(&self.adopted),
            grown(&self.items),
            Some(resident.points().clone()),
            Some(resident.normals().clone()),
            grown(&self.survivors),
            grown(&self.views),
            grown(&self.work),
            grown(&self.entries),
            grown(&self.samples),
            grown(&self.splats),
            grown(&self.fragments),
            grown(&self.layers),
            grown(&self.found),
            grown(&self.groups),
            grown(&self.splat_groups),
            grown(&self.planes),
        ]
    }
}
