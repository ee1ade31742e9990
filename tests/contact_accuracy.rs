//! The accuracy of contacts against analytic truth.

use tldi_tests::{AccuracyRow, measure_accuracy};

#[test]
fn contacts_are_accurate_at_every_angle_of_motion() {
    measure_accuracy(21, 1, |r: &AccuracyRow| {
        let ok = r.normal_error[0] <= 1.0
            && r.depth_error[0]
                <= match r.regime.name() {
                    "shallow" => 0.1,
                    _ => 0.05,
                };
        eprintln!(
            "{} {:15} {:8} {:2}0 deg missed {:2} normal med {:7.3} max {:7.2} depth med {:6.3} max {:6.3} bias {:+6.3} {}",
            if r.with_normals { "given" } else { "none " },
            r.pair.name(),
            r.regime.name(),
            r.angle_bin,
            r.missed,
            r.normal_error[0],
            r.normal_error[1],
            r.depth_error[0],
            r.depth_error[1],
            r.depth_bias,
            if ok { "" } else { "FAILS" }
        );
    });
}
