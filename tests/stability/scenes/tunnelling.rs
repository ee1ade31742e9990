//! Fast, small, spinning bodies against sheets, scans and waves: nothing may pass through.

mod drops;
mod ground;

use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::known::{UNLIKELY, chance_of_as_many};
use drops::{Outcome, SizeClass, Target, run_drop};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "tunnelling",
    about: "Boxes and balls of 2 mm to 1 m, with a few hundred points each and `ccd_enabled`, \
            hit a surface at 0 to 200 m/s, 0 to 75° off the normal, spinning at up to 50 rad/s. \
            The surface is a sheet, a spot of a scan (scaled to the body), or a sheet that waves \
            (new points in each frame).",
    rule: "No body's middle passes through the surface. For a scan, the surface is the mean \
           height of its points within 2 r̄.",
    cases,
};

/// How many failures of a row are named.
const NAMED_FAILURES: usize = 5;

fn cases(scale: &Scale, cases: &mut Cases) {
    let rows = Target::ALL.len() * SizeClass::ALL.len() * scale.seeds.len();
    let drops = scale.drops.div_ceil(rows.max(1));
    let only = scale.only_drop;
    for target in Target::ALL {
        for size in SizeClass::ALL {
            let name = format!("{}, {}", target.name(), size.name());
            cases.add(name, move |setup, verdict| {
                let chosen = only.map_or(0..drops, |k| k..k + 1);
                drop_all(setup, verdict, target, size, chosen)
            });
        }
    }
}

fn drop_all(
    setup: &Setup,
    verdict: &mut Verdict,
    target: Target,
    size: SizeClass,
    drops: std::ops::Range<usize>,
) -> Result<(), Stop> {
    let mut hits = 0_u32;
    let mut failures = Vec::new();
    let count = drops.len();
    for index in drops {
        // Every drop has a seed of its own, so that it can be run alone (`--only-drop`).
        let row = setup
            .seed
            .wrapping_mul(31)
            .wrapping_add(10 * target as u64 + size as u64);
        let drop_seed = row.wrapping_mul(1_000_003).wrapping_add(index as u64);
        let (outcome, description) = run_drop(setup, target, size, drop_seed)?;
        match outcome {
            Outcome::Missed => {}
            Outcome::Stopped => hits += 1,
            Outcome::Passed => {
                hits += 1;
                failures.push(format!("drop {index} ({description})"));
            }
        }
    }
    verdict.note("drops", count as f64);
    // Of 50 drops of a row, 35 to 49 hit.
    let missed = count as u32 - hits;
    verdict.note("hits", hits);
    verdict.require(
        "hits",
        chance_of_as_many([missed, count as u32], 0.3) > UNLIKELY,
        || format!("only {hits} of {count} hit"),
    );
    verdict.note("passed_through", failures.len() as f64);
    verdict.note(
        "passed_share",
        failures.len() as f64 / f64::from(hits.max(1)),
    );
    verdict.require("passed_share", failures.is_empty(), || {
        let named = &failures[..failures.len().min(NAMED_FAILURES)];
        format!(
            "{} of {hits} passed through: {}",
            failures.len(),
            named.join(", ")
        )
    });
    Ok(())
}
