//! Budgets decide how large pixels are, and bodies rest all the same.

use crate::common::worlds::{TestResult, attached_with, dynamic_at, insert_floor};
use crate::common::{cloud, cube};
use rapier3d_tldi::prelude::*;
use std::error::Error;
use std::time::Duration;

/// Half the edges of the cube: 8 pixels across, the fewest, are then 2.5 radii large.
const HALF: f32 = 0.4;

/// Drops a cube of points onto a floor of points for three seconds; where it lies, and how many
/// contact pixels it has there.
fn dropped(resolution: Resolution) -> Result<(f32, usize), Box<dyn Error>> {
    // Contacts are measured in every step, so that the last one counts.
    let (mut world, mut tldi) = attached_with(TldiConfig {
        resolution,
        scatter: 0.0,
        ..TldiConfig::default()
    });
    insert_floor(&mut world, 1.0);
    let body = dynamic_at(HALF + 0.03).can_sleep(false);
    let (body, _) = world.insert(body, tldi.collider(cloud(&cube(HALF))));
    let mut pixels = 0;
    for _ in 0..180 {
        pixels = tldi.step(&mut world)?.contact_pixels;
    }
    Ok((world.bodies[body].translation().y, pixels))
}

#[test]
fn coarse_pixels_keep_the_error_budget() -> TestResult {
    let (height, fine) = dropped(Resolution::Radii(1.0))?;
    assert!((height - HALF).abs() < 0.007, "{height}");
    // A budget that no pixel is too fine for changes nothing.
    assert_eq!(dropped(Resolution::Error(1e-3))?, (height, fine));
    let error = 0.06;
    let (height, coarse) = dropped(Resolution::Error(error))?;
    assert!((height - HALF).abs() < error, "{height}");
    // Pixels of 0.06 m, in place of 0.04 m: 2.25 times fewer, less what the border makes of it.
    let fewer = fine as f32 / coarse as f32;
    assert!((1.7..3.0).contains(&fewer), "{fine} and {coarse} pixels");
    Ok(())
}

/// A budget that nothing can keep gives the coarsest pixels, one that nothing exceeds the finest.
#[test]
fn pixels_follow_the_time_that_a_step_takes() -> TestResult {
    let fine = dropped(Resolution::Radii(1.0))?;
    assert_eq!(dropped(Resolution::Time(Duration::from_secs(3600)))?, fine);
    // An eighth of the cube: it rests within an error of a pixel.
    let (height, coarse) = dropped(Resolution::Time(Duration::from_nanos(1)))?;
    assert!((height - HALF).abs() < HALF / 4.0, "{height}");
    assert!(4 * coarse < fine.1, "{} and {coarse} pixels", fine.1);
    Ok(())
}
