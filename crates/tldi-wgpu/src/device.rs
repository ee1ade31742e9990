//! The device: chosen once, shared with whoever brings their own.

use crate::GpuError;
use crate::pipelines::{Pipeline, pipelines};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;
use tldi::plan::stage_constants;
use wgpu::SubmissionIndex;

/// How long the device may take for what it was given. Batches take milliseconds; a driver that
/// imitates a GPU takes seconds for large ones.
const PATIENCE: Duration = Duration::from_secs(60);

/// Which adapters will do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum AdapterChoice {
    /// Hardware only. A software adapter is slower than the CPU backend.
    #[default]
    Hardware,
    /// The best there is, be it a driver that computes on the CPU: for tests.
    Any,
}

/// A device and its queue, and what went wrong with them.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    adapter: Arc<str>,
    failure: Arc<Mutex<Option<GpuError>>>,
    pub(crate) patience: Duration,
    pipelines: Arc<OnceLock<Vec<Pipeline>>>,
    /// Bytes that were written since they were last asked for.
    uploaded: Arc<AtomicU64>,
}

impl Gpu {
    /// The device of this process: opened when it is first asked for, and shared.
    ///
    /// # Errors
    /// Those of [`open`](Self::open), which are kept as well.
    pub fn of_process(choice: AdapterChoice) -> Result<Self, GpuError> {
        static HARDWARE: OnceLock<Result<Gpu, GpuError>> = OnceLock::new();
        static ANY: OnceLock<Result<Gpu, GpuError>> = OnceLock::new();
        let opened = match choice {
            AdapterChoice::Hardware => &HARDWARE,
            AdapterChoice::Any => &ANY,
        };
        opened.get_or_init(|| Self::open(choice)).clone()
    }

    /// Opens the best adapter. Waits for it, which a browser cannot: see [`open_async`](Self::open_async).
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] where there is none of the kind asked for, [`GpuError::NoDevice`]
    /// where its driver refuses, [`GpuError::CannotWait`] in a browser.
    pub fn open(choice: AdapterChoice) -> Result<Self, GpuError> {
        if cfg!(target_arch = "wasm32") {
            return Err(GpuError::CannotWait);
        }
        pollster::block_on(Self::open_async(choice))
    }

    /// Opens the best adapter.
    ///
    /// ```
    /// use tldi_wgpu::{AdapterChoice, Gpu};
    /// let opened = pollster::block_on(Gpu::open_async(AdapterChoice::Any));
    /// assert!(opened.is_ok() || opened.is_err_and(|error| error.to_string().contains("GPU")));
    /// ```
    ///
    /// # Errors
    /// Those of [`open`](Self::open).
    pub async fn open_async(choice: AdapterChoice) -> Result<Self, GpuError> {
        // Where a page has no WebGPU, `wgpu` panics.
        if cfg!(target_arch = "wasm32") && !wgpu::util::is_browser_webgpu_supported().await {
            let reason = "there is no WebGPU here".to_owned();
            return Err(GpuError::NoAdapter { reason });
        }
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        // Not GL: its drivers miscompiled loops without an error.
        descriptor.backends = wgpu::Backends::VULKAN
            | wgpu::Backends::METAL
            | wgpu::Backends::DX12
            | wgpu::Backends::BROWSER_WEBGPU;
        // Checking sizes that the device computes takes a dispatch for each. Our stages bound theirs by `MAX_GROUPS`.
        (descriptor.flags).remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter =
            (instance.request_adapter(&options).await).map_err(|source| GpuError::NoAdapter {
                reason: source.to_string(),
            })?;
        let info = adapter.get_info();
        if choice == AdapterChoice::Hardware && info.device_type == wgpu::DeviceType::Cpu {
            return Err(GpuError::NoAdapter {
                reason: format!("`{}` computes on the CPU", info.name),
            });
        }
        let offered = adapter.limits();
        let opened = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("tldi"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            // More than the default only where it is offered: larger clouds.
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
                max_buffer_size: offered.max_buffer_size,
                ..wgpu::Limits::default()
            },
            ..Default::default()
        });
        let (device, queue) = opened.await.map_err(|source| GpuError::NoDevice {
            adapter: info.name.clone(),
            reason: source.to_string(),
        })?;
        Ok(Self::shared(device, queue))
    }

    /// Takes a device that the caller has: clouds that already live in its buffers need no copy to
    /// the host. Errors of the device that nothing else catches are handled here from now on: call it once for a device and
    /// clone the [`Gpu`] for several backends, since a second call takes the errors that the first waits for.
    pub fn shared(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let adapter: Arc<str> = device.adapter_info().name.into();
        let failure = Arc::new(Mutex::new(None));
        let noting = |what: Arc<Mutex<Option<GpuError>>>| {
            let adapter = Arc::clone(&adapter);
            move |reason: String| {
                let adapter = adapter.to_string();
                note(&what, GpuError::Failed { adapter, reason });
            }
        };
        let note_error = noting(Arc::clone(&failure));
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            note_error(error.to_string());
        }));
        let note_loss = noting(Arc::clone(&failure));
        device.set_device_lost_callback(move |reason, message| {
            note_loss(format!("the device was lost ({reason:?}): {message}"));
        });
        Self {
            device,
            queue,
            adapter,
            failure,
            patience: PATIENCE,
            pipelines: Arc::default(),
            uploaded: Arc::default(),
        }
    }

    /// Name of the adapter.
    pub fn adapter(&self) -> &str {
        &self.adapter
    }

    /// The device.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// The stages, compiled when they are first asked for.
    pub(crate) fn pipelines(&self) -> &[Pipeline] {
        self.pipelines
            .get_or_init(|| pipelines(self, &stage_constants()))
    }

    /// Sets the stages, before they are asked for.
    #[cfg(test)]
    pub(crate) fn set_pipelines(&self, stages: Vec<Pipeline>) {
        self.pipelines.set(stages).expect("they were not asked for");
    }

    /// The same device, whose uploads are counted apart.
    pub(crate) fn with_own_tally(self) -> Self {
        Self {
            uploaded: Arc::default(),
            ..self
        }
    }

    /// Writes `bytes` into a buffer, from byte `offset` on.
    pub(crate) fn write(&self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        self.uploaded
            .fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.queue.write_buffer(buffer, offset, bytes);
    }

    /// Bytes that were written since this was last asked.
    pub(crate) fn take_uploaded(&self) -> u64 {
        self.uploaded.swap(0, Ordering::Relaxed)
    }

    /// An error that says what went wrong on this device.
    pub(crate) fn failed(&self, reason: String) -> GpuError {
        GpuError::Failed {
            adapter: self.adapter.to_string(),
            reason,
        }
    }

    /// What went wrong since the device was opened.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        match &*failure {
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// Lets the device tell what is done, without waiting. In a browser it tells by itself.
    pub(crate) fn poll(&self) -> Result<(), GpuError> {
        let outcome = self.device.poll(wgpu::PollType::Poll);
        outcome.map_err(|error| self.failed(error.to_string()))?;
        self.check()
    }

    /// Waits until a submission is done, or without one all that was submitted, by whoever shares the device.
    ///
    /// # Errors
    /// [`GpuError::TimedOut`] where that takes too long; the device is not used any more.
    /// [`GpuError::CannotWait`] in a browser.
    pub(crate) fn wait(&self, submission: Option<SubmissionIndex>) -> Result<(), GpuError> {
        if cfg!(target_arch = "wasm32") {
            return Err(GpuError::CannotWait);
        }
        let outcome = self.device.poll(wgpu::PollType::Wait {
            submission_index: submission,
            timeout: Some(self.patience),
        });
        match outcome {
            Ok(_) => self.check(),
            Err(wgpu::PollError::Timeout) => Err(self.give_up()),
            Err(error) => Err(self.failed(error.to_string())),
        }
    }

    /// Notes that the device did not answer in time.
    pub(crate) fn give_up(&self) -> GpuError {
        let error = GpuError::TimedOut {
            adapter: self.adapter.to_string(),
            seconds: self.patience.as_secs(),
        };
        note(&self.failure, error.clone());
        // To drop a queue is to wait until it is idle, however long that takes.
        std::mem::forget(self.clone());
        error
    }
}

/// The first failure stays.
fn note(failure: &Mutex<Option<GpuError>>, error: GpuError) {
    let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
    failure.get_or_insert(error);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::WgpuBackend;
    use crate::buffers::create;

    /// A device that takes longer than it may is given up, with an error that says so, and does not
    /// hold up whoever drops it.
    #[test]
    fn a_device_that_takes_too_long_is_given_up() {
        let Some(mut gpu) = crate::testing::open() else {
            return;
        };
        gpu.wait(None).expect("it is idle");
        gpu.patience = Duration::ZERO;
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        // Copies of 16 GB take longer than no time.
        let [from, to] = [(); 2].map(|()| create(&gpu, "copied", usage, 1 << 26).expect("room"));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for _ in 0..256 {
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, 1 << 26);
        }
        gpu.queue.submit([encoder.finish()]);
        let error = gpu.wait(None).expect_err("it is not done");
        assert!(matches!(error, GpuError::TimedOut { .. }), "{error}");
        assert!(error.to_string().contains("TLDI_BACKEND=cpu"), "{error}");
        // From now on.
        assert_eq!(gpu.check(), Err(error.clone()));
        assert_eq!(WgpuBackend::new(gpu).err(), Some(error));
    }
}
