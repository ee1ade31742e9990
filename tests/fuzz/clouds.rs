//! Any points and settings: a sound cloud or a typed error.

use crate::check;
use crate::shares::Shares;
use crate::spec::{CloudSpec, cloud};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;
use tldi::{PointCloud, Radii};

#[test]
fn builders_give_clouds_or_errors() {
    let shares = Shares::default();
    check(&cloud(-6..=6i32, true), |spec| {
        let built = spec.build();
        shares.note("any points and settings", built.is_ok());
        is_sound(&spec, &built)
    });
    check(&cloud(-6..=6i32, false), |spec| {
        let built = spec.build();
        shares.note("usual points and settings", built.is_ok());
        is_sound(&spec, &built)
    });
    shares.assert_at_least(&[
        ("any points and settings", 0.38),
        ("usual points and settings", 0.96),
    ]);
}

fn is_sound(
    spec: &CloudSpec,
    built: &Result<PointCloud, tldi::CloudError>,
) -> Result<(), TestCaseError> {
    let cloud = match built {
        Ok(cloud) => cloud,
        Err(error) => {
            prop_assert!(!error.to_string().is_empty());
            return Ok(());
        }
    };
    prop_assert_eq!(cloud.len() + cloud.dropped(), spec.count);
    prop_assert!(!spec.refuses || cloud.dropped() == 0);
    let bounds = cloud.bounds();
    for (k, point) in cloud.points().iter().copied().enumerate() {
        prop_assert!(point.is_finite());
        prop_assert!(bounds.min.cmple(point).all() && point.cmple(bounds.max).all());
        let radius = cloud.radius(k);
        prop_assert!(radius > 0.0 && radius <= cloud.max_radius());
    }
    prop_assert!(cloud.mean_radius() > 0.0 && cloud.max_radius().is_finite());
    if let Radii::PerPoint(radii) = cloud.radii() {
        prop_assert_eq!(radii.len(), cloud.len());
    }
    if let Some(normals) = cloud.normals() {
        prop_assert_eq!(normals.len(), cloud.len());
        for normal in normals {
            // Rounding of a unit vector in f32, ten times.
            prop_assert!((normal.length() - 1.0).abs() < 1e-6, "{}", normal);
        }
    }
    Ok(())
}

/// New points for a cloud that exists: taken, or refused and the old ones kept.
#[test]
fn new_points_are_taken_or_refused() {
    let cases = (cloud(-6..=6i32, false), cloud(-6..=6i32, true));
    let shares = Shares::default();
    check(&cases, |(before, after)| {
        let Ok(mut cloud) = before.build() else {
            return Ok(());
        };
        let old: Vec<_> = cloud.points().to_vec();
        let given = after.points();
        let taken = cloud.set_points(&given, None);
        shares.note("new points", taken.is_ok());
        match taken {
            Ok(()) => {
                prop_assert!(cloud.len() <= given.len() && !old.is_empty());
                prop_assert!(cloud.points().iter().all(|p| p.is_finite()));
            }
            Err(error) => {
                prop_assert!(!error.to_string().is_empty());
                prop_assert!(cloud.points() == old);
            }
        }
        let radius = cloud.mean_radius();
        prop_assert!(radius > 0.0 && radius.is_finite());
        Ok(())
    });
    shares.assert_at_least(&[("new points", 0.45)]);
}
