//! Decimation of near points while the work exceeds the budget.
//!
//! When the budget runs out, contacts in leaves not reached that pushed, or may now, are carried over, and the next tick resumes where this one stopped. That
//! suffices where two ticks complete a round, and for the first pass over everything after a grab. Where they do not, every second near point is
//! decimated, then, a round later, every second of the rest, until two ticks suffice. Whole leaves are decimated only where points are most of the
//! work even at an eighth of them: a face may have no more than one leaf. Otherwise the ticks continue to complete rounds as they can. Contacts
//! count as points, those carried over, too. The level falls again, doubling the points each time, once that would not make it rise, for a quarter
//! of a second: contacts that come and go are felt more than fewer of them.
//!
//! Points of edges and corners stay: of a face's inside one point stands for its neighbours, but a prism has nothing else that could touch, and without
//! them went millimetres into its hole's walls.

use mortise_protocol::image::{NO_FACE, PointRecord};

use crate::collision::contact::MAX_CONTACTS;
use crate::collision::cost::Used;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::node_key::{ALL, Points};

/// Consecutive ticks whose budget may run out before the last leaf is reached: beyond them, that is, where near points are not queried every second
/// tick, points are decimated.
const MAX_OVERRUNS: u8 = 1;
/// The same limit after a grab, and after a rise of the level, until everything was searched once.
const MAX_FIRST_OVERRUNS: u8 = 64;
/// Highest level: each 128th near point is always queried.
const MAX_DECIMATION: u8 = 7;
/// Consecutive ticks whose budget must suffice, or hardly be spent on points, before the level falls.
const CALM_TICKS: u16 = 250;
/// Twice the points fit a budget or store when they are expected to fill less than eight ninths of it.
const NINTHS: u32 = 8;

/// Highest level at which some point of every leaf is queried: most leaves have 8 points or a few more.
pub(crate) const LEAF_DECIMATION: u8 = 3;
/// Points of a leaf that are queried, by level.
const KEPT_POINTS: [Points; LEAF_DECIMATION as usize + 1] = [ALL, 0x5555, 0x1111, 0x0101];

/// Decimation level and the history that decides its changes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decimation {
    /// Only each 2ⁿth near point is queried.
    level: u8,
    /// Ticks whose budget may still run out before the level rises.
    patience: u8,
    /// Consecutive ticks in which twice the points would not have raised the level, counted anew from each fall of the level.
    calm: u16,
}

/// Outcome of one search.
pub(crate) struct Searched {
    /// Where the search started.
    pub start: NodeCursor,
    /// Where the budget ran out, if it did.
    pub stopped: Option<NodeCursor>,
    /// Cost, field queries.
    pub used: Used,
    /// Budget, field queries.
    pub budget: u32,
    /// Contacts that overlap.
    pub touching: u32,
    /// Further overlapping contacts that the store could not hold.
    pub lost: u32,
}

impl Decimation {
    /// State after a grab: nothing was searched yet.
    pub const NEW: Self = Self {
        level: 0,
        patience: MAX_FIRST_OVERRUNS,
        calm: 0,
    };

    /// Decimation level: only each 2ⁿth near point is to be queried.
    pub fn level(&self) -> u8 {
        self.level
    }

    /// Which of a leaf's `points` are queried, [`ALL`] if all are. Above [`LEAF_DECIMATION`] whole leaves are decimated, evenly too.
    #[inline]
    pub fn mask(&self, first_point: u32, points: &[PointRecord]) -> Points {
        if self.level == 0 {
            return ALL;
        }
        let leaves = (1u32 << self.level.saturating_sub(LEAF_DECIMATION)) - 1;
        let evenly = if (first_point >> LEAF_DECIMATION) & leaves != 0 {
            0
        } else {
            KEPT_POINTS[usize::from(self.level.min(LEAF_DECIMATION))]
        };
        let mut kept = evenly;
        let mut which: Points = 1;
        for point in points {
            if point.edge_face != NO_FACE {
                kept |= which;
            }
            which <<= 1;
        }
        // Bits past the last point count as kept.
        if kept | !which.wrapping_sub(1) == ALL {
            ALL
        } else {
            kept
        }
    }

    /// Adapts the level to the outcome of a search.
    pub fn update(&mut self, searched: &Searched) {
        let overrun = self.count_overrun(searched);
        let Searched {
            touching,
            lost,
            budget,
            ..
        } = *searched;
        let point_work = searched.used.point_work;
        let calm = searched.stopped.is_none() || !helps(self.level.saturating_sub(1), 2 * point_work, budget);
        self.calm = if calm { self.calm.saturating_add(1) } else { 0 };
        if lost > 0 {
            self.decimate_to_fit(touching + lost);
        } else if overrun && self.level < MAX_DECIMATION && helps(self.level, point_work, budget) {
            self.level += 1;
            self.patience = MAX_FIRST_OVERRUNS;
        } else if self.level > 0 && self.calm >= CALM_TICKS && has_capacity(searched) {
            self.level -= 1;
            self.calm = 0;
        }
    }

    /// Counts a budget overrun without a completed round. Returns whether there was one too many.
    fn count_overrun(&mut self, searched: &Searched) -> bool {
        let Some(stop) = searched.stopped else {
            self.patience = MAX_OVERRUNS;
            return false;
        };
        if stop < searched.start {
            // Past the last leaf and on from the first: the first pass is complete, too.
            self.patience = MAX_OVERRUNS;
            return false;
        }
        let overrun = self.patience == 0;
        self.patience = if overrun { MAX_OVERRUNS } else { self.patience - 1 };
        overrun
    }

    /// Raises the level until `touching` points, counted at the present level, fill at most three quarters of the store.
    ///
    /// More points than the store holds must not touch: the selection of kept contacts would follow the last tick's tilt and tilt the part the other
    /// way, and the stiffness that comes and goes with them generates energy. A flat face on more than 256 points rattled so from tick to tick, by as
    /// much as its depth.
    fn decimate_to_fit(&mut self, mut touching: u32) {
        while self.level < MAX_DECIMATION && touching * 4 > MAX_CONTACTS as u32 * 3 {
            self.level += 1;
            touching /= 2;
        }
    }
}

/// Whether half the points would reduce the work of a search at this level noticeably, because points rather than the traversal dominate it. Where whole
/// leaves would be decimated, points must dominate so far that there are enough leaves for every face to keep some.
fn helps(level: u8, point_work: u32, budget: u32) -> bool {
    let part = if level < LEAF_DECIMATION { 4 } else { 2 };
    part * point_work > budget
}

/// Whether twice the points would fit. The traversal to them costs the same as before. Where the budget ran out although points take little of
/// it, so that the level has been calm, their number decides nothing.
fn has_capacity(searched: &Searched) -> bool {
    let has_capacity = |filled: u32, of: u32| 9 * filled < NINTHS * of;
    let twice = searched.used.all + searched.used.point_work;
    let fits = searched.stopped.is_some() || has_capacity(twice, searched.budget);
    fits && has_capacity(2 * searched.touching, MAX_CONTACTS as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(node: u32) -> NodeCursor {
        NodeCursor { pair: 0, node }
    }

    fn stopped(start: u32, stop: u32) -> Searched {
        Searched {
            start: at(start),
            stopped: Some(at(stop)),
            ..sufficed(500)
        }
    }

    fn sufficed(all: u32) -> Searched {
        Searched {
            start: NodeCursor::FIRST,
            stopped: None,
            used: Used {
                all,
                point_work: 3 * all / 4,
            },
            budget: 500,
            touching: 10,
            lost: 0,
        }
    }

    #[test]
    fn the_first_pass_may_overrun_until_it_is_complete() {
        let mut o = Decimation::NEW;
        for tick in 0..50 {
            o.update(&stopped(10 * tick, 10 * tick + 10));
            assert_eq!(o.level(), 0, "{tick}");
        }
        // From the end to the beginning again.
        o.update(&stopped(500, 5));
        for _ in 0..=MAX_OVERRUNS {
            o.update(&stopped(5, 15));
        }
        assert_eq!(o.level(), 1);
    }

    /// A pass without progress does not postpone decimation for ever.
    #[test]
    fn a_first_pass_that_never_completes_decimates() {
        let mut o = Decimation::NEW;
        for _ in 0..=MAX_FIRST_OVERRUNS {
            o.update(&stopped(0, 1));
        }
        assert_eq!(o.level(), 1);
    }

    /// Points are decimated when they make up the work, whole leaves when they make up more of it.
    #[test]
    fn traversal_cost_alone_does_not_decimate() {
        let mut o = Decimation::NEW;
        let mut play = |point_work| {
            for _ in 0..1000 {
                let used = Used { all: 500, point_work };
                o.update(&Searched {
                    used,
                    ..stopped(5, 40)
                });
            }
            o.level()
        };
        assert_eq!(play(125), 0);
        assert_eq!(play(126), LEAF_DECIMATION);
        assert_eq!(play(250), LEAF_DECIMATION);
        assert_eq!(play(251), MAX_DECIMATION);
    }

    #[test]
    fn comes_back_step_by_step_and_only_after_calm() {
        let mut o = Decimation::NEW;
        for _ in 0..1000 {
            o.update(&stopped(5, 40));
        }
        assert_eq!(o.level(), MAX_DECIMATION);
        for ticks in 1..=u32::from(MAX_DECIMATION) * u32::from(CALM_TICKS) {
            o.update(&sufficed(100));
            let steps = (ticks / u32::from(CALM_TICKS)) as u8;
            assert_eq!(o.level(), MAX_DECIMATION - steps, "{ticks}");
        }
        // Points that would not fit stay decimated.
        o.update(&Searched {
            lost: 100,
            touching: 256,
            ..sufficed(100)
        });
        assert_eq!(o.level(), 1);
        for _ in 0..2 * CALM_TICKS {
            o.update(&sufficed(400));
        }
        assert_eq!(o.level(), 1);
    }

    /// What a rise of the level brought is known when a round has passed, not before.
    #[test]
    fn the_level_rises_once_a_round() {
        let mut o = Decimation::NEW;
        o.update(&stopped(500, 5));
        for round in 0..4 {
            for tick in 0..10 {
                o.update(&stopped(5 + 10 * tick, 15 + 10 * tick));
            }
            o.update(&stopped(105, 5));
            assert_eq!(o.level(), round + 1);
        }
    }

    /// Once the traversal alone spends the budget, decimated points come back.
    #[test]
    fn comes_back_where_points_are_not_what_spends_the_budget() {
        let mut o = Decimation::NEW;
        for tick in 0..1000 {
            o.update(&if tick % 3 == 0 {
                stopped(40, 5)
            } else {
                stopped(5, 40)
            });
        }
        assert_eq!(o.level(), MAX_DECIMATION);
        let spent_on_points = |point_work| {
            let used = Used { all: 550, point_work };
            Searched {
                used,
                ..stopped(5, 40)
            }
        };
        let level_after = |o: &mut Decimation, point_work| {
            for _ in 0..10 * CALM_TICKS {
                o.update(&spent_on_points(point_work));
            }
            o.level()
        };
        // Twice that would raise the level again: where whole leaves are decimated half of the budget, else a quarter.
        assert_eq!(level_after(&mut o, 126), MAX_DECIMATION);
        assert_eq!(level_after(&mut o, 125), LEAF_DECIMATION);
        assert_eq!(level_after(&mut o, 63), LEAF_DECIMATION);
        assert_eq!(level_after(&mut o, 62), 0);
    }

    proptest! {
        /// For any sequence of searches at least each 128th point is queried, and touching points are decimated until they fit the store.
        #[test]
        fn stays_within_its_bounds(
            ticks in prop::collection::vec((0u32..100, prop::option::of(0u32..100), 0u32..2000, 0u32..257, 0u32..40_000), 1..300)
        ) {
            let mut o = Decimation::NEW;
            for (start, stop, all, touching, lost) in ticks {
                let before = o.level();
                o.update(&Searched { start: at(start), stopped: stop.map(at), touching, lost, ..sufficed(all) });
                prop_assert!(o.level() <= MAX_DECIMATION);
                let fits = 4 * ((touching + lost) >> (o.level() - before.min(o.level()))) <= 3 * MAX_CONTACTS as u32;
                prop_assert!(lost == 0 || fits || o.level() == MAX_DECIMATION);
            }
        }
    }

    /// At every level points of edges stay, and of those inside of faces the same ones as without them.
    #[test]
    fn points_of_edges_stay() {
        let inside = PointRecord {
            edge_face: NO_FACE,
            ..PointRecord::default()
        };
        let edge = PointRecord::default();
        let mut decimation = Decimation::NEW;
        assert_eq!(decimation.mask(0, &[inside; 8]), ALL);
        for level in 1..=MAX_DECIMATION {
            decimation.level = level;
            for first in [0, 8, 64] {
                let evenly = decimation.mask(first, &[inside; 8]);
                assert_ne!(evenly, ALL);
                assert_eq!(decimation.mask(first, &[edge; 8]), ALL);
                assert_eq!(decimation.mask(first, &[edge; 20]), ALL);
                let [mut first_two, mut all_but_one] = [[inside; 8], [edge; 8]];
                (first_two[0], first_two[1], all_but_one[7]) = (edge, edge, inside);
                assert_eq!(decimation.mask(first, &first_two), evenly | 0b11);
                assert_eq!(decimation.mask(first, &all_but_one) & 0xff, 0x7f | evenly & 0xff);
            }
        }
    }
}
