//! Chains of boundary pieces: the pieces of one edge, joined end to end.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::distance::ExactSurface;
use crate::piece::{Link, Piece};

/// All chains of a shape: one or more for each B-rep edge; where the edge is unknown, for each set of adjacent faces.
pub(crate) fn edge_chains(surface: &ExactSurface) -> Vec<Vec<Link>> {
    let pieces = &surface.topology.pieces;
    let mut groups: BTreeMap<(Option<u32>, Vec<u32>), Vec<u32>> = BTreeMap::new();
    for (i, piece) in pieces.iter().enumerate() {
        let mut faces: Vec<u32> = piece.sides.iter().map(|s| s.face).collect();
        faces.sort_unstable();
        groups.entry((piece.edge, faces)).or_default().push(i as u32);
    }
    groups.values().flat_map(|group| chains(pieces, group)).collect()
}

/// Joins the pieces of a group end to end. A chain stops where the group forks.
fn chains(pieces: &[Piece], group: &[u32]) -> Vec<Vec<Link>> {
    let mut at: HashMap<u32, Vec<u32>> = HashMap::new();
    for &i in group {
        for end in pieces[i as usize].ends {
            at.entry(end).or_default().push(i);
        }
    }
    let mut used: BTreeSet<u32> = BTreeSet::new();
    let mut all = Vec::new();
    let walk = |first: u32, forward: bool, used: &mut BTreeSet<u32>| {
        let mut chain = vec![(first, forward)];
        used.insert(first);
        let mut tip = pieces[first as usize].ends[usize::from(forward)];
        while let Some(&[a, b]) = at.get(&tip).map(Vec::as_slice) {
            let last = chain[chain.len() - 1].0;
            let next = if a == last { b } else { a };
            if !used.insert(next) {
                break;
            }
            let forward = pieces[next as usize].ends[0] == tip;
            tip = pieces[next as usize].ends[usize::from(forward)];
            chain.push((next, forward));
        }
        chain
    };
    // Open chains first, from their ends; what is left is closed.
    for &i in group {
        for (k, end) in pieces[i as usize].ends.iter().enumerate() {
            if !used.contains(&i) && at[end].len() != 2 {
                all.push(walk(i, k == 0, &mut used));
            }
        }
    }
    for &i in group {
        if !used.contains(&i) {
            all.push(walk(i, true, &mut used));
        }
    }
    all
}
