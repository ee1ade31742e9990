//! What is remembered about pairs from step to step: on which side they touched, and what was measured.

use crate::step::candidates::{Candidate, pose_of};
use crate::step::measured::Measured;
use crate::step::prepared::Batch;
use rapier3d::dynamics::RigidBodySet;
use rapier3d::geometry::{ColliderHandle, ColliderSet};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::shape::Shape;
use std::sync::atomic::Ordering;
use tldi::PairResult;
use tldi::plan::first_is_smaller;

/// Index and generation of both colliders.
type PairId = [(u32, u32); 2];

fn pair_id(colliders: [ColliderHandle; 2]) -> PairId {
    colliders.map(|handle| handle.into_raw_parts())
}

/// Colliders and parts of a comparison.
type PartsId = (PairId, [u32; 2]);

/// Steps without contact for which the last axis is remembered. A body that hops, or whose contact noise hides, is still
/// on the side where it was. After more steps it may be elsewhere. Half or twice: no row of any suite changes.
const MOST_LOST: u32 = 6;

/// The larger and the smaller collider of a pair.
struct BySize {
    first_is_smaller: bool,
    /// From the frame of the larger one.
    world_from_larger: Pose,
    /// Middle of the smaller one's bounds in the frame of the larger one, metres.
    middle: Vector,
}

impl BySize {
    fn new(shapes: [&dyn Shape; 2], world_from_shapes: [Pose; 2]) -> Self {
        let bounds = shapes.map(|shape| shape.compute_local_aabb());
        let first_is_smaller = first_is_smaller(bounds.map(|bounds| bounds.extents()));
        let (smaller, larger) = if first_is_smaller { (0, 1) } else { (1, 0) };
        let world_from_larger = world_from_shapes[larger];
        let middle = world_from_shapes[smaller] * bounds[smaller].center();
        Self {
            first_is_smaller,
            world_from_larger,
            middle: world_from_larger.inverse_transform_point(middle),
        }
    }
}

/// Main view axis of the last contact of two parts: on which side of the larger collider the smaller one is. It is in
/// the frame of the larger one, whatever the user does with both between two steps. While rapier moves them, it stays
/// as it is in world space: bodies that roll turn under their contacts.
#[derive(Clone, Copy)]
struct LastAxis {
    /// Unit vector in the frame of the larger collider.
    axis: Vector,
    first_is_smaller: bool,
    /// Middle of the smaller one's bounds in the frame of the larger one, after the last step, metres.
    middle: Vector,
    /// How far that was from what it touched, along the axis, metres.
    height: f32,
    /// Steps without contact since.
    lost_for: u32,
}

impl LastAxis {
    /// In world space; none if since the last step the user moved the smaller collider, or what it consists of, so far
    /// that its middle may have passed what it touched.
    fn in_world(&self, now: &BySize) -> Option<Vector> {
        let way = (now.middle - self.middle).dot(self.axis).abs();
        let holds = self.first_is_smaller == now.first_is_smaller && way <= self.height;
        holds.then(|| now.world_from_larger.rotation * self.axis)
    }

    /// That of two parts; none if they do not touch.
    fn of(result: &PairResult, world_from_a: Pose, pair: &BySize) -> Option<Self> {
        let larger_from_a = pair.world_from_larger.inv_mul(&world_from_a);
        let axis = larger_from_a.rotation * *result.axes.first()?;
        let contacts = result.contacts.iter();
        let deepest = contacts.min_by(|a, b| a.gap.total_cmp(&b.gap))?;
        let touched = match pair.first_is_smaller {
            true => deepest.point_b,
            false => deepest.point_a,
        };
        let touched = larger_from_a * touched;
        Some(Self {
            axis,
            first_is_smaller: pair.first_is_smaller,
            middle: pair.middle,
            height: (pair.middle - touched).dot(axis).abs(),
            lost_for: 0,
        })
    }

    /// After a step that moved the colliders.
    fn after(self, before: &BySize, after: &BySize) -> Self {
        let [before, now] = [before, after].map(|pair| pair.world_from_larger.rotation);
        let axis = match before == now {
            true => self.axis,
            false => (now.inverse() * (before * self.axis)).normalize(),
        };
        Self {
            axis,
            middle: after.middle,
            ..self
        }
    }

    /// After another step without contact.
    fn lost(self) -> Option<Self> {
        let lost_for = self.lost_for + 1;
        (lost_for <= MOST_LOST).then_some(Self { lost_for, ..self })
    }
}

/// What an ascending list holds for a key.
fn found<K: Ord + Copy, T: Copy>(list: &[(K, T)], key: K) -> Option<T> {
    let at = list.binary_search_by_key(&key, |(key, _)| *key).ok()?;
    Some(list[at].1)
}

/// What is remembered about pairs from step to step, until they separate. All in ascending order.
#[derive(Default)]
pub(crate) struct PairMemory {
    /// Of each comparison, by colliders and parts.
    axes: Vec<(PartsId, LastAxis)>,
    /// The measurements that rapier's manifolds are from.
    measured: Vec<(PairId, Measured)>,
    older_axes: Vec<(PartsId, LastAxis)>,
    older_measured: Vec<(PairId, Measured)>,
}

impl PairMemory {
    /// That of the last contact of two parts, in world space.
    pub(crate) fn axis(
        &self,
        colliders: [ColliderHandle; 2],
        parts: [u32; 2],
        shapes: [&dyn Shape; 2],
        world_from_shapes: [Pose; 2],
    ) -> Option<Vector> {
        let last = found(&self.axes, (pair_id(colliders), parts))?;
        last.in_world(&BySize::new(shapes, world_from_shapes))
    }

    pub(crate) fn measured(&self, colliders: [ColliderHandle; 2]) -> Option<Measured> {
        found(&self.measured, pair_id(colliders))
    }

    /// After a step: what its batch measured, if rapier took it. What sleeps stays as it is.
    pub(crate) fn update(
        &mut self,
        candidates: &[Candidate],
        batch: &Batch,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) {
        std::mem::swap(&mut self.axes, &mut self.older_axes);
        std::mem::swap(&mut self.measured, &mut self.older_measured);
        self.axes.clear();
        self.measured.clear();
        for candidate in candidates.iter().filter(|candidate| candidate.asleep) {
            let id = pair_id([candidate.collider1, candidate.collider2]);
            self.retain_axes(id);
            let measured = found(&self.older_measured, id);
            (self.measured).extend(measured.map(|measured| (id, measured)));
        }
        for pair in &batch.pairs {
            let [Some(collider1), Some(collider2)] = pair.colliders.map(|c| colliders.get(c))
            else {
                continue;
            };
            let shapes = [&*pair.shapes[0].0, &*pair.shapes[1].0];
            let before = BySize::new(shapes, pair.poses);
            let after = BySize::new(shapes, [collider1, collider2].map(|c| pose_of(c, bodies)));
            let id = pair_id(pair.colliders);
            let was_used = pair.used.load(Ordering::Relaxed);
            let measured = pair.measured.filter(|_| was_used);
            (self.measured).extend(measured.map(|measured| (id, measured)));
            if pair.is_kept {
                let first = self.axes.len();
                self.retain_axes(id);
                self.axes[first..]
                    .iter_mut()
                    .for_each(|(_, last)| *last = last.after(&before, &after));
                continue;
            }
            for part in &batch.parts[pair.parts.clone()] {
                let Some(result) = part.result(&batch.results) else {
                    continue;
                };
                let key = (id, part.indices);
                // An axis without contact may be that of the few points that came near first.
                let of_contact = LastAxis::of(result, part.world_from_a(&pair.poses[0]), &before);
                let lost = || {
                    // One that was outdated for the comparison stays so.
                    part.comparison.as_ref()?.last_axis()?;
                    found(&self.older_axes, key)?.lost()
                };
                let axis = of_contact
                    .or_else(lost)
                    .map(|last| last.after(&before, &after));
                self.axes.extend(axis.map(|axis| (key, axis)));
            }
        }
        self.axes.sort_unstable_by_key(|(key, _)| *key);
        self.measured.sort_unstable_by_key(|(key, _)| *key);
    }

    fn retain_axes(&mut self, id: PairId) {
        let start = self.older_axes.partition_point(|((key, _), _)| *key < id);
        let kept = self.older_axes[start..]
            .iter()
            .take_while(|((key, _), _)| *key == id);
        self.axes.extend(kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::narrow_phase::parts::{Hint, ShapePair, append_part_pairs};
    use crate::step::prepared::{PreparedPair, Question};
    use crate::{PointCloudShape, TldiConfig};
    use rapier3d::geometry::ColliderBuilder;
    use tldi::{ContactPixel, PointCloud};

    /// While rapier turns the larger collider, the axis stays in world space. Where the user turns it, the axis follows.
    #[test]
    fn axes_follow_the_user() {
        let [before, turned] = [0.0, 0.5].map(|angle| BySize {
            first_is_smaller: false,
            world_from_larger: Pose::rotation(angle * Vector::Z),
            middle: Vector::ZERO,
        });
        let last = LastAxis {
            axis: Vector::X,
            first_is_smaller: false,
            middle: Vector::ZERO,
            height: 0.1,
            lost_for: 0,
        };
        let is_close = |axis: Option<Vector>, to: Vector| axis.unwrap().distance(to) < 1e-6;
        let by_rapier = last.after(&before, &turned).in_world(&turned);
        assert!(is_close(by_rapier, Vector::X), "{by_rapier:?}");
        let by_user = last.in_world(&turned);
        let expected = turned.world_from_larger.rotation * Vector::X;
        assert!(is_close(by_user, expected), "{by_user:?}");
    }

    /// The axis of points that came near without touching says nothing of the side of a body.
    #[test]
    fn axes_are_remembered_of_contacts() {
        let points: Vec<Vector> = (0..64)
            .map(|k| 0.1 * Vector::new((k % 8) as f32, 0.0, (k / 8) as f32))
            .collect();
        let cloud = PointCloud::builder(points).radius(0.1).build().unwrap();
        let shape: rapier3d::geometry::SharedShape =
            rapier3d::geometry::SharedShape::new(PointCloudShape::new(cloud));
        // A quarter turn about z: from x in the collider to y in the world.
        let turned = Pose::rotation(0.5 * std::f32::consts::PI * Vector::Z);
        let mut set = ColliderSet::new();
        let collider = ColliderBuilder::new(shape.clone()).position(turned);
        let colliders = [(); 2].map(|()| set.insert(collider.clone()));
        let mut memory = PairMemory::default();
        let mut remembered = |axis: Vector, contacts: Vec<ContactPixel>| {
            let pair = ShapePair::new(&*shape.0, &*shape.0, Pose::IDENTITY, 0.1);
            let mut batch = Batch::default();
            let last_axis = memory.axis(colliders, [0, 0], [&*shape.0, &*shape.0], [turned; 2]);
            let hint = |_, _: Option<&Pose>, _| Hint {
                last_axis,
                ..Hint::default()
            };
            let mut sides = Vec::new();
            let config = TldiConfig::default();
            append_part_pairs(pair, &config, &mut batch.parts, &mut sides, hint);
            batch.results.push(PairResult {
                axes: vec![axis],
                contacts,
                ..PairResult::default()
            });
            let shapes = [shape.clone(), shape.clone()];
            let question = Question::Contacts(pair.prediction);
            let prepared =
                PreparedPair::without_bodies(colliders, shapes, [turned; 2], question, 0..1);
            batch.push(prepared, &pair.pos12);
            memory.update(&[], &batch, &RigidBodySet::new(), &set);
            memory.axis(colliders, [0, 0], [&*shape.0, &*shape.0], [turned; 2])
        };
        assert_eq!(remembered(Vector::Z, vec![]), None);
        let touching = ContactPixel {
            pixel: [0, 0],
            view: 0,
            point_a: Vector::ZERO,
            point_b: Vector::ZERO,
            normal_a: Vector::Y,
            normal_b: -Vector::Y,
            gap: 0.0,
        };
        let axis = remembered(Vector::X, vec![touching]);
        assert!(axis.is_some_and(|axis| axis.distance(Vector::Y) < 1e-6));
        for _ in 0..MOST_LOST {
            assert_eq!(remembered(Vector::Z, vec![]), axis);
        }
        assert_eq!(remembered(Vector::Z, vec![]), None);
    }
}
