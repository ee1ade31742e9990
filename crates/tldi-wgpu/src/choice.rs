//! Which backend compares.

use crate::{AdapterChoice, AutoBackend, Gpu, GpuError, WgpuBackend};
use std::fmt;
use std::str::FromStr;
use tldi::{Backend, CpuBackend};

/// Name of the environment variable that decides where [`BackendChoice::Auto`] is asked for.
pub const BACKEND_VARIABLE: &str = "TLDI_BACKEND";

/// Which backend compares: of a command line, or of the variable `TLDI_BACKEND`.
///
/// ```
/// use tldi_wgpu::BackendChoice;
/// assert_eq!("cpu".parse(), Ok(BackendChoice::Cpu));
/// assert!("fast".parse::<BackendChoice>().is_err());
/// let backend = BackendChoice::Cpu.open()?;
/// assert_eq!(backend.name(), "cpu");
/// # Ok::<(), tldi_wgpu::GpuError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum BackendChoice {
    /// What `TLDI_BACKEND` says; without it, a hardware GPU where there is one and the batch is
    /// large enough to gain from it, else the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// A GPU, be it one that a software driver imitates.
    Gpu,
}

impl BackendChoice {
    /// The backend.
    ///
    /// # Errors
    /// Where a GPU was asked for and cannot be used; [`GpuError::UnknownBackend`] where
    /// `TLDI_BACKEND` is none of `auto`, `cpu`, `gpu`.
    pub fn open(self) -> Result<Box<dyn Backend>, GpuError> {
        let choice = match (self, std::env::var(BACKEND_VARIABLE)) {
            (Self::Auto, Ok(text)) => text.parse()?,
            (choice, _) => choice,
        };
        Ok(match choice {
            Self::Auto => Box::new(AutoBackend::new()),
            Self::Cpu => Box::new(CpuBackend::new()),
            Self::Gpu => Box::new(WgpuBackend::new(Gpu::of_process(AdapterChoice::Any)?)?),
        })
    }
}

impl FromStr for BackendChoice {
    type Err = GpuError;

    fn from_str(text: &str) -> Result<Self, GpuError> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu),
            _ => Err(GpuError::UnknownBackend(text.to_owned())),
        }
    }
}

impl fmt::Display for BackendChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        })
    }
}
