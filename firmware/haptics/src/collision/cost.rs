//! What work counts in the budget of a tick, in eighths of a field query ([`LOOKUP`]).

/// A look-up, 190 instructions: what the budget is counted in, here in eighths of one. What exclusions take: [`crate::exclusion`].
pub(crate) const LOOKUP: u32 = 8;
/// A point at an edge, besides.
pub(crate) const EDGE: u32 = 6;
/// A point within the margin, besides.
pub(crate) const NEAR: u32 = 6;
/// Where targets guide, besides, to ask for the faces' mating,
pub(crate) const MATING: u32 = 2;
/// and at an edge for the room its faces have.
pub(crate) const ALLOWANCE: u32 = 8;
/// A point that may touch, besides: half of them do, and in most ticks two solves are enough.
pub(crate) const CANDIDATE: u32 = 11;
/// To begin with a leaf.
pub(crate) const LEAF: u32 = 6;
/// To ask the field about a node.
pub(crate) const NODE: u32 = 12;
/// To pass over a node of which enough is known.
pub(crate) const PASSED_OVER: u32 = 5;
/// A look-up of a point of which the face is known.
pub(crate) const CACHED_POINT: u32 = 5;
/// To find out which it is.
pub(crate) const FIND_FACE: u32 = 32;
/// A look-up whose gap is noted, besides.
pub(crate) const NOTED: u32 = 1;
/// What asking about a leaf counts in the budget before anything is read.
pub(crate) const EXCLUSION: u32 = 4 * LOOKUP;
/// So many reads of the field's bricks and cells count in the budget as one [`LOOKUP`].
pub(crate) const EXCLUSION_READS: u32 = 14;
/// To find what a target pulls with, and what follows from it, look-ups. What it takes in a solve: [`solve_cost`].
pub(crate) const SPRING: u32 = 6;

/// A solve with so many pulls, in the look-ups of the budget.
pub(crate) fn solve_cost(springs: usize) -> u32 {
    8 + 5 * springs as u32 / 2
}

/// What a search took, look-ups.
#[derive(Clone, Copy)]
pub(crate) struct Used {
    pub all: u32,
    /// On points rather than the way to them.
    pub on_points: u32,
}
