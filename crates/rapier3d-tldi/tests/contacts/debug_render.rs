//! What is drawn for debugging, line by line.

use crate::common::worlds::{TestResult, attached, insert_floor};
use crate::common::{SPACING, shape, square};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use rapier3d_tldi::{DEBUG_POINT_LIMIT, TldiDebugRenderMode as Mode};

const BALL: f32 = 0.3;
const DEPTH: f32 = 0.01;
const MIDDLE: Vector = Vector::new(0.07, BALL - DEPTH, -0.05);

/// Keeps the lines, and declines pairs or colliders on demand.
#[derive(Default)]
struct Recorder {
    lines: Vec<([Vector; 2], DebugColor)>,
    declines_pairs: bool,
    declines_colliders: bool,
}

impl DebugRenderBackend for Recorder {
    fn filter_object(&self, object: DebugRenderObject) -> bool {
        match object {
            DebugRenderObject::ContactPair(..) => !self.declines_pairs,
            DebugRenderObject::Collider(..) => !self.declines_colliders,
            _ => panic!("an object of another kind"),
        }
    }

    fn draw_line(&mut self, _: DebugRenderObject, a: Vector, b: Vector, color: DebugColor) {
        self.lines.push(([a, b], color));
    }
}

/// A ball 1 cm deep in a floor without normals, with edges of 1.2 m.
fn ball_in_floor() -> Result<(PhysicsWorld, TldiPipeline), TldiError> {
    let (mut world, mut tldi) = attached();
    insert_floor(&mut world, 0.6);
    let ball = RigidBodyBuilder::dynamic()
        .translation(MIDDLE + Vector::Y * 0.01)
        .gravity_scale(0.0);
    let (ball, _) = world.insert(ball, ColliderBuilder::ball(BALL));
    tldi.step(&mut world)?;
    // What is drawn follows the poses of now, not those of the step.
    world.bodies[ball].set_translation(MIDDLE, false);
    Ok((world, tldi))
}

fn drawn(
    world: &PhysicsWorld,
    tldi: &TldiPipeline,
    mode: Mode,
) -> Result<Vec<([Vector; 2], DebugColor)>, TldiError> {
    let mut recorder = Recorder::default();
    tldi.debug_render(world, &mut recorder, mode)?;
    Ok(recorder.lines)
}

/// The lines of each colour, in the order in which the colours appear.
fn by_color(lines: &[([Vector; 2], DebugColor)]) -> Vec<Vec<[Vector; 2]>> {
    let mut groups: Vec<(DebugColor, Vec<[Vector; 2]>)> = Vec::new();
    for (line, color) in lines {
        match groups.iter_mut().find(|(c, _)| c == color) {
            Some((_, group)) => group.push(*line),
            None => groups.push((*color, vec![*line])),
        }
    }
    groups.into_iter().map(|(_, lines)| lines).collect()
}

/// Three lines through every point without a normal; one along each normal, at its place in the
/// world; of a large cloud no more than the limit.
#[test]
fn points() -> TestResult {
    let (mut world, mut tldi) = ball_in_floor()?;
    let lines = drawn(&world, &tldi, Mode::POINTS)?;
    assert_eq!(lines.len(), 3 * square(0.6).len());
    for ([a, b], _) in &lines {
        let middle = a.midpoint(*b);
        assert!(middle.y.abs() < 1e-6 && middle.abs().max_element() < 0.6 + 1e-5);
        assert!((a.distance(*b) - SPACING).abs() < 1e-6);
    }

    let points: Vec<Vector> = (0..3 * DEBUG_POINT_LIMIT + 1)
        .map(|i| Vector::new((i % 200) as f32, 0.0, (i / 200) as f32) * 0.1)
        .collect();
    let normals = vec![Vector::Y; points.len()];
    let cloud = PointCloud::builder(points).radius(0.1).normals(normals);
    let pose = Pose::new(Vector::new(50.0, 0.0, 0.0), Vector::Z * 0.5);
    let body = RigidBodyBuilder::fixed().pose(pose);
    world.insert(body, tldi.collider(cloud.build()?));
    tldi.step(&mut world)?;
    let all = drawn(&world, &tldi, Mode::POINTS)?;
    let large = &all[lines.len()..];
    assert!(large.len() <= DEBUG_POINT_LIMIT && large.len() > DEBUG_POINT_LIMIT / 2);
    let normal = pose.rotation * Vector::Y;
    for ([a, b], _) in large {
        assert!((*b - *a).distance(0.1 * normal) < 1e-5);
        assert!((pose.inverse() * *a).y.abs() < 1e-5);
    }
    Ok(())
}

/// The zone is a box around the contact: twelve edges, within the floor's bounds.
#[test]
fn contact_zone() -> TestResult {
    let (world, tldi) = ball_in_floor()?;
    let lines = drawn(&world, &tldi, Mode::CONTACT_ZONE)?;
    assert_eq!(lines.len(), 12);
    let corners = lines.iter().flat_map(|(line, _)| *line);
    let (low, high) = corners.fold((Vector::MAX, Vector::MIN), |(low, high), p| {
        (low.min(p), high.max(p))
    });
    // The ball's bounds, cut to those of the floor, 4 cm thick either way, and the prediction.
    let prediction = world.integration_parameters.prediction_distance();
    let expected_low = Vector::new(MIDDLE.x - BALL, -DEPTH, MIDDLE.z - BALL);
    let expected_high = Vector::new(MIDDLE.x + BALL, SPACING + prediction, MIDDLE.z + BALL);
    assert!(low.distance(expected_low) < 1e-5, "{low}");
    assert!(high.distance(expected_high) < 1e-5, "{high}");
    let length: f32 = lines.iter().map(|([a, b], _)| a.distance(*b)).sum();
    assert!((length - 4.0 * (high - low).element_sum()).abs() < 1e-3);
    Ok(())
}

/// One view along the normal of the floor, with a frame around the contact's pixels.
#[test]
fn cameras() -> TestResult {
    let (world, tldi) = ball_in_floor()?;
    let lines = drawn(&world, &tldi, Mode::CAMERAS)?;
    assert_eq!(lines.len(), 5);
    let ([behind, eye], _) = lines[4];
    // Four pixels long, and up to 3° off: where the ball's middle lies turns the axis.
    assert!((eye.distance(behind) - 4.0 * SPACING).abs() < 1e-5);
    assert!((eye - behind).angle_between(-Vector::Y).to_degrees() < 3.5);
    // A cap of 1 cm and the prediction's height: 0.13 m in radius, and a pixel.
    let prediction = world.integration_parameters.prediction_distance();
    let reach = (2.0 * BALL * (DEPTH + prediction)).sqrt() + 1.5 * SPACING;
    for ([a, b], _) in &lines[..4] {
        for corner in [a, b] {
            let aside = (*corner - MIDDLE).with_y(0.0).abs().max_element();
            // The pixels may lie at any angle.
            assert!(aside < 1.5 * reach && aside > 0.5 * DEPTH, "{corner}");
        }
    }
    Ok(())
}

/// Every contact pixel: a line up or down between floor and ball, and one along the normal.
#[test]
fn contact_pixels() -> TestResult {
    let (world, mut tldi) = ball_in_floor()?;
    let lines = drawn(&world, &tldi, Mode::CONTACT_PIXELS)?;
    let groups = by_color(&lines);
    let [gaps, normals] = &groups[..] else {
        return Err(format!("{} colours", groups.len()).into());
    };
    assert_eq!(gaps.len(), normals.len());
    for [a, b] in gaps {
        assert!(a.y.abs() < 0.1 * SPACING, "{a} is on the floor");
        let from_ball = (b.distance(MIDDLE) - BALL).abs();
        assert!(from_ball < 0.1 * SPACING, "{b} is on the ball");
    }
    for ([a, b], [middle, tip]) in gaps.iter().zip(normals) {
        assert!(a.midpoint(*b).distance(*middle) < 1e-6);
        assert!((middle.distance(*tip) - SPACING).abs() < 1e-5);
        assert!((tip.y - middle.y) > 0.9 * SPACING, "from the floor up");
    }
    // As many as the step finds at this pose.
    let mut world = world;
    let report = tldi.step(&mut world)?;
    assert_eq!(report.contact_pixels, gaps.len());
    Ok(())
}

/// The contacts of the manifolds, each with its depth and its normal.
#[test]
fn manifolds() -> TestResult {
    let (world, tldi) = ball_in_floor()?;
    let lines = drawn(&world, &tldi, Mode::MANIFOLDS)?;
    let groups = by_color(&lines);
    let [depths, normals] = &groups[..] else {
        return Err(format!("{} colours", groups.len()).into());
    };
    assert!((1..=8).contains(&depths.len()), "{}", depths.len());
    let scatter = TldiConfig::default().scatter * SPACING;
    let deepest = depths.iter().map(|[a, b]| a.y - b.y).fold(0.0, f32::max);
    // A penetration counts by what it exceeds the scatter; curved contacts are good to 0.15 r.
    assert!(
        (deepest - (DEPTH - scatter)).abs() < 0.15 * SPACING,
        "{deepest}"
    );
    for ([a, _], [start, tip]) in depths.iter().zip(normals) {
        assert_eq!(a, start);
        assert!((*tip - *start).distance(2.0 * SPACING * Vector::Y) < 0.1 * SPACING);
    }
    Ok(())
}

/// Declined objects are not drawn, no flag draws nothing, and a cloud in a compound is drawn where
/// it is.
#[test]
fn filters_and_compounds() -> TestResult {
    let (mut world, mut tldi) = ball_in_floor()?;
    assert!(drawn(&world, &tldi, Mode::empty())?.is_empty());
    let all = drawn(&world, &tldi, Mode::all())?.len();
    let points = drawn(&world, &tldi, Mode::POINTS)?.len();
    for (declines_pairs, declines_colliders, expected) in
        [(true, false, points), (false, true, all - points)]
    {
        let mut recorder = Recorder {
            declines_pairs,
            declines_colliders,
            ..Recorder::default()
        };
        tldi.debug_render(&world, &mut recorder, Mode::all())?;
        assert_eq!(recorder.lines.len(), expected);
    }

    let part = Pose::from_translation(Vector::new(0.0, 3.0, 0.0));
    let parts = vec![
        (Pose::IDENTITY, SharedShape::ball(0.1)),
        (part, SharedShape::new(shape(&[Vector::X, Vector::Z]))),
    ];
    let body = RigidBodyBuilder::fixed().translation(Vector::X * 9.0);
    world.insert(body, ColliderBuilder::compound(parts));
    tldi.step(&mut world)?;
    let lines = drawn(&world, &tldi, Mode::POINTS)?;
    let [first, second] = [lines[points].0, lines[points + 3].0].map(|[a, b]| a.midpoint(b));
    assert!(
        first.distance(Vector::new(10.0, 3.0, 0.0)) < 1e-5,
        "{first}"
    );
    assert!(
        second.distance(Vector::new(9.0, 3.0, 1.0)) < 1e-5,
        "{second}"
    );
    Ok(())
}
