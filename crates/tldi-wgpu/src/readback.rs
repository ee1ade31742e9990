//! What a batch found, as it is read back.

use crate::counters::Counters;
use crate::layout::{CONTACT_WORDS, COUNTERS, FRAGMENTS_WRAPPED, MAX_VIEWS, PAIR_WORDS};
use std::ops::Range;
use tldi::glamx::Vec3;
use tldi::{CameraPolicy, ContactPixel, PairQuery, PairResult, View, VirtualCamera, plan};
use tldi_shaders::numbers;

/// The words that were read back: counters, pairs, contacts. The device wrote them, so nothing is
/// taken from them unchecked.
#[derive(Debug)]
pub(crate) struct Readback<'a> {
    counters: &'a [u32],
    pairs: &'a [[u32; PAIR_WORDS as usize]],
    contacts: &'a [[u32; CONTACT_WORDS as usize]],
}

const CROSSINGS: usize = numbers::CROSSINGS as usize;
const GAP: usize = numbers::GAP as usize;
const CROWDED: usize = numbers::CROWDED as usize;
const VIEWS: usize = numbers::VIEWS as usize;
const AXES: usize = numbers::AXES as usize;
const BEYOND: usize = numbers::BEYOND as usize;
const WAYS: usize = numbers::WAYS as usize;
const VIEW_WAYS: usize = numbers::VIEW_WAYS as usize;
const SPARE: usize = numbers::SPARE as usize;
const CONTACT_PIXEL: usize = numbers::CONTACT_PIXEL as usize;
const CONTACT_DEPTHS: usize = numbers::CONTACT_DEPTHS as usize;
const CONTACT_GAP: usize = numbers::CONTACT_GAP as usize;
const CONTACT_NORMALS: usize = numbers::CONTACT_NORMALS as usize;

impl<'a> Readback<'a> {
    /// The words of a batch with so many pairs.
    ///
    /// # Errors
    /// What is missing, where there are too few.
    pub(crate) fn new(words: &'a [u32], pairs: usize) -> Result<Self, String> {
        let split = (words.split_at_checked(COUNTERS as usize)).and_then(|(counters, rest)| {
            let (pairs, contacts) = rest.split_at_checked(pairs * PAIR_WORDS as usize)?;
            Some((counters, pairs, contacts))
        });
        let (counters, pairs, contacts) = split
            .ok_or_else(|| format!("{} words came back, too few for {pairs} pairs", words.len()))?;
        Ok(Self {
            counters,
            pairs: pairs.as_chunks().0,
            contacts: contacts.as_chunks().0,
        })
    }

    /// What the batch needed.
    pub(crate) fn counters(&self) -> Counters {
        let words: [u32; 7] = std::array::from_fn(|k| self.counters[k]);
        let mut counters: Counters = bytemuck::cast(words);
        if self.counters[FRAGMENTS_WRAPPED as usize] != 0 {
            counters.fragments = u32::MAX;
        }
        counters
    }

    /// Whether as many contacts came back as were counted.
    pub(crate) fn has_all_contacts(&self) -> bool {
        self.counters().contacts as usize <= self.contacts.len()
    }

    /// Whether the `k`-th pair on the device has a pixel with too many fragments.
    pub(crate) fn is_crowded(&self, k: usize) -> bool {
        self.pairs[k][CROWDED] != 0
    }

    /// Whether the `k`-th pair on the device is to be looked at from all directions and shows no crossing yet, or asks for
    /// its spare views. As `further` in WGSL sees it.
    pub(crate) fn wants_further(&self, k: usize, query: &PairQuery) -> bool {
        let words = &self.pairs[k];
        let View::Aim { policy, .. } = query.view else {
            return false;
        };
        let is_asked = policy == CameraPolicy::AllDirections && words[CROSSINGS] < plan::CROSSED;
        !self.is_crowded(k)
            && (1..MAX_VIEWS).contains(&words[VIEWS])
            && (is_asked || self.spare_views(k, query) > 0)
    }

    /// How many spare views of the `k`-th pair are asked for.
    fn spare_views(&self, k: usize, query: &PairQuery) -> usize {
        let words = &self.pairs[k];
        let way_out = self.way_out(k, 0..words[VIEWS] as usize);
        match plan::asks_for_spare(way_out, self.moved(k, query), &query.params) {
            true => words[SPARE] as usize,
            false => 0,
        }
    }

    /// How far `b` of the `k`-th pair moved, metres, if along the axis of the first view; else 0.
    fn moved(&self, k: usize, query: &PairQuery) -> f32 {
        match query.view {
            View::Aim { motion, .. } => plan::moved_along(motion, self.axis(k, 0)),
            View::Fixed(_) => 0.0,
        }
    }

    /// As the device chose it.
    fn axis(&self, k: usize, view: usize) -> Vec3 {
        let at = AXES + 3 * view;
        Vec3::from_array([0, 1, 2].map(|axis| f32::from_bits(self.pairs[k][at + axis])))
    }

    /// The least way out of these views of the `k`-th pair, metres.
    fn way_out(&self, k: usize, views: Range<usize>) -> Option<f32> {
        let words = &self.pairs[k];
        let way_out = |view: usize| {
            let way = words[WAYS + view * VIEW_WAYS + words[BEYOND + view].min(1) as usize];
            (way != 0).then(|| unordered(way))
        };
        views.filter_map(way_out).reduce(f32::min)
    }

    /// Fills all but the contacts of the `k`-th pair on the device; the way out is that of the spare views, until
    /// [`fill_contacts`](Self::fill_contacts).
    ///
    /// # Errors
    /// What makes no sense.
    pub(crate) fn fill(
        &self,
        k: usize,
        query: &PairQuery,
        result: &mut PairResult,
    ) -> Result<(), String> {
        let words = &self.pairs[k];
        let count = words[VIEWS].saturating_add(words[SPARE]);
        if count > MAX_VIEWS {
            return Err(format!(
                "pair {k} has {count} views, at most {MAX_VIEWS} exist"
            ));
        }
        result.collides = words[CROSSINGS] >= plan::CROSSED;
        result.gap = (words[GAP] != 0).then(|| -unordered(words[GAP]));
        result.axes.clear();
        let first_spare = words[VIEWS] as usize;
        let views = 0..first_spare + self.spare_views(k, query);
        result
            .axes
            .extend(views.clone().map(|view| match query.view {
                View::Fixed(camera) => camera.axis(),
                View::Aim { .. } => self.axis(k, view),
            }));
        result.contacts.clear();
        result.way_out = self.way_out(k, first_spare..views.end);
        let axes = result.axes.iter().flat_map(|axis| axis.to_array());
        let ways = self
            .way_out(k, 0..first_spare)
            .into_iter()
            .chain(result.way_out);
        all_finite(axes.chain(result.gap).chain(ways))
            .ok_or_else(|| format!("pair {k} has a gap, an axis or a way out that is no number"))
    }

    /// Adds the contacts of all pairs but crowded ones to their results.
    ///
    /// # Errors
    /// What makes no sense.
    pub(crate) fn fill_contacts(
        &self,
        pairs_of: &[usize],
        batch: &[PairQuery],
        results: &mut [PairResult],
    ) -> Result<(), String> {
        let count = self.counters().contacts as usize;
        let contacts = self.contacts.get(..count).ok_or_else(|| {
            let room = self.contacts.len();
            format!("{count} contacts were counted where {room} have room")
        })?;
        for (at, words) in contacts.iter().enumerate() {
            let (k, view) = ((words[0] / MAX_VIEWS) as usize, words[0] % MAX_VIEWS);
            let Some(&pair) = pairs_of.get(k) else {
                let pairs = pairs_of.len();
                return Err(format!("contact {at} is of pair {k} of {pairs}"));
            };
            if self.is_crowded(k) {
                continue;
            }
            let query = &batch[pair];
            let result = &mut results[pair];
            let Some(axis) = result.axes.get(view as usize) else {
                let views = self.pairs[k][VIEWS] + self.pairs[k][SPARE];
                if view < views {
                    // A spare view that was asked for by no more than rounding.
                    continue;
                }
                return Err(format!("contact {at} is in view {view} of {views}"));
            };
            let camera = match query.view {
                View::Fixed(camera) => camera,
                View::Aim { .. } => VirtualCamera::along(*axis, query.params.pixel_size),
            };
            let number = |at: usize| f32::from_bits(words[at]);
            all_finite((CONTACT_DEPTHS..words.len()).map(number))
                .ok_or_else(|| format!("contact {at} has a place or a normal that is no number"))?;
            let vector = |at: usize| Vec3::new(number(at), number(at + 1), number(at + 2));
            let pixel = [0, 1].map(|axis| words[CONTACT_PIXEL + axis] as i32);
            let [u, v] = pixel.map(|c| c as f32 + 0.5);
            let frame_from_view = camera.view_from_frame.rotation.inverse();
            result.contacts.push(ContactPixel {
                pixel,
                view,
                point_a: camera.point_at(u, v, number(CONTACT_DEPTHS)),
                point_b: camera.point_at(u, v, number(CONTACT_DEPTHS + 1)),
                normal_a: frame_from_view * vector(CONTACT_NORMALS),
                normal_b: frame_from_view * vector(CONTACT_NORMALS + 3),
                gap: number(CONTACT_GAP),
            });
        }
        for (k, &pair) in pairs_of.iter().enumerate() {
            if self.is_crowded(k) {
                continue;
            }
            let (query, result) = (&batch[pair], &mut results[pair]);
            let is_beyond = |view: &usize| self.pairs[k][BEYOND + view] != 0;
            (0..result.axes.len())
                .filter(is_beyond)
                .for_each(|view| result.turn_view(view));
            let first_spare = self.pairs[k][VIEWS] as usize;
            let way_out = self.way_out(k, 0..first_spare);
            let moved = self.moved(k, query);
            plan::settle_spare(result, first_spare, way_out, moved, &query.params);
        }
        Ok(())
    }
}

fn all_finite(mut numbers: impl Iterator<Item = f32>) -> Option<()> {
    numbers.all(f32::is_finite).then_some(())
}

/// The inverse of `ordered` in WGSL.
fn unordered(key: u32) -> f32 {
    f32::from_bits(if key >= 1 << 31 {
        key & !(1 << 31)
    } else {
        !key
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tldi::glamx::Pose3;
    use tldi::{Params, PointCloud, Surface};

    const PAIR: usize = COUNTERS as usize;
    const CONTACT: usize = PAIR + PAIR_WORDS as usize;
    const CONTACTS: usize = 6;

    /// Of one pair with one view and one contact, and room for two.
    fn words() -> Vec<u32> {
        let mut words = vec![0; CONTACT + 2 * CONTACT_WORDS as usize];
        words[CONTACTS] = 1;
        words[PAIR + VIEWS] = 1;
        words[PAIR + AXES + 1] = 1.0_f32.to_bits();
        words
    }

    fn taken(words: &[u32]) -> Result<PairResult, String> {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Z];
        let cloud = PointCloud::builder(&points[..]).radius(1.0).build();
        let cloud = cloud.expect("the points are valid");
        let batch = [PairQuery {
            a: Surface::Cloud(&cloud),
            b: Surface::Cloud(&cloud),
            a_from_b: Pose3::IDENTITY,
            view: View::aimed(),
            params: Params::for_radius(1.0),
        }];
        let mut results = [PairResult::default()];
        let readback = Readback::new(words, 1)?;
        readback.fill(0, &batch[0], &mut results[0])?;
        readback.fill_contacts(&[0], &batch, &mut results)?;
        let [result] = results;
        Ok(result)
    }

    /// Words that a sound device does not write are refused, each with what is wrong.
    #[test]
    fn words_that_make_no_sense_are_refused() {
        assert_eq!(taken(&words()).map(|result| result.contacts.len()), Ok(1));
        let nan = f32::NAN.to_bits();
        for (at, word, expected) in [
            (CONTACTS, 3, "3 contacts were counted where 2 have room"),
            (CONTACTS, u32::MAX, "have room"),
            (PAIR + VIEWS, 4, "pair 0 has 4 views"),
            (PAIR + VIEWS, u32::MAX, "views"),
            (PAIR + VIEWS, 0, "contact 0 is in view 0 of 0"),
            (PAIR + AXES, nan, "an axis or a way out that is no number"),
            (PAIR + GAP, u32::MAX, "no number"),
            (PAIR + WAYS, u32::MAX, "no number"),
            (CONTACT, 1, "contact 0 is in view 1 of 1"),
            (CONTACT, 3, "contact 0 is of pair 1 of 1"),
            (CONTACT, u32::MAX, "contact 0 is of pair"),
            (CONTACT + CONTACT_DEPTHS, nan, "contact 0 has a place"),
            (
                CONTACT + CONTACT_NORMALS + 5,
                f32::INFINITY.to_bits(),
                "contact 0 has a place",
            ),
        ] {
            let mut words = words();
            words[at] = word;
            let refused = taken(&words).expect_err(expected);
            assert!(refused.contains(expected), "{at}: {refused}");
        }
        for length in [0, PAIR - 1, CONTACT - 1] {
            let refused = taken(&words()[..length]).expect_err("too few");
            assert!(refused.contains("too few"), "{length}: {refused}");
        }
    }

    /// More fragments than a word counts are more than any buffer holds.
    #[test]
    fn fragments_beyond_a_word_are_too_many() {
        let mut words = words();
        words[FRAGMENTS_WRAPPED as usize] = 1;
        let needed = Readback::new(&words, 1).map(|readback| readback.counters());
        let needed = needed.expect("there are enough words");
        let most = Counters::most(u64::MAX);
        assert!(Counters::LEAST.grown(&needed, &most).is_err());
    }
}
