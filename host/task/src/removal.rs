//! Removal paths of a part or group: straight ways first, then ways of several legs.
//!
//! Two searches run at the same time, and the one that needs less work wins (`race`, which makes the result independent of the computer): the one from opening to opening below, whose ways
//! have few legs, and walks in contact (`explore`), which find narrow passages that no slide or turn about one axis of a surface leads through. Before it walks, the second looks for
//! a proof that there is no way (`proof`).
//!
//! A leg is a slide along a candidate direction, or along the line that two planes nearby have in common, or a turn about a candidate axis ([`crate::directions`]). A way of several legs is searched from opening to
//! opening: while the group makes one leg, another motion that was blocked becomes possible. Where it does is found by testing the group *displaced* by that
//! motion past its present range, at places along the leg: the depth of its overlap there changes by no more than the group travels, so the next place
//! worth testing is as far as the overlap is deep. Of a stretch that is clear the displacement grows until the stretch is narrowest, and the leg ends
//! in its middle: so the way goes through the middle of narrow passages, and of an opening that is too small the least overlap is known.
//!
//! Cost: at each place of the search one sweep per candidate, and for each pair of a free leg and a blocked motion some tens of distance queries.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DAffine3, DVec3};

use crate::assembly::{Assembly, Moved};
use crate::explore::Explorer;
use crate::proof::{Proof, locked};
use crate::race::Clock;
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
    let found_at = AtomicU64::new(u64::MAX);
    let start = Moved {
        parts,
        by: DAffine3::IDENTITY,
    };
    let clock = Clock::new(budget, &found_at);
    let mut search = Search::new(assembly, parts, others, extra, &clock);
    if let Some(leg) = search.straight(&start) {
        return Removal::Out(Path { legs: vec![leg] });
    }
    if budget.legs <= 1 {
        return Removal::Blocked(search.held());
    }
    let (by_legs, by_walks) = std::thread::scope(|scope| {
        let walks = scope.spawn(|| walks(assembly, parts, others, extra, budget, &found_at));
        let by_legs = search.way().map(|path| (clock.found(), path));
        // A panic of the walks is one of this search.
        let by_walks = walks.join().unwrap_or_else(|panic| resume_unwind(panic));
        (by_legs, by_walks)
    });
    match (by_legs, by_walks) {
        (_, Walked::Never(blocked)) => Removal::Blocked(blocked),
        (Some((work, _)), Walked::Out(less, path)) if less < work => Removal::Out(path),
        (Some((_, path)), _) | (None, Walked::Out(_, path)) => Removal::Out(path),
        (None, Walked::Nothing) if budget.is_over() => Removal::TimedOut(search.held()),
        (None, Walked::Nothing) => Removal::Blocked(search.held()),
    }
}

/// Result of the walks.
enum Walked {
    /// A way, and the work that it took.
    Out(u64, Path),
    /// Proved that there is none.
    Never(Blocked),
    Nothing,
}

/// A proof that there is no way, or the search by walks.
fn walks(
    assembly: &Assembly,
    parts: &[usize],
    others: &[usize],
    extra: &[DVec3],
    budget: &Budget,
    found_at: &AtomicU64,
) -> Walked {
    if let Some((overlap_mm, pair, proof)) = proved(assembly, parts, others, budget, found_at) {
        // There is nothing to be found: the other search ends.
        found_at.store(0, Ordering::Relaxed);
        return Walked::Never(Blocked {
            pair,
            overlap_mm: Some(overlap_mm),
            proof: Some(proof),
        });
    }
    let clock = Clock::new(budget, found_at);
    let found = Explorer::new(assembly, parts, others, extra, &clock).search();
    found.map_or(Walked::Nothing, |path| Walked::Out(clock.found(), path))
}

/// Most pairs of parts for which a proof is sought, and share of the time left that it may take.
const PROVED_PAIRS: usize = 4;
const PROOF_SHARE: f64 = 0.2;

/// A proof that the group stays: that a part of it cannot leave one of the others.
fn proved(
    assembly: &Assembly,
    parts: &[usize],
    others: &[usize],
    budget: &Budget,
    found_at: &AtomicU64,
) -> Option<(f64, [usize; 2], Proof)> {
    let until = budget.until.share(PROOF_SHARE);
    // A way that is found meanwhile is an answer, too: there is no proof then.
    let over = || until.is_over() || found_at.load(Ordering::Relaxed) != u64::MAX;
    // Where boxes have most in common, one part is most likely within the other.
    let common = |a: usize, b: usize| {
        let [(al, ah), (bl, bh)] = [a, b].map(|part| assembly.bounds(part, DAffine3::IDENTITY));
        (ah.min(bh) - al.max(bl)).max(DVec3::ZERO).element_product()
    };
    let pairs = parts.iter().flat_map(|&a| others.iter().map(move |&b| (a, b)));
    let mut pairs: Vec<(f64, usize, usize)> = pairs.map(|(a, b)| (common(a, b), a, b)).collect();
    pairs.retain(|pair| pair.0 > 0.0);
    pairs.sort_by(|p, q| q.0.total_cmp(&p.0));
    pairs.truncate(PROVED_PAIRS);
    let mut best: Option<(f64, [usize; 2], Proof)> = None;
    for (_, a, b) in pairs {
        let [pa, pb] = [a, b].map(|p| (assembly.placed(p, DAffine3::IDENTITY), assembly.skeleton(p)));
        // A way may overlap by what is allowed of the pair.
        if let Some((depth, proof)) = locked(pa, pb, &over)
            && depth > assembly.allowed_mm(a, b)
            && best.is_none_or(|known| depth > known.0)
        {
            best = Some((depth, [a, b], proof));
        }
    }
    best
}
