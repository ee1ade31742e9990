//! Wrong answers.

use crate::table::{Table, numbers};
use crate::{number, stored};
use serde_json::Value;

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

#[test]
fn accuracy_of_samples() {
    let models = ["bunny_watertight", "armadillo_86k"];
    let large = models.map(|model| stored(&format!("accuracy/speed_accuracy_{model}.json")));
    Table::read("docs/benchmarks.md", "<details><summary>Two large models")
        .check(|name, k| Some(of_accuracy(&large[k], name)));
    let models = ["rabbit", "dilo", "octopus"];
    let small = models.map(|model| stored(&format!("accuracy/speed_accuracy_{model}.json")));
    let without_setting = |mut figures: Vec<f64>, is_exact: bool| {
        // "0, 0.02": what errs never has no false negatives to tell.
        if is_exact && figures[0] == 0.0 {
            figures.remove(1);
        }
        figures
    };
    Table::read("docs/benchmarks.md", "<details><summary>Small models").check(|name, k| {
        Some(match name {
            "paper, 256²" => {
                let is_it = |row: &&Value| row["variant"] == "paper" && row["resolution"] == 256;
                let row = small[k].iter().find(is_it)?;
                let keys = ["error_pct", "false_negative_pct", "median_ms"];
                keys.map(|key| number(row, key)).to_vec()
            }
            name => without_setting(of_accuracy(&small[k], name), name.starts_with('`')),
        })
    });
}

/// Error, false negatives, the deepest of them, in all cases of a model.
fn of_all_cases(model: &str, name: &str) -> Option<Vec<f64>> {
    let keys = [
        "error_pct",
        "false_negative_pct",
        "worst_false_negative_mean_radii",
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

/// Milliseconds of the median case of a model's sample, in which all methods take turns.
pub(crate) fn median_ms(rows: &[Value], variant: &str, setting: &str, value: f64) -> Option<f64> {
    let is_it =
        |row: &&Value| row["variant"] == variant && (number(row, setting) - value).abs() < 1e-6;
    rows.iter().find(is_it).map(|row| number(row, "median_ms"))
}

#[test]
fn accuracy_of_all_cases() {
    let models = [
        "bunny_watertight",
        "armadillo_86k",
        "rabbit",
        "dilo",
        "octopus",
    ];
    Table::read("docs/benchmarks.md", "<details><summary>All 27,900 cases")
        .check(|name, k| of_all_cases(models[k], name));
}
