//! Pairs of clouds, and of a cloud and a shape, at any pose and with any parameters.

use crate::check;
use crate::shapes::shape;
use crate::shares::Shares;
use crate::spec::{any_number, cloud, pose};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;
use rapier3d_tldi::ExactShape;
use tldi::glamx::Vec3;
use tldi::{
    Backend, CameraPolicy, CpuBackend, ImpactQuery, PairQuery, PairResult, Params, Surface, View,
};

/// All of a result is finite, its vectors have their lengths, its patches their points.
fn is_sound(result: &PairResult) -> Result<(), TestCaseError> {
    prop_assert!(result.gap.is_none_or(f32::is_finite));
    prop_assert!(result.coarser.is_none_or(|c| c.is_finite() && c > 1.0));
    let is_unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-4;
    prop_assert!(result.axes.iter().all(|axis| is_unit(*axis)));
    for contact in &result.contacts {
        prop_assert!(contact.point_a.is_finite() && contact.point_b.is_finite());
        prop_assert!(contact.normal_a.is_finite() && contact.normal_b.is_finite());
        prop_assert!(contact.gap.is_finite() && (contact.view as usize) < result.axes.len());
    }
    for patch in &result.patches {
        prop_assert!(is_unit(patch.normal), "{}", patch.normal);
        prop_assert!(!patch.points.is_empty() && patch.roughness.is_finite());
        for point in &patch.points {
            prop_assert!(point.point_a.is_finite() && point.point_b.is_finite());
            prop_assert!(point.gap.is_finite());
        }
    }
    Ok(())
}

fn policy() -> impl Strategy<Value = CameraPolicy> {
    prop_oneof![
        3 => Just(CameraPolicy::default()),
        1 => Just(CameraPolicy::AllDirections),
    ]
}

/// Parameters as a user may set them: shares of a radius, and any number at all.
#[derive(Clone, Copy, Debug)]
struct ParamSpec {
    pixel: f32,
    prediction: f32,
    any: Option<(u8, f32)>,
}

fn params() -> impl Strategy<Value = ParamSpec> {
    let any = proptest::option::weighted(0.15, (0..4u8, any_number()));
    (0.25..8.0f32, 0.0..4.0f32, any).prop_map(|(pixel, prediction, any)| ParamSpec {
        pixel,
        prediction,
        any,
    })
}

impl ParamSpec {
    fn of(&self, radius: f32) -> Params {
        let mut params = Params::for_radius(radius)
            .with_pixel_size(self.pixel * radius)
            .with_prediction(self.prediction * radius);
        match self.any {
            Some((0, value)) => params.pixel_size = value,
            Some((1, value)) => params.prediction = value,
            Some((2, value)) => params.merge_gap = value,
            Some((_, value)) => params.thickness = value,
            None => {}
        }
        params
    }
}

fn compare(query: PairQuery, shares: &Shares) -> Result<(), TestCaseError> {
    let mut results = Vec::new();
    let mut backend = CpuBackend::new();
    let compared = backend.compare(&[query], &mut results);
    shares.note("compared", compared.is_ok());
    match compared {
        Ok(()) => {
            shares.note("in contact", !results[0].patches.is_empty());
            is_sound(&results[0])
        }
        Err(error) => {
            prop_assert!(!error.to_string().is_empty());
            Ok(())
        }
    }
}

#[test]
fn clouds_meet_clouds() {
    let sizes = (-6..=6i32, -2..=2i32);
    let cases = sizes.prop_flat_map(|(e, ratio)| {
        let other = (e + ratio).clamp(-6, 6);
        let clouds = (cloud(Just(e), false), cloud(Just(other), false));
        (
            clouds,
            pose(),
            params(),
            policy(),
            [any_number(), any_number(), any_number()],
        )
    });
    let shares = Shares::default();
    check(&cases, |((a, b), pose, params, policy, motion)| {
        let (Ok(cloud_a), Ok(cloud_b)) = (a.build(), b.build()) else {
            shares.note("built", false);
            return Ok(());
        };
        shares.note("built", true);
        let coarsest = cloud_a.mean_radius().max(cloud_b.mean_radius());
        let query = PairQuery {
            a: Surface::Cloud(&cloud_a),
            b: Surface::Cloud(&cloud_b),
            a_from_b: pose.at(a.scale().max(b.scale())),
            view: View::Aim {
                policy,
                motion: Vec3::from_array(motion),
                last_axis: None,
            },
            params: params.of(coarsest),
        };
        compare(query, &shares)
    });
    shares.assert_at_least(&[("built", 0.95), ("compared", 0.46), ("in contact", 0.37)]);
}

#[test]
fn clouds_meet_shapes() {
    let cases = (
        cloud(-6..=6i32, false),
        shape(),
        pose(),
        params(),
        policy(),
        any::<bool>(),
    );
    let shares = Shares::default();
    check(
        &cases,
        |(spec, shape, pose, params, policy, cloud_first)| {
            let (Ok(cloud), Some(shape)) = (spec.build(), shape.build(spec.scale())) else {
                shares.note("built", false);
                return Ok(());
            };
            shares.note("built", true);
            if shape.as_compound().is_some() {
                return Ok(()); // the pipeline takes it apart
            }
            let exact = ExactShape(&*shape.0);
            let (cloud_side, shape_side) = (Surface::Cloud(&cloud), Surface::Exact(&exact));
            let [a, b] = match cloud_first {
                true => [cloud_side, shape_side],
                false => [shape_side, cloud_side],
            };
            let query = PairQuery {
                a,
                b,
                a_from_b: pose.at(spec.scale()),
                view: View::Aim {
                    policy,
                    motion: Vec3::ZERO,
                    last_axis: None,
                },
                params: params.of(cloud.mean_radius()),
            };
            compare(query, &shares)
        },
    );
    shares.assert_at_least(&[("built", 0.94), ("compared", 0.89), ("in contact", 0.16)]);
}

/// Along any motion: nowhere, or at a finite place within it.
#[test]
fn impacts_are_on_the_way() {
    let motion = [any_number(), any_number(), any_number()];
    let cases = (
        (cloud(-6..=6i32, false), cloud(Just(0), false), shape()),
        (pose(), params(), motion, any::<[bool; 2]>()),
    );
    let shares = Shares::default();
    check(
        &cases,
        |((a, mut b, shape), (pose, params, motion, flags))| {
            b.exponent = a.exponent;
            let (Ok(cloud_a), Ok(cloud_b), Some(shape)) =
                (a.build(), b.build(), shape.build(a.scale()))
            else {
                shares.note("built", false);
                return Ok(());
            };
            shares.note("built", true);
            let exact = ExactShape(&*shape.0);
            let motion = a.scale() * Vec3::from_array(motion);
            let query = ImpactQuery {
                a: match flags[0] {
                    true => Surface::Cloud(&cloud_a),
                    false => Surface::Exact(&exact),
                },
                b: Surface::Cloud(&cloud_b),
                a_from_b: pose.at(a.scale()),
                motion,
                touching: 0.0,
                core_only: flags[1],
                penetration: None,
                turned: &[],
                params: params.of(cloud_b.mean_radius()),
            };
            let answer = CpuBackend::new().impact(&query);
            shares.note("answered", answer.is_ok());
            shares.note("met", matches!(answer, Ok(Some(_))));
            match answer {
                Ok(None) => {}
                Ok(Some(impact)) => {
                    prop_assert!(impact.distance >= 0.0 && impact.distance <= motion.length());
                    prop_assert!(impact.point.is_finite() && impact.normal.is_normalized());
                }
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
            Ok(())
        },
    );
    shares.assert_at_least(&[("built", 0.93), ("answered", 0.37), ("met", 0.05)]);
}
