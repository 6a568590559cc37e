//! Cost model of the work budget of a tick, in eighths of a field query ([`LOOKUP`]).

/// One field query, 190 instructions: the unit of the budget, in eighths. For contact exclusions see the source of `exclusion`.
pub(crate) const LOOKUP: u32 = 8;
/// Extra cost of a point at an edge.
pub(crate) const EDGE: u32 = 6;
/// Extra cost of a point within the margin.
pub(crate) const NEAR: u32 = 6;
/// Extra cost at guided parts: query for the faces' mating.
pub(crate) const MATING: u32 = 2;
/// Extra cost at an edge of guided parts: query for the allowances of its faces.
pub(crate) const ALLOWANCE: u32 = 8;
/// Extra cost of a candidate, a point that may touch: half of them do, and in most ticks two solves are enough.
pub(crate) const CANDIDATE: u32 = 11;
/// Fixed cost of a leaf.
pub(crate) const LEAF: u32 = 6;
/// Field query for a node.
pub(crate) const NODE: u32 = 12;
/// Node that its stored bound lets the traversal skip or descend without a field query.
pub(crate) const PASSED_OVER: u32 = 5;
/// Query of a point whose face is cached.
pub(crate) const CACHED_POINT: u32 = 5;
/// Search for the face to cache.
pub(crate) const FIND_FACE: u32 = 32;
/// Extra cost of a query whose gap enters the leaf's bound.
pub(crate) const NOTED: u32 = 1;
/// Fixed cost of an exclusion query for a leaf, before anything is read.
pub(crate) const EXCLUSION: u32 = 4 * LOOKUP;
/// Reads of the field's bricks and cells that cost as much as one [`LOOKUP`].
pub(crate) const EXCLUSION_READS: u32 = 14;
/// Cost of setting up a target's spring and what depends on it, field queries. The cost within a solve: [`solve_cost`].
pub(crate) const SPRING: u32 = 6;

/// Cost of one solve with this many springs, field queries.
pub(crate) fn solve_cost(springs: usize) -> u32 {
    8 + 5 * springs as u32 / 2
}

/// Cost of a search, field queries.
#[derive(Clone, Copy)]
pub(crate) struct Used {
    pub all: u32,
    /// Share spent on points rather than on the traversal.
    pub point_work: u32,
}
