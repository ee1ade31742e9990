//! A batch in as many parts as the device has room for, each grown and redone where a buffer was
//! too small.

use super::WgpuBackend;
use crate::layout::lives_on_device;
use crate::{GpuError, Traffic};
use tldi::{Backend, BackendError, PairQuery, PairResult};

/// Times that a part is redone with larger buffers before that counts as a fault: every time at
/// least one of seven has doubled.
const MOST_TRIES: usize = 64;

/// Why a part was not compared.
enum Stop {
    /// It needs larger buffers than the device allows.
    TooLarge,
    Failed(BackendError),
}

impl From<GpuError> for Stop {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::TooLarge { .. } => Self::TooLarge,
            error => Self::Failed(error.into()),
        }
    }
}

impl From<BackendError> for Stop {
    fn from(error: BackendError) -> Self {
        Self::Failed(error)
    }
}

impl WgpuBackend {
    /// Compares the selected pairs on the device, in halves where it has no room for all, and the
    /// others on the CPU meanwhile.
    pub(super) fn compare_on_device(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut [PairResult],
        left_to_cpu: &mut Vec<usize>,
    ) -> Result<(), BackendError> {
        self.gpu.check()?;
        self.pairs_on_cpu = 0;
        self.traffic = Traffic::default();
        let mut parts = vec![self.upload.pairs_of.clone()];
        while let Some(part) = parts.pop() {
            if part.is_empty() {
                continue;
            }
            if part != self.upload.pairs_of {
                self.upload.select(batch, part.iter().copied());
            }
            match self.compare_part(batch, results, left_to_cpu) {
                Ok(()) => {}
                Err(Stop::Failed(error)) => return Err(error),
                Err(Stop::TooLarge) if part.len() > 1 => {
                    let (first, second) = part.split_at(part.len() / 2);
                    parts.extend([second.to_vec(), first.to_vec()]);
                }
                Err(Stop::TooLarge) => {
                    left_to_cpu.extend(&part);
                    let reason = "it needs larger buffers than the device allows, and points that live \
                                  on the device cannot be left to the CPU: use larger pixels or fewer points";
                    check_left(batch, left_to_cpu, reason)?;
                }
            }
        }
        self.traffic.uploaded = self.gpu.take_uploaded();
        self.compare_on_cpu(batch, results, left_to_cpu)
    }

    /// Compares the pairs of the present selection on the device.
    fn compare_part(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut [PairResult],
        left_to_cpu: &mut Vec<usize>,
    ) -> Result<(), Stop> {
        let (resident, sources) = (&mut self.resident, &mut self.sources);
        self.upload.place(batch, &self.gpu, resident, sources)?;
        let predicted = self.upload.predicted.min(&self.most);
        self.capacities = self.capacities.grown(&predicted, &self.most)?;
        let mut fitting = None;
        for _ in 0..MOST_TRIES {
            if let Err(error) = self.submit() {
                if matches!(error, GpuError::TooLarge { .. }) {
                    match fitting {
                        Some(former) => self.capacities = former,
                        // What earlier batches needed may take the room that this one needs.
                        None if self.capacities != self.least => {
                            self.capacities = self.least;
                            continue;
                        }
                        None => {}
                    }
                }
                return Err(error.into());
            }
            fitting = Some(self.capacities);
            self.compare_on_cpu(batch, results, left_to_cpu)?;
            let needed = self.read_back(batch, results, left_to_cpu)?;
            let reason = "a pixel has more than 1024 fragments, and points that live on the device \
                          cannot be left to the CPU: use smaller pixels or fewer points";
            check_left(batch, left_to_cpu, reason)?;
            if self.capacities.holds(&needed) {
                return Ok(());
            }
            self.capacities = self.capacities.grown(&needed, &self.most)?;
            self.traffic.redos += 1;
        }
        Err(self
            .gpu
            .failed("its counters never settled".to_owned())
            .into())
    }

    /// Compares what is left to the CPU, and leaves nothing.
    fn compare_on_cpu(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut [PairResult],
        left_to_cpu: &mut Vec<usize>,
    ) -> Result<(), BackendError> {
        self.pairs_on_cpu += left_to_cpu.len();
        let queries: Vec<PairQuery> = left_to_cpu.iter().map(|&pair| batch[pair]).collect();
        let mut compared = Vec::new();
        self.cpu.compare(&queries, &mut compared)?;
        for (pair, result) in left_to_cpu.drain(..).zip(compared) {
            results[pair] = result;
        }
        Ok(())
    }
}

/// Refuses to leave points to the CPU that only the device has.
fn check_left(
    batch: &[PairQuery<'_>],
    left_to_cpu: &[usize],
    reason: &'static str,
) -> Result<(), BackendError> {
    match (left_to_cpu.iter()).find(|&&pair| lives_on_device(&batch[pair])) {
        Some(&pair) => Err(BackendError::Unsupported { pair, reason }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counters::Counters;
    use crate::testing;
    use tldi::glamx::{Pose3, Vec3};
    use tldi::{Params, PointCloud, Surface, View};

    const R: f32 = 0.05;

    /// Flat sheets of `edge` points a side, one above the other by the shares of `R`.
    fn sheet(edge: usize) -> PointCloud<'static> {
        let position = |i: usize| Vec3::new((i % edge) as f32, 0.0, (i / edge) as f32) * R;
        let positions: Vec<Vec3> = (0..edge * edge).map(position).collect();
        let built = PointCloud::builder(positions).radius(R).build();
        built.expect("the points are valid")
    }

    fn queries<'a>(sheet: &'a PointCloud<'static>, pairs: usize) -> Vec<PairQuery<'a>> {
        let query = |k: usize| PairQuery {
            a: Surface::Cloud(sheet),
            b: Surface::Cloud(sheet),
            a_from_b: Pose3::translation(0.0, R * (k + 1) as f32 / (pairs + 1) as f32, 0.0),
            view: View::aimed(),
            params: Params::for_radius(R),
        };
        (0..pairs).map(query).collect()
    }

    fn compared(backend: &mut WgpuBackend, batch: &[PairQuery<'_>]) -> Vec<PairResult> {
        let mut results = Vec::new();
        let outcome = backend.compare(batch, &mut results);
        outcome.expect("nothing fails");
        results
    }

    /// A batch with more splats than fragments can number is compared in parts, with the same
    /// results; a pair that alone has more is the CPU's, and the next batch the device's again.
    #[test]
    fn batches_with_too_many_splats_are_halved() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
        let (small, large) = (sheet(40), sheet(80));
        let mut batch = queries(&small, 7);
        let whole = compared(&mut backend, &batch);
        let of_batch = backend.last.splats;
        // As if a fragment had room for the numbers of two pairs' splats only.
        let most = Counters {
            splats: of_batch / 3,
            ..backend.most
        };
        backend.most = most;
        backend.least = backend.least.min(&most);
        backend.capacities = backend.least;
        assert_eq!(whole, compared(&mut backend, &batch));
        assert_eq!(backend.pairs_on_cpu(), 0);
        assert!(backend.capacities.splats <= most.splats);

        batch[3] = queries(&large, 1)[0];
        let results = compared(&mut backend, &batch);
        assert_eq!(backend.pairs_on_cpu(), 1);
        let mut on_cpu = Vec::new();
        let outcome = tldi::CpuBackend::new().compare(&batch[3..4], &mut on_cpu);
        outcome.expect("the CPU takes it");
        assert_eq!(results[3], on_cpu[0]);
        assert_eq!((&results[..3], &results[4..]), (&whole[..3], &whole[4..]));

        batch.remove(3);
        compared(&mut backend, &batch);
        assert_eq!(backend.pairs_on_cpu(), 0);
    }
    /// What earlier batches needed does not keep a batch from the device.
    #[test]
    fn a_batch_does_not_suffer_from_earlier_ones() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
        let small = sheet(40);
        let batch = queries(&small, 2);
        let cold = compared(&mut backend, &batch);
        // Tiles and pixels share a buffer: each has room in it, both have not.
        backend.capacities = Counters {
            tiles: backend.most.tiles,
            pixels: backend.most.pixels,
            ..backend.least
        };
        assert_eq!(cold, compared(&mut backend, &batch));
        assert_eq!(backend.pairs_on_cpu(), 0);
    }

    /// A pair that is too large, and whose points only the device has, is refused by its place in the
    /// batch, and the device goes on; so is one that neither takes.
    #[test]
    fn points_of_the_device_are_not_left_to_the_cpu() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu.clone()).expect("the stages fit");
        let (small, large) = (sheet(40), sheet(80));
        let [x, y, z] = large.coordinates();
        let points: Vec<[f32; 4]> = (0..large.len()).map(|i| [x[i], y[i], z[i], R]).collect();
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let bytes: &[u8] = bytemuck::cast_slice(&points);
        let buffer = crate::buffers::create(&gpu, "points", usage, bytes.len() as u64);
        let buffer = buffer.expect("there is room");
        gpu.queue.write_buffer(&buffer, 0, bytes);
        let told = tldi::DeviceCloud {
            id: 0,
            len: points.len(),
            bounds: large.bounds(),
            mean_radius: R,
            max_radius: R,
        };
        let on_device = backend.adopt(&buffer, told).expect("it is valid");
        let mut batch = queries(&small, 3);
        batch[2] = PairQuery {
            b: Surface::Device(&on_device),
            ..queries(&large, 1)[0]
        };
        compared(&mut backend, &batch);
        assert_eq!(backend.pairs_on_cpu(), 0);
        let whole = compared(&mut backend, &batch[..2]);
        let of_two = backend.last.splats;

        let refused = |backend: &mut WgpuBackend, batch: &[PairQuery<'_>]| match backend
            .compare(batch, &mut Vec::new())
        {
            Err(BackendError::Unsupported { pair, reason }) => (pair, reason),
            other => panic!("{other:?}"),
        };
        let neither = PairQuery {
            params: Params::paper(R),
            ..batch[2]
        };
        assert_eq!(refused(&mut backend, &[batch[0], neither]).0, 1);
        // Half of what the large pair has.
        backend.most.splats = of_two;
        backend.least = backend.least.min(&backend.most);
        backend.capacities = backend.least;
        let (pair, reason) = refused(&mut backend, &batch);
        assert_eq!(pair, 2);
        assert!(reason.contains("larger buffers"), "{reason}");
        assert_eq!(whole, compared(&mut backend, &batch[..2]));
    }
}
