//! Takes the robot out of what its own camera sees.

use super::links::LinkCloud;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Aabb, KdTree};

/// Finds points that lie on or in a robot.
pub struct SelfFilter {
    links: Vec<Part>,
    margin: f32,
}

struct Part {
    link: usize,
    tree: KdTree,
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    bounds: Aabb,
    radius: f32,
}

impl SelfFilter {
    /// A filter for links whose surface is seen up to `margin` metres off: three standard deviations
    /// of the sensor's noise, and what the model of the robot is wrong by.
    pub fn new(links: &[LinkCloud], margin: f32) -> Self {
        let part = |link: &LinkCloud| Part {
            link: link.link,
            tree: KdTree::new(&link.cloud),
            points: link.cloud.points().collect(),
            normals: link.cloud.normals().unwrap_or_default().to_vec(),
            bounds: link.cloud.bounds(),
            radius: link.cloud.mean_radius(),
        };
        Self {
            links: links.iter().map(part).collect(),
            margin,
        }
    }

    /// Whether each point lies on the robot, whose links are at `world_from_link` (by index of the
    /// URDF). A point whose nearest sample of a link is within the margin and the sample's radius,
    /// or that is behind the link's surface. Cost: a box test a point, and a search in a tree for
    /// those within a link's box.
    pub fn on_robot(&self, points: &[Vec3], world_from_link: &[Pose3]) -> Vec<bool> {
        let parts: Vec<(&Part, Pose3, Aabb)> = (self.links.iter())
            .map(|part| {
                let pose = world_from_link[part.link];
                let bounds = part.bounds.transformed(&pose).loosened(self.margin);
                (part, pose.inverse(), bounds)
            })
            .collect();
        let whole = (parts.iter()).fold(Aabb::EMPTY, |all, (_, _, bounds)| all.merged(*bounds));
        let is_on = |p: &Vec3| {
            whole.contains(*p)
                && (parts.iter()).any(|(part, link_from_world, bounds)| {
                    bounds.contains(*p) && part.covers(*link_from_world * *p, self.margin)
                })
        };
        points.iter().map(is_on).collect()
    }
}

impl Part {
    /// Whether a point in the frame of the link is on or in it.
    fn covers(&self, p: Vec3, margin: f32) -> bool {
        if !self.bounds.loosened(margin).contains(p) {
            return false;
        }
        let Some(nearest) = self.tree.nearest(p, f32::INFINITY) else {
            return false;
        };
        let k = nearest.index;
        let offset = p - self.points[k];
        let height = offset.dot(self.normals[k]);
        let aside = (offset - height * self.normals[k]).length();
        let on_surface = height <= margin && nearest.distance() <= margin + self.radius;
        // Beyond an edge, the nearest sample may belong to the face around the corner.
        let inside = height < 0.0 && aside < 2.0 * -height;
        on_surface || inside
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load;
    use crate::scene::BodyShape;
    use fastrand::Rng;

    /// A ring seen by a noisy camera, in a room of random points: what is on the ring goes, and what
    /// is off it by more than margin and spacing stays. The distance to a torus is known.
    #[test]
    fn the_robot_goes_and_the_room_stays() {
        let cloud = load::body_from_surface(BodyShape::Torus.sample(0.02, 1)).unwrap();
        let link = LinkCloud {
            link: 1,
            name: "ring".to_owned(),
            cloud,
        };
        let radius = link.cloud.mean_radius();
        let margin = 0.01;
        let filter = SelfFilter::new(&[link], margin);
        let pose = Pose3::from_parts(
            Vec3::new(1.0, 2.0, 0.5),
            tldi::glamx::Quat::from_rotation_x(0.7),
        );
        let poses = [Pose3::IDENTITY, pose];
        let mut rng = Rng::with_seed(2);
        let mut random = || Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 1.6 - Vec3::splat(0.8);
        let points: Vec<Vec3> = (0..20_000).map(|_| random()).collect();
        let in_world: Vec<Vec3> = points.iter().map(|p| pose * *p).collect();
        let mut removed = 0;
        for (p, on) in points.iter().zip(filter.on_robot(&in_world, &poses)) {
            let ring = tldi::glamx::Vec2::new(p.x, p.z).length() - 0.35;
            let distance = ring.hypot(p.y) - 0.15;
            if distance < 0.5 * margin {
                assert!(on, "{p} is {distance} off");
            } else if distance > margin + radius {
                assert!(!on, "{p} is {distance} off");
            }
            removed += usize::from(on);
        }
        // The ring's share of the cube: 2 π² · 0.35 · 0.15² / 1.6³ = 3.8 %, with the margin 5 %.
        assert!((700..1200).contains(&removed), "{removed}");
    }
}
