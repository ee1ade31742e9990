//! Options that every binary has.

use crate::output;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;
use thiserror::Error;
use tldi::glamx::{DPose3, DQuat, DVec3, EulerRot, Pose3, Vec3};
use tldi_wgpu::BackendChoice;

/// How a binary ends: with 0, or with 1 and what went wrong on the standard error.
pub fn ended(outcome: anyhow::Result<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Options that every binary has; flatten into the binary's own arguments.
#[derive(clap::Args, Clone, Debug)]
pub struct Common {
    /// Write the results to this file as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Where clouds are compared; auto takes a hardware GPU where it gains, else the CPU (or what the
    /// variable TLDI_BACKEND says)
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t = BackendChoice::Auto)]
    pub backend: BackendChoice,
    /// Seed of everything random: equal seeds give equal results
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Draw nothing: pictures take longer than most simulations
    #[arg(long)]
    pub no_pictures: bool,
}

impl Common {
    /// Makes sure that the results can be written, before they are computed.
    ///
    /// # Errors
    /// Those of the file system, with the path.
    pub fn check_outputs(&self) -> anyhow::Result<()> {
        self.json.as_deref().map_or(Ok(()), output::check_writable)
    }
}

/// A finite number above 0.
///
/// # Errors
/// What was expected.
pub fn positive(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(number) if number > 0.0 && f32::is_finite(number) => Ok(number),
        _ => Err("expected a number greater than 0".to_owned()),
    }
}

/// A parser of numbers from `least` to `most`.
pub fn within(least: f32, most: f32) -> impl Fn(&str) -> Result<f32, String> + Clone {
    move |text| match text.parse() {
        Ok(number) if least <= number && number <= most => Ok(number),
        _ => Err(format!("expected a number from {least} to {most}")),
    }
}

/// Numbers that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{text}` {fault}")]
pub struct BadNumbers {
    text: String,
    /// What is wrong, and what to write.
    fault: &'static str,
}

/// What `read` makes of the numbers of a list with commas, all finite as `f32` too.
fn parsed<T>(
    text: &str,
    fault: &'static str,
    read: impl FnOnce(&[f64]) -> Option<T>,
) -> Result<T, BadNumbers> {
    let number = |part: &str| {
        let number: f64 = part.trim().parse().ok()?;
        (number as f32).is_finite().then_some(number)
    };
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    (numbers.and_then(|numbers| read(&numbers))).ok_or_else(|| BadNumbers {
        text: text.to_owned(),
        fault,
    })
}

/// The up direction: given, or to be found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UpChoice {
    /// What the program takes for it, such as what [`detect_up`](crate::up::detect_up) finds.
    Auto,
    /// This direction (unit length).
    Given(Vec3),
}

impl UpChoice {
    /// The direction that was given, or else another.
    pub fn or_else(self, auto: impl FnOnce() -> Vec3) -> Vec3 {
        match self {
            Self::Auto => auto(),
            Self::Given(up) => up,
        }
    }
}

impl FromStr for UpChoice {
    type Err = BadNumbers;

    fn from_str(text: &str) -> Result<Self, BadNumbers> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let fault = "is not an up direction: write auto, or three numbers that are not all zero, as in 0,0,1";
        parsed(text, fault, |numbers| {
            let up = DVec3::from_array(numbers.try_into().ok()?).as_vec3();
            up.try_normalize().map(Self::Given)
        })
    }
}

/// Three numbers, `x,y,z`; wide, since they may be coordinates of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triple(pub DVec3);

/// A pose, `x,y,z` in metres or `x,y,z,rx,ry,rz` with turns in degrees, about the fixed axes x,
/// then y, then z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseArgument(pub DPose3);

impl PoseArgument {
    /// The frames are one.
    pub const IDENTITY: Self = Self(DPose3::IDENTITY);

    /// The same pose of frames that were moved: from that of `b`, whose zero is now at `origin_b`, into that of `a`.
    ///
    /// ```
    /// use tldi::glamx::{DVec3, Vec3};
    /// use tldi_examples::cli::PoseArgument;
    /// let pose: PoseArgument = "0,0,0,0,0,90".parse()?;
    /// let [origin_a, origin_b] = [DVec3::Y, DVec3::X].map(|axis| 5e6 * axis);
    /// // A quarter turn about z takes the one origin to the other.
    /// assert!((pose.between(origin_a, origin_b) * Vec3::X - Vec3::Y).length() < 1e-6);
    /// # Ok::<(), tldi_examples::cli::BadNumbers>(())
    /// ```
    pub fn between(&self, origin_a: DVec3, origin_b: DVec3) -> Pose3 {
        let moved = DPose3::from_parts(self.0 * origin_b - origin_a, self.0.rotation);
        moved.into()
    }
}

/// The nearest and the farthest range that count, metres, `near,far`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeArgument(pub [f32; 2]);

impl FromStr for RangeArgument {
    type Err = BadNumbers;

    fn from_str(text: &str) -> Result<Self, BadNumbers> {
        let fault =
            "cannot be read: write the nearest and the farthest range in metres, as in 0.3,8";
        parsed(text, fault, |numbers| match *numbers {
            [near, far] if 0.0 <= near && near < far => Some(Self([near as f32, far as f32])),
            _ => None,
        })
    }
}

impl FromStr for Triple {
    type Err = BadNumbers;

    fn from_str(text: &str) -> Result<Self, BadNumbers> {
        let fault = "cannot be read: write three numbers, as in 0,0,-1.5";
        parsed(text, fault, |numbers| {
            Some(Self(DVec3::from_array(numbers.try_into().ok()?)))
        })
    }
}

impl FromStr for PoseArgument {
    type Err = BadNumbers;

    fn from_str(text: &str) -> Result<Self, BadNumbers> {
        let fault = "cannot be read: write three numbers of metres, as in 0,0,0.5, or these and three of degrees";
        parsed(text, fault, |numbers| {
            let (place, turn) = numbers.split_at_checked(3)?;
            let place = DVec3::from_array(place.try_into().ok()?);
            let turn = match *turn {
                [] => DQuat::IDENTITY,
                [rx, ry, rz] => {
                    let [rx, ry, rz] = [rx, ry, rz].map(f64::to_radians);
                    DQuat::from_euler(EulerRot::ZYX, rz, ry, rx)
                }
                _ => return None,
            };
            Some(Self(DPose3::from_parts(place, turn)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_1_SQRT_2;

    #[test]
    fn poses_turn_by_degrees_about_fixed_axes() {
        // A quarter turn about x takes y to z, one about z then leaves it there.
        let PoseArgument(pose) = "1,2,3,90,0,90".parse().unwrap();
        assert!((pose * DVec3::Y - DVec3::new(1.0, 2.0, 4.0)).length() < 1e-6);
        assert!((pose * DVec3::X - DVec3::new(1.0, 3.0, 3.0)).length() < 1e-6);
        let PoseArgument(pose) = "0, 0, 0, 0, 45, 0".parse().unwrap();
        let turned = DVec3::new(FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2);
        assert!((pose * DVec3::X - turned).length() < 1e-6);
        assert_eq!(
            "1,0,2".parse(),
            Ok(PoseArgument(DPose3::translation(1.0, 0.0, 2.0)))
        );
        for bad in ["", "1,2", "1,2,3,4", "1,2,x", "nan,0,0", "1,2,3,4,5,6,7"] {
            assert!(bad.parse::<PoseArgument>().is_err(), "{bad}");
            assert!(bad.parse::<Triple>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_range_grows() {
        assert_eq!("0, 25.5".parse(), Ok(RangeArgument([0.0, 25.5])));
        for bad in ["", "8", "8,0.3", "1,1", "-1,2", "0,inf", "1,2,3"] {
            assert!(bad.parse::<RangeArgument>().is_err(), "{bad}");
        }
    }

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
}
