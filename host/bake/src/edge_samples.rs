//! Points along edges: pieces are joined to chains and sampled at equal steps of arc length.
//!
//! No sample of a smooth partner finds a sharp convex edge, so all partners count for it. A smooth edge (a fillet's) is part of the surface it
//! borders: it counts partners no sharper than that surface and, where it borders a flat, the flats that may lie across it. Concave edges, and smooth
//! ones between faces without convex curvature, need no samples: a partner that touches there has an edge of its own, or also touches an adjacent
//! face.

use std::collections::BTreeSet;

use mortise_protocol::image::{NO_FACE, NO_SPAN};

use crate::chains::edge_chains;
use crate::distance::ExactSurface;
use crate::edge_spans::spans;
use glam::DVec3;
use mortise_brep::Surface;

use crate::partners::{Partners, face_range};
use crate::piece::{Link, Piece, PieceCurve};
use crate::ring_samples::sample_ring;
use crate::shell::{PointshellOptions, ShellPoint};

/// Most points on one chain.
const MAX_POINTS: f64 = 4000.0;
/// Faces whose normals differ by a smaller angle (rad) meet smoothly: ten times the error that modellers and STEP files leave.
const SMOOTH: f64 = 0.01;

/// Sampling requirement of an edge: partner curvature to add to the edge's own, and the largest spacing.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Demand {
    curvature: f64,
    max_spacing_mm: f64,
    /// Whether the edge's own curvature counts only where the edge bends away from the normals at it.
    away_only: bool,
}

/// Appends points strictly inside each chain of boundary pieces, or its spans where they are fewer; returns the vertices where chains end.
pub(crate) fn sample_edges(
    surface: &ExactSurface,
    options: &PointshellOptions,
    out: &mut Vec<ShellPoint>,
) -> BTreeSet<u32> {
    let pieces = &surface.topology.pieces;
    let mut corners = BTreeSet::new();
    let convex: Vec<f64> = (0..surface.shape().faces.len() as u32)
        .map(|face| face_range(surface, face).map_or(0.0, |[_, high]| high))
        .collect();
    for chain in edge_chains(surface) {
        let demands = chain
            .iter()
            .filter_map(|&(i, _)| demand(surface, &pieces[i as usize], &convex, options));
        let Some(demand) = demands.reduce(|a, b| Demand {
            curvature: a.curvature.max(b.curvature),
            max_spacing_mm: a.max_spacing_mm.min(b.max_spacing_mm),
            ..a
        }) else {
            continue;
        };
        let before = out.len();
        sample_chain(surface, &chain, &demand, options, out);
        if options.partners != Partners::Unknown
            && let Some(spans) = spans(surface, &chain, options)
            && spans.len() < out.len() - before
            && before + spans.len() <= usize::from(NO_SPAN)
        {
            out.truncate(before);
            out.extend(spans);
        }
        sample_ring(surface, &chain, options, out);
        if let (Some(&(first, from)), Some(&(last, to))) = (chain.first(), chain.last()) {
            let start = pieces[first as usize].ends[usize::from(!from)];
            let end = pieces[last as usize].ends[usize::from(to)];
            if start != end || is_corner(surface, start) {
                corners.extend([start, end]);
            }
        }
    }
    corners
}

/// Whether a vertex is an end of any edges other than a single closed one.
fn is_corner(surface: &ExactSurface, vertex: u32) -> bool {
    surface
        .topology
        .vertex_pieces
        .get(&vertex)
        .is_some_and(|p| p.len() > 2)
}

fn sample_chain(
    surface: &ExactSurface,
    chain: &[Link],
    demand: &Demand,
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
    let steps = steps(surface, chain, length, demand, options, closed);
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
                span: None,
            });
        }
    }
}

/// Sampling requirement of `piece`; `None` when it needs no samples. `convex`: largest convex curvature of each face.
fn demand(
    surface: &ExactSurface,
    piece: &Piece,
    convex: &[f64],
    options: &PointshellOptions,
) -> Option<Demand> {
    if options.partners == Partners::Unknown {
        return Some(Demand {
            curvature: 0.0,
            max_spacing_mm: options.max_spacing_mm,
            away_only: false,
        });
    }
    let sharp = Demand {
        curvature: options.partners.sharpest(),
        max_spacing_mm: options.max_spacing_mm,
        away_only: true,
    };
    let [first, second] = piece.sides.as_slice() else {
        // A border of an open shell, or more than two faces: always treated as sharp.
        return Some(sharp);
    };
    let at = piece.at(0.5);
    let [a, b] = [first, second].map(|side| surface.topology.outward(surface.shape(), side.triangle, at));
    if a.cross(b).length() < SMOOTH && a.dot(b) > 0.0 {
        let own = [first, second].map(|side| convex[side.face as usize]);
        let sharper = own[0].max(own[1]);
        let flat = |face: u32| {
            matches!(
                surface.shape().faces[face as usize].surface,
                Surface::Plane { .. } | Surface::Spline
            )
        };
        return (sharper > 0.0).then(|| Demand {
            curvature: options.partners.no_sharper_than(sharper),
            max_spacing_mm: if flat(first.face) || flat(second.face) {
                options.max_spacing_mm
            } else {
                f64::INFINITY
            },
            away_only: true,
        });
    }
    // Direction into the first face, which lies on the left of its side.
    let inward = a.cross(piece.tangent(at) * if first.forward { 1.0 } else { -1.0 });
    (b.dot(inward) < 0.0).then_some(sharp)
}

/// Equal steps along a chain: ∫√((κ + κ')/8ε) ds of them, where κ ds is the turn of the tangent and κ' the addition from `demand`; each step stays
/// within the limits.
fn steps(
    surface: &ExactSurface,
    chain: &[Link],
    length: f64,
    demand: &Demand,
    options: &PointshellOptions,
    closed: bool,
) -> usize {
    let pieces = &surface.topology.pieces;
    // Turn of the tangent in each piece: an arc's own angle, and half of the corner angle at each end between segments.
    let mut turns: Vec<f64> = chain
        .iter()
        .map(|&(i, _)| own_turn(surface, &pieces[i as usize], demand))
        .collect();
    for (k, pair) in chain.windows(2).enumerate() {
        let [(i, forward), (j, next_forward)] = [pair[0], pair[1]];
        let (piece, next) = (&pieces[i as usize], &pieces[j as usize]);
        if piece.turn() == 0.0 && next.turn() == 0.0 {
            let along = |p: &Piece, f: bool| p.tangent(p.at(0.5)) * if f { 1.0 } else { -1.0 };
            let turn = along(piece, forward).angle_between(along(next, next_forward));
            if turn.is_finite() {
                turns[k] += 0.5 * turn;
                turns[k + 1] += 0.5 * turn;
            }
        }
    }
    let by_curvature: f64 = chain
        .iter()
        .zip(&turns)
        .map(|(&(i, _), turn)| {
            let length = pieces[i as usize].length();
            length * (turn / length.max(1e-300) + demand.curvature.min(1e12)).sqrt()
        })
        .sum();
    let steps = by_curvature / (8.0 * options.epsilon_mm).sqrt();
    let most = if options.least_spacing_mm > 0.0 {
        length / options.least_spacing_mm
    } else {
        f64::INFINITY
    };
    let least = if closed && steps > 0.0 { 3.0 } else { 1.0 };
    (steps.min(most) - 1e-9)
        .max(length / demand.max_spacing_mm)
        .ceil()
        .clamp(least, MAX_POINTS) as usize
}

/// Angle by which the tangent of `piece` turns away from a touching partner: a bore's rim bends towards the part in the bore.
fn own_turn(surface: &ExactSurface, piece: &Piece, demand: &Demand) -> f64 {
    let PieceCurve::Arc { center, .. } = piece.curve else {
        return piece.turn();
    };
    if !demand.away_only {
        return piece.turn();
    }
    let at = piece.at(0.5);
    let outward = (at - center).normalize_or_zero();
    let normals = || {
        piece
            .sides
            .iter()
            .map(|side| surface.topology.outward(surface.shape(), side.triangle, at))
    };
    let middle = normals().sum::<DVec3>().normalize_or_zero();
    let away = normals()
        .chain([middle])
        .map(|n| n.dot(outward))
        .fold(0.0, f64::max);
    piece.turn() * away.min(1.0)
}
