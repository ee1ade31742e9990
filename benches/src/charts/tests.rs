use super::*;
use crate::stored::DistanceTally;
use crate::stored::Provenance;
use crate::stored::tests::{accuracy_row, contact_row};
use tldi_tests::ContactPair;

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("tldi_charts_{name}_{}", std::process::id()));
    if folder.exists() {
        // Of a run that was broken off.
        std::fs::remove_dir_all(&folder).expect("the folder can be removed");
    }
    std::fs::create_dir_all(&folder).expect("the folder for temporary files can be written");
    folder
}

fn provenance(commit: &str) -> Provenance {
    Provenance {
        commit: commit.to_owned(),
        adapter: Some("a device".to_owned()),
        ..stored::tests::provenance()
    }
}

fn accuracy(variant: &str, wrong: usize, median_ms: f64) -> AccuracyRow {
    let wrong_pct = 100.0 * wrong as f64 / 1000.0;
    AccuracyRow {
        model: "a ball".to_owned(),
        points: 4321,
        cases: 1000,
        variant: variant.to_owned(),
        pixel_scale: None,
        false_negative_pct: wrong_pct,
        false_positive_pct: 0.0,
        error_pct: wrong_pct,
        median_ms,
        lower_quartile_ms: 0.5 * median_ms,
        upper_quartile_ms: 2.0 * median_ms,
        by_distance: vec![DistanceTally {
            distance: 1.5,
            cases: 1000,
            false_negatives: wrong,
            false_positives: 0,
        }],
        ..accuracy_row()
    }
}

fn ours(pixel_scale: f32, wrong: usize, median_ms: f64) -> AccuracyRow {
    AccuracyRow {
        pixel_scale: Some(pixel_scale),
        ..accuracy("default", wrong, median_ms)
    }
}

fn paper(rho: f32, noise: f32, wrong: usize) -> AccuracyRow {
    AccuracyRow {
        rho: Some(rho),
        resolution: Some(1024),
        noise,
        ..accuracy("paper", wrong, 50.0)
    }
}

fn frame(method: &str, placement: &str, points: usize, total_ms: f64) -> FrameRow {
    FrameRow {
        model: "a ball".to_owned(),
        points,
        points_b: points,
        placement: placement.to_owned(),
        method: method.to_owned(),
        threads: 1,
        build_ms: 0.5 * total_ms,
        query_ms: 0.5 * total_ms,
        total_ms,
        least_ms: 0.9 * total_ms,
        quartiles_ms: Some([0.95 * total_ms, 1.2 * total_ms]),
        most_ms: 1.5 * total_ms,
        frames: 3,
        collides: true,
        contacts: 12,
        peak_mib: 1.0,
        floor_ratio: 9.0,
        work: None,
        stages: None,
    }
}

fn run<R: Measured>(rows: Vec<R>) -> Stored<R> {
    Stored {
        kind: R::KIND.to_owned(),
        provenance: provenance("aaa1111"),
        rows,
    }
}

/// Where the points of a curve of a panel are.
fn places(panel: &figure::Panel, curve: usize) -> Vec<(f64, f64)> {
    let points = panel.curves[curve].points.iter();
    points.map(|p| (p.x, p.y)).collect()
}

fn names(files: &[PathBuf]) -> Vec<String> {
    let names = files.iter().filter_map(|file| file.file_name());
    names.map(|name| name.to_string_lossy().into()).collect()
}

/// Charts are drawn of what is stored, and say so: commits, machine, models, methods, settings.
#[test]
fn stored_results_become_charts() {
    let results = folder("good");
    let rows = vec![
        ours(1.0, 0, 5.0),
        ours(2.0, 2, 2.0),
        paper(0.05, 0.0, 4),
        accuracy("bit grid, culled", 30, 1.0),
        accuracy("grid (counting sort), culled", 30, 1.5),
        accuracy("k-d tree rebuild (kiddo), culled", 30, 2.0),
    ];
    stored::write(&results.join("methods.json"), provenance("aaa1111"), rows).expect("written");
    // The same method in a larger run, with fewer errors: that counts.
    let many = AccuracyRow {
        cases: 9000,
        false_negative_pct: 0.1,
        error_pct: 0.1,
        by_distance: vec![DistanceTally {
            distance: 1.5,
            cases: 9000,
            false_negatives: 9,
            false_positives: 0,
        }],
        ..accuracy("bit grid, culled", 0, 1.0)
    };
    stored::write(
        &results.join("many.json"),
        provenance("ddd4444"),
        vec![many],
    )
    .expect("written");
    let rows = vec![
        paper(0.01, 0.0, 3),
        paper(0.05, 0.0, 4),
        paper(0.05, 1.0, 9),
    ];
    stored::write(&results.join("sweep.json"), provenance("bbb2222"), rows).expect("written");
    let rows = vec![
        frame("tldi (cpu)", "deep", 1_000, 2.0),
        frame("bit grid", "deep", 1_000, 4.0),
        frame("bit grid, culled", "deep", 1_000, 3.0),
        frame("bit grid, culled", "deep", 2_000, 6.0),
    ];
    stored::write(&results.join("frames.json"), provenance("ccc3333"), rows).expect("written");
    let out = results.join("charts");
    let Drawn { files, skipped } = draw_all(&results, &out).expect("they can be drawn");
    let [work, stages] = &skipped[..] else {
        panic!("{skipped:?}");
    };
    assert!(work.starts_with("work") && stages.starts_with("stages"));
    assert!(skipped.iter().all(|why| why.contains("bvh_vs_tldi")));
    let expected = [
        "speed_accuracy",
        "false_answers",
        "error_rho",
        "error_distance",
        "error_noise",
        "frame_cost_a_ball",
    ];
    let expected: Vec<String> = expected
        .iter()
        .flat_map(|name| ["svg", "png"].map(|kind| format!("{name}.{kind}")))
        .collect();
    assert_eq!(names(&files), expected);
    for file in &files {
        let length = std::fs::metadata(file).expect("it was drawn").len();
        assert!(length > 3_000, "{}: {length} bytes", file.display());
    }
    let text = |name: &str| std::fs::read_to_string(out.join(name)).expect("it was drawn");
    let main = text("accuracy/speed_accuracy.svg");
    for words in [
        "2 × 4321 points, 1000 to 9000 cases",
        "ddd4444",
        "this project",
        "bit grid, culled",
        "Pareto front",
        "pixel 1 r",
        "aaa1111",
        "a processor",
        "a device",
    ] {
        assert!(main.contains(words), "{words}");
    }
    // Not on the front, so without its setting; and not of another run.
    assert!(!main.contains("1024²") && !main.contains("bbb2222"));
    assert!(
        text("accuracy/false_answers.svg")
            .contains("grid (counting sort), culled and 1 that answer alike")
    );
    assert!(text("sweeps/error_rho.svg").contains("Bunny 36k: 0.39 %"));
    assert!(text("sweeps/error_noise.svg").contains("bbb2222"));
    assert!(text("frames/frame_cost_a_ball.svg").contains("ccc3333"));
    std::fs::remove_dir_all(results).expect("it is there");
}

/// A panel a regime and error; the front is of points alone; what misses half has no place, and what 95 %
/// of the cases are below is told where it is finite.
#[test]
fn contacts_become_panels() {
    let ours = contact_row();
    let balls = |radius: f32, error: Option<f64>, median_ms: f64| ContactRow {
        variant: "grid (counting sort), culled".to_owned(),
        pixel_scale: None,
        radius_scale: Some(radius),
        normal_median_deg: error,
        depth_median_radii: Some(0.25),
        lower_quartile_ms: 0.5,
        median_ms,
        ..contact_row()
    };
    let mesh = ContactRow {
        radius_scale: None,
        variant: "mesh rebuild (TriMesh), culled".to_owned(),
        normal_median_deg: Some(0.1),
        ..balls(1.0, None, 0.5)
    };
    let of_one_pair = ContactRow {
        pair: Some(ContactPair::BoxPlane),
        normal_median_deg: Some(0.01),
        ..contact_row()
    };
    let run = run(vec![
        balls(0.5, Some(70.0), 0.9),
        balls(0.7, Some(80.0), 1.0),
        balls(1.0, None, 0.8),
        mesh,
        of_one_pair,
        ours,
    ]);
    let figures = contact_quality::figures(&[run]);
    let [figure] = &figures[..] else {
        panic!("a figure a run");
    };
    assert_eq!(figure.name, "contact_quality");
    let [.., deep_normal, deep_depth] = &figure.panels[..] else {
        panic!("four panels");
    };
    let steps = [(0.9, 70.0), (2.0, 70.0), (2.0, 0.25)];
    assert_eq!(places(deep_normal, 0), steps);
    assert_eq!(places(deep_normal, 1), [(0.9, 70.0), (1.0, 80.0)]);
    assert_eq!(places(deep_normal, 2), [(0.5, 0.1)]);
    // The only ones of all pairs.
    assert_eq!(places(deep_normal, 3), [(2.0, 0.25)]);
    let ours = |panel: &figure::Panel| panel.curves[3].points[0].clone();
    assert_eq!(ours(deep_depth).label.as_deref(), Some("pixel 1 r"));
    assert_eq!(
        ours(deep_normal).y_spread,
        Some([0.25, deep_normal.y.range[1]])
    );
    assert_eq!(ours(deep_depth).y_spread, Some([0.125, 0.5]));
    // Of balls those on the front alone have a bar.
    let bars = deep_depth.curves[1].points.iter().map(|p| p.y_spread);
    let expected = [None, None, Some([0.25, 0.5])];
    assert_eq!(bars.collect::<Vec<_>>(), expected);
    assert_eq!(
        (deep_normal.levels[0].y, deep_depth.levels[0].y),
        (90.0, 6.0)
    );
}

/// The faster form of a peer is drawn, at its time.
#[test]
fn peers_are_drawn_in_their_best_form() {
    let run = run(vec![
        frame("bit grid", "deep", 1_000, 4.0),
        frame("bit grid, culled", "deep", 1_000, 3.0),
        frame("bit grid", "deep", 2_000, 5.0),
        frame("bit grid, culled", "deep", 2_000, 6.0),
        // By the clock: not to be drawn beside processor time.
        FrameRow {
            threads: 2,
            ..frame("bit grid", "deep", 2_000, 1.0)
        },
    ]);
    let figures = frames::figures(&[run.clone(), run]);
    let [first, second] = &figures[..] else {
        panic!("a figure a run");
    };
    assert_eq!(second.name, format!("{}_2", first.name));
    let [panel] = &first.panels[..] else {
        panic!("a panel a placement");
    };
    assert_eq!(places(panel, 0), [(1_000.0, 3.0), (2_000.0, 5.0)]);
    assert_eq!(panel.curves.len(), 1);
}

/// What is modelled becomes a curve a placement, with its name beside its end; nothing modelled has a place.
#[test]
fn work_becomes_curves() {
    let row = |placement: &str, points: usize, modelled: usize| FrameRow {
        work: Some(stored::WorkRow {
            culled: 9 * modelled,
            large: stored::LookedRow {
                points: modelled,
                pixels: 2 * modelled,
                layers: 7 * modelled,
            },
            fine: stored::LookedRow {
                points: 3 * modelled,
                ..Default::default()
            },
            ..Default::default()
        }),
        ..frame("tldi (cpu)", placement, points, 2.0)
    };
    let counted = run(vec![
        row("apart", 1_000, 0),
        row("apart", 2_000, 0),
        row("deep", 2_000, 30),
        row("deep", 1_000, 10),
        row("deeper", 1_000, 11),
        row("deeper", 2_000, 31),
        frame("bit grid", "deep", 4_000, 2.0),
    ]);
    let uncounted = run(vec![frame("tldi (cpu)", "deep", 1_000, 2.0)]);
    let figures = work::figures(&[uncounted.clone(), counted]).expect("one run counted");
    let [figure] = &figures[..] else {
        panic!("a figure a run that counted");
    };
    let panel = &figure.panels[0];
    assert_eq!(places(panel, 0), [(1_000.0, 0.0), (2_000.0, 0.0)]);
    assert_eq!(places(panel, 1), [(1_000.0, 60.0), (2_000.0, 180.0)]);
    assert_eq!(places(panel, 3), [(1_000.0, 2_000.0), (2_000.0, 4_000.0)]);
    assert!(panel.y.has_zero && panel.x.place(2_000.0) < 0.8);
    let words: Vec<(&str, f64)> = (panel.curves[4..].iter())
        .filter_map(|curve| Some((curve.points[0].label.as_deref()?, curve.points[0].y)))
        .collect();
    let names = [
        "points of both clouds: 4000",
        "deeper: 190",
        "deep: 180",
        "apart: 0",
    ];
    assert_eq!(
        words.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
        names
    );
    // A line apart.
    let [deeper, deep] = [1, 2].map(|k| panel.y.place(words[k].1));
    assert!(deeper - deep > 0.03, "{deeper} {deep}");
    assert!(work::figures(&[uncounted]).is_err_and(|why| why.contains("bvh_vs_tldi")));
}

/// Parts of a bar add up to all of the frame, in the order of the stages, whatever the order of the rows; words are
/// where there is room. Of several runs that over most numbers of points is drawn.
#[test]
fn stages_become_bars() {
    let row = |placement: &str, points: usize, stages: &[(&str, f64)]| FrameRow {
        stages: Some(
            (stages.iter())
                .map(|(name, ms)| stored::StageRow {
                    name: (*name).to_owned(),
                    ms: *ms,
                })
                .collect(),
        ),
        ..frame("tldi (cpu)", placement, points, 2.25)
    };
    let deep = [("normals", 0.9), ("cull", 0.3), ("rest", 0.3)];
    let one = run(vec![row("deep", 9_000, &deep)]);
    let two = run(vec![
        row("apart", 1_000, &[("rest", 0.5)]),
        row("deep", 1_000, &deep),
        row("deep", 2_000, &[("patches", 0.02), ("compare", 0.98)]),
        row("idle", 2_000, &[("rest", 0.0)]),
        frame("bit grid", "deep", 1_000, 2.0),
    ]);
    let untold = run(vec![frame("tldi (cpu)", "deep", 1_000, 2.0)]);
    let figures = stages::figures(&[untold.clone(), one, two]).expect("two runs told stages");
    let [figure] = &figures[..] else {
        panic!("one figure of all runs");
    };
    assert_eq!(figure.name, "stages");
    let legend: Vec<&str> = figure.legend.iter().map(|e| &*e.label).collect();
    assert_eq!(legend, ["cull", "normals", "compare", "patches", "rest"]);
    let [first, second] = &figure.panels[..] else {
        panic!("a panel a number of points");
    };
    type Bar = (Vec<(f64, f64)>, Option<String>);
    let bars = |panel: &figure::Panel| -> Vec<Bar> {
        let of = |curve: &figure::Curve| {
            let ends = curve
                .points
                .iter()
                .map(|p| ((1e3 * p.x).round() / 1e3, p.y));
            (ends.collect(), curve.points[0].label.clone())
        };
        panel.curves.iter().map(of).collect()
    };
    let words = |words: &str| Some(words.to_owned());
    assert_eq!(
        bars(first),
        [
            (vec![(0.0, 2.0), (100.0, 2.0)], words("rest 100 %")),
            (vec![(0.0, 2.24)], words("apart: 2.25 ms")),
            (vec![(0.0, 1.0), (20.0, 1.0)], words("cull 20 %")),
            (vec![(20.0, 1.0), (80.0, 1.0)], words("normals 60 %")),
            (vec![(80.0, 1.0), (100.0, 1.0)], words("rest 20 %")),
            (vec![(0.0, 1.24)], words("deep: 2.25 ms")),
        ]
    );
    let short: Vec<_> = bars(second).into_iter().map(|(_, words)| words).collect();
    assert_eq!(short, [words("compare 98 %"), None, words("deep: 2.25 ms")]);
    assert!(stages::figures(&[untold]).is_err_and(|why| why.contains("bvh_vs_tldi")));
    assert!(stages::figures(&[]).is_ok_and(|none| none.is_empty()));
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let results = folder("bad");
    let refusal = || {
        draw_all(&results, &results)
            .expect_err("it is bad")
            .to_string()
    };
    assert!(refusal().contains("no results of benches"), "{}", refusal());
    std::fs::write(
        results.join("other.json"),
        "{\"rows\": [], \"kind\": \"taste\"}",
    )
    .expect("it can be written");
    assert!(refusal().contains("other.json") && refusal().contains("taste"));
    std::fs::write(results.join("other.json"), "[1, 2").expect("it can be written");
    assert!(refusal().contains("other.json") && refusal().contains("line 1"));
    std::fs::remove_dir_all(&results).expect("it is there");
    assert!(refusal().contains("tldi_charts_bad"), "{}", refusal());
}
