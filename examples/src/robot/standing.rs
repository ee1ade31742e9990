//! How well a robot stands on ground whose surface is known.

use super::count;
use super::links::LinkCloud;
use crate::numbers::range;
use crate::terrain::Terrain;
use serde::Serialize;
use std::io::{self, Write};
use tldi::glamx::{Pose3, Vec3};
use tldi::{KdTree, PointCloud};

/// Height over the lowest link at the start, metres, up to which a link is a foot.
const FOOT_HEIGHT: f32 = 0.01;
/// Points around a contact whose radii are the radius of the scan there.
const LOCAL_POINTS: usize = 12;

/// What a standing or walking robot did. Contacts come from the library, all else from the ground as it
/// was made.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StandingReport {
    /// Number of feet: links that the robot stands on at the start.
    pub feet: usize,
    /// Weight that a foot carries when it stands, N.
    pub weight_share: f32,
    /// Height of the root over the lowest link at the start, metres.
    pub start_height: f32,
    /// Least height of the root over the mean ground under the feet, metres.
    pub least_height: f32,
    /// That height after the last step.
    pub last_height: f32,
    /// How far the root moved over ground, metres.
    pub way: f32,
    /// Deepest contact with the scan in radii of the points around it.
    pub deepest_radii: f32,
    /// The step in which that was.
    pub deepest_step: usize,
    /// Largest force on a foot in one step, in weight shares.
    pub max_foot_force: f32,
    /// The step in which that was.
    pub max_force_step: usize,
    /// How deep a point of a foot was under the true ground at most, metres.
    pub feet_under_ground: f32,
    /// How deep a point of another link was, metres.
    pub links_under_ground: f32,
}

impl StandingReport {
    /// Writes a line for people.
    pub(crate) fn write_line(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "went {:.2} m; base {:.3} m high at the start, at least {:.3} m, {:.3} m at the end; contacts at most {:.2} r \
             deep (step {}); at most {:.2} of its share of {:.0} N on a foot (step {}); under the true ground: \
             feet {:.1} mm, other links {:.1} mm",
            self.way,
            self.start_height,
            self.least_height,
            self.last_height,
            self.deepest_radii,
            self.deepest_step,
            self.max_foot_force,
            self.weight_share,
            self.max_force_step,
            1e3 * self.feet_under_ground,
            1e3 * self.links_under_ground
        )
    }
}

/// Measures it step by step. z is up.
pub(super) struct Standing {
    terrain: Terrain,
    tree: KdTree,
    feet: Vec<bool>,
    start: Vec3,
    step: usize,
    report: StandingReport,
}

impl Standing {
    /// Before the first step: the root and the links (of the clouds) at their start.
    pub(super) fn new(
        terrain: Terrain,
        scan: &PointCloud<'_>,
        clouds: &[LinkCloud],
        root: &Pose3,
        links: &[Pose3],
        weight: f32,
    ) -> Self {
        let lowest = |(link, pose): (&LinkCloud, &Pose3)| {
            range(link.cloud.points().iter().map(|&p| (*pose * p).z))[0]
        };
        let heights: Vec<f32> = clouds.iter().zip(links).map(lowest).collect();
        let [least, _] = range(heights.iter().copied());
        let feet: Vec<bool> = heights.iter().map(|h| *h < least + FOOT_HEIGHT).collect();
        let count = count(&feet);
        // The start is above the ground by the drop.
        let start_height = root.translation.z - least;
        Self {
            terrain,
            tree: KdTree::new(scan),
            feet,
            start: root.translation,
            step: 0,
            report: StandingReport {
                feet: count,
                weight_share: weight / count as f32,
                start_height,
                least_height: start_height,
                last_height: start_height,
                ..StandingReport::default()
            },
        }
    }

    /// After a step: contacts (point and depth) with the scan, and the normal force on each link.
    pub(super) fn observe(
        &mut self,
        scan: &PointCloud<'_>,
        clouds: &[LinkCloud],
        root: &Pose3,
        links: &[Pose3],
        contacts: impl Iterator<Item = (Vec3, f32)>,
        forces: &[f32],
    ) {
        self.step += 1;
        let report = &mut self.report;
        let mut ground = 0.0;
        for ((link, pose), is_foot) in clouds.iter().zip(links).zip(&self.feet) {
            // Distances grow by no more than the way: what is far off is not looked at point by point.
            let bounds = link.cloud.bounds();
            let reach = 0.5 * bounds.extents().length();
            let is_near = self.terrain.distance(*pose * bounds.center()) < reach;
            let deepest = (link.cloud.points().iter().copied().filter(|_| is_near))
                .map(|p| -self.terrain.distance(*pose * p))
                .fold(0.0, f32::max);
            let worst = if *is_foot {
                ground += self.terrain.height(pose.translation.truncate());
                &mut report.feet_under_ground
            } else {
                &mut report.links_under_ground
            };
            *worst = worst.max(deepest);
        }
        report.last_height = root.translation.z - ground / report.feet as f32;
        report.least_height = report.least_height.min(report.last_height);
        report.way = (root.translation - self.start).truncate().length();
        let mut near = Vec::new();
        for (point, depth) in contacts {
            self.tree.k_nearest(point, LOCAL_POINTS, &mut near);
            let radii = near.iter().map(|neighbor| scan.radius(neighbor.index));
            let radius = radii.sum::<f32>() / near.len() as f32;
            if depth / radius > report.deepest_radii {
                report.deepest_radii = depth / radius;
                report.deepest_step = self.step;
            }
        }
        for (force, is_foot) in forces.iter().zip(&self.feet) {
            let shares = force / report.weight_share;
            if *is_foot && shares > report.max_foot_force {
                report.max_foot_force = shares;
                report.max_force_step = self.step;
            }
        }
    }

    pub(super) fn report(&self) -> &StandingReport {
        &self.report
    }
}
