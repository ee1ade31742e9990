//! What can go wrong with a GPU.

use thiserror::Error;
use tldi::BackendError;

/// Why there is no GPU, or why it did not finish a batch.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No adapter of the kind that was asked for.
    #[error(
        "no GPU: {reason}; install its driver, or use the CPU backend (`TLDI_BACKEND=gpu` takes a software driver too)"
    )]
    NoAdapter {
        /// What the system says.
        reason: String,
    },
    /// A browser lets nobody wait.
    #[error(
        "a browser cannot wait for the GPU: open it with `Gpu::open_async`, and compare with `WgpuBackend::begin` and \
         `.await`"
    )]
    CannotWait,
    /// The adapter's driver gives no device.
    #[error("the GPU `{adapter}` cannot be used: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// What its driver says.
        reason: String,
    },
    /// The device failed or was lost. Nothing that was given to it comes back.
    #[error("the GPU `{adapter}` failed: {reason}")]
    Failed {
        /// Name of the adapter.
        adapter: String,
        /// What its driver says.
        reason: String,
    },
    /// The device did not finish its work in time.
    #[error(
        "the GPU `{adapter}` did not finish its work within {seconds} s: it hangs or another program holds it; \
         restart the program, update the driver, or use the CPU backend (`TLDI_BACKEND=cpu`)"
    )]
    TimedOut {
        /// Name of the adapter.
        adapter: String,
        /// How long it was waited for.
        seconds: u64,
    },
    /// What came back from the device makes no sense.
    #[error(
        "the GPU `{adapter}` gave an answer that makes no sense: {reason}; update its driver, or use the CPU \
         backend (`TLDI_BACKEND=cpu`)"
    )]
    BadAnswer {
        /// Name of the adapter.
        adapter: String,
        /// What is wrong.
        reason: String,
    },
    /// The device's answers are not the CPU's.
    #[error(
        "the GPU `{adapter}` is not used, its answers are not those of the CPU: {reason}; update its driver"
    )]
    Disagrees {
        /// Name of the adapter.
        adapter: String,
        /// Where they differ.
        reason: String,
    },
    /// The variable `TLDI_BACKEND`, or an option, names no backend.
    #[error("`{0}` is no backend: write auto, cpu or gpu")]
    UnknownBackend(String),
    /// A cloud on the device, or a depth image, cannot be used.
    #[error("{reason}")]
    BadSource {
        /// What is wrong, and what is needed.
        reason: String,
    },
    /// Whether the GPU gains could not be measured.
    #[error("the GPU could not be measured: {reason}")]
    NotMeasured {
        /// What went wrong.
        reason: String,
    },
    /// A buffer would be larger than the device, or the caller's budget, allows.
    #[error(
        "the GPU's buffer `{buffer}` needs {needed} bytes, {allowed} are allowed: use larger pixels, smaller clouds or fewer pairs a step"
    )]
    TooLarge {
        /// What it holds.
        buffer: &'static str,
        /// Bytes.
        needed: u64,
        /// Bytes.
        allowed: u64,
    },
    /// The device has no memory for a buffer that it allows.
    #[error(
        "the GPU has no memory for {needed} bytes of its buffer `{buffer}`: use larger pixels, smaller clouds or fewer pairs a step"
    )]
    OutOfMemory {
        /// What it holds.
        buffer: &'static str,
        /// Bytes.
        needed: u64,
    },
}

impl From<GpuError> for BackendError {
    fn from(error: GpuError) -> Self {
        Self::Device(error.to_string())
    }
}

/// `count` words, or elements, as the stages number them.
///
/// # Errors
/// [`GpuError::TooLarge`] where a word cannot.
pub(crate) fn numbered(buffer: &'static str, count: u64) -> Result<u32, GpuError> {
    u32::try_from(count).map_err(|_| GpuError::TooLarge {
        buffer,
        needed: count.saturating_mul(4),
        allowed: 4 * u64::from(u32::MAX),
    })
}
