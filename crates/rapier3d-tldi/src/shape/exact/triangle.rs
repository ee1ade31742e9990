//! One triangle: crossing and nearest point, in `f64`.

use super::Line;
use rapier3d::glamx::{DVec2, DVec3};
use rapier3d::parry::shape::Triangle;

pub(super) fn vertices(triangle: &Triangle) -> [DVec3; 3] {
    [triangle.a, triangle.b, triangle.c].map(|vertex| vertex.as_dvec3())
}

/// Unit normal by winding; zero for a triangle without area.
pub(super) fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

/// The point of the triangle nearest to `point` (Ericson, Real-Time Collision Detection, 5.1.5).
pub(super) fn nearest(point: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let ap = point - a;
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let denominator = va + vb + vc;
    a + ab * (vb / denominator) + ac * (vc / denominator)
}

/// A line in coordinates where it is the third axis, so that a triangle is crossed where its
/// shadow in the first two holds the origin (Woop, Benthin, Wald: Watertight Ray/Triangle
/// Intersection, JCGT 2(1), 2013).
pub(super) struct ShearedLine {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

impl ShearedLine {
    pub(super) fn new(line: &Line) -> Self {
        let z = line.direction.abs().max_position();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let d = line.direction;
        Self {
            origin: line.origin,
            axes,
            shear: DVec3::new(d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]),
        }
    }

    /// The same vertex gives the same bits in every triangle that has it.
    fn sheared(&self, vertex: DVec3) -> DVec3 {
        let v = vertex - self.origin;
        let [x, y, z] = self.axes.map(|axis| v[axis]);
        DVec3::new(x - self.shear.x * z, y - self.shear.y * z, self.shear.z * z)
    }

    /// Parameter of the crossing with a triangle.
    ///
    /// A line through an edge or a vertex counts as shifted by (ε, ε²), ε → 0, in the plane of the
    /// shadows, whichever triangle asks: neighbours never both claim it, nor both disown it.
    pub(super) fn crossing(&self, triangle: [DVec3; 3]) -> Option<f64> {
        let [a, b, c] = triangle.map(|vertex| self.sheared(vertex));
        let (bc, side_bc) = edge(b, c);
        let (ca, side_ca) = edge(c, a);
        let (ab, side_ab) = edge(a, b);
        if side_bc != side_ca || side_ca != side_ab {
            return None;
        }
        let area = bc + ca + ab;
        let t = (bc * a.z + ca * b.z + ab * c.z) / area;
        t.is_finite().then_some(t)
    }
}

/// Twice the signed area of the origin with an edge, and on which side of the edge the origin,
/// shifted by (ε, ε²), lies. Reversing the edge reverses both exactly.
fn edge(from: DVec3, to: DVec3) -> (f64, bool) {
    let area = from.x * to.y - from.y * to.x;
    let step: DVec2 = (to - from).truncate();
    let positive = if area != 0.0 {
        area > 0.0
    } else if step.y != 0.0 {
        step.y < 0.0
    } else {
        step.x > 0.0
    };
    (area, positive)
}
