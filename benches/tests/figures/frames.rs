//! Times and work of frames of new points.

use crate::table::{Table, is_rounded, numbers};
use crate::{number, page, stored};
use serde_json::Value;

const PLACEMENTS: [&str; 5] = ["near-miss", "slight", "deep", "coincident", "body on scan"];

/// Milliseconds, and the ratio to the floor, of a frame.
pub(crate) fn frame(
    rows: &[Value],
    points: Option<u64>,
    method: &str,
    threads: u64,
    k: usize,
) -> [f64; 2] {
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

/// This library's time divided by that of the faster culled grid.
pub(crate) fn beside_a_grid(rows: &[Value], points: Option<u64>, k: usize) -> f64 {
    let of = |method| frame(rows, points, method, 1, k)[0];
    of("tldi (cpu)") / of("bit grid, culled").min(of("grid (counting sort), culled"))
}

#[test]
fn frames_beside_the_grid() {
    let generated = stored("frames/frames_generated.json");
    let models =
        ["armadillo_86k", "bunny_watertight"].map(|m| stored(&format!("frames/frames_{m}.json")));
    Table::read(
        "docs/benchmarks.md",
        "This library's time divided by that of the faster culled grid",
    )
    .only(|name| !name.starts_with("asked"))
    .check(|name, k| {
        let (rows, points) = match name.split(' ').next() {
            Some("armadillo,") => (&models[0], None),
            Some("bunny,") => (&models[1], None),
            _ => (&generated, numbers(name)[0].parse().ok()),
        };
        let mut all = vec![beside_a_grid(rows, points, k)];
        // What was asked of the first row stands beside.
        all.extend((name == "10,000" && k == 1).then_some(2.0));
        Some(all)
    });
}

#[test]
fn frames_of_the_bunny() {
    let rows = stored("frames/frames_bunny_watertight.json");
    Table::read("docs/benchmarks.md", "2 × 29,834 points, ms on one thread").check(|name, k| {
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
    });
}

#[test]
fn frames_of_the_bumpy_ball() {
    let rows = stored("frames/frames_generated.json");
    for (shown, points) in [
        ("| 10,000 | near-miss |", 10_000),
        ("| 134,000 | near-miss |", 134_000),
        ("| 544,000 | near-miss |", 544_000),
        ("| 1,000,000 | near-miss |", 1_000_000),
    ] {
        Table::read("docs/benchmarks.md", shown).check(|name, k| {
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
        });
    }
}

/// The page that tells users what a pair costs has the same figures.
#[test]
fn frames_on_the_page_of_choices() {
    let page = page("docs/choosing.md");
    let rows = stored("frames/frames_generated.json");
    Table::read(
        "docs/choosing.md",
        "Two clouds of new points in every frame",
    )
    .check(|name, k| {
        let points = numbers(name)[0].parse().expect("points");
        Some(vec![frame(&rows, Some(points), "tldi (cpu)", 1, k)[0]])
    });
    // "0.4 to 5 ms for two clouds of 10,000 to a million points that overlap": slight and deep.
    let of = |points, k| frame(&rows, Some(points), "tldi (cpu)", 1, k)[0];
    let row = page
        .lines()
        .find(|line| line.starts_with("| [What does it"));
    let shown = numbers(row.expect("a short answer"));
    assert!(is_rounded(&shown[0], of(10_000, 1)), "{shown:?}");
    assert!(is_rounded(&shown[1], of(1_000_000, 1)), "{shown:?}");
}

#[test]
fn work_of_the_bumpy_ball() {
    let rows = stored("frames/frames_generated.json");
    Table::read("docs/benchmarks.md", "`PairResult::work`").check(|name, k| {
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
    });
}

/// A plain build, and one with all instructions of the machine.
#[test]
fn frames_with_the_same_instruction_sets() {
    let builds = ["plain", "native"].map(|build| {
        let rows = stored(&format!("instruction_sets/{build}.json"));
        assert!(rows.iter().all(|row| row["quartiles_ms"].is_array()));
        rows
    });
    Table::read("docs/benchmarks.md", "`RUSTFLAGS=\"-C target-cpu=native\"`").check(|name, k| {
        let method = match name {
            "bit grid, culled" => "bit grid, culled",
            "grid, culled" => "grid (counting sort), culled",
            "voxels, culled" => "voxels rebuild, culled",
            "BVH rebuild, binned, culled" => "bvh rebuild (binned), culled",
            "kiddo, culled" => "k-d tree rebuild (kiddo), culled",
            other => panic!("no method {other:?}"),
        };
        let ratio = |rows: &Vec<Value>| {
            let of = |method| frame(rows, Some(134_000), method, 1, k)[0];
            of("tldi (cpu)") / of(method)
        };
        Some(builds.iter().map(ratio).collect())
    });
}
