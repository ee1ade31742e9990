//! The figures of the README and of `docs/benchmarks.md` are those of the stored results, rounded to the digits shown.

use serde_json::Value;
use std::path::{Path, PathBuf};

const PLACEMENTS: [&str; 5] = ["near-miss", "slight", "deep", "coincident", "body on scan"];

fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn page(name: &str) -> String {
    std::fs::read_to_string(top().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Rows of a stored file under `benches/results`.
fn stored(name: &str) -> Vec<Value> {
    let path = top().join("benches/results").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
    let file: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
    file["rows"].as_array().expect("rows").clone()
}

fn number(row: &Value, key: &str) -> f64 {
    let value = &row[key];
    value.as_f64().unwrap_or_else(|| panic!("{key} of {row}"))
}

/// The numbers in a text, as written.
fn numbers(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut current = String::new();
    for c in text.chars().chain([' ']) {
        let goes_on = matches!(c, '.' | ',') && !current.is_empty();
        if c.is_ascii_digit() || goes_on {
            current.push(c);
        } else if !current.is_empty() {
            all.push(current.trim_end_matches(['.', ',']).replace(',', ""));
            current.clear();
        }
    }
    all
}

/// Whether a number is `value`, rounded to the digits shown. Zeros at the end of a whole number may be rounded, too.
fn is_rounded(shown: &str, value: f64) -> bool {
    let digits = shown.split_once('.').map_or(0, |(_, digits)| digits.len());
    let parsed: f64 = shown.parse().expect("a number");
    // What lies on the border between two roundings may be shown as either.
    let step = 10f64.powi(-(digits as i32));
    (parsed - value).abs() <= 0.5 * step * (1.0 + 1e-6)
}

/// A table of a page: the first one behind `caption`.
struct Table<'a> {
    caption: &'a str,
    rows: Vec<Vec<&'a str>>,
}

impl<'a> Table<'a> {
    fn new(page: &'a str, caption: &'a str) -> Self {
        let (_, behind) = (page.split_once(caption)).unwrap_or_else(|| panic!("no {caption:?}"));
        let lines = behind.lines().map(str::trim);
        let table = lines.skip_while(|line| !line.starts_with('|'));
        let rows = table.take_while(|line| line.starts_with('|'));
        let cells = |line: &'a str| line.trim_matches('|').split('|').map(str::trim).collect();
        Self {
            caption,
            rows: rows.map(cells).collect(),
        }
    }

    /// Compares every cell behind the first of every row with what `expected` has for the row's name and the cell's
    /// number. `None`: the cell has no number. Rows that are about nothing measured have no entry (`is_row`).
    fn check(
        &self,
        wrong: &mut Vec<String>,
        is_row: impl Fn(&str) -> bool,
        expected: impl Fn(&str, usize) -> Option<Vec<f64>>,
    ) {
        let mut checked = 0;
        for row in self.rows.iter().skip(2).filter(|row| is_row(row[0])) {
            for (k, cell) in row[1..].iter().enumerate() {
                let expected = expected(row[0], k).unwrap_or_default();
                let shown = numbers(cell);
                let agree = shown.len() == expected.len()
                    && shown.iter().zip(&expected).all(|(s, v)| is_rounded(s, *v));
                if !agree {
                    let Self { caption, .. } = self;
                    wrong.push(format!("{caption}: {}: {cell:?} is {expected:.4?}", row[0]));
                }
                checked += 1;
            }
        }
        assert!(checked > 3, "{}: {checked} cells", self.caption);
    }
}

/// The row of a method whose setting errs least, and its setting.
fn least_error<'a>(rows: &'a [Value], variant: &str, setting: &str) -> (&'a Value, f64) {
    let of_it = rows.iter().filter(|row| row["variant"] == variant);
    let best = of_it.min_by(|m, n| number(m, "error_pct").total_cmp(&number(n, "error_pct")));
    let best = best.unwrap_or_else(|| panic!("no {variant:?}"));
    (best, best[setting].as_f64().unwrap_or(f64::NAN))
}

/// Error, false negatives, setting where there is one, milliseconds.
fn of_accuracy(rows: &[Value], name: &str) -> Vec<f64> {
    let pixel = |pixel: f64| {
        let is_it = |row: &&Value| row["variant"] == "default" && row["pixel_scale"] == pixel;
        let row = rows.iter().find(is_it).expect("the default");
        vec![
            number(row, "error_pct"),
            number(row, "false_negative_pct"),
            number(row, "median_ms"),
        ]
    };
    let best = |variant: &str, setting: &str| {
        let (row, setting) = least_error(rows, variant, setting);
        let mut all = vec![number(row, "error_pct"), number(row, "false_negative_pct")];
        all.extend(Some(setting).filter(|s| s.is_finite()));
        all.push(number(row, "median_ms"));
        all
    };
    match name {
        "this project, pixel 1 r" => pixel(1.0),
        "pixel 0.7 r" => pixel(0.7),
        "paper" => best("paper", "resolution"),
        other => best(method(other), "radius_scale"),
    }
}

/// The name of a method in stored rows, without what says that it is culled.
fn method(shown: &str) -> &str {
    match shown {
        "bit grid, culled" => "bit grid, culled",
        "grid (counting sort), culled" => "grid (counting sort), culled",
        "BVH rebuild (binned), culled" => "bvh rebuild (binned), culled",
        "BVH refit" => "bvh refit",
        "kiddo, culled" => "k-d tree rebuild (kiddo), culled",
        "voxels, culled" => "voxels rebuild, culled",
        "`TriMesh` rebuild, culled (knows the mesh)" | "`TriMesh`, culled (knows the mesh)" => {
            "mesh rebuild (TriMesh), culled"
        }
        "`TriMesh::set_vertices` (knows the mesh)" => "mesh set_vertices (TriMesh)",
        other => panic!("no method {other:?}"),
    }
}

/// Milliseconds, and the ratio to the floor, of a frame.
fn frame(rows: &[Value], points: Option<u64>, method: &str, threads: u64, k: usize) -> [f64; 2] {
    let is_it = |row: &&Value| {
        points.is_none_or(|points| row["points"] == points)
            && row["method"] == method
            && row["threads"] == threads
            && row["placement"] == PLACEMENTS[k]
    };
    match rows.iter().find(is_it) {
        Some(row) => [number(row, "total_ms"), number(row, "floor_ratio")],
        None => [f64::NAN; 2],
    }
}

fn done(wrong: Vec<String>) {
    assert!(
        wrong.is_empty(),
        "{} are wrong:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}

#[test]
fn accuracy_of_samples() {
    let page = page("docs/benchmarks.md");
    let mut wrong = Vec::new();
    let models = ["bunny_watertight", "armadillo_86k"];
    let large = models.map(|model| stored(&format!("accuracy/speed_accuracy_{model}.json")));
    Table::new(&page, "<details><summary>Two large models").check(
        &mut wrong,
        |_| true,
        |name, k| Some(of_accuracy(&large[k], name)),
    );
    let models = ["rabbit", "dilo", "octopus"];
    let small = models.map(|model| stored(&format!("accuracy/speed_accuracy_{model}.json")));
    let without_setting = |mut figures: Vec<f64>, is_exact: bool| {
        // "0, 0.02": what errs never has no false negatives to tell.
        if is_exact && figures[0] == 0.0 {
            figures.remove(1);
        }
        figures
    };
    Table::new(&page, "<details><summary>Small models").check(
        &mut wrong,
        |_| true,
        |name, k| {
            Some(match name {
                "paper, 256²" => {
                    let is_it =
                        |row: &&Value| row["variant"] == "paper" && row["resolution"] == 256;
                    let row = small[k].iter().find(is_it)?;
                    let keys = ["error_pct", "false_negative_pct", "median_ms"];
                    keys.map(|key| number(row, key)).to_vec()
                }
                name => without_setting(of_accuracy(&small[k], name), name.starts_with('`')),
            })
        },
    );
    done(wrong);
}

/// Error, false negatives, the deepest of them, milliseconds of all cases of a model.
fn of_all_cases(model: &str, name: &str) -> Option<Vec<f64>> {
    let keys = [
        "error_pct",
        "false_negative_pct",
        "worst_false_negative_mean_radii",
        "median_ms",
    ];
    let row = match name {
        "this project, pixel 1 r" => stored(&format!("more_cases/{model}.json")).remove(0),
        _ => {
            let radius = numbers(name)[0].parse::<f32>().expect("a radius");
            let rows = stored(&format!("more_cases/peers_{model}.json"));
            rows.into_iter().find(|row| {
                row["variant"] == "bit grid, culled"
                    && (number(row, "radius_scale") as f32 - radius).abs() < 1e-6
            })?
        }
    };
    let mut all = keys.map(|key| number(&row, key)).to_vec();
    if all[2] == 0.0 {
        all.remove(2);
    }
    Some(all)
}

#[test]
fn accuracy_of_all_cases() {
    let page = page("docs/benchmarks.md");
    let mut wrong = Vec::new();
    let models = [
        "bunny_watertight",
        "armadillo_86k",
        "rabbit",
        "dilo",
        "octopus",
    ];
    Table::new(&page, "<details><summary>All 27,900 cases").check(
        &mut wrong,
        |_| true,
        |name, k| of_all_cases(models[k], name),
    );
    done(wrong);
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
    // Deep: "a third of a grid's time from 134,000 points each"; slight: "1.5 to 9 times faster".
    let rows = stored("frames/frames_generated.json");
    let ratio = |points, k| {
        let of = |method| frame(&rows, Some(points), method, 1, k)[0];
        of("tldi (cpu)") / of("bit grid, culled")
    };
    for points in [134_000, 544_000, 1_000_000] {
        assert!(
            (0.28..0.38).contains(&ratio(points, 2)),
            "{}",
            ratio(points, 2)
        );
    }
    let slight = [10_000, 134_000, 544_000, 1_000_000].map(|points| ratio(points, 1));
    let (least, most) = slight
        .iter()
        .fold((f64::INFINITY, 0f64), |(l, m), r| (l.min(*r), m.max(*r)));
    assert!(page.contains("is 1.5 to 9 times faster"));
    assert!(
        is_rounded("1.5", least) && is_rounded("9", most),
        "{slight:?}"
    );
}

#[test]
fn frames_beside_the_grid() {
    let page = page("docs/benchmarks.md");
    let mut wrong = Vec::new();
    let generated = stored("frames/frames_generated.json");
    let models =
        ["armadillo_86k", "bunny_watertight"].map(|m| stored(&format!("frames/frames_{m}.json")));
    Table::new(
        &page,
        "This library's time divided by that of the culled bit grid",
    )
    .check(
        &mut wrong,
        |name| !name.starts_with("asked"),
        |name, k| {
            let (rows, points) = match name.split(' ').next() {
                Some("armadillo,") => (&models[0], None),
                Some("bunny,") => (&models[1], None),
                _ => (&generated, numbers(name)[0].parse().ok()),
            };
            let of = |method| frame(rows, points, method, 1, k)[0];
            let mut all = vec![of("tldi (cpu)") / of("bit grid, culled")];
            // What was asked of the first row stands beside.
            all.extend((name == "10,000" && k == 1).then_some(2.0));
            Some(all)
        },
    );
    done(wrong);
}

#[test]
fn frames_of_the_bunny() {
    let page = page("docs/benchmarks.md");
    let mut wrong = Vec::new();
    let rows = stored("frames/frames_bunny_watertight.json");
    Table::new(&page, "2 × 29,834 points, ms on one thread").check(
        &mut wrong,
        |_| true,
        |name, k| {
            let of = |method: &str| frame(&rows, None, method, 1, k)[0];
            let faster = |method: &str| of(method).min(of(&format!("{method}, culled")));
            let all = match name {
                "this project" => vec![of("tldi (cpu)")],
                "bit grid" => vec![faster("bit grid")],
                "grid, counting sort" => vec![faster("grid (counting sort)")],
                "voxels" => vec![faster("voxels rebuild")],
                "BVH rebuild, binned (not culled)" => {
                    vec![
                        of("bvh rebuild (binned), culled"),
                        of("bvh rebuild (binned)"),
                    ]
                }
                "kiddo" => vec![faster("k-d tree rebuild (kiddo)")],
                "compound of balls" => vec![faster("compound of balls")],
                "compound of discs" => vec![faster("compound of discs")],
                "`TriMesh` rebuild" => vec![faster("mesh rebuild (TriMesh)")],
                "`TriMesh::set_vertices`" => vec![of("mesh set_vertices (TriMesh)")],
                other => panic!("no method {other:?}"),
            };
            all[0].is_finite().then_some(all)
        },
    );
    done(wrong);
}

#[test]
fn frames_of_the_bumpy_ball() {
    let page = page("docs/benchmarks.md");
    let mut wrong = Vec::new();
    let rows = stored("frames/frames_generated.json");
    for (shown, points) in [
        ("| 10,000 | near-miss |", 10_000),
        ("| 134,000 | near-miss |", 134_000),
        ("| 544,000 | near-miss |", 544_000),
        ("| 1,000,000 | near-miss |", 1_000_000),
    ] {
        // The caption is the head itself.
        let (before, _) = page
            .split_once(shown)
            .unwrap_or_else(|| panic!("no {shown:?}"));
        Table {
            caption: shown,
            ..Table::new(&page[before.len() - 1..], "\n")
        }
        .check(
            &mut wrong,
            |_| true,
            |name, k| {
                let of = |method: &str, threads| frame(&rows, Some(points), method, threads, k);
                let both = |method: &str| {
                    [format!("{method}, culled"), method.to_owned()]
                        .map(|m| of(&m, 1)[0])
                        .to_vec()
                };
                Some(match name {
                    "this project" => of("tldi (cpu)", 1).to_vec(),
                    "this project, two threads" => vec![of("tldi (cpu)", 2)[0]],
                    "bit grid, culled" => of("bit grid, culled", 1).to_vec(),
                    "grid, culled" => vec![of("grid (counting sort), culled", 1)[0]],
                    "voxels, culled (not)" => both("voxels rebuild"),
                    "BVH rebuild, binned, culled (not)" => both("bvh rebuild (binned)"),
                    "kiddo, culled (not)" => both("k-d tree rebuild (kiddo)"),
                    other => panic!("no method {other:?}"),
                })
            },
        );
    }
    done(wrong);
}

#[test]
fn work_of_the_bumpy_ball() {
    let page = page("docs/benchmarks.md");
    let mut wrong = Vec::new();
    let rows = stored("frames/frames_generated.json");
    Table::new(&page, "`PairResult::work`").check(
        &mut wrong,
        |_| true,
        |name, k| {
            let points: u64 = numbers(name)[0].parse().expect("points");
            let is_it = |row: &&Value| {
                row["points"] == points
                    && row["method"] == "tldi (cpu)"
                    && row["threads"] == 1
                    && row["placement"] == PLACEMENTS[k]
            };
            let work = &rows.iter().find(is_it)?["work"];
            let looks = ["large", "windows", "fine"].map(|look| &work[look]);
            let mut all = looks.map(|look| number(look, "points")).to_vec();
            all.push(looks.iter().map(|look| number(look, "pixels")).sum());
            // "0": nothing was drawn.
            if all.iter().all(|figure| *figure == 0.0) {
                all.truncate(1);
            }
            Some(all)
        },
    );
    done(wrong);
}

#[test]
fn budgets() {
    let page = page("docs/benchmarks.md");
    let mut wrong = Vec::new();
    let rows = stored("budgets/scan_and_bodies.json");
    Table::new(
        &page,
        "processor time of one thread for all of a step's batch",
    )
    .check(
        &mut wrong,
        |_| true,
        |name, k| {
            let row = rows.iter().find(|row| row["setting"] == name)?;
            let key = ["median_ms", "median_error_mm", "p95_error_mm"].get(k)?;
            Some(vec![number(row, key)])
        },
    );
    let settings = Table::new(
        &page,
        "processor time of one thread for all of a step's batch",
    );
    for shown in settings.rows.iter().skip(2) {
        let row = rows.iter().find(|row| row["setting"] == shown[0]);
        let is_on_front = row.expect("a setting")["is_on_front"] == true;
        assert_eq!(shown[4] == "yes", is_on_front, "{shown:?}");
    }
    Table::new(&page, "A ball of 0.1 m, one r deep").check(
        &mut wrong,
        |_| true,
        |name, k| {
            let points: u64 = numbers(name)[0].parse().expect("points");
            let of = |setting: &str, key: &str| {
                let is_it =
                    |row: &&Value| row["scan_points"] == points && row["setting"] == setting;
                rows.iter().find(is_it).map(|row| number(row, key))
            };
            let figure = match k {
                0 => of("random order", "floor_ms"),
                1 => of("random order", "median_ms"),
                _ => of("spatial order", "median_ms"),
            };
            figure.map(|figure| vec![figure])
        },
    );
    done(wrong);
}

/// The rules themselves.
#[test]
fn roundings() {
    assert_eq!(
        numbers("0.15 (0.02) at 0.15 r, 1,018"),
        ["0.15", "0.02", "0.15", "1018"]
    );
    assert!(is_rounded("0.018", 0.01792) && !is_rounded("0.018", 0.0186));
    assert!(is_rounded("2024", 2023.6) && !is_rounded("2024", 2025.1));
}
