//! The axes along which contact points on one plane extend, and contacts at places along them.

use crate::ContactPoint;
use crate::contact::bowl::{Floor, Valley};
use glamx::{Vec2, Vec3};

/// Least extent across the longest direction, as a share of that along it: less is rounding. Half or twice: no row
/// changes.
const LEAST_WIDTH: f32 = 1e-6;

/// Largest distance, in standard deviations across the valley, from which points tell how low its floor is. Half or twice:
/// no row changes.
const NEAR_FLOOR: f32 = 0.4;

/// Two axes of points on one plane, at right angles.
#[derive(Clone, Copy)]
pub(super) struct PlaneAxes {
    centre: Vec3,
    normal: Vec3,
    /// Unit vectors.
    pub(super) axes: [Vec3; 2],
    /// Standard deviations along them, metres.
    pub(super) sigma: Vec2,
}

impl PlaneAxes {
    /// The main axes: the points extend the most along the first, and have no covariance.
    pub(super) fn of(points: &[ContactPoint], normal: Vec3) -> Self {
        let middles = || points.iter().map(ContactPoint::middle);
        let count = points.len() as f32;
        let centre = middles().sum::<Vec3>() / count;
        let longest = longest_axis(middles(), centre, normal);
        let mut own = Self {
            centre,
            normal,
            axes: [longest, normal.cross(longest)],
            sigma: Vec2::ONE,
        };
        let squares = middles().map(|middle| own.along(middle)).map(|d| d * d);
        let variance = squares.sum::<Vec2>() / count;
        let sigma = Vec2::new(variance.x.sqrt(), variance.y.sqrt());
        // Points in a row, or a single one, have no extent across.
        own.sigma = sigma.max(Vec2::splat(f32::MIN_POSITIVE.max(LEAST_WIDTH * sigma.x)));
        own
    }

    /// Main axes turned by the angle with the cosine and the sine of `turn`.
    pub(super) fn turned(&self, turn: Vec2) -> Self {
        let [x, y] = self.axes;
        let variance = self.sigma * self.sigma;
        let turned = Vec2::new(
            variance.dot(turn * turn),
            variance.dot(turn.perp() * turn.perp()),
        );
        Self {
            axes: [turn.x * x + turn.y * y, turn.x * y - turn.y * x],
            sigma: Vec2::new(turned.x.sqrt(), turned.y.sqrt()),
            ..*self
        }
    }

    /// Coordinates from the centre along the axes, metres.
    fn along(&self, point: Vec3) -> Vec2 {
        let off = point - self.centre;
        Vec2::new(off.dot(self.axes[0]), off.dot(self.axes[1]))
    }

    /// The same in standard deviations.
    pub(super) fn place(&self, point: &ContactPoint) -> Vec2 {
        self.along(point.middle()) / self.sigma
    }

    /// The contact at a place, with this gap. As the surfaces bend away from the plane, its height is that of the nearest of
    /// `points`.
    pub(super) fn contact_at(
        &self,
        place: Vec2,
        gap: f32,
        points: &[ContactPoint],
    ) -> ContactPoint {
        let aside = place * self.sigma;
        let middle = self.centre + aside.x * self.axes[0] + aside.y * self.axes[1];
        let off = |p: &ContactPoint| (p.middle() - middle).reject_from_normalized(self.normal);
        let nearest = (points.iter())
            .min_by(|p, q| off(p).length_squared().total_cmp(&off(q).length_squared()));
        let above = nearest.map_or(0.0, |p| (p.middle() - middle).dot(self.normal));
        ContactPoint::about(middle + above * self.normal, gap, self.normal)
    }

    /// The floor of a valley across the first axis, whose gaps rise by `slope` in a standard deviation of each place; `None`
    /// if no two points are near it.
    pub(super) fn floor(
        &self,
        valley: Valley,
        slope: Vec2,
        points: &[ContactPoint],
    ) -> Option<Floor> {
        let Valley {
            place: lowest,
            bend,
        } = valley;
        let near = (points.iter().map(|p| (self.place(p), p.gap)))
            .filter(|(place, _)| (place.x - lowest).abs() <= NEAR_FLOOR);
        let (mut ends, mut sum, mut count) = ([f32::INFINITY, f32::NEG_INFINITY], 0.0, 0.0);
        for (place, gap) in near {
            ends = [ends[0].min(place.y), ends[1].max(place.y)];
            sum += gap - slope.y * place.y - bend * (place.x - lowest).powi(2);
            count += 1.0;
        }
        let end = |along: f32| {
            let gap = sum / count + slope.y * along;
            self.contact_at(Vec2::new(lowest, along), gap, points)
        };
        (ends[0] < ends[1]).then(|| Floor {
            ends: ends.map(end),
            radius: 0.5 / bend * self.sigma.x.powi(2) * self.axes[0],
        })
    }
}

/// Direction across `normal`, of unit length, in which points about `centre` extend the most.
pub(super) fn longest_axis(points: impl Iterator<Item = Vec3>, centre: Vec3, normal: Vec3) -> Vec3 {
    let (u, v) = normal.any_orthonormal_pair();
    let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
    for p in points {
        let d = Vec2::new((p - centre).dot(u), (p - centre).dot(v));
        uu += d.x * d.x;
        uv += d.x * d.y;
        vv += d.y * d.y;
    }
    let (sin, cos) = (0.5 * (2.0 * uv).atan2(uu - vv)).sin_cos();
    cos * u + sin * v
}
