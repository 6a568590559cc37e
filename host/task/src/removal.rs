//! Removal paths of a part or group: straight ways first, then ways of several legs.
//!
//! A leg is a slide along a candidate direction or a turn about a candidate axis ([`crate::directions`]). A way of several legs is searched from opening to
//! opening: while the group makes one leg, another motion that was blocked becomes possible. Where it does is found by testing the group *displaced* by that
//! motion past its present range, at places along the leg: the depth of its overlap there changes by no more than the group travels, so the next place
//! worth testing is as far as the overlap is deep. Of a stretch that is clear the displacement grows until the stretch is narrowest, and the leg ends
//! in its middle: so the way goes through the middle of narrow passages, and of an opening that is too small the least overlap is known.
//!
//! Cost: at each place of the search one sweep per candidate, and for each pair of a free leg and a blocked motion some tens of distance queries.

use glam::{DAffine3, DVec3};

use crate::assembly::{Assembly, Moved};
use crate::search::Search;
pub use crate::way::{Blocked, Budget, Path, Removal};

/// Searches a way out of `parts` from among `others`, which stay.
pub fn remove(
    assembly: &Assembly,
    parts: &[usize],
    others: &[usize],
    extra: &[DVec3],
    budget: &Budget,
) -> Removal {
    let mut search = Search::new(assembly, parts, others, extra, budget);
    let start = Moved {
        parts,
        by: DAffine3::IDENTITY,
    };
    if let Some(leg) = search.straight(&start) {
        return Removal::Out(Path { legs: vec![leg] });
    }
    let mut found = if budget.legs > 1 { search.legs() } else { None };
    if found.is_none() && budget.legs > 1 && !search.out_of_time {
        // Again, with more motions.
        search.tilts = true;
        search.seen.truncate(1);
        found = search.legs();
    }
    if let Some(path) = found {
        return Removal::Out(path);
    }
    let blocked = search.held().unwrap_or_else(|| Blocked {
        pair: search.nearest_pair(),
        overlap_mm: None,
    });
    if search.out_of_time {
        Removal::TimedOut(blocked)
    } else {
        Removal::Blocked(blocked)
    }
}
