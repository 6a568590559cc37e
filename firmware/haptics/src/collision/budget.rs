//! Budget of a search: what is paid for before it, whether a leaf fits in, and what is left.

use mortise_protocol::image::{NO_SPAN, PointRecord};

use crate::collision::cost::{CANDIDATE, LOOKUP, PUSHING};
use crate::collision::node_key::Points;
use crate::collision::rules::FacePairRules;
use crate::collision::search::{Search, Traversal};

/// Field queries of a span that presses.
const PRESSED_SPAN: u32 = 16;
/// A leaf seldom takes more field queries than this.
const MOST_OF_A_LEAF: u32 = 96;

impl<R: FacePairRules> Search<'_, '_, R> {
    /// Contacts paid for before the search, of those carried over. A quarter of the budget at least is left, so that every leaf's turn comes.
    pub fn expected(&self) -> [u32; 2] {
        let most = LOOKUP
            .saturating_mul(self.budget / 4 * 3)
            .saturating_sub(LOOKUP * self.reserved);
        let [pushed, others] = self.carried;
        let pushed = pushed.min(most / PUSHING);
        [pushed, others.min((most - PUSHING * pushed) / CANDIDATE)]
    }
}

impl<R: FacePairRules> Traversal<'_, '_, '_, R> {
    /// Counts a candidate, a point that may touch, and charges it to the budget.
    #[inline(always)]
    pub fn count_candidate(&mut self) {
        match &mut self.expected {
            [0, 0] => self.spent += CANDIDATE,
            [0, expected] | [expected, _] => *expected -= 1,
        }
        self.work.candidates = self.work.candidates.saturating_add(1);
    }

    /// Whether the budget falls short of a leaf that takes this many `queries`. A leaf is evaluated as a whole; the first one of a tick always, so that each
    /// one's turn comes.
    #[inline]
    pub fn is_short_of(&mut self, queries: impl FnOnce() -> u32) -> bool {
        let left = self.left();
        let is_short = self.has_evaluated && left < MOST_OF_A_LEAF && left < queries();
        self.has_evaluated = true;
        is_short
    }

    /// Whether it falls short of these points of a leaf.
    pub fn is_short_of_points(&mut self, points: &[PointRecord], which: Points) -> bool {
        self.is_short_of(|| queries_of(points, which))
    }

    /// Budget left, field queries.
    pub fn left(&self) -> u32 {
        self.search.budget.saturating_sub(self.spent / LOOKUP)
    }
}

/// Field queries that a leaf's `points` take, those selected by `which`, at most: those of spans that press.
#[inline(never)]
fn queries_of(points: &[PointRecord], which: Points) -> u32 {
    let chosen = |i: usize| which & 1u16.checked_shl(i as u32).unwrap_or(1) != 0;
    let of = |point: &PointRecord| if point.span == NO_SPAN { 1 } else { PRESSED_SPAN };
    (points.iter().enumerate())
        .map(|(i, point)| if chosen(i) { of(point) } else { 0 })
        .sum()
}
