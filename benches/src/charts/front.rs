//! The Pareto front: methods that no other one beats in both time and error.

use super::figure::Point;

/// Indices of the points of which no other has less of one and no more of the other, by rising first
/// coordinate. Of equal points the first.
pub(super) fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&i, &j| {
        let ([x, y], [u, v]) = (points[i], points[j]);
        x.total_cmp(&u).then(y.total_cmp(&v)).then(i.cmp(&j))
    });
    let mut best = f64::INFINITY;
    order.retain(|&i| {
        let is_better = points[i][1] < best;
        best = best.min(points[i][1]);
        is_better
    });
    order
}

/// A line through the points of a front, by rising first coordinate: between two of them nothing better
/// than the first is known.
pub(super) fn steps(on_front: impl IntoIterator<Item = [f64; 2]>) -> Vec<Point> {
    let mut steps: Vec<Point> = Vec::new();
    for [x, y] in on_front {
        let corner = steps.last().map(|last| last.y);
        for y in corner.into_iter().chain([y]) {
            steps.push(Point::new(x, y));
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the definition, one pair after the other.
    #[test]
    fn no_point_of_the_front_is_beaten() {
        let mut rng = fastrand::Rng::with_seed(4);
        for _ in 0..50 {
            let points: Vec<[f64; 2]> = (0..40)
                .map(|_| [0, 1].map(|_| f64::from(rng.u32(0..12))))
                .collect();
            let found = front(&points);
            let beats = |p: [f64; 2], q: [f64; 2]| p[0] <= q[0] && p[1] <= q[1] && p != q;
            for (i, &point) in points.iter().enumerate() {
                let is_beaten = points.iter().any(|&other| beats(other, point));
                let is_repeated = points[..i].contains(&point);
                assert_eq!(found.contains(&i), !is_beaten && !is_repeated, "{point:?}");
            }
            assert!(found.is_sorted_by(|&i, &j| points[i][0] < points[j][0]));
        }
        assert!(front(&[]).is_empty());
    }
}
