//! Axis-aligned bounding boxes.

use glamx::{Pose3, Vec3};

/// An axis-aligned box; empty where `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Default for Aabb {
    /// [`EMPTY`](Self::EMPTY).
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// The box grown to hold `point`.
    pub fn including(self, point: Vec3) -> Self {
        Self {
            min: self.min.min(point),
            max: self.max.max(point),
        }
    }

    /// The box that holds both.
    pub fn merged(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The box grown by `margin` metres on all sides.
    pub fn loosened(self, margin: f32) -> Self {
        Self {
            min: self.min - Vec3::splat(margin),
            max: self.max + Vec3::splat(margin),
        }
    }

    /// The box, grown to where `body` ends that passes through it: on each axis on which `body`
    /// stands out on both sides, on the side on which it stands out less.
    ///
    /// ```
    /// use tldi::{Aabb, glamx::Vec3};
    /// let floor = Aabb { min: Vec3::new(-9.0, 0.0, -9.0), max: Vec3::new(9.0, 0.0, 9.0) };
    /// let body = Aabb { min: Vec3::new(8.0, -0.2, 0.0), max: Vec3::new(10.0, 1.0, 1.0) };
    /// let grown = floor.reached_through(body);
    /// assert_eq!((grown.min.y, grown.max), (-0.2, floor.max));
    /// ```
    pub fn reached_through(self, body: Self) -> Self {
        let (below, above) = (self.min - body.min, body.max - self.max);
        let through = below.cmpgt(Vec3::ZERO) & above.cmpgt(Vec3::ZERO);
        let down = below.cmple(above);
        Self {
            min: Vec3::select(through & down, body.min, self.min),
            max: Vec3::select(through & !down, body.max, self.max),
        }
    }

    /// What both boxes hold; may be empty.
    pub fn intersection(self, other: Self) -> Self {
        Self {
            min: self.min.max(other.min),
            max: self.max.min(other.max),
        }
    }

    /// Whether the box holds nothing.
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max).all())
    }

    /// Whether `point` is inside or on the boundary.
    pub fn contains(&self, point: Vec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// Whether the boxes share a point.
    pub fn intersects(&self, other: &Self) -> bool {
        !self.intersection(*other).is_empty()
    }

    /// Middle of the box.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Edge lengths in metres.
    pub fn extents(&self) -> Vec3 {
        self.max - self.min
    }

    /// The smallest axis-aligned box around this one after a rigid motion. A box that is infinite anywhere
    /// becomes all of space.
    pub fn transformed(&self, pose: &Pose3) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let center = self.center();
        let half = 0.5 * self.extents();
        if !center.is_finite() || !half.is_finite() {
            return Self {
                min: Vec3::NEG_INFINITY,
                max: Vec3::INFINITY,
            };
        }
        let center = *pose * center;
        let r = glamx::Mat3::from_quat(pose.rotation);
        let half = r.x_axis.abs() * half.x + r.y_axis.abs() * half.y + r.z_axis.abs() * half.z;
        Self {
            min: center - half,
            max: center + half,
        }
    }
}
