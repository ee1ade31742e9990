//! How far two closed surfaces must part until they no longer overlap, from dense samples of both.

use tldi::glamx::{Quat, Vec2, Vec3};

/// Directions that are tried first: a Fibonacci lattice, about 20° apart.
const DIRECTIONS: usize = 100;

/// Half angles of the rounds in which the best direction is refined, radians.
const ROUNDS: [f32; 4] = [0.2, 0.1, 0.05, 0.025];

/// Two surfaces as dense points in one frame.
pub struct WayOut {
    a: Vec<Vec3>,
    b: Vec<Vec3>,
    /// Edge of a cell across the way, metres.
    cell: f32,
}

impl WayOut {
    /// Samples of both surfaces in one frame, less than `spacing` metres apart.
    pub fn new(a: Vec<Vec3>, b: Vec<Vec3>, spacing: f32) -> Self {
        let cell = 2.0 * spacing;
        Self { a, b, cell }
    }

    /// How far the second surface must move along the unit vector `along` to be past all of the first, metres;
    /// negative where it already is, and minus infinity where it never meets it.
    ///
    /// Points in one cell across the way count as one behind the other, so that a slope of angle s errs by up to a
    /// cell times the tangent of s.
    pub fn along(&self, along: Vec3) -> f32 {
        let (u, v) = along.any_orthonormal_pair();
        let across = |p: &Vec3| Vec2::new(p.dot(u), p.dot(v)) / self.cell;
        let bounds = |points: &[Vec3]| {
            let fold = |(lo, hi): (Vec2, Vec2), p: &Vec3| (lo.min(across(p)), hi.max(across(p)));
            (points.iter()).fold((Vec2::INFINITY, Vec2::NEG_INFINITY), fold)
        };
        let ((lo_a, hi_a), (lo_b, hi_b)) = (bounds(&self.a), bounds(&self.b));
        let (lo, hi) = (lo_a.max(lo_b).floor(), hi_a.min(hi_b));
        if lo.cmpgt(hi).any() {
            return f32::NEG_INFINITY;
        }
        let size = ((hi - lo).floor() + 1.0).to_array().map(|x| x as usize);
        let place = |p: &Vec3| {
            let at = (across(p) - lo).floor();
            let inside = at.cmpge(Vec2::ZERO).all()
                && at.cmplt(Vec2::new(size[0] as f32, size[1] as f32)).all();
            inside.then(|| at.y as usize * size[0] + at.x as usize)
        };
        let mut farthest = vec![f32::NEG_INFINITY; size[0] * size[1]];
        for p in &self.a {
            if let Some(cell) = place(p) {
                farthest[cell] = farthest[cell].max(p.dot(along));
            }
        }
        let ways = (self.b.iter()).filter_map(|p| Some(farthest[place(p)?] - p.dot(along)));
        ways.fold(f32::NEG_INFINITY, f32::max)
    }

    /// The least way out over all directions, metres; `guess` is tried as well.
    pub fn least(&self, guess: Vec3) -> f32 {
        let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
        let lattice = (0..DIRECTIONS).map(|i| {
            let z = 1.0 - (2 * i + 1) as f32 / DIRECTIONS as f32;
            let (sin, cos) = (golden * i as f32).sin_cos();
            Vec2::new(cos, sin).extend(0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
        });
        let mut best = (self.along(guess), guess);
        let try_one = |direction: Vec3, best: &mut (f32, Vec3)| {
            let way = self.along(direction);
            if way < best.0 {
                *best = (way, direction);
            }
        };
        lattice.for_each(|direction| try_one(direction, &mut best));
        for angle in ROUNDS {
            let middle = best.1;
            let (u, v) = middle.any_orthonormal_pair();
            for k in 0..6 {
                let (sin, cos) = (std::f32::consts::FRAC_PI_3 * k as f32).sin_cos();
                let turn = Quat::from_axis_angle(cos * u + sin * v, angle);
                try_one(turn * middle, &mut best);
            }
        }
        best.0
    }
}
