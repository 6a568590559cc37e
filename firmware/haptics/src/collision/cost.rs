//! Cost table of a tick's work, in instructions of a Cortex-M7: used by the tick's budget and by the desktop's planner.
//!
//! [`crate::ContactSettings::point_budget`] is in field queries of [`QUERY_INSTRUCTIONS`]. A tick counts whole eighths of a query, so each constant
//! here is its row's instructions rounded to the nearest eighth, 23.75 instructions; [`TABLE`] has both. A row that was not measured by itself has the
//! instructions of the eighths that the budget counts for it.
//!
//! Source: a regression of instructions on counts over 13 motions on the emulated board, `docs/notes/2026-11-22-what-a-touching-point-costs.md`; a
//! test holds the table to within an eighth of it. Surfaces beside others, pairs, contacts that push, spans and what edges take: a regression over crowded ticks,
//! `docs/notes/2026-11-29-what-a-crowded-tick-costs.md`.

pub use super::contact::MAX_CONTACTS;

/// Instructions of one field query: the unit of the budget.
pub const QUERY_INSTRUCTIONS: u32 = 190;

/// Minimum contact solves per step, regardless of search cost; most steps need fewer. The budget reserves them before the search.
pub const LEAST_SOLVES: u8 = 4;

/// A row of [`TABLE`].
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Name of the constant.
    pub name: &'static str,
    /// Meaning, a sentence.
    pub meaning: &'static str,
    /// Instructions.
    pub instructions: u32,
    /// Eighths of a query that the budget counts.
    pub eighths: u32,
}

/// Declares each cost as the eighths of a query that the budget counts, and [`TABLE`].
macro_rules! costs {
    ($(#[doc = $meaning:literal] $name:ident = $instructions:expr;)+) => {
        $(#[doc = $meaning] pub const $name: u32 = eighths($instructions);)+

        /// Every cost.
        pub const TABLE: &[Cost] = &[$(Cost {
            name: stringify!($name),
            meaning: $meaning.trim_ascii(),
            instructions: $instructions,
            eighths: $name,
        }),+];
    };
}

costs! {
    /// Field query of a point: the unit of the budget.
    LOOKUP = QUERY_INSTRUCTIONS;
    /// Distance to one of several surfaces that a cell names.
    SURFACE = 124;
    /// Extra cost of a span of an edge: its parabola, and whether it may touch.
    SPAN = 545;
    /// Extra cost of a point within the margin.
    NEAR = 135;
    /// Extra cost at guided parts: query for the faces' mating.
    MATING = 48;
    /// Extra cost at an edge of guided parts: query for the allowances of its faces.
    ALLOWANCE = 190;
    /// Extra cost of a candidate, a point that may touch: 180, and 37 a solve; half of them do, and in most ticks two solves are enough.
    CANDIDATE = 180 + 2 * 37;
    /// Extra cost of a contact that pushed in the last tick, whether it is found again or carried over, with two solves.
    PUSHING = 480 + 2 * 40;
    /// Extra cost of a candidate in each solve past the third.
    CANDIDATE_IN_SOLVE = 71;
    /// Transforms and data of a pair of parts, in one direction, that is searched.
    PAIR = 600;
    /// Fixed cost of a leaf.
    LEAF = 148;
    /// Field query of a node.
    NODE = 275;
    /// Node that its stored bound lets the traversal skip or descend without a field query.
    PASSED_OVER = 119;
    /// Query of a point whose face is cached.
    CACHED_POINT = 119;
    /// Search for the face to cache.
    FIND_FACE = 760;
    /// Extra cost of a query whose gap enters the leaf's bound.
    NOTED = 24;
    /// Fixed cost of an exclusion query for a leaf, before anything is read.
    EXCLUSION = 760;
    /// Bound of the distance from a leaf's sphere to that about a node of the other part's edges.
    EDGE_NODE = 24;
    /// Bound of the distance from the sphere about a piece of an edge, or about a leaf of them, to that about a piece of the other part's edges.
    EDGE_BOUND = 36;
    /// Bound of the distance from a piece of an edge to the sphere about a piece of the other part's edges.
    PIECE_BOUND = 42;
    /// Placing a piece of an edge of the held part.
    PIECE = 95;
    /// Nearest places of two pieces of edges.
    EDGE_PAIR = 75;
    /// Circle through a piece of an edge.
    CIRCLE = 190;
    /// Bound of the travel until two circles cross.
    CIRCLE_PAIR = 67;
    /// Pair of pieces of edges that is kept for a leaf.
    KEPT_PAIR = 24;
    /// Step to the common perpendicular of two pieces of edges.
    FEET_STEP = 95;
    /// Contact of two pieces of edges.
    CROSSING = 285;
    /// Fixed cost of a search for the travel until a leaf's edges may touch.
    EDGE_TRAVEL = 760;
    /// Setting up a target's spring and what depends on it, without its cost in a solve.
    SPRING = 1140;
    /// One solve without springs.
    SOLVE = 1520;
    /// Extra cost of a spring in one solve.
    SPRING_IN_SOLVE = 475;
    /// Charge of a geometric energy.
    CHARGE = 230;
    /// Model of the geometric energies, with what it adds to the solves.
    MODEL = 2500;
}

/// Reads of the field's bricks and cells that cost as much as one query, [`LOOKUP`].
pub(crate) const EXCLUSION_READS: u32 = 14;

/// Eighths of a query nearest to a number of instructions.
const fn eighths(instructions: u32) -> u32 {
    (8 * instructions + QUERY_INSTRUCTIONS / 2) / QUERY_INSTRUCTIONS
}

/// Cost of setting up this many springs, field queries.
pub(crate) fn spring_cost(springs: usize) -> u32 {
    SPRING * springs as u32 / LOOKUP
}

/// Cost of the model of geometric energies and of this many charges, field queries.
pub(crate) fn energy_cost(charges: u16) -> u32 {
    (MODEL + CHARGE * u32::from(charges)) / LOOKUP
}

/// Cost of one solve with this many springs, field queries.
pub(crate) fn solve_cost(springs: usize) -> u32 {
    (SOLVE + SPRING_IN_SOLVE * springs as u32) / LOOKUP
}

/// Cost of one solve past the third with this many springs and candidates, field queries.
pub(crate) fn further_solve_cost(springs: usize, candidates: u16) -> u32 {
    solve_cost(springs) + CANDIDATE_IN_SOLVE * u32::from(candidates) / LOOKUP
}

/// Cost of a search, field queries.
#[derive(Clone, Copy)]
pub(crate) struct Used {
    pub all: u32,
    /// Share spent on points rather than on the traversal.
    pub point_work: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the budget counts decides which points an overloaded tick decimates: another number here is another force.
    #[test]
    fn the_budget_counts_these_eighths() {
        let counted = TABLE.iter().map(|row| (row.name, row.eighths));
        assert!(
            counted.eq([
                ("LOOKUP", 8),
                ("SURFACE", 5),
                ("SPAN", 23),
                ("NEAR", 6),
                ("MATING", 2),
                ("ALLOWANCE", 8),
                ("CANDIDATE", 11),
                ("PUSHING", 24),
                ("CANDIDATE_IN_SOLVE", 3),
                ("PAIR", 25),
                ("LEAF", 6),
                ("NODE", 12),
                ("PASSED_OVER", 5),
                ("CACHED_POINT", 5),
                ("FIND_FACE", 32),
                ("NOTED", 1),
                ("EXCLUSION", 32),
                ("EDGE_NODE", 1),
                ("EDGE_BOUND", 2),
                ("PIECE_BOUND", 2),
                ("PIECE", 4),
                ("EDGE_PAIR", 3),
                ("CIRCLE", 8),
                ("CIRCLE_PAIR", 3),
                ("KEPT_PAIR", 1),
                ("FEET_STEP", 4),
                ("CROSSING", 12),
                ("EDGE_TRAVEL", 32),
                ("SPRING", 48),
                ("SOLVE", 64),
                ("SPRING_IN_SOLVE", 20),
                ("CHARGE", 10),
                ("MODEL", 105),
            ]),
            "{TABLE:#?}"
        );
        for n in 0..=16 {
            assert_eq!(spring_cost(n), 6 * n as u32);
            assert_eq!(solve_cost(n), 8 + 5 * n as u32 / 2);
        }
        for candidates in 0..=MAX_CONTACTS as u16 {
            assert_eq!(
                further_solve_cost(3, candidates),
                solve_cost(3) + 3 * u32::from(candidates) / 8
            );
        }
    }

    /// Instructions by the regression of the note above. Rounding takes up to half an eighth; the rest is for a node passed over, for which the budget
    /// counts more than was measured.
    #[test]
    fn the_table_is_within_an_eighth_of_what_was_measured() {
        let eighth = f64::from(QUERY_INSTRUCTIONS) / 8.0;
        for (what, counted, measured) in [
            ("near point", LOOKUP, 194),
            ("point of a leaf queried whole", LOOKUP + NOTED, 214),
            ("node passed over", PASSED_OVER, 104),
            ("node queried", NODE, 275),
            ("leaf", LEAF, 148),
            ("point within the margin", NEAR, 135),
            ("candidate, with two solves", CANDIDATE, 180 + 2 * 37),
        ] {
            let off = f64::from(counted) * eighth - f64::from(measured);
            assert!(off.abs() <= eighth, "{what}: {off} instructions");
        }
        for row in TABLE {
            let off = f64::from(row.eighths) * eighth - f64::from(row.instructions);
            assert!(off.abs() <= eighth / 2.0, "{row:?}");
        }
    }
}
