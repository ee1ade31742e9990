//! Clouds on the device: blocks of points are uploaded when they first come into reach, and kept while the cloud is used and its
//! content stays the same.

use crate::buffers::{create, most_bytes};
use crate::error::numbered;
use crate::{Gpu, GpuError};
use std::collections::HashMap;
use std::ops::Range;
use tldi::{BLOCK, PointCloud, Radii};
use wgpu::BufferUsages;

/// Batches after which a cloud that is not used gives its place to others. Half or twice: no test fails.
const KEPT_BATCHES: u64 = 2;

/// A pool of equal elements on the device, in which ranges are taken and given back.
#[derive(Debug)]
struct Pool {
    name: &'static str,
    element_bytes: u64,
    buffer: wgpu::Buffer,
    /// Free ranges (first, length) in ascending order, none next to another.
    free: Vec<(u32, u32)>,
    capacity: u32,
}

const USAGE: BufferUsages = BufferUsages::STORAGE
    .union(BufferUsages::COPY_DST)
    .union(BufferUsages::COPY_SRC);

impl Pool {
    fn new(gpu: &Gpu, name: &'static str, element_bytes: u64) -> Result<Self, GpuError> {
        let buffer = create(gpu, name, USAGE, 1024 * element_bytes)?;
        let capacity = (buffer.size() / element_bytes) as u32;
        Ok(Self {
            name,
            element_bytes,
            buffer,
            free: vec![(0, capacity)],
            capacity,
        })
    }

    fn take(&mut self, count: u32) -> Option<u32> {
        let at = self.free.iter().position(|(_, length)| *length >= count)?;
        let (first, length) = self.free[at];
        if length == count {
            self.free.remove(at);
        } else {
            self.free[at] = (first + count, length - count);
        }
        Some(first)
    }

    fn give_back(&mut self, first: u32, count: u32) {
        let at = self.free.partition_point(|(start, _)| *start < first);
        self.free.insert(at, (first, count));
        if at + 1 < self.free.len() && first + count == self.free[at + 1].0 {
            self.free[at].1 += self.free[at + 1].1;
            self.free.remove(at + 1);
        }
        if at > 0 && self.free[at - 1].0 + self.free[at - 1].1 == first {
            self.free[at - 1].1 += self.free[at].1;
            self.free.remove(at);
        }
    }

    /// Makes room for `count` more elements in a row, or for as many as the device allows; what is
    /// there stays where it is.
    fn grow(&mut self, gpu: &Gpu, count: u32) -> Result<(), GpuError> {
        let most = most_bytes(gpu) / self.element_bytes;
        let elements = (u64::from(self.capacity) + u64::from(count)).min(most);
        if elements <= u64::from(self.capacity) {
            return Ok(());
        }
        let buffer = create(gpu, self.name, USAGE, elements * self.element_bytes)?;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &buffer, 0, self.buffer.size());
        gpu.queue.submit([encoder.finish()]);
        let capacity = (buffer.size() / self.element_bytes).min(most) as u32;
        let former = std::mem::replace(&mut self.capacity, capacity);
        self.buffer = buffer;
        self.give_back(former, capacity - former);
        Ok(())
    }
}

/// Where the points and normals of a cloud are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// Word of the first point's x.
    pub(crate) first_point: u32,
    /// Normals before the first one.
    pub(crate) first_normal: u32,
    /// Words from a point to the next one. The radius, where points have their own, is the fourth.
    pub(crate) point_step: u32,
}

impl Place {
    /// Of points that have x, y, z and radius one after the other.
    pub(crate) fn interleaved(first_point: u32) -> Self {
        Self {
            first_point,
            first_normal: 0,
            point_step: 4,
        }
    }
}

#[derive(Debug)]
struct Slot {
    /// First word, and number of words.
    points: (u32, u32),
    /// First of the normals, and their number.
    normals: Option<(u32, u32)>,
    /// Which blocks of points are there.
    blocks: Vec<bool>,
    used: u64,
}

impl Slot {
    /// First word of the points, and first normal.
    fn firsts(&self) -> (u32, u32) {
        (self.points.0, self.normals.map_or(0, |(first, _)| first))
    }
}

/// The clouds on the device.
#[derive(Debug)]
pub(crate) struct Resident {
    points: Pool,
    normals: Pool,
    slots: HashMap<u64, Slot>,
    batch: u64,
    staging: Vec<f32>,
}

impl Resident {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self {
            points: Pool::new(gpu, "points", 4)?,
            normals: Pool::new(gpu, "normals", 12)?,
            slots: HashMap::new(),
            batch: 0,
            staging: Vec::new(),
        })
    }

    /// Begins a batch: what it does not use may give its place to others later.
    pub(crate) fn begin(&mut self) {
        self.batch += 1;
    }

    pub(crate) fn points(&self) -> &wgpu::Buffer {
        &self.points.buffer
    }

    pub(crate) fn normals(&self) -> &wgpu::Buffer {
        &self.normals.buffer
    }

    /// Where the points of a cloud are. There is room for all; those of `blocks`, in ascending order, are uploaded if they are
    /// not there. Each point is its x, y and z, followed by its radius if they are not equal.
    pub(crate) fn place(
        &mut self,
        gpu: &Gpu,
        cloud: &PointCloud,
        blocks: impl Iterator<Item = usize>,
    ) -> Result<Place, GpuError> {
        let id = cloud.content_id();
        let count = numbered("points", cloud.len() as u64)?;
        let radii = match cloud.radii() {
            Radii::Global(_) => None,
            Radii::PerPoint(radii) => Some(&radii[..]),
        };
        let step = 3 + u32::from(radii.is_some());
        let words = numbered("points", u64::from(step) * u64::from(count))?;
        let normals = cloud.normals();
        let (first_point, first_normal) = self.reserve(gpu, id, words, normals.map(|_| count))?;
        for points in self.missing(id, cloud.len(), blocks) {
            if let Some(normals) = normals {
                self.staging.clear();
                let some = normals[points.clone()].iter();
                self.staging.extend(some.flat_map(|n| n.to_array()));
                let at = 12 * (u64::from(first_normal) + points.start as u64);
                gpu.write(
                    &self.normals.buffer,
                    at,
                    bytemuck::cast_slice(&self.staging),
                );
            }
            let some = &cloud.points()[points.clone()];
            let word = u64::from(first_point) + u64::from(step) * points.start as u64;
            let bytes = match radii {
                None => bytemuck::cast_slice(some),
                Some(radii) => {
                    self.staging.clear();
                    let with_radii = some.iter().zip(&radii[points]);
                    let words = with_radii.flat_map(|(p, &radius)| [p.x, p.y, p.z, radius]);
                    self.staging.extend(words);
                    bytemuck::cast_slice(&self.staging)
                }
            };
            gpu.write(&self.points.buffer, 4 * word, bytes);
        }
        Ok(Place {
            first_point,
            first_normal,
            point_step: step,
        })
    }

    /// Points of those of the `blocks` of cloud `id` that are not on the device, blocks in a row together. They count as there
    /// from now on.
    fn missing(
        &mut self,
        id: u64,
        len: usize,
        blocks: impl Iterator<Item = usize>,
    ) -> Vec<Range<usize>> {
        let mut missing: Vec<Range<usize>> = Vec::new();
        let Some(slot) = self.slots.get_mut(&id) else {
            return missing;
        };
        slot.blocks.resize(len.div_ceil(BLOCK), false);
        for block in blocks {
            if std::mem::replace(&mut slot.blocks[block], true) {
                continue;
            }
            let points = block * BLOCK..((block + 1) * BLOCK).min(len);
            match missing.last_mut() {
                Some(last) if last.end == points.start => last.end = points.end,
                _ => missing.push(points),
            }
        }
        missing
    }

    /// Room for the points of cloud `id`, of so many words, and for its normals if it has any: the first word and the
    /// first normal, which are there or will be written.
    pub(crate) fn reserve(
        &mut self,
        gpu: &Gpu,
        id: u64,
        words: u32,
        normals: Option<u32>,
    ) -> Result<(u32, u32), GpuError> {
        let known = self.slots.get_mut(&id);
        if let Some(slot) = known.filter(|slot| slot.points.1 == words) {
            slot.used = self.batch;
            return Ok(slot.firsts());
        }
        self.forget(id);
        let first = self.room(gpu, words, |all| &mut all.points)?;
        let normals = match normals {
            Some(count) => match self.room(gpu, count, |all| &mut all.normals) {
                Ok(first) => Some((first, count)),
                Err(error) => {
                    self.points.give_back(first, words);
                    return Err(error);
                }
            },
            None => None,
        };
        let slot = Slot {
            points: (first, words),
            normals,
            blocks: Vec::new(),
            used: self.batch,
        };
        let firsts = slot.firsts();
        self.slots.insert(id, slot);
        Ok(firsts)
    }

    /// A range of `count` elements: free, else of clouds that are no longer used, else new.
    fn room(
        &mut self,
        gpu: &Gpu,
        count: u32,
        pool: impl Fn(&mut Self) -> &mut Pool,
    ) -> Result<u32, GpuError> {
        if let Some(first) = pool(self).take(count) {
            return Ok(first);
        }
        self.forget_unused(KEPT_BATCHES);
        if let Some(first) = pool(self).take(count) {
            return Ok(first);
        }
        pool(self).grow(gpu, count)?;
        if let Some(first) = pool(self).take(count) {
            return Ok(first);
        }
        // The device has no more: only this batch's clouds stay.
        self.forget_unused(1);
        let pool = pool(self);
        pool.take(count).ok_or(GpuError::TooLarge {
            buffer: pool.name,
            needed: u64::from(count) * pool.element_bytes,
            allowed: pool.buffer.size(),
        })
    }

    fn forget(&mut self, id: u64) {
        if let Some(slot) = self.slots.remove(&id) {
            self.points.give_back(slot.points.0, slot.points.1);
            if let Some((first, count)) = slot.normals {
                self.normals.give_back(first, count);
            }
        }
    }

    /// Forgets the clouds that none of the last `kept` batches used, the present one included.
    fn forget_unused(&mut self, kept: u64) {
        let is_unused = |slot: &Slot| slot.used + kept <= self.batch;
        let unused = self.slots.iter().filter(|(_, slot)| is_unused(slot));
        let unused: Vec<u64> = unused.map(|(id, _)| *id).collect();
        unused.into_iter().for_each(|id| self.forget(id));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use tldi::glamx::Vec3;

    /// A cloud that has no room beside those of earlier batches takes their place; one that has none
    /// beside those of its own batch is refused, and what is there stays.
    #[test]
    fn clouds_of_earlier_batches_give_their_place() {
        // 5461 points.
        let Some(gpu) = testing::open_small(1 << 16) else {
            return;
        };
        let cloud = |points: usize| {
            let positions: Vec<Vec3> = (0..points).map(|i| Vec3::X * i as f32).collect();
            let built = PointCloud::builder(positions).radius(1.0).build();
            built.expect("the points are valid")
        };
        let (first, second, third) = (cloud(3000), cloud(3500), cloud(2000));
        let mut resident = Resident::new(&gpu).expect("there is room");
        let place = |resident: &mut Resident, cloud: &PointCloud| {
            resident.place(&gpu, cloud, 0..cloud.blocks().len())
        };
        resident.begin();
        place(&mut resident, &first).expect("there is room");
        resident.begin();
        let there = place(&mut resident, &second);
        let there = there.expect("the first cloud is not used any more");
        let refused = place(&mut resident, &third);
        assert!(
            matches!(refused, Err(GpuError::TooLarge { .. })),
            "{refused:?}"
        );
        assert_eq!(place(&mut resident, &second), Ok(there));
        gpu.check().expect("nothing failed");
    }
}
