//! The README.

use crate::accuracy::median_ms;
use crate::frames::beside_a_grid;
use crate::table::{is_rounded, numbers};
use crate::{number, page, stored};
use serde_json::Value;

/// Wrong answers of a row.
fn wrong(row: &Value) -> f64 {
    let tallies = row["by_distance"].as_array().expect("tallies");
    let of = |tally| number(tally, "false_negatives") + number(tally, "false_positives");
    tallies.iter().map(of).sum()
}

/// Of both large models: this library's wrong answers to all cases; then those of the balls that err least, and the ends of
/// their times (of a sample) divided by this library's; then the ends of both for all larger balls.
fn counts() -> Vec<f64> {
    let (mut ours, mut least, mut larger) = (Vec::new(), Vec::new(), Vec::new());
    for model in ["bunny_watertight", "armadillo_86k"] {
        ours.push(wrong(&stored(&format!("more_cases/{model}.json"))[0]));
        let sample = stored(&format!("accuracy/speed_accuracy_{model}.json"));
        let our_ms = median_ms(&sample, "default", "pixel_scale", 1.0).expect("the default");
        let mut balls: Vec<_> = stored(&format!("more_cases/peers_{model}.json"))
            .iter()
            .filter(|row| row["variant"] == "bit grid, culled")
            .map(|row| {
                let radius = number(row, "radius_scale");
                let ms = median_ms(&sample, "bit grid, culled", "radius_scale", radius);
                let time = ms.expect("the same balls in the sample") / our_ms;
                (radius, wrong(row), time)
            })
            .collect();
        balls.sort_by(|m, n| m.1.total_cmp(&n.1));
        let best = balls.remove(0);
        assert!(
            balls.iter().all(|ball| ball.0 > best.0),
            "{model}: smaller balls err more than {best:?}: {balls:?}"
        );
        least.push(best);
        larger.extend(balls);
    }
    type Ball = (f64, f64, f64);
    let ends = |balls: &[Ball], of: fn(&Ball) -> f64| {
        let values = || balls.iter().map(of);
        [
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        ]
    };
    ours.extend(least.iter().map(|ball| ball.1));
    ours.extend(ends(&least, |ball| ball.2));
    ours.extend(ends(&larger, |ball| ball.1));
    ours.extend(ends(&larger, |ball| ball.2));
    ours
}

/// Three texts have the counts in the same order, behind the number of all cases.
#[test]
fn wrong_answers() {
    let counts = counts();
    for (name, begin) in [
        ("README.md", "**Accuracy.**"),
        ("docs/benchmarks.md", "| wrong answers, all"),
        ("docs/benchmarks.md", "On both large models, "),
    ] {
        let page = page(name);
        let (_, text) = page.split_once(begin).expect("a paragraph");
        let shown = numbers(text);
        assert_eq!(shown[0], "27900", "{begin}");
        for (shown, is) in shown[1..].iter().zip(&counts) {
            assert!(
                is_rounded(shown, *is),
                "{begin}: {shown} is {is}: {counts:?}"
            );
        }
    }
}

#[test]
fn a_grid_beside_it() {
    let page = page("README.md");
    let rows = stored("frames/frames_generated.json");
    let of_grid = |points, k| beside_a_grid(&rows, Some(points), k);
    // Deep: "0.3 of a grid's time or less, from 134,000 points".
    for points in [134_000, 544_000, 1_000_000] {
        let ratio = of_grid(points, 2);
        assert!((0.15..0.3).contains(&ratio), "{points}: {ratio}");
    }
    // Slight: the ends of this library's times, and how much faster a grid is at most.
    let slight = [10_000, 134_000, 544_000, 1_000_000].map(|points| of_grid(points, 1));
    let [least, most] = [
        slight.into_iter().fold(f64::INFINITY, f64::min),
        slight.into_iter().fold(0.0, f64::max),
    ];
    let (_, text) = page
        .split_once("a grid that pairs balls is up to")
        .expect("a row");
    assert!(is_rounded(&numbers(text)[0], most), "{slight:?}");
    let page = crate::page("docs/benchmarks.md");
    let (_, text) = page.split_once("| shallow contact |").expect("a row");
    let shown = numbers(text);
    assert!(
        is_rounded(&shown[0], least) && is_rounded(&shown[1], most),
        "{slight:?}"
    );
    let (_, text) = page.split_once("a culled grid is ahead by").expect("a row");
    let shown = numbers(text);
    assert!(
        is_rounded(&shown[0], slight[1]) && is_rounded(&shown[2], slight[0]),
        "{slight:?}"
    );
}
