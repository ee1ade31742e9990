//! The generated scene: a furnished room as a scanner would see it, and bodies to drop into it.

use crate::random;
use crate::surface_sampling::{SampledSurface, sample_surface};
use fastrand::Rng;
use tldi::Aabb;
use tldi::glamx::{Vec2, Vec3};

/// A solid of the room.
struct Solid {
    /// Signed distance in metres to its surface.
    distance: Box<dyn Fn(Vec3) -> f32>,
    /// Its colour at a point of its surface.
    color: Box<dyn Fn(Vec3) -> [u8; 3]>,
}

impl Solid {
    fn new(
        distance: impl Fn(Vec3) -> f32 + 'static,
        color: impl Fn(Vec3) -> [u8; 3] + 'static,
    ) -> Self {
        Self {
            distance: Box::new(distance),
            color: Box::new(color),
        }
    }

    /// A block of one colour, with a grain where it is of wood.
    fn block(center: [f32; 3], half: [f32; 3], color: [u8; 3], grain: f32) -> Self {
        let (center, half) = (Vec3::from(center), Vec3::from(half));
        Self::new(
            move |p| rounded_block(p - center, half, 0.01),
            move |p| grained(p, color, grain),
        )
    }
}

/// A corner of a furnished room as a coloured point cloud with noise, z up, 4.2 × 3.6 × 1.5 m:
/// floor, two walls, a table with a bowl on it, steps, a bookcase, a stool, an open crate.
///
/// `spacing` is the distance between neighbouring points in metres (0.015 gives some 200,000
/// points) and `noise` the standard deviation of their error in metres.
pub fn furnished_room(spacing: f32, noise: f32, seed: u64) -> SampledSurface {
    let solids = room_solids();
    let bounds = Aabb {
        min: Vec3::splat(-0.01),
        max: Vec3::new(4.2, 3.6, 1.5),
    };
    let distances = |p: Vec3| solids.iter().map(move |solid| (solid.distance)(p));
    let distance = |p: Vec3| distances(p).fold(f32::MAX, f32::min);
    let mut room = sample_surface(distance, bounds, spacing, seed);
    let color = |p: &Vec3| {
        let nearest = (solids.iter().zip(distances(*p))).min_by(|a, b| a.1.total_cmp(&b.1));
        let [r, g, b] = nearest.map_or([0; 3], |(solid, _)| (solid.color)(*p));
        [r, g, b, 255]
    };
    room.colors = room.points.iter().map(color).collect();
    let mut rng = Rng::with_seed(seed ^ 0x6e6f_6973);
    for (point, normal) in room.points.iter_mut().zip(&room.normals) {
        *point += noise * random::normal(&mut rng) * *normal;
    }
    room
}

fn room_solids() -> Vec<Solid> {
    let crate_center = Vec3::new(0.75, 2.75, 0.0);
    let stool = Vec3::new(2.75, 2.75, 0.23);
    let bowl = Vec3::new(1.5, 1.5, 0.725);
    let bowl_color = |p: Vec3| match p.z > 0.88 {
        true => [235, 238, 240],
        false => [72, 112, 160],
    };
    let mut solids = vec![
        Solid::new(|p| p.z, floor_color),
        Solid::new(|p| p.x, |_| [214, 206, 190]),
        Solid::new(|p| p.y, |_| [198, 204, 206]),
    ];
    solids.extend(table());
    // Steps along the wall y = 0.
    for (k, height) in [0.2, 0.4, 0.6].into_iter().enumerate() {
        let (y, half) = (1.05 - 0.35 * k as f32 - 0.35, 0.5 * height);
        let step = ([3.45, y, half], [0.42, 0.18, half]);
        solids.push(Solid::block(step.0, step.1, [146, 148, 152], 0.0));
    }
    solids.extend(bookcase());
    solids.extend([
        Solid::new(
            move |p| open_crate(yawed(p - crate_center, 0.4)),
            |p| grained(p, [186, 152, 98], WOOD_GRAIN),
        ),
        Solid::new(
            move |p| rounded_disc(p - stool, 0.27, 0.23, 0.03),
            |_| [92, 128, 112],
        ),
        Solid::new(move |p| bowl_distance(p - bowl), bowl_color),
    ]);
    solids
}

const WOOD: [u8; 3] = [164, 116, 72];

fn table() -> impl Iterator<Item = Solid> {
    let top = Solid::block([1.9, 1.5, 0.70], [0.75, 0.48, 0.025], WOOD, WOOD_GRAIN);
    let legs = [(1.22, 1.09), (2.58, 1.09), (1.22, 1.91), (2.58, 1.91)];
    let leg = |(x, y)| Solid::block([x, y, 0.34], [0.03, 0.03, 0.34], [120, 84, 52], WOOD_GRAIN);
    std::iter::once(top).chain(legs.map(leg))
}

/// A bookcase with books along the wall x = 0.
fn bookcase() -> impl Iterator<Item = Solid> {
    const BOOK_COLORS: [[u8; 3]; 4] = [[150, 52, 48], [52, 92, 130], [196, 160, 70], [70, 110, 74]];
    let side = |y| Solid::block([0.2, y, 0.5], [0.19, 0.02, 0.5], WOOD, WOOD_GRAIN);
    let shelf = |z| Solid::block([0.2, 1.1, z], [0.19, 0.6, 0.02], WOOD, WOOD_GRAIN);
    let book = |k: usize| {
        let half = 0.11 + 0.012 * ((k * 5) % 4) as f32;
        let center = [0.17, 0.6 + 0.07 * k as f32, 0.57 + half];
        Solid::block(center, [0.12, 0.026, half], BOOK_COLORS[k % 4], 0.0)
    };
    let (sides, shelves) = ([0.5, 1.7].map(side), [0.1, 0.55, 1.0].map(shelf));
    sides.into_iter().chain(shelves).chain((0..9).map(book))
}

fn floor_color(p: Vec3) -> [u8; 3] {
    let on_rug = rounded_rectangle(p.truncate() - Vec2::new(2.0, 2.6), Vec2::new(1.3, 0.6), 0.1);
    if on_rug < -0.08 {
        return [136, 60, 58];
    }
    if on_rug < 0.0 {
        return [212, 190, 150];
    }
    let plank = (p.y / 0.15).floor();
    let shade = 0.9 + 0.2 * (plank * 0.618).fract();
    [150.0, 124.0, 96.0].map(|c: f32| (c * shade) as u8)
}

/// Strength of the grain of wood, as a share of its brightness.
const WOOD_GRAIN: f32 = 0.05;

/// A colour with a grain along x.
fn grained(p: Vec3, color: [u8; 3], grain: f32) -> [u8; 3] {
    let shade = 1.0 + grain * (55.0 * (p.y + p.z) + 1.5 * (3.0 * p.x).sin()).sin();
    color.map(|c| (f32::from(c) * shade).min(255.0) as u8)
}

// Signed distances in metres; see Inigo Quilez, "distance functions",
// https://iquilezles.org/articles/distfunctions/.

pub(crate) fn rounded_block(p: Vec3, half: Vec3, rounding: f32) -> f32 {
    let q = p.abs() - half + Vec3::splat(rounding);
    q.max(Vec3::ZERO).length() + q.max_element().min(0.0) - rounding
}

fn rounded_rectangle(p: Vec2, half: Vec2, rounding: f32) -> f32 {
    let q = p.abs() - half + Vec2::splat(rounding);
    q.max(Vec2::ZERO).length() + q.max_element().min(0.0) - rounding
}

/// A disc around the z axis.
fn rounded_disc(p: Vec3, radius: f32, half_height: f32, rounding: f32) -> f32 {
    let from_axis = Vec2::new(p.truncate().length(), p.z);
    rounded_rectangle(from_axis, Vec2::new(radius, half_height), rounding)
}

/// A box of 0.7 × 0.5 × 0.3 m with walls of 3 cm, open at the top, standing on z = 0.
fn open_crate(p: Vec3) -> f32 {
    let block = |height: f32, half| rounded_block(p - height * Vec3::Z, Vec3::from(half), 0.005);
    let outside = block(0.15, [0.35, 0.25, 0.15]);
    let inside = block(0.33, [0.32, 0.22, 0.3]);
    outside.max(-inside)
}

/// The lower part of a spherical shell, its outside 20 cm in radius, standing on z = 0.
fn bowl_distance(p: Vec3) -> f32 {
    let from_center = p - Vec3::new(0.0, 0.0, 0.2);
    let shell = (from_center.length() - 0.19).abs() - 0.01;
    shell.max(p.z - 0.17)
}

fn yawed(p: Vec3, angle: f32) -> Vec3 {
    let (sin, cos) = angle.sin_cos();
    Vec3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z)
}

/// Shapes of the generated bodies. Each stands on its widest side where its y axis points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyShape {
    /// A ring.
    Torus,
    /// A box with rounded edges.
    RoundedBox,
    /// A five-pointed star with rounded edges.
    Star,
    /// A ball flattened to 6/10 of its width.
    Pebble,
}

impl BodyShape {
    /// All shapes.
    pub const ALL: [Self; 4] = [Self::Torus, Self::RoundedBox, Self::Star, Self::Pebble];

    /// Those without a hole.
    pub const WHOLE: [Self; 3] = [Self::RoundedBox, Self::Pebble, Self::Star];

    /// Name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Torus => "torus",
            Self::RoundedBox => "rounded box",
            Self::Star => "star",
            Self::Pebble => "pebble",
        }
    }

    /// Signed distance in metres (or a bound of it) for a body 1 m wide around the origin.
    pub(crate) fn distance(self, p: Vec3) -> f32 {
        match self {
            Self::Torus => {
                let from_ring = Vec2::new(Vec2::new(p.x, p.z).length() - 0.35, p.y);
                from_ring.length() - 0.15
            }
            Self::RoundedBox => rounded_block(p, Vec3::new(0.5, 0.25, 0.35), 0.08),
            Self::Star => {
                let outline = star_outline(Vec2::new(p.x, p.z)) - 0.02;
                let q = Vec2::new(outline + 0.06, p.y.abs() - 0.14 + 0.06);
                q.max(Vec2::ZERO).length() + q.max_element().min(0.0) - 0.06
            }
            Self::Pebble => {
                let half = Vec3::new(0.5, 0.3, 0.42);
                let k0 = (p / half).length();
                let k1 = (p / (half * half)).length();
                // The first-order distance overestimates far from the surface: 0.5 bounds it.
                if k1 > 0.0 {
                    0.5 * k0 * (k0 - 1.0) / k1
                } else {
                    -0.15
                }
            }
        }
    }

    /// The shape as a point cloud with outward normals, about 1 m wide, with `spacing` metres
    /// between neighbouring points.
    pub fn sample(self, spacing: f32, seed: u64) -> SampledSurface {
        let bounds = Aabb {
            min: Vec3::splat(-0.6),
            max: Vec3::splat(0.6),
        };
        sample_surface(|p| self.distance(p), bounds, spacing, seed)
    }
}

/// Signed distance to a five-pointed star of radius 0.48 and inner radius 0.24.
fn star_outline(p: Vec2) -> f32 {
    let sector = std::f32::consts::TAU / 5.0;
    let angle = p.y.atan2(p.x);
    let folded = (angle - (angle / sector).round() * sector).abs();
    let (sin, cos) = folded.sin_cos();
    let q = p.length() * Vec2::new(cos, sin);
    let tip = Vec2::new(0.48, 0.0);
    let notch = 0.24 * Vec2::new((0.5 * sector).cos(), (0.5 * sector).sin());
    let edge = notch - tip;
    let t = ((q - tip).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
    let side = edge.perp_dot(q - tip).signum();
    (q - tip - t * edge).length() * -side
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_lie_flat_and_their_normals_point_outward() {
        for shape in BodyShape::ALL {
            let body = shape.sample(0.05, 1);
            let bounds = body.points.iter().fold(Aabb::EMPTY, |b, p| b.including(*p));
            let extents = bounds.extents();
            let name = shape.name();
            assert!(
                (0.8..=1.01).contains(&extents.max_element()),
                "{name}: {extents}"
            );
            assert!(extents.y <= extents.x.min(extents.z), "{name}: {extents}");
            for (p, n) in body.points.iter().zip(&body.normals) {
                assert!(shape.distance(*p + 0.02 * *n) > 0.0, "{name}: {n} at {p}");
                assert!(shape.distance(*p - 0.02 * *n) < 0.0, "{name}: {n} at {p}");
            }
        }
    }

    #[test]
    fn the_room_has_all_its_surfaces() {
        let room = furnished_room(0.05, 0.0, 1);
        let share = |keep: &dyn Fn(Vec3) -> bool| {
            let kept = room.points.iter().filter(|p| keep(**p)).count();
            kept as f32 / room.points.len() as f32
        };
        assert!(share(&|p| p.z.abs() < 1e-3) > 0.2, "floor");
        assert!(share(&|p| p.x.abs() < 1e-3) > 0.05, "wall");
        assert!(share(&|p| (p.z - 0.725).abs() < 1e-3) > 0.02, "table top");
        assert!(share(&|p| p.z < -0.01) == 0.0, "below the floor");
        assert_eq!(room.points.len(), room.colors.len());
    }
}
