//! Cost of a tick on the board, estimated from the model.
//!
//! Work is counted in field queries by the table of the board's own budget ([`mortise_haptics::cost`]). The figure is an estimate, not a bound: the
//! budget is the bound, at which a tick decimates its points.

use mortise_haptics::cost::{
    CANDIDATE, LEAST_SOLVES, LOOKUP, MAX_CONTACTS, NEAR, NODE, QUERY_INSTRUCTIONS, SOLVE,
};
use serde::{Deserialize, Serialize};

/// Instructions of a tick without counted work.
pub const FIXED: u64 = 6_000;
/// Solves that the budget reserves: one without contacts, and the least number with them.
const SOLVES: u64 = 1 + LEAST_SOLVES as u64;
/// Points per tree node visited: leaves hold 8 to 16 points, and there are as many nodes above them.
const POINTS_PER_NODE: u64 = 4;
/// Near points per touching point: a pin pressed to its bore touches along a quarter of its rims.
const NEAR_PER_TOUCHING: u64 = 4;

/// Estimated worst-case tick of a part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TickCost {
    /// Points near when the part sits in everything it fits into, both its own points and its partners'.
    pub points: u64,
    /// Number of those points that touch.
    pub contacts: u64,
    /// Field queries, as the board's budget counts them.
    pub lookups: u64,
    /// Instructions of that tick.
    pub instructions: u64,
    /// Total number of points: the part's own and those of all parts it can meet.
    pub points_at_most: u64,
}

impl TickCost {
    /// Cost with `points` points near, of `all` in total.
    pub fn of(points: u64, all: u64) -> Self {
        let contacts = points.div_ceil(NEAR_PER_TOUCHING).min(MAX_CONTACTS as u64);
        let eighths = u64::from(SOLVE) * SOLVES
            + u64::from(NODE) * points.div_ceil(POINTS_PER_NODE)
            + u64::from(LOOKUP + NEAR) * points
            + u64::from(CANDIDATE) * contacts;
        let lookups = eighths.div_ceil(u64::from(LOOKUP));
        Self {
            points,
            contacts,
            lookups,
            instructions: FIXED + u64::from(QUERY_INSTRUCTIONS) * lookups,
            points_at_most: all,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 200 points near, 50 of which touch: 5 solves of 8, 50 nodes of 1½, 200 points of 1¾ and 50 candidates of 1⅜ queries.
    #[test]
    fn work_is_counted_as_the_board_counts_it() {
        let cost = TickCost::of(200, 1_000);
        assert_eq!((cost.contacts, cost.lookups), (50, 40 + 75 + 350 + 69));
        assert_eq!(cost.instructions, FIXED + 190 * 534);
    }
}
