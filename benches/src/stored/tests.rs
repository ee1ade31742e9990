use super::*;
use tldi_tests::Regime;

/// A possible row.
pub(crate) fn accuracy_row() -> AccuracyRow {
    let tally = |distance, false_negatives, false_positives| DistanceTally {
        distance,
        cases: 10,
        false_negatives,
        false_positives,
    };
    AccuracyRow {
        model: "ball".to_owned(),
        points: 1000,
        cases: 20,
        variant: "default".to_owned(),
        backend: Some("cpu".to_owned()),
        rho: None,
        resolution: None,
        pixel_scale: Some(1.0),
        radius_scale: Some(1.0),
        noise: 0.0,
        false_negative_pct: 5.0,
        false_positive_pct: 10.0,
        error_pct: 15.0,
        colliding_pct: 50.0,
        worst_false_negative_mean_radii: 0.25,
        median_ms: 2.0,
        lower_quartile_ms: 1.0,
        upper_quartile_ms: 3.0,
        by_distance: vec![tally(0.0, 1, 0), tally(3.0, 0, 2)],
    }
}

/// A possible row.
pub(crate) fn contact_row() -> ContactRow {
    ContactRow {
        pair: None,
        regime: Regime::Deep,
        cases: 20,
        variant: "default".to_owned(),
        backend: Some("cpu".to_owned()),
        pixel_scale: Some(1.0),
        radius_scale: Some(1.0),
        tells_motion: true,
        missed_pct: 5.0,
        wrong_side_pct: 10.0,
        normal_median_deg: Some(0.25),
        normal_p95_deg: None,
        depth_median_radii: Some(0.125),
        depth_p95_radii: Some(0.5),
        median_ms: 2.0,
        lower_quartile_ms: 1.0,
        upper_quartile_ms: 3.0,
    }
}

pub(crate) fn provenance() -> Provenance {
    Provenance {
        date: "2026-01-31".to_owned(),
        cpu: "a processor".to_owned(),
        cores: 2,
        commit: "0123abc".to_owned(),
        features: vec!["release".to_owned()],
        adapter: None,
    }
}

/// A file in the build's own folder.
fn file(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../target/stored_tests");
    std::fs::create_dir_all(&folder).expect("the build's folder can be written");
    folder.join(name)
}

#[test]
fn what_is_written_is_read() {
    let path = file("good.json");
    let row = accuracy_row();
    write(&path, provenance(), vec![row.clone()]).expect("it can be written");
    assert_eq!(kind(&path).expect("it has a kind"), "accuracy");
    let stored = read::<AccuracyRow>(&path).expect("it can be read");
    assert_eq!(stored.provenance, provenance());
    assert_eq!(stored.rows, [row]);
}

/// Errors are infinite, or rise; shares are of the same cases.
#[test]
fn contacts_that_cannot_be_are_refused() {
    let good = contact_row();
    assert_eq!(good.fault(), None);
    let faults: [fn(&mut ContactRow); 6] = [
        |row| row.cases = 0,
        |row| row.median_ms = 5.0,
        |row| row.wrong_side_pct = 96.0,
        |row| row.missed_pct = -1.0,
        |row| row.depth_median_radii = None,
        |row| row.depth_p95_radii = Some(0.1),
    ];
    for (k, fault) in faults.into_iter().enumerate() {
        let mut row = good.clone();
        fault(&mut row);
        assert!(row.fault().is_some(), "{k}");
    }
}

#[test]
fn bad_results_are_refused_by_name_with_a_way_out() {
    let path = file("bad.json");
    let refusal = |path: &Path| {
        let error = read::<AccuracyRow>(path).expect_err("it is bad");
        let said = error.to_string();
        assert!(said.contains("bad"), "{said}");
        (error, said)
    };
    let absent = file("bad_absent.json");
    assert!(matches!(refusal(&absent).0, StoredError::File { .. }));

    std::fs::write(&path, "{\"kind\": \"accuracy\",\n \"rows\": [}").expect("it can be written");
    let (error, said) = refusal(&path);
    assert!(matches!(error, StoredError::Format { .. }));
    assert!(said.contains("line 2") && said.contains("--json"), "{said}");

    write::<AccuracyRow>(&path, provenance(), vec![]).expect("it can be written");
    assert!(matches!(refusal(&path).0, StoredError::Empty { .. }));

    let faults: [fn(&mut AccuracyRow); 5] = [
        |row| row.median_ms = 0.5,
        |row| row.lower_quartile_ms = 0.0,
        |row| row.error_pct = 14.0,
        |row| row.cases = 21,
        |row| {
            row.false_positive_pct = -10.0;
            row.error_pct = -5.0;
        },
    ];
    for (k, fault) in faults.into_iter().enumerate() {
        let mut row = accuracy_row();
        fault(&mut row);
        write(&path, provenance(), vec![accuracy_row(), row]).expect("it can be written");
        let (error, said) = refusal(&path);
        assert!(
            matches!(error, StoredError::Row { row: 1, .. }),
            "{k}: {said}"
        );
    }

    let good = file("bad_kind.json");
    write(&good, provenance(), vec![accuracy_row()]).expect("it can be written");
    let text = std::fs::read_to_string(&good).expect("it was written");
    let other = text.replace("\"kind\": \"accuracy\"", "\"kind\": \"taste\"");
    std::fs::write(&good, other).expect("it can be written");
    assert!(matches!(refusal(&good).0, StoredError::Kind { .. }));
}

/// Rows of before work was counted, and quartiles and stages were told, are read, and those without are written like them.
#[test]
fn work_quartiles_and_stages_are_optional() {
    let old = r#"{"model": "ball", "points": 10, "points_b": 20, "placement": "deep", "method": "grid",
        "threads": 1, "build_ms": 1.0, "query_ms": 1.0, "total_ms": 2.0, "least_ms": 1.5, "most_ms": 3.0,
        "frames": 3, "collides": true, "contacts": 4, "peak_mib": 0.5, "floor_ratio": 9.0}"#;
    let row: FrameRow = serde_json::from_str(old).expect("it is a row");
    assert_eq!((row.work, row.quartiles_ms), (None, None));
    assert_eq!(row.stages, None);
    let written = serde_json::to_string(&row).expect("it can be written");
    assert!(
        ["work", "quartiles", "stages"]
            .iter()
            .all(|part| !written.contains(part)),
        "{written}"
    );
    let staged = |ms| FrameRow {
        stages: Some(vec![StageRow {
            name: "cull".to_owned(),
            ms,
        }]),
        ..row.clone()
    };
    assert_eq!(staged(0.0).fault(), None);
    for ms in [-0.1, f64::NAN, f64::INFINITY] {
        assert!(staged(ms).fault().is_some_and(|why| why.contains("cull")));
    }
    let spread = |lower, upper| FrameRow {
        quartiles_ms: Some([lower, upper]),
        ..row.clone()
    };
    assert_eq!(spread(1.7, 2.5).fault(), None);
    // Below the fastest frame, and on the wrong side of the median.
    for (lower, upper) in [(1.4, 2.5), (2.1, 2.5), (1.7, 1.9), (1.7, 3.1)] {
        assert!(spread(lower, upper).fault().is_some(), "{lower} {upper}");
    }
    let work = WorkRow {
        culled: 7,
        windows: LookedRow {
            points: 1,
            pixels: 20,
            layers: 3,
        },
        ..WorkRow::default()
    };
    let counted = FrameRow {
        work: Some(work),
        ..staged(0.25)
    };
    let written = serde_json::to_string(&counted).expect("it can be written");
    let read: FrameRow = serde_json::from_str(&written).expect("it is a row");
    assert_eq!(read, counted);
    assert_eq!(work.modelled(), 21);
}
