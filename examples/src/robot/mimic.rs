//! Joints that follow others: `<mimic>`.

/// What a joint is told to follow: the index of another joint, the multiplier of its position, and what is added, in
/// radians or metres.
pub(super) type Mimic = (usize, f64, f64);

/// Each joint's mimic, with the leader replaced by the joint at the end of its chain, which follows none: what a leader
/// follows, its follower does. Joints that would follow themselves, one after the other, follow none.
pub(super) fn resolved(told: &[Option<Mimic>]) -> Vec<Option<Mimic>> {
    let mut links = told.to_vec();
    for joint in (0..told.len()).filter(|joint| follows_itself(told, *joint)) {
        links[joint] = None;
    }
    (links.iter())
        .map(|link| {
            let (mut leader, mut multiplier, mut offset) = (*link)?;
            while let Some((next, factor, shift)) = links[leader] {
                offset += multiplier * shift;
                multiplier *= factor;
                leader = next;
            }
            Some((leader, multiplier, offset))
        })
        .collect()
}

/// Whether a chain of leaders comes back to the joint.
pub(super) fn follows_itself(told: &[Option<Mimic>], joint: usize) -> bool {
    let next = |of: &usize| told[*of].map(|(leader, ..)| leader);
    let leaders = std::iter::successors(next(&joint), next);
    // A chain that comes back does so after as many leaders as there are joints.
    leaders.take(told.len()).any(|leader| leader == joint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// Chains of any order: each joint is where one step after the other along its chain takes it.
    #[test]
    fn a_chain_is_followed_to_its_end() {
        for seed in 0..50 {
            let mut rng = Rng::with_seed(seed);
            // Each follows one that is before it in a random order, or none.
            let mut order: Vec<usize> = (0..8).collect();
            rng.shuffle(&mut order);
            let mut told = vec![None; 8];
            for k in 1..8 {
                let leader = order[rng.usize(0..k)];
                let [multiplier, offset] = [(); 2].map(|()| 4.0 * rng.f64() - 2.0);
                told[order[k]] = (rng.u8(0..4) > 0).then_some((leader, multiplier, offset));
            }
            let mut position: Vec<f64> = (0..8).map(|_| rng.f64()).collect();
            let own = position.clone();
            for k in order {
                if let Some((leader, multiplier, offset)) = told[k] {
                    position[k] = multiplier * position[leader] + offset;
                }
            }
            for (k, mimic) in resolved(&told).into_iter().enumerate() {
                assert_eq!(mimic.is_some(), told[k].is_some());
                if let Some((root, multiplier, offset)) = mimic {
                    assert_eq!(told[root], None);
                    assert!((multiplier * own[root] + offset - position[k]).abs() < 1e-9);
                }
            }
        }
    }

    /// Two that follow each other and one that follows itself are on their own; who follows one of them still does.
    #[test]
    fn a_circle_is_left_out() {
        let told = [
            Some((1, 2.0, 0.5)),
            Some((0, 3.0, 0.0)),
            Some((3, 2.0, 0.0)),
            Some((1, 4.0, 1.0)),
            Some((4, 1.0, 0.0)),
        ];
        let circles = [0, 1, 2, 3, 4].map(|joint| follows_itself(&told, joint));
        assert_eq!(circles, [true, true, false, false, true]);
        let expected = [None, None, Some((1, 8.0, 2.0)), Some((1, 4.0, 1.0)), None];
        assert_eq!(resolved(&told), expected);
    }
}
