//! Options that every binary has.

use std::path::PathBuf;
use std::str::FromStr;
use thiserror::Error;
use tldi::glamx::Vec3;

/// Options that every binary has; flatten into the binary's own arguments.
#[derive(clap::Args, Clone, Debug)]
pub struct Common {
    /// Write the results to this file as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Where the work is done; auto takes the GPU if there is one, else the CPU
    #[arg(long, value_enum, default_value_t = BackendChoice::Auto)]
    pub backend: BackendChoice,
    /// Seed of everything random: equal seeds give equal results
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Where the work is done.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendChoice {
    /// The best that there is.
    Auto,
    /// The CPU backend.
    Cpu,
    /// A GPU backend.
    Gpu,
}

/// A backend was asked for that this build does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the GPU backend is not built yet: use --backend cpu (or leave the option out)")]
pub struct NoGpuBackend;

impl BackendChoice {
    /// Turns the choice into a backend that exists.
    ///
    /// # Errors
    /// [`NoGpuBackend`] if a GPU was asked for.
    pub fn require_available(self) -> Result<(), NoGpuBackend> {
        match self {
            Self::Auto | Self::Cpu => Ok(()),
            Self::Gpu => Err(NoGpuBackend),
        }
    }
}

/// The up direction of a scan: given, or to be found in the scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UpChoice {
    /// Find it with [`detect_up`](crate::up::detect_up).
    Auto,
    /// This direction (unit length).
    Given(Vec3),
}

/// An up direction that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "`{0}` is not an up direction: write auto, or three numbers that are not all zero, as in 0,0,1"
)]
pub struct BadUp(String);

impl FromStr for UpChoice {
    type Err = BadUp;

    fn from_str(text: &str) -> Result<Self, BadUp> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let bad = || BadUp(text.to_owned());
        let numbers: Vec<f32> = text
            .split(',')
            .map(|part| part.trim().parse().map_err(|_| bad()))
            .collect::<Result<_, _>>()?;
        let [x, y, z] = numbers[..] else {
            return Err(bad());
        };
        Vec3::new(x, y, z)
            .try_normalize()
            .map(Self::Given)
            .ok_or_else(bad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_read_and_normalised() {
        assert_eq!("auto".parse(), Ok(UpChoice::Auto));
        assert_eq!(
            "0, -2,0".parse(),
            Ok(UpChoice::Given(Vec3::new(0.0, -1.0, 0.0)))
        );
        for bad in ["", "z", "1,2", "1,2,3,4", "0,0,0", "nan,0,1", "inf,0,0"] {
            assert!(bad.parse::<UpChoice>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_missing_gpu_is_an_error_that_says_so() {
        assert_eq!(BackendChoice::Auto.require_available(), Ok(()));
        let error = BackendChoice::Gpu.require_available().unwrap_err();
        assert!(error.to_string().contains("not built"), "{error}");
    }
}
