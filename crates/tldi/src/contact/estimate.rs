//! The estimate of a contact from its pixels: where the surfaces are nearest, how near, and on which few points a body rests.
//!
//! One idea yields balls, cylinders, faces and noise: **a contact is the part of its footprint that may be the lowest
//! place**. A quadric is fitted to the gaps and normals of the pixels. Along each axis in which it bends, the lowest place
//! is known to within its standard error; along others it may be anywhere in the footprint. So a ball touches in a point,
//! a cylinder in the ends of a line, a face in its corners, and a ball on noise in as wide a patch as the noise leaves open.
//! Where two or three faces explain the pixels better than a quadric, the lowest place is where they meet ([`Vertex`]).
//!
//! All lengths are in pixels, places are on the plane of the contact.

use crate::contact::links::Links;
use crate::contact::quadric::Quadric;
use crate::contact::supports::farthest;
use crate::contact::vertex::Vertex;
use crate::{ContactPixel, ContactPoint, PATCH_POINTS};
use arrayvec::ArrayVec;
use glamx::{Vec2, Vec3};

/// Standard errors within which the lowest place is taken to be: 95 % of them.
const DOUBT: f32 = 2.0;

/// Gaps count the less the higher they are above the least, and not at all from here on, in pixels. With half of it a ball's
/// contact has few pixels, with twice of it a ball of three pixels is no quadric any more.
const BAND: f32 = 1.0;

/// What a pixel counts at least: one that is far up still tells that nothing is lower there.
const LEAST_WEIGHT: f32 = 1e-3;

/// Steepest slope that is one, a tangent: 79°. What rises more steeply is seen edge on.
const STEEPEST: f32 = 5.0;

/// Most by which a gap along the normal of the contact and one along the pixel's own differ.
const LONGER: f32 = 2.0;

/// Points that are nearer to each other than this count as one, pixels: what the lowest place of a smooth ball is uncertain
/// by is a tenth of it. With twice of it balls roll about on noise; with half of it they stop on smooth planes.
const SAME_POINT: f32 = 0.25;

/// Most by which the contact is lower than the lowest pixel. A pixel's corner is 0.7 pixels from its middle.
const LOWER: f32 = 1.0;

/// A pixel at the rim stands out beyond the surface by half a pixel on average. Footprints of at least so many pixels reach
/// to the mean of a pixel and its neighbours, which is as far inwards at a rim or a corner, and nowhere within.
const LEAST_INWARDS: usize = 12;

/// What a contact pixel tells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Observed {
    /// Index of the contact pixel.
    pub(crate) member: u32,
    /// Where it is on the plane of the contact, and how far above.
    pub(crate) place: Vec2,
    height: f32,
    pub(crate) gap: f32,
    /// How steeply the gap rises with the place.
    pub(crate) slope: Vec2,
    /// The same by the sines of angles in place of tangents: these are linear in the place where a ball touches.
    pub(crate) turn: Vec2,
    /// What the gap counts, 1 at most, and what the slope does.
    pub(crate) weight: f32,
    pub(crate) turn_weight: f32,
}

/// The plane of a contact.
pub(crate) struct Plane {
    /// A point on it, metres.
    pub(crate) origin: Vec3,
    /// Unit vectors.
    pub(crate) axes: [Vec3; 2],
    pub(crate) normal: Vec3,
    /// Metres.
    pub(crate) pixel_size: f32,
    /// The least gap of the contact, metres.
    pub(crate) least_gap: f32,
}

impl Plane {
    fn across(&self, vector: Vec3) -> Vec2 {
        Vec2::new(vector.dot(self.axes[0]), vector.dot(self.axes[1]))
    }

    /// What a contact pixel tells, whose gap is `mean_gap` metres among its neighbours.
    pub(crate) fn observe(&self, member: u32, contact: &ContactPixel, mean_gap: f32) -> Observed {
        let pixels = |point: Vec3| (point - self.origin) / self.pixel_size;
        let [a, b] = [contact.normal_a, contact.normal_b].map(Vec3::normalize_or_zero);
        let facing = (-a.dot(b)).max(0.0);
        let apart = contact.point_b - contact.point_a;
        let longer = apart.dot(self.normal) / apart.dot(contact.normal());
        let longer = if longer.is_finite() { longer } else { 1.0 };
        let gap = longer.clamp(1.0 / LONGER, LONGER) * contact.gap / self.pixel_size;
        let above = (mean_gap - self.least_gap) / (BAND * self.pixel_size);
        let weight = (1.0 - above).clamp(0.0, 1.0).powi(2).max(LEAST_WEIGHT);
        let [slope_a, slope_b] = [a, b].map(|n| -self.across(n) / n.dot(self.normal));
        let middle = pixels(contact.middle());
        let mut observed = Observed {
            member,
            place: self.across(middle),
            height: middle.dot(self.normal),
            gap,
            slope: Vec2::ZERO,
            turn: Vec2::ZERO,
            weight,
            turn_weight: 0.0,
        };
        if slope_a.is_finite() && slope_b.is_finite() && (slope_b - slope_a).length() < STEEPEST {
            // Both surfaces' tangent planes at the place midway between what the ray meets.
            let aside = self.across(0.5 * apart / self.pixel_size);
            observed.gap -= (slope_a + slope_b).dot(aside);
            observed.slope = slope_b - slope_a;
            observed.turn = self.across(a + b);
            observed.turn_weight = weight * facing * facing;
        }
        observed
    }

    /// The contact point at a place `height` above the plane.
    fn point(&self, place: Vec2, height: f32, gap: f32) -> ContactPoint {
        let off = place.x * self.axes[0] + place.y * self.axes[1] + height * self.normal;
        let (middle, gap) = (self.origin + self.pixel_size * off, self.pixel_size * gap);
        ContactPoint {
            point_a: middle - 0.5 * gap * self.normal,
            point_b: middle + 0.5 * gap * self.normal,
            gap,
        }
    }
}

/// What a contact is.
pub(crate) struct Estimate {
    /// Deepest first.
    pub(crate) points: ArrayVec<ContactPoint, PATCH_POINTS>,
    /// As in [`ContactPatch`](crate::ContactPatch).
    pub(crate) relative_radii: Option<[Vec3; 2]>,
    /// Standard deviation of gaps about the estimate, metres.
    pub(crate) roughness: f32,
}

/// Memory of [`Estimate::of`], kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct EstimateScratch {
    observed: Vec<Observed>,
    residuals: Vec<Vec3>,
    /// Where each pixel would be a contact point, along the axes of the region.
    places: Vec<Vec2>,
}

/// Where the lowest place may be: a rectangle along axes of its own.
struct Region {
    axes: [Vec2; 2],
    from: Vec2,
    to: Vec2,
    /// Along each axis: by how much gaps bend, per pixel; 0 where they bend downwards.
    bends: [f32; 2],
    /// Where along each axis the gap is least in the footprint, if the gaps tell.
    lowest: [Option<f32>; 2],
    /// Whether the footprint is bent so that it is much longer than the region.
    is_round: [bool; 2],
}

impl Region {
    fn along(&self, place: Vec2) -> Vec2 {
        Vec2::new(place.dot(self.axes[0]), place.dot(self.axes[1]))
    }

    fn place(&self, along: Vec2) -> Vec2 {
        along.x * self.axes[0] + along.y * self.axes[1]
    }

    /// Takes away extents that are less than [`SAME_POINT`].
    fn narrow(&mut self) {
        let middle = 0.5 * (self.from + self.to);
        for k in 0..2 {
            if self.to[k] - self.from[k] < SAME_POINT {
                (self.from[k], self.to[k]) = (middle[k], middle[k]);
            }
        }
    }

    /// All of the footprint.
    fn whole(axis: Vec2, observed: &[Observed]) -> Self {
        let mut region = Self {
            axes: [axis, axis.perp()],
            from: Vec2::INFINITY,
            to: Vec2::NEG_INFINITY,
            bends: [0.0; 2],
            lowest: [None; 2],
            is_round: [false; 2],
        };
        for o in observed {
            let along = region.along(o.place);
            region.from = region.from.min(along);
            region.to = region.to.max(along);
        }
        region
    }

    /// Where faces meet.
    fn of_vertex(vertex: &Vertex, observed: &[Observed]) -> Self {
        let mut region = Self::whole(vertex.across, observed);
        let at = region.along(vertex.place).clamp(region.from, region.to);
        let axes = if vertex.is_corner { 0..2 } else { 0..1 };
        for k in axes {
            region.from[k] = at[k];
            region.to[k] = at[k];
        }
        region
    }

    /// Where a quadric is lowest, to within [`DOUBT`] standard errors.
    fn of_quadric(quadric: &Quadric, observed: &[Observed]) -> Self {
        let mut region = Self::whole(quadric.main_axis(), observed);
        let (low, high) = (region.from, region.to);
        // What is left of a bend without what noise adds to its square: a face's is gone.
        let sure = region.axes.map(|axis| {
            let [bend, error] = quadric.bend_along(axis);
            if bend > error {
                bend - error * error / bend
            } else {
                0.0
            }
        });
        let mut lowest = Vec2::ZERO;
        for k in 0..2 {
            let axis = region.axes[k];
            region.bends[k] = quadric.bend_along(axis)[0].max(0.0);
            if sure[k] > 0.0 {
                lowest[k] = -quadric.slope_along(Vec2::ZERO, axis)[0] / region.bends[k];
            }
        }
        let at = region.place(lowest);
        for k in (0..2).filter(|&k| sure[k] > 0.0) {
            let [_, error] = quadric.slope_along(at, region.axes[k]);
            let reach = DOUBT * error / sure[k];
            let inside = lowest[k].clamp(low[k], high[k]);
            region.lowest[k] = Some(inside);
            region.from[k] = (inside - reach).max(low[k]);
            region.to[k] = (inside + reach).min(high[k]);
            let is_narrow = region.to[k] - region.from[k] < 0.5 * (high[k] - low[k]);
            region.is_round[k] = is_narrow && inside == lowest[k];
        }
        region
    }
}

impl Estimate {
    /// The estimate of a contact with this `plane` from its pixels: index, pixel and mean gap among neighbours, by index.
    /// `contacts` is the number of all contact pixels of the pair. There is at least one pixel.
    ///
    /// Cost: linear in pixels, about fifteen passes.
    pub(crate) fn of<'a>(
        pixels: impl Iterator<Item = (u32, &'a ContactPixel, f32)>,
        plane: &Plane,
        links: &Links,
        contacts: usize,
        scratch: &mut EstimateScratch,
    ) -> Self {
        let EstimateScratch {
            observed,
            residuals,
            places,
        } = scratch;
        observed.clear();
        observed.extend(pixels.map(|(k, contact, gap)| plane.observe(k, contact, gap)));
        let observed = &observed[..];
        let least = observed.iter().fold(f32::INFINITY, |g, o| g.min(o.gap)) - LOWER;
        let quadric = Quadric::fit(observed, links, contacts, residuals);
        let vertex = Vertex::find(observed, &quadric, least);
        let mut region = match &vertex {
            Some(vertex) => Region::of_vertex(vertex, observed),
            None => Region::of_quadric(&quadric, observed),
        };
        region.narrow();
        let middle = 0.5 * (region.from + region.to);
        let gap_at = |along: Vec2| match &vertex {
            Some(vertex) => vertex.gap(region.place(along)),
            None => {
                let (mut at, mut rise) = (along, 0.0);
                for k in 0..2 {
                    match region.lowest[k] {
                        // All of the region may be the lowest place.
                        Some(lowest) => at[k] = lowest,
                        // What is no bend leaves a slope.
                        None => rise += 0.5 * region.bends[k] * (along[k] - middle[k]).powi(2),
                    }
                }
                (quadric.gap(region.place(at)) - rise).max(least)
            }
        };
        let point = |along: Vec2| {
            let place = region.place(along);
            // The surfaces bend away from the plane: as high as what is nearest.
            let nearest = observed.iter().min_by(|o, p| {
                let [o, p] = [o, p].map(|o| o.place.distance_squared(place));
                o.total_cmp(&p)
            });
            let height = nearest.map_or(0.0, |o| o.height);
            plane.point(place, height, gap_at(along))
        };
        let in_region = |along: Vec2| along.clamp(region.from, region.to);
        places.clear();
        places.extend(observed.iter().map(|o| in_region(region.along(o.place))));
        let mut chosen = ArrayVec::<Vec2, PATCH_POINTS>::new();
        for k in farthest(places.iter().copied()) {
            let inwards = inwards(&observed[k], observed, links);
            let along = in_region(region.along(inwards));
            if chosen.iter().all(|c| c.distance(along) >= SAME_POINT) {
                chosen.push(along);
            }
        }
        let mut points: ArrayVec<_, PATCH_POINTS> = chosen.into_iter().map(point).collect();
        points.sort_by(|p, q| p.gap.total_cmp(&q.gap));
        let radius = |k: usize| {
            let axis = region.axes[k];
            let axis = axis.x * plane.axes[0] + axis.y * plane.axes[1];
            plane.pixel_size / region.bends[k] * axis
        };
        let deviation = vertex.as_ref().map_or(quadric.gaps_off, Vertex::deviation);
        Self {
            points,
            relative_radii: match region.is_round {
                [true, true] => Some([radius(0), radius(1)]),
                [true, false] => Some([radius(0), Vec3::ZERO]),
                [false, true] => Some([radius(1), Vec3::ZERO]),
                [false, false] => None,
            },
            roughness: deviation * plane.pixel_size,
        }
    }
}

/// Where a pixel is without what it stands out by at the rim. See [`LEAST_INWARDS`].
fn inwards(pixel: &Observed, observed: &[Observed], links: &Links) -> Vec2 {
    if observed.len() < LEAST_INWARDS {
        return pixel.place;
    }
    let (mut sum, mut count) = (pixel.place, 1.0);
    for neighbor in links.neighbors(pixel.member) {
        if let Ok(k) = observed.binary_search_by_key(neighbor, |o| o.member) {
            sum += observed[k].place;
            count += 1.0;
        }
    }
    sum / count
}

#[cfg(test)]
mod tests {
    use crate::ContactPoint;
    use crate::contact::footprint::{Footprint, PIXEL, ball, faces, normal};
    use glamx::Vec2;

    fn place(point: &ContactPoint) -> Vec2 {
        point.middle().truncate() / PIXEL
    }

    fn disc(reach: f32, at: Vec2) -> Option<Vec2> {
        (at.length() <= reach).then_some(at)
    }

    #[test]
    fn a_ball_touches_in_its_lowest_point() {
        for seed in 0..100 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let lowest = Vec2::new(rng.f32(), rng.f32());
            let (radius, gap) = (8.0 + 30.0 * rng.f32(), -rng.f32());
            // As far as the surfaces are within a pixel.
            let reach = (2.0 * radius).sqrt();
            let found =
                Footprint::of(|at| disc(reach, at - lowest).map(|_| ball(at, lowest, radius, gap)));
            let found = found.estimate();
            assert_eq!(found.points.len(), 1, "seed {seed}");
            let point = &found.points[0];
            // The ball is no quadric: at a height of a pixel it is lower by 1 / (2 radius).
            assert!(
                place(point).distance(lowest) < 0.05,
                "seed {seed}: {point:?}"
            );
            assert!(
                (point.gap / PIXEL - gap).abs() < 0.02,
                "seed {seed}: {point:?}"
            );
            for radii in found.relative_radii.expect("it rolls") {
                let ratio = radii.length() / PIXEL / radius;
                assert!((0.9..1.05).contains(&ratio), "seed {seed}: {ratio}");
            }
        }
    }

    /// The wider the more noise there is: with one of 95 % both coordinates of the lowest place are between its points.
    #[test]
    fn a_ball_on_noise_touches_as_wide_as_the_noise_leaves_open() {
        let (mut within, mut seen) = (0, 0);
        let mut widths = [0.0; 2];
        for seed in 0..400 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let noise = [0.08, 0.16][seed as usize % 2];
            let lowest = Vec2::new(rng.f32(), rng.f32());
            let found = Footprint::of(|at| {
                let at = disc(7.0, at - lowest)? + lowest;
                let (gap, slope) = ball(at, lowest, 30.0, -0.5);
                let turn = 0.5 * Vec2::new(normal(&mut rng), normal(&mut rng));
                Some((gap + noise * normal(&mut rng), slope + noise * turn))
            });
            let points = found.estimate().points;
            let places = || points.iter().map(place);
            let low = places().fold(Vec2::INFINITY, Vec2::min);
            let high = places().fold(Vec2::NEG_INFINITY, Vec2::max);
            within += usize::from(low.cmple(lowest).all() && lowest.cmple(high).all());
            seen += 1;
            widths[seed as usize % 2] += (high - low).length();
        }
        let share = f64::from(within as u32) / f64::from(seen);
        assert!(share > 0.9, "{share}");
        assert!(widths[1] > 1.3 * widths[0], "{widths:?}");
    }

    #[test]
    fn a_face_rests_on_its_corners_and_a_cylinder_on_the_ends_of_a_line() {
        for seed in 0..100 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let axis = Vec2::from_angle(std::f32::consts::TAU * rng.f32());
            let half = Vec2::new(8.0, 5.0);
            let along = |at: Vec2| Vec2::new(at.dot(axis), at.dot(axis.perp()));
            let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]
                .map(|[x, y]| half * Vec2::new(x, y));
            // Pixels that the face covers in part have a contact as well.
            let inside = |at: Vec2| along(at).abs().cmple(half + 0.5).all();
            let face = Footprint::of(|at| inside(at).then_some((-0.3, Vec2::ZERO))).estimate();
            assert_eq!(face.points.len(), 4, "seed {seed}");
            for corner in corners {
                let off = face.points.iter().map(|p| along(place(p)).distance(corner));
                // A pixel's middle, and as far again inwards.
                assert!(off.fold(f32::INFINITY, f32::min) < 2.0, "seed {seed}");
            }
            assert!(face.relative_radii.is_none(), "seed {seed}");

            let cylinder = Footprint::of(|at| {
                let (gap, slope) = ball(Vec2::Y * along(at).y, Vec2::ZERO, 20.0, -0.3);
                inside(at).then_some((gap, slope.y * axis.perp()))
            });
            let cylinder = cylinder.estimate();
            assert_eq!(cylinder.points.len(), 2, "seed {seed}");
            for point in &cylinder.points {
                let at = along(place(point));
                assert!(
                    (at.x.abs() - half.x).abs() < 1.0 && at.y.abs() < 0.1,
                    "seed {seed}: {at}"
                );
                assert!((point.gap / PIXEL + 0.3).abs() < 0.05, "seed {seed}");
            }
            let radii = cylinder.relative_radii.expect("it rolls");
            assert!(
                (radii[0].length() / PIXEL / 20.0 - 1.0).abs() < 0.05,
                "seed {seed}"
            );
            assert!(radii[1].length() == 0.0, "seed {seed}");
        }
    }

    #[test]
    fn an_edge_touches_where_its_faces_meet_and_does_not_roll() {
        for seed in 0..100 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let across = Vec2::from_angle(std::f32::consts::TAU * rng.f32());
            let meet = Vec2::new(rng.f32(), rng.f32());
            let found = Footprint::of(|at| {
                let (gap, slope) = faces(at, meet, -0.4, &[0.8 * across, -1.2 * across]);
                (gap < 0.6 && at.dot(across.perp()).abs() < 8.0).then_some((gap, slope))
            });
            let found = found.estimate();
            assert_eq!(found.points.len(), 2, "seed {seed}");
            for point in &found.points {
                let off = (place(point) - meet).dot(across);
                assert!(off.abs() < 0.05, "seed {seed}: {off}");
                assert!((point.gap / PIXEL + 0.4).abs() < 0.05, "seed {seed}");
            }
            assert!(found.relative_radii.is_none(), "seed {seed}");
        }
    }

    /// What a device tells may be wrong: whatever it is, nothing panics.
    #[test]
    fn no_pixels_panic() {
        for seed in 0..2000 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let scale = 10.0_f32.powi(rng.i32(-30..38));
            let mut footprint = Footprint::of(|at| disc(3.0, at).map(|_| (-0.5, Vec2::ZERO)));
            for contact in &mut footprint.contacts {
                contact.gap *= rng.f32() * scale;
                contact.point_b *= rng.f32() * scale;
                contact.normal_a *= rng.f32() - 0.5;
                contact.normal_b =
                    [contact.normal_b, glamx::Vec3::NAN, scale * contact.normal_b][rng.usize(0..3)];
            }
            footprint.estimate();
        }
    }
}
