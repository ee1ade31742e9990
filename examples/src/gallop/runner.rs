//! A cycle of moving points, with normals, brought to a size and onto its feet.

use tldi::Aabb;
use tldi::glamx::{Quat, Vec3};
use tldi_sources::{MovingPoints, RawCloud};

/// Share of the points that are its feet: the lowest.
const FEET: usize = 50;

/// What moves, in its own frame: y up, x ahead.
#[derive(Clone, Debug)]
pub struct Runner {
    points: MovingPoints,
    normals: Normals,
}

#[derive(Clone, Debug)]
enum Normals {
    None,
    Given(MovingPoints),
    Faces(Vec<[u32; 3]>),
}

impl Runner {
    /// Points whose normals are not known: they are estimated where they are needed.
    pub fn new(points: MovingPoints) -> Self {
        Self {
            points,
            normals: Normals::None,
        }
    }

    /// Points with the normals of every frame.
    pub fn with_normals(points: MovingPoints, normals: MovingPoints) -> Self {
        Self {
            points,
            normals: Normals::Given(normals),
        }
    }

    /// Points with normals from the faces that connect them.
    pub fn with_faces(points: MovingPoints, faces: Vec<[u32; 3]>) -> Self {
        Self {
            points,
            normals: Normals::Faces(faces),
        }
    }

    /// Number of frames and of points.
    pub fn counts(&self) -> [usize; 2] {
        [self.points.frames().len(), self.points.points()]
    }

    /// The largest extent over all frames.
    pub fn size(&self) -> f32 {
        self.bounds().extents().max_element()
    }

    fn bounds(&self) -> Aabb {
        let all = self.points.frames().iter().flatten().copied();
        all.fold(Aabb::EMPTY, Aabb::including)
    }

    /// Turns `up` to y, and it to run along x: against the way that the feet, its lowest points, go while they are down.
    /// Then scales the largest extent to `size` metres, and sets the feet on y = 0 and the middle over the origin. Gives
    /// the distance that the feet go so in a cycle, metres.
    pub fn stand(&mut self, up: Vec3, size: f32) -> f32 {
        let upright = Quat::from_rotation_arc(up, Vec3::Y);
        self.points.map(|p| upright * p);
        let stride = self.stride();
        let ahead = Vec3::new(-stride.x, 0.0, -stride.z);
        let turn = match ahead.try_normalize() {
            Some(ahead) => Quat::from_rotation_y(ahead.z.atan2(ahead.x)),
            None => Quat::IDENTITY,
        };
        self.points.map(|p| turn * p);
        let scale = size / self.size();
        self.points.map(|p| scale * p);
        if let Normals::Given(normals) = &mut self.normals {
            normals.map(|n| turn * (upright * n));
        }
        let bounds = self.bounds();
        let lift = bounds.center().with_y(bounds.min.y);
        self.points.map(|p| p - lift);
        scale * ahead.length()
    }

    /// How far its lowest points go in a cycle, while they are that.
    fn stride(&self) -> Vec3 {
        let frames = self.points.frames();
        let mut sum = Vec3::ZERO;
        for (k, frame) in frames.iter().enumerate() {
            let next = &frames[(k + 1) % frames.len()];
            let mut order: Vec<usize> = (0..frame.len()).collect();
            order.sort_by(|a, b| frame[*a].y.total_cmp(&frame[*b].y));
            let feet = &order[..frame.len().div_ceil(FEET)];
            sum += feet.iter().map(|i| next[*i] - frame[*i]).sum::<Vec3>() / feet.len() as f32;
        }
        sum
    }

    /// Points and, where they are known, normals at a phase of the cycle.
    pub fn at(&self, phase: f32) -> (Vec<Vec3>, Option<Vec<Vec3>>) {
        let points = self.points.at(phase);
        match &self.normals {
            Normals::None => (points, None),
            Normals::Given(normals) => {
                let normals = normals.at(phase).into_iter();
                (
                    points,
                    Some(normals.map(|n| n.normalize_or(Vec3::Y)).collect()),
                )
            }
            Normals::Faces(faces) => {
                let mesh = RawCloud {
                    points,
                    faces: faces.clone(),
                    ..RawCloud::default()
                };
                let normals = mesh.vertex_normals();
                (mesh.points, normals)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two feet that go back along −z by 0.4 each while they are down, and a head that is longer: x is
    /// ahead afterwards, and the stride is known.
    #[test]
    fn it_runs_against_its_feet() {
        let frame = |k: usize| {
            let t = k as f32 / 8.0;
            let foot = |t: f32| {
                let down = t < 0.5;
                let z = if down { 0.2 - 0.8 * t } else { 0.8 * t - 0.6 };
                Vec3::new(0.0, if down { 0.0 } else { 0.3 }, z)
            };
            let mut points = vec![foot(t), foot((t + 0.5) % 1.0)];
            points.extend((0..40).map(|k| Vec3::new(0.0, 1.0, 0.03 * k as f32 - 0.6)));
            points
        };
        let moving = MovingPoints::new((0..8).map(frame).collect()).unwrap();
        let mut runner = Runner::new(moving);
        // z up in the file: turned about x.
        runner.points.map(|p| Vec3::new(p.x, -p.z, p.y));
        let stride = runner.stand(Vec3::Z, 2.4);
        assert!((runner.size() - 2.4).abs() < 1e-4);
        // The head, 39 × 0.03 long, has become 2.4 m long. One foot is down at a time.
        let scale = 2.4 / 1.17;
        assert!((stride - 0.8 * scale).abs() < 1e-4, "{stride}");
        let (points, _) = runner.at(0.0);
        let lowest = points.iter().map(|p| p.y).fold(f32::MAX, f32::min);
        assert!(lowest.abs() < 1e-4, "{lowest}");
        assert!(points.iter().all(|p| p.z.abs() < 1e-4), "it runs along x");
        // The first foot is down and goes back.
        let (later, _) = runner.at(1.0 / 8.0);
        assert!((later[0] - points[0]).distance(-0.1 * scale * Vec3::X) < 1e-4);
    }

    /// A body 1 m long that runs along the diagonal of its frame: its size is its length.
    #[test]
    fn the_size_is_that_of_what_runs_ahead() {
        let ahead = Vec3::new(1.0, 0.0, 1.0).normalize();
        // Each foot goes back while it is down, and ahead over the ground.
        let frame = |k: usize| {
            let (back, ahead_by) = (-0.02 * k as f32 * ahead, 0.02 * k as f32 * ahead);
            let [lift, fall] = [k, 1 - k].map(|k| 0.05 * k as f32 * Vec3::Y);
            let ends = [-0.5, 0.5].map(|share| 0.1 * Vec3::Y + share * ahead);
            vec![back + lift, ahead_by + fall, ends[0], ends[1]]
        };
        let moving = MovingPoints::new((0..2).map(frame).collect()).unwrap();
        let mut runner = Runner::new(moving);
        runner.stand(Vec3::Y, 2.0);
        assert!((runner.size() - 2.0).abs() < 1e-4, "{}", runner.size());
    }

    #[test]
    fn faces_tell_normals() {
        let moving = MovingPoints::new(vec![vec![Vec3::ZERO, Vec3::X, Vec3::Z]]).unwrap();
        let runner = Runner::with_faces(moving, vec![[0, 2, 1]]);
        assert_eq!(runner.at(0.3).1.unwrap()[0], Vec3::Y);
    }
}
