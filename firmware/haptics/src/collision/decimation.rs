//! What is left out while there is more to look at than the budget allows, and when it is looked at again.
//!
//! A tick whose budget runs out carries over what pushed in leaves not reached, and the next goes on where it stopped: that does where two ticks get
//! round, and for the first look at everything after a grab. Where they do not, every second of the points that are near is left out, then every
//! second of the rest, until they do. Where an eighth of them is not the most of the work, no leaf is left out as a whole: a face may have no more
//! than one. The ticks then go on getting round as they can. Points come back, twice as many at a time, once the budget would allow it and nothing
//! was carried over for a quarter of a second: contacts that come and go are felt more than fewer of them.

use crate::collision::contact::MAX_CONTACTS;
use crate::collision::cost::Used;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::node_key::{ALL, Points};

/// Ticks in a row whose budget may run out with the last leaf not reached: so whatever is near is looked at every second tick, or points are left
/// out.
const OVERRUNS_BORNE: u8 = 1;
/// Likewise after a grab, until all was looked at for the first time.
const FIRST_LOOK: u8 = 64;
/// Of the points that are near each 128th is looked at in any case.
const MAX_DECIMATION: u8 = 7;
/// Ticks in a row whose budget must suffice before more points are looked at.
const CALM_TICKS: u16 = 250;
/// A budget or a store has room for twice the points when they are expected to fill less than eight ninths of it.
const NINTHS: u32 = 8;

/// Thinning up to which some point of every leaf is looked at: most leaves have 8 points or a few more.
pub(crate) const LEAF_DECIMATION: u8 = 3;
/// Which points of a leaf are looked at, by decimation.
const KEPT_POINTS: [Points; LEAF_DECIMATION as usize + 1] = [ALL, 0x5555, 0x1111, 0x0101];

/// Which points of a leaf are looked at. When one of each leaf is too many, whole leaves are left out, evenly too.
#[inline]
pub(crate) fn mask(decimation: u8, first_point: u32) -> Points {
    let leaves = (1u32 << decimation.saturating_sub(LEAF_DECIMATION)) - 1;
    if (first_point >> LEAF_DECIMATION) & leaves != 0 {
        0
    } else {
        KEPT_POINTS[usize::from(decimation.min(LEAF_DECIMATION))]
    }
}

/// How much is left out, and for how long it went well or ill.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decimation {
    /// Of the points that are near only each 2ⁿth is looked at.
    level: u8,
    /// Ticks whose budget may still run out before more points are left out.
    patience: u8,
    /// Ticks in a row whose budget was enough, or since more points were looked at again.
    calm: u16,
}

/// What one search came to.
pub(crate) struct Searched {
    /// Where it began.
    pub start: NodeCursor,
    /// Where the budget ran out.
    pub stopped: Option<NodeCursor>,
    /// Look-ups.
    pub used: Used,
    /// Look-ups allowed.
    pub budget: u32,
    /// Contacts that overlap.
    pub touching: u32,
    /// How many more did, for which there was no room.
    pub lost: u32,
}

impl Decimation {
    /// After a grab: nothing was looked at yet.
    pub const NEW: Self = Self {
        level: 0,
        patience: FIRST_LOOK,
        calm: 0,
    };

    /// Of the points that are near only each 2ⁿth is to be looked at.
    pub fn level(&self) -> u8 {
        self.level
    }

    /// Draws the conclusions of a search.
    pub fn update(&mut self, searched: &Searched) {
        let overrun = self.bear(searched);
        let Searched { touching, lost, .. } = *searched;
        if lost > 0 {
            self.decimate_to_fit(touching + lost);
        } else if overrun && self.level < MAX_DECIMATION && self.helps(searched) {
            self.level += 1;
        } else if self.level > 0 && self.calm >= CALM_TICKS && has_room(searched) {
            self.level -= 1;
            self.calm = 0;
        }
    }

    /// Whether the budget ran out once too often without getting round.
    fn bear(&mut self, searched: &Searched) -> bool {
        let Some(stop) = searched.stopped else {
            self.patience = OVERRUNS_BORNE;
            self.calm = self.calm.saturating_add(1);
            return false;
        };
        self.calm = 0;
        if stop < searched.start {
            // Past the last leaf and on from the first: the first look is over, too.
            self.patience = OVERRUNS_BORNE;
            return false;
        }
        let overrun = self.patience == 0;
        self.patience = if overrun {
            OVERRUNS_BORNE
        } else {
            self.patience - 1
        };
        overrun
    }

    /// Whether half the points would make a difference, not only the way to them be too long; and where that leaves out whole leaves, whether there
    /// are so many that faces are not left out with them.
    fn helps(&self, searched: &Searched) -> bool {
        let part = if self.level < LEAF_DECIMATION { 4 } else { 2 };
        part * searched.used.on_points > searched.budget
    }

    /// To where three quarters of a store are left of so many `touching` points seen at this decimation.
    ///
    /// More than the store holds must not touch: which are kept would follow the last tick's tilt and tilt the part the other way, and the
    /// stiffness that comes and goes with them makes energy. A flat face on more than 256 points rattled so from tick to tick, by as much as it was
    /// deep in.
    fn decimate_to_fit(&mut self, mut touching: u32) {
        while self.level < MAX_DECIMATION && touching * 4 > MAX_CONTACTS as u32 * 3 {
            self.level += 1;
            touching /= 2;
        }
    }
}

/// Whether twice the points would do. What leads to them costs the same as before.
fn has_room(searched: &Searched) -> bool {
    let has_room = |filled: u32, of: u32| 9 * filled < NINTHS * of;
    let twice = searched.used.all + searched.used.on_points;
    has_room(twice, searched.budget) && has_room(2 * searched.touching, MAX_CONTACTS as u32)
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
                on_points: 3 * all / 4,
            },
            budget: 500,
            touching: 10,
            lost: 0,
        }
    }

    #[test]
    fn the_first_look_is_borne_once_round() {
        let mut o = Decimation::NEW;
        for tick in 0..50 {
            o.update(&stopped(10 * tick, 10 * tick + 10));
            assert_eq!(o.level(), 0, "{tick}");
        }
        // From the end to the beginning again.
        o.update(&stopped(500, 5));
        for _ in 0..=OVERRUNS_BORNE {
            o.update(&stopped(5, 15));
        }
        assert_eq!(o.level(), 1);
    }

    /// A look that gets nowhere is not borne for ever.
    #[test]
    fn a_first_look_without_end_thins() {
        let mut o = Decimation::NEW;
        for _ in 0..=FIRST_LOOK {
            o.update(&stopped(0, 1));
        }
        assert_eq!(o.level(), 1);
    }

    /// Points are left out for the work they make, whole leaves for more of it.
    #[test]
    fn a_way_too_long_leaves_nothing_out() {
        let mut o = Decimation::NEW;
        let mut play = |on_points| {
            for _ in 0..1000 {
                let used = Used { all: 500, on_points };
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
        // What would not fit stays out.
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

    proptest! {
        /// Whatever comes, at most each 128th is looked at, and of what touches no more stays than there is room for.
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
}
