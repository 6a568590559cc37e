//! Where the parts of a connection graph are drawn: their distances follow the number of connections between them. Pure, and the same for any order of its input.
//!
//! The places minimise the stress Σ (|xᵢ − xⱼ| − dᵢⱼ)² / dᵢⱼ² over all pairs, where dᵢⱼ is the least number of connections from one part to the other, by
//! majorisation (Gansner, Koren, North 2004, one part at a time) from a circle in the order of a search by depth. They are turned upright, stretched to the
//! unit square, and pairs that are too near are moved apart. Cost: some milliseconds for 40 parts.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use glam::DVec2;

/// Rounds of majorisation.
const ROUNDS: usize = 300;
/// Most rounds of moving pairs apart.
const SPREADS: usize = 400;

/// Least distance of two of so many parts in the unit square: discs of this diameter cover a third of it.
pub fn least_distance(count: usize) -> f64 {
    0.64 / (count.max(1) as f64).sqrt()
}

/// Places of different parts in the unit square, in the order of `parts`. Edges to others are ignored.
pub fn layout(parts: &[usize], edges: &[[usize; 2]]) -> Vec<DVec2> {
    let mut order: Vec<usize> = parts.to_vec();
    order.sort_unstable();
    order.dedup();
    let number = |part: &usize| order.binary_search(part).ok();
    let mut near = vec![vec![]; order.len()];
    for [a, b] in edges {
        if let (Some(a), Some(b)) = (number(a), number(b)) {
            near[a].push(b);
            near[b].push(a);
        }
    }
    for near in &mut near {
        near.sort_unstable();
        near.dedup();
    }
    let mut places = on_circle(&near);
    settle(&mut places, &distances(&near));
    turn_upright(&mut places);
    stretch(&mut places);
    spread(&mut places, least_distance(order.len()));
    let place = |part| number(part).map_or(DVec2::splat(0.5), |number| places[number]);
    parts.iter().map(place).collect()
}

/// Parts in the order of a search by depth, from that with the most connections on; each part that is not reached yet begins another search. Lines of a tree
/// between parts on a circle in this order do not cross.
fn by_depth(near: &[Vec<usize>]) -> Vec<usize> {
    let mut starts: Vec<usize> = (0..near.len()).collect();
    starts.sort_by_key(|&part| (usize::MAX - near[part].len(), part));
    let (mut order, mut known) = (Vec::new(), vec![false; near.len()]);
    for start in starts {
        let mut next = vec![start];
        while let Some(part) = next.pop() {
            if !std::mem::replace(&mut known[part], true) {
                order.push(part);
                next.extend(near[part].iter().rev());
            }
        }
    }
    order
}

fn on_circle(near: &[Vec<usize>]) -> Vec<DVec2> {
    let mut places = vec![DVec2::ZERO; near.len()];
    for (turn, part) in by_depth(near).into_iter().enumerate() {
        let angle = TAU * turn as f64 / near.len() as f64;
        places[part] = DVec2::from_angle(angle) * near.len() as f64 / TAU;
    }
    places
}

/// Least number of edges between each two; between those without a way, one more than the most.
fn distances(near: &[Vec<usize>]) -> Vec<Vec<f64>> {
    let from = |start: usize| {
        let mut steps = vec![f64::INFINITY; near.len()];
        steps[start] = 0.0;
        let mut next = VecDeque::from([start]);
        while let Some(part) = next.pop_front() {
            for &other in &near[part] {
                if steps[other].is_infinite() {
                    steps[other] = steps[part] + 1.0;
                    next.push_back(other);
                }
            }
        }
        steps
    };
    let mut all: Vec<Vec<f64>> = (0..near.len()).map(from).collect();
    let finite = all.iter().flatten().filter(|steps| steps.is_finite());
    let most = finite.fold(1.0f64, |most, steps| most.max(*steps));
    for steps in all.iter_mut().flatten() {
        *steps = steps.min(most + 1.0);
    }
    all
}

fn settle(places: &mut [DVec2], distances: &[Vec<f64>]) {
    for _ in 0..ROUNDS {
        for part in 0..places.len() {
            let (mut sum, mut weights) = (DVec2::ZERO, 0.0);
            for other in (0..places.len()).filter(|&other| other != part) {
                let distance = distances[part][other];
                let weight = distance.powi(-2);
                let away = (places[part] - places[other]).normalize_or_zero();
                sum += weight * (places[other] + distance * away);
                weights += weight;
            }
            if weights > 0.0 {
                places[part] = sum / weights;
            }
        }
    }
}

/// Turns all about their mean so that they vary most downwards: names are wide, and have room one under the other.
fn turn_upright(places: &mut [DVec2]) {
    let mean = places.iter().sum::<DVec2>() / places.len().max(1) as f64;
    let (mut across, mut both) = (0.0, 0.0);
    for place in places.iter_mut() {
        *place -= mean;
        across += place.x * place.x - place.y * place.y;
        both += place.x * place.y;
    }
    let longest = 0.5 * f64::atan2(2.0 * both, across);
    let turn = DVec2::from_angle(0.25 * TAU - longest);
    for place in places {
        *place = turn.rotate(*place);
    }
}

/// Moves and stretches all to the unit square; what has no extent along an axis goes to its middle.
fn stretch(places: &mut [DVec2]) {
    let low = places.iter().fold(DVec2::INFINITY, |low, place| low.min(*place));
    let high = places
        .iter()
        .fold(DVec2::NEG_INFINITY, |high, place| high.max(*place));
    for place in places {
        let along = |axis: usize| match high[axis] - low[axis] {
            extent if extent > 1e-6 => ((place[axis] - low[axis]) / extent).clamp(0.0, 1.0),
            _ => 0.5,
        };
        *place = DVec2::new(along(0), along(1));
    }
}

/// Moves pairs that are nearer than `least` apart, within the unit square.
fn spread(places: &mut [DVec2], least: f64) {
    for _ in 0..SPREADS {
        let mut moved = false;
        for a in 0..places.len() {
            for b in a + 1..places.len() {
                let between = places[b] - places[a];
                if between.length() >= least {
                    continue;
                }
                // Parts at one place part in a direction of their own.
                let away = (between.try_normalize()).unwrap_or_else(|| DVec2::from_angle((7 * a + b) as f64));
                // A little more than needed, so that it ends.
                let by = away * 0.55 * (least - between.length());
                places[a] = (places[a] - by).clamp(DVec2::ZERO, DVec2::ONE);
                places[b] = (places[b] + by).clamp(DVec2::ZERO, DVec2::ONE);
                moved = true;
            }
        }
        if !moved {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Different parts, and edges between some of them.
    fn graphs() -> impl Strategy<Value = (Vec<usize>, Vec<[usize; 2]>)> {
        (1usize..=40, 0usize..3).prop_flat_map(|(count, density)| {
            let part = 0..count;
            let edges = prop::collection::vec([part.clone(), part], 0..=density * count);
            edges.prop_map(move |edges| {
                let parts = (0..count).map(|part| 3 * part + 1).collect();
                let edges = edges.into_iter().map(|ends| ends.map(|part| 3 * part + 1));
                (parts, edges.filter(|[a, b]| a != b).collect())
            })
        })
    }

    fn nearest(places: &[DVec2]) -> f64 {
        let pairs = (0..places.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        pairs.fold(f64::INFINITY, |least, (a, b)| {
            least.min(places[a].distance(places[b]))
        })
    }

    proptest! {
        #[test]
        fn parts_are_within_the_square_and_apart((parts, edges) in graphs()) {
            let places = layout(&parts, &edges);
            prop_assert_eq!(places.len(), parts.len());
            for place in &places {
                prop_assert!(place.cmpge(DVec2::ZERO).all() && place.cmple(DVec2::ONE).all(), "{}", place);
            }
            let least = least_distance(parts.len());
            prop_assert!(nearest(&places) > 0.9 * least, "{} of {least}", nearest(&places));
        }

        /// Parts and edges in another order, and edges from their other end, give the same places.
        #[test]
        fn the_order_changes_nothing(
            (parts, edges) in graphs(),
            seed in any::<[u8; 40]>(),
        ) {
            let places = layout(&parts, &edges);
            let mut mixed: Vec<(u8, usize)> = seed.into_iter().zip(0..parts.len()).collect();
            mixed.sort_unstable();
            let order: Vec<usize> = mixed.into_iter().map(|(_, number)| number).collect();
            let others: Vec<usize> = order.iter().map(|&number| parts[number]).collect();
            let turned: Vec<[usize; 2]> = edges.iter().rev().map(|[a, b]| [*b, *a]).collect();
            let again = layout(&others, &turned);
            for (number, place) in order.into_iter().zip(again) {
                prop_assert_eq!(places[number], place);
            }
        }

        /// Lines of a chain, of a ring and of a star do not cross.
        #[test]
        fn simple_graphs_are_drawn_without_crossings(count in 3usize..=12) {
            let parts: Vec<usize> = (0..count).collect();
            let chain: Vec<[usize; 2]> = (1..count).map(|part| [part - 1, part]).collect();
            let ring = [&chain[..], &[[count - 1, 0]]].concat();
            let star = (1..count).map(|part| [0, part]).collect();
            for edges in [chain, ring, star] {
                let places = layout(&parts, &edges);
                for (number, first) in edges.iter().enumerate() {
                    for second in &edges[..number] {
                        let [a, b] = [first, second].map(|ends| ends.map(|part| places[part]));
                        let apart = first.iter().all(|part| !second.contains(part));
                        prop_assert!(!apart || !cross(a, b), "{first:?} {second:?} {places:?}");
                    }
                }
            }
        }
    }

    fn cross([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> bool {
        let side = |from: DVec2, to: DVec2, point: DVec2| (to - from).perp_dot(point - from) > 0.0;
        side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b)
    }

    #[test]
    fn few_parts_and_none_have_their_places() {
        assert!(layout(&[], &[]).is_empty());
        assert_eq!(layout(&[7], &[[7, 7], [1, 2]]), [DVec2::splat(0.5)]);
        let two = layout(&[3, 5], &[[5, 3]]);
        assert!(two[0].distance(two[1]) >= 1.0 - 1e-9, "{two:?}");
    }
}
