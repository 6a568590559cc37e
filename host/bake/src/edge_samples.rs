//! Points along edges: pieces joined to chains, sampled at equal steps by length.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use mortise_protocol::image::NO_FACE;

use crate::distance::ExactSurface;
use crate::piece::Piece;
use crate::pointshell::{PointshellOptions, ShellPoint};

/// Most points on one chain.
const MAX_POINTS: f64 = 4000.0;

/// Appends points strictly inside each chain of boundary pieces, and returns the vertices where chains end.
pub(crate) fn sample_edges(
    surface: &ExactSurface,
    options: &PointshellOptions,
    out: &mut Vec<ShellPoint>,
) -> BTreeSet<u32> {
    let pieces = &surface.topology.pieces;
    // One group for each B-rep edge; where that is unknown, for each set of faces that meet.
    let mut groups: BTreeMap<(Option<u32>, Vec<u32>), Vec<u32>> = BTreeMap::new();
    for (i, piece) in pieces.iter().enumerate() {
        let mut faces: Vec<u32> = piece.sides.iter().map(|s| s.face).collect();
        faces.sort_unstable();
        groups.entry((piece.edge, faces)).or_default().push(i as u32);
    }
    let mut corners = BTreeSet::new();
    for group in groups.into_values() {
        for chain in chains(pieces, &group) {
            sample_chain(surface, &chain, options, out);
            if let (Some(&(first, from)), Some(&(last, to))) = (chain.first(), chain.last()) {
                let start = pieces[first as usize].ends[usize::from(!from)];
                let end = pieces[last as usize].ends[usize::from(to)];
                if start != end || is_corner(surface, start) {
                    corners.extend([start, end]);
                }
            }
        }
    }
    corners
}

/// Whether other edges than one closed one end at this vertex.
fn is_corner(surface: &ExactSurface, vertex: u32) -> bool {
    surface
        .topology
        .vertex_pieces
        .get(&vertex)
        .is_some_and(|p| p.len() > 2)
}

/// A piece and whether the chain runs along it from `ends[0]` to `ends[1]`.
type Link = (u32, bool);

/// Joins pieces end to end. A chain stops where the group forks.
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

fn sample_chain(
    surface: &ExactSurface,
    chain: &[Link],
    options: &PointshellOptions,
    out: &mut Vec<ShellPoint>,
) {
    let pieces = &surface.topology.pieces;
    let length: f64 = chain.iter().map(|&(i, _)| pieces[i as usize].length()).sum();
    let closed = {
        let (first, from) = chain[0];
        let (last, to) = chain[chain.len() - 1];
        pieces[first as usize].ends[usize::from(!from)] == pieces[last as usize].ends[usize::from(to)]
            && chain.len() > 1
    };
    let steps = steps(pieces, chain, length, options, closed);
    let mut walked = 0.0;
    let mut at = 0;
    // A closed chain has no ends of its own: its first point is sampled too.
    let first = usize::from(!closed);
    for k in first..steps {
        let target = length * k as f64 / steps as f64;
        while at + 1 < chain.len() && walked + pieces[chain[at].0 as usize].length() < target {
            walked += pieces[chain[at].0 as usize].length();
            at += 1;
        }
        let (i, forward) = chain[at];
        let piece = &pieces[i as usize];
        let t = ((target - walked) / piece.length().max(1e-300)).clamp(0.0, 1.0);
        let position = piece.at(if forward { t } else { 1.0 - t });
        let normal = surface.topology.piece_normal(surface.shape(), piece, position);
        if let Some(normal) = normal.try_normalize() {
            out.push(ShellPoint {
                position,
                normal,
                face: piece.sides[0].face as u16,
                edge_face: piece
                    .sides
                    .iter()
                    .map(|s| s.face)
                    .find(|&f| f != piece.sides[0].face)
                    .map_or(NO_FACE, |f| f as u16),
            });
        }
    }
}

/// Equal steps along a chain: ∫√(κ/8ε) ds of them, κ ds being the turn of the tangent, and no longer than the limit.
fn steps(pieces: &[Piece], chain: &[Link], length: f64, options: &PointshellOptions, closed: bool) -> usize {
    let mut root_curvature = 0.0;
    for (k, &(i, forward)) in chain.iter().enumerate() {
        let piece = &pieces[i as usize];
        root_curvature += (piece.turn() * piece.length()).sqrt();
        if let Some(&(j, next_forward)) = chain.get(k + 1) {
            let next = &pieces[j as usize];
            if piece.turn() == 0.0 && next.turn() == 0.0 {
                let along = |p: &Piece, f: bool| p.tangent(p.at(0.5)) * if f { 1.0 } else { -1.0 };
                let turn = along(piece, forward).angle_between(along(next, next_forward));
                if turn.is_finite() {
                    root_curvature += (turn * 0.5 * (piece.length() + next.length())).sqrt();
                }
            }
        }
    }
    let by_curvature = root_curvature / (8.0 * options.epsilon_mm).sqrt();
    let least = if closed { 3.0 } else { 1.0 };
    by_curvature
        .max(length / options.max_spacing_mm)
        .ceil()
        .clamp(least, MAX_POINTS) as usize
}
