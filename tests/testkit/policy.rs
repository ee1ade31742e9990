//! Camera policies as an option of the programs that compare them.

use tldi::CameraPolicy;

/// From where pairs of clouds are looked at.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolicyChoice {
    /// By the normals of the contact zone, with hysteresis, up to three views.
    ContactZone,
    /// One view against the motion.
    Motion,
    /// One view by the normals of the contact zone, anew in every frame.
    Covariance,
    /// One view along the axis in which the bounds overlap least.
    SmallestExtent,
    /// One view along the last axis.
    LastNormal,
}

impl From<PolicyChoice> for CameraPolicy {
    fn from(choice: PolicyChoice) -> Self {
        match choice {
            PolicyChoice::ContactZone => Self::ContactZone,
            PolicyChoice::Motion => Self::Motion,
            PolicyChoice::Covariance => Self::Covariance,
            PolicyChoice::SmallestExtent => Self::SmallestExtent,
            PolicyChoice::LastNormal => Self::LastNormal,
        }
    }
}

impl PolicyChoice {
    /// What a file of this policy's results adds to its name: nothing for the default.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::ContactZone => "",
            Self::Motion => "_motion",
            Self::Covariance => "_covariance",
            Self::SmallestExtent => "_smallest_extent",
            Self::LastNormal => "_last_normal",
        }
    }
}
