//! Exact signed distance functions, in `f64`.

use super::triangle;
use rapier3d::glamx::{DVec2, DVec3};

/// Signed distance and outward unit normal at the nearest point of the surface.
pub(super) type Projection = (f64, DVec3);

/// The vector along an axis with this component.
pub(super) fn along_axis(axis: usize, component: f64) -> DVec3 {
    let mut vector = DVec3::ZERO;
    vector[axis] = component;
    vector
}

/// Grows a solid by `border` metres.
pub(super) fn rounded((distance, normal): Projection, border: f32) -> Projection {
    (distance - f64::from(border), normal)
}

/// A ball about the origin.
pub(super) fn ball(point: DVec3, radius: f64) -> Projection {
    let normal = point.try_normalize().unwrap_or(DVec3::Y);
    (point.length() - radius, normal)
}

/// A box about the origin.
pub(super) fn cuboid(point: DVec3, half_extents: DVec3) -> Projection {
    let sign = DVec3::ONE.copysign(point);
    let beyond = point.abs() - half_extents;
    let outside = beyond.max(DVec3::ZERO);
    if let Some(normal) = outside.try_normalize() {
        return (outside.length(), normal * sign);
    }
    let axis = beyond.max_position();
    (beyond[axis], along_axis(axis, sign[axis]))
}

/// A segment without thickness: the distance is never negative.
pub(super) fn segment(point: DVec3, a: DVec3, b: DVec3) -> Projection {
    let ab = b - a;
    let s = (point - a).dot(ab) / ab.length_squared();
    let foot = if s.is_nan() {
        a
    } else {
        a + s.clamp(0.0, 1.0) * ab
    };
    let normal = (point - foot).try_normalize().unwrap_or_else(|| {
        ab.try_normalize()
            .map_or(DVec3::Y, |along| along.any_orthonormal_vector())
    });
    ((point - foot).length(), normal)
}

/// A triangle without thickness: the distance is never negative.
pub(super) fn triangle(point: DVec3, vertices: [DVec3; 3]) -> Projection {
    let delta = point - triangle::nearest(point, vertices);
    let normal = delta
        .try_normalize()
        .unwrap_or_else(|| triangle::normal(vertices));
    (delta.length(), normal)
}

/// A cylinder along y.
pub(super) fn cylinder(point: DVec3, half_height: f64, radius: f64) -> Projection {
    revolved(point, |p| {
        let up = 1f64.copysign(p.y);
        let beyond = DVec2::new(p.x - radius, p.y.abs() - half_height);
        let outside = beyond.max(DVec2::ZERO);
        if let Some(normal) = outside.try_normalize() {
            return (outside.length(), DVec2::new(normal.x, normal.y * up));
        }
        if beyond.x > beyond.y {
            (beyond.x, DVec2::X)
        } else {
            (beyond.y, DVec2::new(0.0, up))
        }
    })
}

/// A cone along y, with its base at `-half_height` and its apex at `half_height`.
pub(super) fn cone(point: DVec3, half_height: f64, radius: f64) -> Projection {
    let apex = DVec2::new(0.0, half_height);
    let rim = DVec2::new(radius, -half_height);
    let base = DVec2::new(0.0, -half_height);
    let side_normal = DVec2::new(2.0 * half_height, radius).normalize_or(DVec2::X);
    revolved(point, |p| {
        let above_side = side_normal.dot(p - rim);
        let below_base = base.y - p.y;
        if above_side <= 0.0 && below_base <= 0.0 {
            return if above_side > below_base {
                (above_side, side_normal)
            } else {
                (below_base, DVec2::NEG_Y)
            };
        }
        let from_side = p - nearest_on_segment(p, rim, apex);
        let from_base = p - nearest_on_segment(p, base, rim);
        let (delta, face_normal) = if from_side.length_squared() < from_base.length_squared() {
            (from_side, side_normal)
        } else {
            (from_base, DVec2::NEG_Y)
        };
        let distance = delta.length();
        // So close that the direction is rounding.
        if distance < 1e-12 * (half_height + radius) {
            return (distance, face_normal);
        }
        (distance, delta / distance)
    })
}

/// A solid of revolution about y, by its profile in (distance from the axis, y).
fn revolved(point: DVec3, profile: impl Fn(DVec2) -> (f64, DVec2)) -> Projection {
    let radial = DVec2::new(point.x, point.z);
    let (distance, normal) = profile(DVec2::new(radial.length(), point.y));
    let outward = radial.try_normalize().unwrap_or(DVec2::X) * normal.x;
    (distance, DVec3::new(outward.x, normal.y, outward.y))
}

fn nearest_on_segment(point: DVec2, a: DVec2, b: DVec2) -> DVec2 {
    let ab = b - a;
    let s = (point - a).dot(ab) / ab.length_squared();
    if s.is_nan() {
        a
    } else {
        a + s.clamp(0.0, 1.0) * ab
    }
}
