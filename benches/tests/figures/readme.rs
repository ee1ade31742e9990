//! The README.

use crate::accuracy::of_all_cases;
use crate::frames::frame;
use crate::table::{is_rounded, numbers};
use crate::{number, page, stored};

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
    // "Balls in a grid take 0.4 to 0.8 of the time and err at least seven times as often."
    let (mut least, mut times) = (f64::INFINITY, Vec::new());
    for (model, ours) in [("bunny_watertight", &bunny), ("armadillo_86k", &armadillo)] {
        let rows = stored(&format!("more_cases/peers_{model}.json"));
        let grids = rows
            .iter()
            .filter(|row| row["variant"] == "bit grid, culled");
        let mut fastest = f64::INFINITY;
        for row in grids {
            least = least.min(number(row, "error_pct") / ours[0]);
            fastest = fastest.min(number(row, "median_ms") / ours[3]);
        }
        times.push(fastest);
    }
    assert!(
        is_rounded(&shown[3], times[0]) && is_rounded(&shown[4], times[1]),
        "{times:?}"
    );
    assert!(
        accuracy.contains("at least seven times") && (6.5..7.5).contains(&least),
        "{least}"
    );
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
