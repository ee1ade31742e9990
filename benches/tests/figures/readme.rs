//! The README.

use crate::accuracy::{median_ms, of_all_cases};
use crate::frames::frame;
use crate::table::{is_rounded, numbers};
use crate::{number, page, stored};

/// Of the culled bit grid, times (of a sample) and errors (of all cases) divided by those of this library, by the radius of its
/// balls. First for the balls that err least on each model, then for all larger ones.
fn balls() -> [Vec<[f64; 2]>; 2] {
    let (mut least, mut larger) = (Vec::new(), Vec::new());
    for model in ["bunny_watertight", "armadillo_86k"] {
        let ours = of_all_cases(model, "this project, pixel 1 r").expect("all cases");
        let sample = stored(&format!("accuracy/speed_accuracy_{model}.json"));
        let our_ms = median_ms(&sample, "default", "pixel_scale", 1.0).expect("the default");
        let rows = stored(&format!("more_cases/peers_{model}.json"));
        let grids = rows
            .iter()
            .filter(|row| row["variant"] == "bit grid, culled");
        let mut balls: Vec<_> = grids
            .map(|row| {
                let radius = number(row, "radius_scale");
                let ms = median_ms(&sample, "bit grid, culled", "radius_scale", radius);
                let ratios = [
                    ms.expect("the same balls in the sample") / our_ms,
                    number(row, "error_pct") / ours[0],
                ];
                (radius, ratios)
            })
            .collect();
        balls.sort_by(|m, n| m.1[1].total_cmp(&n.1[1]));
        let best = balls.remove(0);
        least.push(best.1);
        assert!(
            balls.iter().all(|ball| ball.0 > best.0),
            "{model}: smaller balls err more than {best:?}: {balls:?}"
        );
        larger.extend(balls.into_iter().map(|ball| ball.1));
    }
    [least, larger]
}

/// Whether the four numbers are the ends of the ranges of times and of errors, rounded.
fn assert_ranges(shown: [&str; 4], rows: &[[f64; 2]]) {
    let ends = |k: usize| {
        let of = || rows.iter().map(|row| row[k]);
        [
            of().fold(f64::INFINITY, f64::min),
            of().fold(f64::NEG_INFINITY, f64::max),
        ]
    };
    let [times, errors] = [ends(0), ends(1)];
    for (shown, is) in shown.iter().zip([times, errors].concat()) {
        assert!(is_rounded(shown, is), "{shown} is {is}: {rows:?}");
    }
}

#[test]
fn the_readme() {
    let page = page("README.md");
    let [bunny, armadillo] = ["bunny_watertight", "armadillo_86k"]
        .map(|model| of_all_cases(model, "this project, pixel 1 r").expect("all cases"));
    let (_, accuracy) = page.split_once("**Accuracy.**").expect("a paragraph");
    let shown = numbers(accuracy);
    assert!(
        is_rounded(&shown[1], bunny[0]) && is_rounded(&shown[2], armadillo[0]),
        "{shown:?}"
    );
    // "Balls that err least err 7 to 8 times as often, in 0.5 to 0.9 of the time. Larger balls take 0.4 to 0.8 of the time
    // and err 8 to 19 times as often."
    let [least, larger] = balls();
    let n = |k: usize| shown[k].as_str();
    assert_ranges([n(5), n(6), n(3), n(4)], &least);
    assert_ranges([n(7), n(8), n(9), n(10)], &larger);
    // The same on the page of the benchmarks.
    let benchmarks = crate::page("docs/benchmarks.md");
    let row = benchmarks
        .lines()
        .find(|line| line.starts_with("| wrong answers"));
    let shown = numbers(row.expect("a row"));
    let n = |k: usize| shown[k].as_str();
    assert_ranges([n(5), n(6), n(3), n(4)], &least);
    assert_ranges([n(9), n(10), n(7), n(8)], &larger);
    let (_, text) = (benchmarks.split_once("the balls that err least")).expect("a paragraph");
    let shown = numbers(text);
    let n = |k: usize| shown[k].as_str();
    // Behind the radius.
    assert_ranges([n(3), n(4), n(1), n(2)], &least);
    assert_ranges([n(5), n(6), n(7), n(8)], &larger);
    // Deep: "0.3 of a grid's time or less, from 134,000 points"; slight: "up to 5 times faster".
    let rows = stored("frames/frames_generated.json");
    let ratio = |points, k| {
        let of = |method| frame(&rows, Some(points), method, 1, k)[0];
        of("tldi (cpu)") / of("bit grid, culled")
    };
    for points in [134_000, 544_000, 1_000_000] {
        assert!(
            (0.15..0.3).contains(&ratio(points, 2)),
            "{}",
            ratio(points, 2)
        );
    }
    let slight = [10_000, 134_000, 544_000, 1_000_000].map(|points| ratio(points, 1));
    let most = slight.into_iter().fold(0.0, f64::max);
    assert!(page.contains("is up to 5 times faster"));
    assert!((4.0..=5.0).contains(&most), "{slight:?}");
}
