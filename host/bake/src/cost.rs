//! Cost of a tick on the board, estimated from the model.
//!
//! Work is counted in field queries, as in the board's own budget. The figure is an estimate, not a bound: the budget is the bound, at which a tick
//! decimates its points.

use serde::{Deserialize, Serialize};

/// Instructions of one field query, for a tree node or for a point out of reach.
pub const PER_LOOKUP: u64 = 150;
/// Queries counted for a point near the other part.
pub const NEAR_LOOKUPS: u64 = 2;
/// Queries counted for a touching point, including its share of the step.
pub const TOUCHING_LOOKUPS: u64 = 6;
/// Instructions of a tick without queries.
pub const FIXED: u64 = 6_000;
/// Most contacts in one step.
pub const MOST_CONTACTS: u64 = 256;
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
    /// Field queries, in the units of the board's budget.
    pub lookups: u64,
    /// Instructions of that tick.
    pub instructions: u64,
    /// Total number of points: the part's own and those of all parts it can meet.
    pub points_at_most: u64,
}

impl TickCost {
    /// Cost with `points` points near, of `all` in total.
    pub fn of(points: u64, all: u64) -> Self {
        let contacts = points.div_ceil(NEAR_PER_TOUCHING).min(MOST_CONTACTS);
        let lookups = points.div_ceil(POINTS_PER_NODE)
            + NEAR_LOOKUPS * (points - contacts)
            + TOUCHING_LOOKUPS * contacts;
        Self {
            points,
            contacts,
            lookups,
            instructions: FIXED + PER_LOOKUP * lookups,
            points_at_most: all,
        }
    }
}
