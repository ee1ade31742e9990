//! The near points of both surfaces, as the stage `aim` asks: where they face an axis, and where that is.

use glamx::Vec3;

/// Least |n·axis| (60°) at which a point faces an axis. Half or twice the angle: no change.
pub(crate) const SUPPORTED: f32 = 0.5;

/// Least share of a side's near points that must face a further axis. Fewer are noise at the rim of the zone. Half or
/// twice: no change.
pub(crate) const LEAST_SHARE: f32 = 0.05;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 2] = [
    ("SUPPORTED", SUPPORTED as f64),
    ("LEAST_SHARE", LEAST_SHARE as f64),
];

/// An even selection of the near points of one surface, in the frame of `a`.
#[derive(Clone, Copy)]
pub(crate) struct ZoneNormals<'a> {
    pub(crate) normals: &'a [Vec3],
    /// Where they are, metres.
    pub(crate) points: &'a [Vec3],
    /// Whether their sign is outward.
    pub(crate) oriented: bool,
}

/// Where points are along an axis, metres.
struct Spread {
    mean: f32,
    /// Standard deviation.
    scatter: f32,
}

impl ZoneNormals<'_> {
    /// Share of the normals that `keep` keeps.
    pub(crate) fn share(&self, keep: impl Fn(&Vec3) -> bool) -> f32 {
        let kept = self.normals.iter().filter(|n| keep(n)).count();
        kept as f32 / self.normals.len().max(1) as f32
    }

    /// Mean of n·axis over the normals that face it or its opposite, if they tell the outside.
    pub(crate) fn mean_along(&self, axis: Vec3) -> f32 {
        if !self.oriented {
            return 0.0;
        }
        let along = self.normals.iter().map(|n| n.dot(axis));
        let facing = along.filter(|d| d.abs() >= SUPPORTED);
        let (sum, count) = facing.fold((0.0, 0.0), |(sum, count), d| (sum + d, count + 1.0));
        if count < LEAST_SHARE * self.normals.len() as f32 {
            return 0.0;
        }
        sum / f32::max(count, 1.0)
    }

    /// Mean place along `axis` of the points that face it or its opposite, metres; of all, if none do.
    pub(crate) fn faces_at(&self, axis: Vec3) -> f32 {
        let faces = self.place(axis, |along| along.abs() >= SUPPORTED);
        let place = faces.or_else(|| self.place(axis, |_| true));
        place.map_or(0.0, |place| place.mean)
    }

    /// Of the points with the n·axis that `keep` keeps, if these are enough.
    fn place(&self, axis: Vec3, keep: impl Fn(f32) -> bool) -> Option<Spread> {
        let kept = self.normals.iter().zip(self.points);
        let kept = kept.filter(|(normal, _)| keep(normal.dot(axis)));
        let mut kept = kept.map(|(_, point)| point.dot(axis)).peekable();
        // Counted from the first one: far from the origin, squares in `f32` would lose the scatter.
        let first = *kept.peek()?;
        let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for off in kept.map(|along| along - first) {
            count += 1.0;
            sum += off;
            squares += off * off;
        }
        let mean = sum / count;
        (count >= LEAST_SHARE * self.normals.len() as f32).then(|| Spread {
            mean: first + mean,
            scatter: (squares / count - mean * mean).max(0.0).sqrt(),
        })
    }

    /// Of the points that face `axis` (`sign` 1) or its opposite (-1); of all, if the outside is not known.
    fn facing(&self, axis: Vec3, sign: f32) -> Option<Spread> {
        self.place(axis, |along| !self.oriented || sign * along >= SUPPORTED)
    }
}

/// Distance from `b` to `a` along `axis`, and the scatter of both, metres, where they face each other. With `sign` -1, the
/// same along the opposite of `axis`.
fn gap([a, b]: &[ZoneNormals; 2], axis: Vec3, sign: f32) -> Option<(f32, f32)> {
    let (of_a, of_b) = (a.facing(axis, -sign)?, b.facing(axis, sign)?);
    let gap = sign * (of_a.mean - of_b.mean);
    Some((gap, of_a.scatter + of_b.scatter))
}

/// Whether `axis` points from `b` towards `a`. Outward normals decide if the surfaces show each other their outsides in
/// one order only. Otherwise the mean places decide, if they differ by more than the points scatter. `None`: neither tells.
///
/// Where the outsides are not known all near points count. So two links of a chain are told, whose middles lie on the
/// wrong sides, but not surfaces that are in each other by as much as their points scatter. If the outside of one is known,
/// a part of it would be compared with all of the other: a cone whose base is under a sheet would be told to be below.
pub(crate) fn side_by_places(sides: &[ZoneNormals; 2], axis: Vec3) -> Option<bool> {
    if sides[0].oriented != sides[1].oriented {
        return None;
    }
    match [1.0, -1.0].map(|sign| gap(sides, axis, sign)) {
        [Some((gap, scatter)), Some((opposite, other_scatter))] => {
            let further = 0.5 * (gap - opposite);
            (further.abs() > scatter.max(other_scatter)).then_some(further > 0.0)
        }
        [Some(_), None] => Some(true),
        [None, Some(_)] => Some(false),
        [None, None] => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bare sheets 5 cm apart that are 3 mm rough are told by their places, and others that are 1 mm apart are not,
    /// wherever the origin is.
    #[test]
    fn places_tell_the_side_far_from_the_origin() {
        let normals = [Vec3::Y; 40];
        for far in [0.0, 10.0, 100.0, 1000.0] {
            for (apart, told) in [(0.05, Some(false)), (-0.05, Some(true)), (0.001, None)] {
                let sheet = |height: f32| {
                    let rough = |k: usize| 0.003 * (k as f32).sin();
                    (0..40).map(move |k| Vec3::new(0.1 * k as f32, far + height + rough(k), 0.0))
                };
                let points = [0.0, apart].map(|height| sheet(height).collect::<Vec<_>>());
                let sides = points.each_ref().map(|points| ZoneNormals {
                    normals: &normals,
                    points,
                    oriented: false,
                });
                assert_eq!(side_by_places(&sides, Vec3::Y), told, "{far} {apart}");
            }
        }
    }

    /// Nothing is told of a bare sheet and a pyramid whose outside is known. Its base is under the sheet, its middle is not.
    #[test]
    fn slanted_faces_are_not_compared_with_a_bare_sheet() {
        let flank = Vec3::new(0.8, 0.6, 0.0);
        let (normals, points): (Vec<_>, Vec<_>) = (0..40)
            .map(|k| match k % 2 {
                0 => (-Vec3::Y, -0.02 * Vec3::Y),
                _ => (flank, -0.001 * k as f32 * Vec3::Y),
            })
            .unzip();
        let pyramid = ZoneNormals {
            normals: &normals,
            points: &points,
            oriented: true,
        };
        let sheet = ZoneNormals {
            normals: &[Vec3::Y; 40],
            points: &[Vec3::ZERO; 40],
            oriented: false,
        };
        assert_eq!(side_by_places(&[sheet, pyramid], Vec3::Y), None);
        assert_eq!(side_by_places(&[pyramid, sheet], Vec3::Y), None);
    }
}
