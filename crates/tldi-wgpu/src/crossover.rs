//! From how many points on the GPU gains, and whether it gives the CPU's answers.

use crate::{GpuError, WgpuBackend};
use std::collections::HashMap;
use std::time::Instant;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{
    Backend, BackendError, ContactPixel, CpuBackend, PairQuery, PairResult, Params, PointCloud,
    Surface, View,
};

/// Points of the sheets that are compared.
const POINTS: [usize; 2] = [1 << 13, 1 << 16];

/// Points from which on the GPU is faster than the CPU, by two sheets that touch, of two sizes:
/// what the GPU needs for a batch of any size, and what both need for a point more.
///
/// # Errors
/// [`GpuError::Disagrees`] where the answers differ; [`GpuError::NotMeasured`] where there are none.
pub(crate) fn crossover(gpu: &mut WgpuBackend) -> Result<usize, GpuError> {
    let adapter = gpu.gpu().adapter().to_owned();
    let not_measured = |source: BackendError| GpuError::NotMeasured {
        reason: source.to_string(),
    };
    for points in POINTS {
        let difference = difference(gpu, points).map_err(not_measured)?;
        if let Some(reason) = difference {
            return Err(GpuError::Disagrees { adapter, reason });
        }
    }
    let mut cpu = CpuBackend::new();
    let mut seconds = [[0.0; 2]; 2];
    for (k, points) in POINTS.into_iter().enumerate() {
        for (backend, seconds) in [gpu as &mut dyn Backend, &mut cpu]
            .into_iter()
            .zip(&mut seconds)
        {
            seconds[k] = time(backend, points).map_err(not_measured)?;
        }
    }
    let step = (POINTS[1] - POINTS[0]) as f64;
    let [on_gpu, on_cpu] = seconds.map(|[small, large]| {
        let a_point = (large - small).max(0.0) / step;
        (small - a_point * POINTS[0] as f64, a_point)
    });
    let gain = on_cpu.1 - on_gpu.1;
    Ok(match gain > 0.0 {
        // Both sheets are in reach of each other.
        true => (2.0 * (on_gpu.0 - on_cpu.0).max(0.0) / gain) as usize,
        false => usize::MAX,
    })
}

/// Two flat sheets of a square metre, of new content.
struct Sheets {
    clouds: [PointCloud<'static>; 2],
    /// Of the points, which are as far apart, metres.
    radius: f32,
}

impl Sheets {
    fn new(points: usize) -> Result<Self, BackendError> {
        let edge = (points as f32).sqrt() as usize;
        let radius = 1.0 / edge as f32;
        let position = |i: usize| Vec3::new((i % edge) as f32, 0.0, (i / edge) as f32) * radius;
        let sheet = || {
            let positions: Vec<Vec3> = (0..edge * edge).map(position).collect();
            let built = PointCloud::builder(positions).radius(radius).build();
            built.map_err(|e| BackendError::Device(e.to_string()))
        };
        Ok(Self {
            clouds: [sheet()?, sheet()?],
            radius,
        })
    }

    fn query(&self, a_from_b: Pose3) -> PairQuery<'_> {
        PairQuery {
            a: Surface::Cloud(&self.clouds[0]),
            b: Surface::Cloud(&self.clouds[1]),
            a_from_b,
            view: View::aimed(),
            params: Params::for_radius(self.radius),
        }
    }

    fn touching(&self) -> PairQuery<'_> {
        self.query(Pose3::translation(0.0, self.radius, 0.0))
    }

    /// The second leans by 3 degrees and passes through the first along a line.
    fn crossing(&self) -> PairQuery<'_> {
        let lean = Quat::from_rotation_z(0.05);
        self.query(Pose3::from_parts(Vec3::new(0.0, -0.02, 0.0), lean))
    }
}

/// Seconds for two sheets of `points` points each that touch, new in every frame: the least of
/// three.
fn time(backend: &mut dyn Backend, points: usize) -> Result<f64, BackendError> {
    let mut results = Vec::new();
    let mut least = f64::INFINITY;
    for _ in 0..4 {
        let sheets = Sheets::new(points)?;
        let start = Instant::now();
        backend.compare(&[sheets.touching()], &mut results)?;
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok(least)
}

/// Where a backend's answers about sheets that touch, and about sheets that cross, are not those of
/// the CPU.
fn difference(backend: &mut dyn Backend, points: usize) -> Result<Option<String>, BackendError> {
    let sheets = Sheets::new(points)?;
    let batch = [sheets.touching(), sheets.crossing()];
    let (mut expected, mut found) = (Vec::new(), Vec::new());
    // Devices have no first look.
    CpuBackend::without_first_look().compare(&batch, &mut expected)?;
    backend.compare(&batch, &mut found)?;
    let named = ["touch", "cross"]
        .into_iter()
        .zip(expected.iter().zip(&found));
    let reasons = named.filter_map(|(how, (expected, found))| {
        let reason = difference_of(expected, found, sheets.radius)?;
        let points = sheets.clouds[0].len();
        Some(format!(
            "of two sheets of {points} points that {how}, {reason}"
        ))
    });
    Ok(reasons.reduce(|all, reason| format!("{all}; {reason}")))
}

/// Angle between axes, radians; gaps in radii; share of the contact pixels: those of the parity tests.
/// Estimated normals, and with them axes, differ by rounding (see docs/architecture.md, "On the GPU");
/// a point within rounding of a pixel's border may fall to either side.
const MOST_AXIS: f32 = 2e-3;
const MOST_GAP: f32 = 0.05;
const MOST_PIXELS: f32 = 0.01;

/// What differs by more than rounding does.
fn difference_of(expected: &PairResult, found: &PairResult, radius: f32) -> Option<String> {
    if expected.collides != found.collides {
        return Some(format!("`collides` is {}", found.collides));
    }
    let axes = (&expected.axes, &found.axes);
    let is_like = |(a, b): (&Vec3, &Vec3)| a.distance(*b) <= MOST_AXIS;
    if axes.0.len() != axes.1.len() || !axes.0.iter().zip(axes.1).all(is_like) {
        return Some(format!(
            "the views are along {:?} and not {:?}",
            axes.1, axes.0
        ));
    }
    let is_like = |a: f32, b: f32| (a - b).abs() <= MOST_GAP * radius;
    let (gap, other) = (expected.gap, found.gap);
    if gap.zip(other).map_or(gap != other, |(a, b)| !is_like(a, b)) {
        return Some(format!("the gap is {other:?} and not {gap:?} m"));
    }
    let key = |c: &ContactPixel| (c.view, c.pixel);
    let gaps: HashMap<_, f32> = found.contacts.iter().map(|c| (key(c), c.gap)).collect();
    let is_found = |c: &&ContactPixel| gaps.get(&key(c)).is_some_and(|g| is_like(*g, c.gap));
    let same = expected.contacts.iter().filter(is_found).count();
    let most = expected.contacts.len().max(found.contacts.len());
    (((most - same) as f32) > MOST_PIXELS * most as f32).then(|| {
        let count = found.contacts.len();
        let own = expected.contacts.len();
        format!("{same} of {own} contact pixels are found, among {count}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each kind of answer that is off by more than rounding is reported; what rounding does is not.
    #[test]
    fn answers_that_differ_are_told() {
        let sheets = Sheets::new(1 << 10).expect("the points are valid");
        let mut found = Vec::new();
        let outcome = CpuBackend::without_first_look().compare(&[sheets.crossing()], &mut found);
        outcome.expect("the CPU takes it");
        let (expected, r) = (&found[0], sheets.radius);
        assert!(
            expected.collides && expected.contacts.len() > 300,
            "{found:?}"
        );
        let told = |change: &dyn Fn(&mut PairResult)| {
            let mut changed = expected.clone();
            change(&mut changed);
            difference_of(expected, &changed, r).unwrap_or_default()
        };
        assert_eq!(told(&|_| {}), "");
        assert_eq!(
            told(&|result| result.gap = result.gap.map(|gap| gap + 0.01 * r)),
            ""
        );
        assert_eq!(
            told(&|result| result.contacts.truncate(result.contacts.len() - 1)),
            ""
        );
        let shifted = |result: &mut PairResult| {
            result
                .contacts
                .iter_mut()
                .step_by(20)
                .for_each(|c| c.gap += 0.1 * r);
        };
        let thinned = |result: &mut PairResult| {
            result.contacts.truncate(result.contacts.len() * 19 / 20);
        };
        let doubled = |result: &mut PairResult| result.contacts.extend_from_within(..20);
        let leaned =
            |result: &mut PairResult| result.axes[0] = Quat::from_rotation_x(0.01) * result.axes[0];
        for (change, expected) in [
            (
                &(|result: &mut PairResult| result.collides = false) as &dyn Fn(&mut PairResult),
                "collides",
            ),
            (&leaned, "views"),
            (&|result| result.axes.clear(), "views"),
            (
                &|result| result.gap = result.gap.map(|gap| gap + 0.1 * r),
                "gap",
            ),
            (&|result| result.gap = None, "gap"),
            (&shifted, "contact pixels"),
            (&thinned, "contact pixels"),
            (&doubled, "contact pixels"),
        ] {
            let told = told(change);
            assert!(told.contains(expected), "{expected}: {told}");
        }
    }
}
