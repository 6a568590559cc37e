//! What a tick costs on the board, estimated from the model.
//!
//! Work is counted as the board's own budget counts it, in look-ups. An estimate, no bound: that is the budget, at which a tick thins its points.

use serde::{Deserialize, Serialize};

/// Instructions of one look-up of a tree node, or of a point out of reach, in a field.
pub const PER_LOOKUP: u64 = 150;
/// Look-ups a point near the other part counts.
pub const NEAR_LOOKUPS: u64 = 2;
/// Look-ups a point counts that touches, with its share of the step.
pub const TOUCHING_LOOKUPS: u64 = 6;
/// Instructions of a tick that looks nothing up.
pub const FIXED: u64 = 6_000;
/// Contacts the step takes at most.
pub const MOST_CONTACTS: u64 = 256;
/// Points to one tree node looked at: leaves hold 8 to 16 points, and there are as many nodes above them.
const POINTS_PER_NODE: u64 = 4;
/// Points near to one that touches: a pin pressed to its bore touches along a quarter of its rims.
const NEAR_PER_TOUCHING: u64 = 4;

/// The dearest tick expected of a part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TickCost {
    /// Points near while the part sits in all it fits into, its own and its partners'.
    pub points: u64,
    /// Of them touching.
    pub contacts: u64,
    /// Look-ups, as the board counts its budget.
    pub lookups: u64,
    /// Instructions of that tick.
    pub instructions: u64,
    /// Points there are, its own and those of all parts it can meet.
    pub points_at_most: u64,
}

impl TickCost {
    /// Of `points` near, of `all` there are.
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
