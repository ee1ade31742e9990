//! A robot whose links are clouds, before it is in a scan.

use super::count;
use super::description::Description;
use super::links::{LinkCloud, clouds_of_links};
use super::placing::{NoPlace, Placement, Site, place};
use super::plan::{Base, Build, start_pose};
use super::self_filter::SelfFilter;
use tldi::PointCloud;
use tldi::glamx::{Pose3, Vec3};

/// Distance within which a place counts as blocked by a point of the scan, metres.
const CLEARANCE: f32 = 0.03;
/// Standard deviations of the sensor's noise within which a point is on the robot.
const NOISE_MARGIN: f32 = 3.0;

/// Links, their clouds, and how they stand at the start.
pub(super) struct Model {
    pub(super) description: Description,
    pub(super) clouds: Vec<LinkCloud>,
    pub(super) build: Build,
    /// Positions of the joints at the start, radians or metres.
    pub(super) start: Vec<f32>,
    /// Poses of the links (by index of the URDF) at the start, in the frame of the root.
    pub(super) root_from_link: Vec<Pose3>,
}

impl Model {
    /// Samples the links for a scan of this mean point radius in metres. Those that cannot be sampled are told.
    ///
    /// # Errors
    /// If not even one can.
    pub(super) fn new(
        mut description: Description,
        base: Base,
        scan_radius: f32,
    ) -> anyhow::Result<Self> {
        let (clouds, warnings) = clouds_of_links(&description, scan_radius)?;
        for warning in &warnings {
            eprintln!("warning: {warning}");
        }
        description.warnings.extend(warnings);
        let build = Build::of(&description.kinematics, &clouds, base);
        let start = start_pose(&description.kinematics, &build);
        Ok(Self {
            root_from_link: description.kinematics.poses(&start),
            description,
            clouds,
            build,
            start,
        })
    }

    /// The links (by index of the URDF) at the start, in the frame of the scan.
    pub(super) fn scan_from_link(&self, scan_from_root: &Pose3) -> Vec<Pose3> {
        let links = self.root_from_link.iter();
        links.map(|pose| *scan_from_root * *pose).collect()
    }

    /// Chooses a place, see [`place`].
    ///
    /// # Errors
    /// [`NoPlace`].
    pub(super) fn place(
        &self,
        scan: &PointCloud<'_>,
        up: Vec3,
        site: &Site,
        at: Option<Vec3>,
    ) -> Result<Placement, NoPlace> {
        let clearance = if self.build.is_fixed { CLEARANCE } else { 0.0 };
        let obstacles = SelfFilter::new(&self.clouds, clearance);
        place(scan, up, site, at, |scan_from_root| {
            // With a margin that is refused there is no place.
            let in_the_way =
                obstacles.on_robot(scan.points(), &self.scan_from_link(scan_from_root));
            in_the_way.map_or(usize::MAX, |on| count(&on))
        })
    }

    /// What finds the robot in the points of a sensor with this noise (standard deviation, metres). What stands on its own
    /// feet keeps the ground under them.
    pub(super) fn filter(&self, noise: f32) -> SelfFilter {
        let margin = if self.build.is_fixed {
            NOISE_MARGIN * noise
        } else {
            0.0
        };
        SelfFilter::new(&self.clouds, margin + self.build.model_error(&self.clouds))
    }
}
