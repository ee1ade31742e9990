//! Which contact pixels continue each other, and which penetrations their neighbours confirm.

use crate::contact::retain_by_index;
use crate::counting_sort::sort_by_bin;
use crate::{ContactPixel, PairResult, Params};

/// Neighbouring pixels are linked if their points on either surface are within this many pixels. Half: 13 of 636
/// stability rows fail instead of 3, and normals are 29 % worse; twice: no change.
const SAME_SURFACE_PX: f32 = 3.0;

/// Linked neighbours, of eight, that confirm a penetration of a layer's thickness.
/// Fewer confirm proportionally less. At the rim of a body, a ray runs along its side, whose depth
/// is uncertain, or misses a layer and seems to run inside up to the next one. Such pixels are
/// alone or follow the rim in rows of one or two. Surfaces that really are so deep in each other
/// overlap over more pixels. 3: 6 of 300 overlaps are falsely deep instead of 4, no change in any other
/// suite; 10, more than a pixel has: 161 of 1,080 contacts are missed, and 11 of 159 stability rows fail
/// instead of none.
const CONFIRMING: u32 = 5;

/// The same where a surface ends in its rim, which is a line of pixels. 1: no test fails; 4: rims are told half as deep as they
/// are.
const CONFIRMING_RIM: u32 = 2;

/// From a pixel to its neighbours that come after it, row by row: columns and rows.
const AFTER: [[i64; 2]; 4] = [[1, 0], [-1, 1], [0, 1], [1, 1]];

/// In place of an index.
pub(crate) const NONE: u32 = u32::MAX;

/// Pairs of neighbouring contact pixels that continue each other on both surfaces.
#[derive(Debug, Default)]
pub(crate) struct Links {
    /// Indices of the contact pixels, the lower one first.
    pub(crate) pairs: Vec<(u32, u32)>,
    /// How many others each contact pixel is linked with.
    counts: Vec<u32>,
    /// Scratch for each contact pixel: whether its component leads out, then its new index or [`NONE`].
    marks: Vec<u32>,
    /// Where the neighbours of each contact pixel start in `neighbors`, and their end.
    starts: Vec<u32>,
    neighbors: Vec<u32>,
}

impl Links {
    /// Finds the links of `contacts`, which are ordered by view, row and column.
    pub(crate) fn find(&mut self, contacts: &[ContactPixel], params: &Params) {
        self.pairs.clear();
        let limit = SAME_SURFACE_PX * params.pixel_size;
        let mut first = 0;
        for view in contacts.chunk_by(|c, d| c.view == d.view) {
            // For each pixel that comes after the present one, the first contact pixel that is not
            // before it. These positions move on together, so no map as large as the bounds of the
            // pixels is needed.
            let mut starts = [0; AFTER.len()];
            for (k, c) in view.iter().enumerate() {
                for (start, offset) in starts.iter_mut().zip(AFTER) {
                    let [i, j] = [0, 1].map(|axis| i64::from(c.pixel[axis]) + offset[axis]);
                    let place = |d: &ContactPixel| (i64::from(d.pixel[1]), i64::from(d.pixel[0]));
                    while view.get(*start).is_some_and(|d| place(d) < (j, i)) {
                        *start += 1;
                    }
                    for (l, d) in view.iter().enumerate().skip(*start) {
                        if place(d) != (j, i) {
                            break;
                        }
                        if c.point_a.distance(d.point_a) <= limit
                            && c.point_b.distance(d.point_b) <= limit
                        {
                            self.pairs.push(((first + k) as u32, (first + l) as u32));
                        }
                    }
                }
            }
            first += view.len();
        }
    }

    /// Fills `roots`, for each of `contacts` contact pixels, with the lowest index among those that
    /// links join it with.
    pub(crate) fn components(&self, contacts: usize, roots: &mut Vec<u32>) {
        find_roots(contacts, self.pairs.iter().copied(), roots);
    }

    /// Keeps the penetrations of `result` that are proven, and sets `collides` and `gap` by them. `roots` is scratch.
    ///
    /// A contact pixel deeper than a layer needs neighbours that confirm it. With too few it is dropped, and its links with
    /// it. A shallower one is cut to the depth that its neighbours confirm.
    ///
    /// `least_proof` is `None` if a surface tells its inside. Otherwise a deep place may also be the space between two limbs.
    /// Then deep pixels count if they *lead out*: links join them with pixels at which the surfaces are apart. If no
    /// confirmed penetration of more than `least_proof` metres leads out, but the surfaces were seen to cross
    /// (`result.collides`), all deep pixels count.
    pub(crate) fn confirm(
        &mut self,
        result: &mut PairResult,
        params: &Params,
        least_proof: Option<f32>,
        roots: &mut Vec<u32>,
    ) {
        let is_deep =
            |c: &ContactPixel| c.point_a.distance(c.point_b) > params.thickness && c.gap < 0.0;
        self.count(result.contacts.len());
        self.marks.clear();
        let counted = self.counts.iter().zip(&mut result.contacts);
        self.marks.extend(counted.map(|(&count, contact)| {
            let confirming = match contact.is_at_rim() {
                true => CONFIRMING_RIM,
                false => CONFIRMING,
            };
            if count < confirming {
                if is_deep(contact) {
                    return NONE;
                }
                let confirmed = count as f32 / confirming as f32 * params.thickness;
                contact.gap = contact.gap.max(-confirmed);
            }
            0
        }));
        self.keep_marked(&mut result.contacts);
        if let Some(least) = least_proof
            && result.contacts.iter().any(is_deep)
        {
            let is_any_proven = self.mark_unproven(&result.contacts, is_deep, least, roots);
            if is_any_proven || !result.collides {
                self.keep_marked(&mut result.contacts);
            }
        }
        self.index(result.contacts.len());
        let gaps = result.contacts.iter().map(|contact| contact.gap);
        result.gap = gaps.chain(result.gap).reduce(f32::min);
        // Solids that overlap by more than a layer's thickness intersect, even if their surfaces cross
        // where no view sees them well.
        result.collides |= result.contacts.iter().any(is_deep);
    }

    /// Fills `counts` for so many contact pixels.
    fn count(&mut self, contacts: usize) {
        self.counts.clear();
        self.counts.resize(contacts, 0);
        for &(k, l) in &self.pairs {
            self.counts[k as usize] += 1;
            self.counts[l as usize] += 1;
        }
    }

    /// Sets `marks` to [`NONE`] for the contact pixels that are deep and do not lead out. On the way out of an overlap the gap
    /// passes through zero; the space between limbs ends where they meet.
    /// Returns whether a penetration of more than `least_proof` leads out that its neighbours confirm.
    fn mark_unproven(
        &mut self,
        contacts: &[ContactPixel],
        is_deep: impl Fn(&ContactPixel) -> bool,
        least_proof: f32,
        roots: &mut Vec<u32>,
    ) -> bool {
        self.count(contacts.len());
        self.components(contacts.len(), roots);
        let leads_out = &mut self.marks;
        leads_out.clear();
        leads_out.resize(contacts.len(), 0);
        for (contact, &root) in contacts.iter().zip(&*roots) {
            leads_out[root as usize] |= u32::from(contact.gap > 0.0);
        }
        let mut is_any_proven = false;
        // The root of a component comes first, and is read by all others of it.
        for (k, contact) in contacts.iter().enumerate().rev() {
            let is_out = self.marks[roots[k] as usize] == 1;
            is_any_proven |= is_out && contact.gap < -least_proof && self.counts[k] >= CONFIRMING;
            self.marks[k] = if is_out || !is_deep(contact) { 1 } else { NONE };
        }
        is_any_proven
    }

    /// Keeps the contact pixels that have no [`NONE`] in `marks`, and the links between them.
    fn keep_marked(&mut self, contacts: &mut Vec<ContactPixel>) {
        let kept = self.marks.iter_mut().filter(|mark| **mark != NONE);
        for (index, mark) in (0..).zip(kept) {
            *mark = index;
        }
        let new_index = &self.marks;
        retain_by_index(contacts, |k, _| new_index[k] != NONE);
        self.pairs.retain_mut(|(k, l)| {
            (*k, *l) = (new_index[*k as usize], new_index[*l as usize]);
            *k != NONE && *l != NONE
        });
    }

    /// Contact pixels linked with `k`.
    pub(crate) fn neighbors(&self, k: u32) -> &[u32] {
        let k = k as usize;
        &self.neighbors[self.starts[k] as usize..self.starts[k + 1] as usize]
    }

    /// Fills what [`neighbors`](Self::neighbors) returns.
    fn index(&mut self, contacts: usize) {
        self.neighbors.resize(2 * self.pairs.len(), 0);
        let both = self.pairs.iter().flat_map(|&(k, l)| [(k, l), (l, k)]);
        sort_by_bin(both, contacts, &mut self.starts, |place, l| {
            self.neighbors[place] = l;
        });
    }
}

/// Items sorted by the sets they are in; kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct Groups {
    /// Items, set by set by the root's index; ascending within a set.
    pub(crate) members: Vec<u32>,
    starts: Vec<u32>,
}

impl Groups {
    /// Sorts as many items as `roots` has, each by its root. Cost: linear.
    pub(crate) fn sort(&mut self, roots: &[u32]) {
        self.members.resize(roots.len(), 0);
        let items = roots.iter().enumerate().rev().map(|(k, root)| (*root, k));
        sort_by_bin(items, roots.len(), &mut self.starts, |place, item| {
            self.members[place] = item as u32;
        });
    }

    /// The sets of those roots.
    pub(crate) fn iter<'a>(&'a self, roots: &'a [u32]) -> impl Iterator<Item = &'a [u32]> {
        let same = |k: &u32, l: &u32| roots[*k as usize] == roots[*l as usize];
        self.members.chunk_by(same)
    }
}

/// Fills `roots`, for each of so many items, with the lowest index among those that `pairs` join it with (union-find).
pub(crate) fn find_roots(
    items: usize,
    pairs: impl Iterator<Item = (u32, u32)>,
    roots: &mut Vec<u32>,
) {
    roots.clear();
    roots.extend(0..items as u32);
    for (k, l) in pairs {
        let (root_k, root_l) = (root(roots, k), root(roots, l));
        roots[root_k.max(root_l) as usize] = root_k.min(root_l);
    }
    for k in 0..items as u32 {
        roots[k as usize] = root(roots, k);
    }
}

/// The root of the set of `k`, shortening the way to it.
fn root(parents: &mut [u32], mut k: u32) -> u32 {
    while parents[k as usize] != k {
        parents[k as usize] = parents[parents[k as usize] as usize];
        k = parents[k as usize];
    }
    k
}

#[cfg(test)]
mod tests {
    use super::*;
    use glamx::Vec3;

    const PIXEL: f32 = 0.01;

    /// Contact pixels of two level surfaces, `depth` metres deep.
    fn contacts(pixels: &[[i32; 2]], depth: f32) -> Vec<ContactPixel> {
        let at = |[i, j]: [i32; 2]| PIXEL * Vec3::new(i as f32, 0.0, j as f32);
        pixels
            .iter()
            .map(|&pixel| ContactPixel {
                pixel,
                view: 0,
                point_a: at(pixel),
                point_b: at(pixel) - depth * Vec3::Y,
                normal_a: Vec3::Y,
                normal_b: -Vec3::Y,
                gap: -depth,
            })
            .collect()
    }

    fn confirmed(contacts: Vec<ContactPixel>, tells_inside: bool) -> PairResult {
        let result = PairResult {
            contacts,
            ..PairResult::default()
        };
        confirm(result, tells_inside)
    }

    /// Of bare surfaces that were seen to cross.
    fn crossing(contacts: Vec<ContactPixel>) -> PairResult {
        let result = PairResult {
            contacts,
            collides: true,
            ..PairResult::default()
        };
        confirm(result, false)
    }

    fn confirm(mut result: PairResult, tells_inside: bool) -> PairResult {
        let params = Params::for_radius(PIXEL);
        let mut links = Links::default();
        links.find(&result.contacts, &params);
        let least_proof = (!tells_inside).then_some(0.0);
        links.confirm(&mut result, &params, least_proof, &mut Vec::new());
        let count = result.contacts.len();
        for (k, l) in &links.pairs {
            assert!(links.neighbors(*k).contains(l) && links.neighbors(*l).contains(k));
            assert!((*k as usize) < count && (*l as usize) < count);
        }
        result
    }

    #[test]
    fn a_deep_row_is_no_penetration_but_a_deep_block_is() {
        let row: Vec<[i32; 2]> = (0..9).map(|i| [i, 0]).collect();
        let result = confirmed(contacts(&row, 5.0 * PIXEL), true);
        assert!(result.contacts.is_empty() && !result.collides && result.gap.is_none());
        let block: Vec<[i32; 2]> = (0..25).map(|k| [k % 5, k / 5]).collect();
        let result = confirmed(contacts(&block, 5.0 * PIXEL), true);
        // Corners have three neighbours, the other pixels five and more.
        assert_eq!(result.contacts.len(), 21);
        assert!(result.collides);
        assert_eq!(result.gap, Some(-5.0 * PIXEL));
    }

    /// Two limbs with space between them, which nothing tells from the inside of one body; such limbs that
    /// meet; and a body on its corner.
    #[test]
    fn without_an_inside_what_is_deep_collides_where_it_leads_out() {
        let block: Vec<[i32; 2]> = (0..64).map(|k| [k % 8, k / 8]).collect();
        let apart = contacts(&block, 5.0 * PIXEL);
        let sloping = |from: f32| {
            let mut contacts = apart.clone();
            for contact in &mut contacts {
                let depth = (from - contact.pixel[0] as f32) * PIXEL;
                contact.point_b = contact.point_a - depth * Vec3::Y;
                contact.gap = -depth;
            }
            contacts
        };
        for (contacts, tells_inside, collides) in [
            (&apart, false, false),
            (&apart, true, true),
            (&sloping(7.0), false, false),
            (&sloping(6.0), false, true),
        ] {
            let result = confirmed(contacts.clone(), tells_inside);
            assert_eq!(result.collides, collides);
            // One truth: what does not collide is no deeper than a layer.
            let is_deep = result.gap.is_some_and(|gap| gap < -4.0 * PIXEL);
            assert_eq!(is_deep, collides);
        }
        // A box that is sunk in a sheet: its bottom is deep all over, and its sides are seen to cross.
        let sunk = crossing(apart.clone());
        assert_eq!((sunk.contacts.len(), sunk.collides), (60, true));
        // The space between limbs beside limbs that meet, which need not be deep.
        for from in [6.0, 1.5] {
            let mut beside = sloping(from);
            beside.extend(apart.iter().map(|contact| ContactPixel {
                pixel: [contact.pixel[0] + 20, contact.pixel[1]],
                ..*contact
            }));
            beside.sort_by_key(|contact| (contact.pixel[1], contact.pixel[0]));
            let result = crossing(beside);
            assert!(result.contacts.iter().all(|contact| contact.pixel[0] < 20));
            assert!(result.collides && result.gap == Some(-from * PIXEL));
        }
    }

    #[test]
    fn a_lone_pixel_touches() {
        let lone = confirmed(contacts(&[[0, 0]], PIXEL), true);
        assert_eq!(lone.contacts.len(), 1);
        assert_eq!(lone.contacts[0].gap, 0.0);
        // Two neighbours of five confirm two fifths of a thickness of two pixels.
        let middle = confirmed(contacts(&[[0, 0], [1, 0], [2, 0]], PIXEL), true).contacts[1];
        assert!((middle.gap + 0.8 * PIXEL).abs() < 1e-6, "{}", middle.gap);
    }
}
