//! The connection graph: parts as nodes, and for each pair that touches or fits an edge with what connects them.
//!
//! A connection is read from geometry: contacts ([`mortise_mating::identify`]) and fits ([`crate::fits`]). Its kind ([`crate::taxonomy`]) follows from the
//! clearance's sign and from threads; what no geometry shows (welded, glued) is not guessed, but stated by a [`crate::catalogue`].

use std::collections::HashMap;

use mortise_mating::ContactKind;
use petgraph::graph::{NodeIndex, UnGraph};

use crate::assembly::Assembly;
use crate::fits::{Ends, Fit, fits};
use crate::taxonomy::{Connection, Evidence, kinds};
use crate::threads;

/// Least overlap of a pressed pair, mm: above the distance of a contact.
const PRESSED_MM: f64 = 1e-3;

/// An edge of the graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Parts, ascending.
    pub parts: [usize; 2],
    /// Kinds of connection, strongest first.
    pub kinds: Vec<Connection>,
    /// Indices into [`Assembly::contacts`].
    pub contacts: Vec<usize>,
    /// Shafts in bores.
    pub fits: Vec<Fit>,
}

/// The graph of an assembly; nodes carry the part's index.
///
/// Cost: a comparison of each shaft with each bore of other parts, and the triangles of the parts of those that share an axis.
pub fn graph(assembly: &Assembly) -> UnGraph<usize, Edge> {
    let count = assembly.count();
    let mut graph = UnGraph::new_undirected();
    let nodes: Vec<NodeIndex> = (0..count).map(|p| graph.add_node(p)).collect();
    let ends: Vec<Ends<'_>> = (0..count).map(|p| Ends::of(assembly, p)).collect();
    let mut contacts: HashMap<[usize; 2], Vec<usize>> = HashMap::new();
    for (i, contact) in assembly.contacts.iter().enumerate() {
        contacts.entry(contact.parts).or_default().push(i);
    }
    let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
    // Where a thread holds depends on all fits of a screw.
    let fits: Vec<Fit> = (pairs.clone())
        .flat_map(|[a, b]| [[a, b], [b, a]])
        .flat_map(|[a, b]| fits(assembly, &ends[a], &ends[b]))
        .collect();
    let mut held: HashMap<[usize; 2], Vec<(Fit, bool)>> = HashMap::new();
    for (fit, holds) in fits.iter().zip(threads::holds(assembly, &fits)) {
        let [a, b] = fit.parts;
        held.entry([a.min(b), a.max(b)]).or_default().push((*fit, holds));
    }
    for pair in pairs {
        let contacts = contacts.remove(&pair).unwrap_or_default();
        let fits = held.remove(&pair).unwrap_or_default();
        if let Some(edge) = edge(assembly, pair, contacts, &fits) {
            graph.add_edge(nodes[pair[0]], nodes[pair[1]], edge);
        }
    }
    graph
}

fn edge(assembly: &Assembly, [a, b]: [usize; 2], contacts: Vec<usize>, fits: &[(Fit, bool)]) -> Option<Edge> {
    let pressed = assembly.pressed_mm(a, b) > PRESSED_MM;
    if contacts.is_empty() && fits.is_empty() && !pressed {
        return None;
    }
    let mut shown: Vec<Evidence> = Vec::new();
    for (fit, holds) in fits {
        shown.push(match (fit.clearance_mm < -PRESSED_MM, fit.is_round) {
            (true, _) => Evidence::Overlap,
            (false, true) => Evidence::Fit,
            (false, false) => Evidence::Profile,
        });
        shown.extend(holds.then_some(Evidence::Thread));
    }
    if pressed && fits.iter().any(|(fit, _)| fit.clearance_mm <= 0.0) {
        shown.push(Evidence::Overlap);
    }
    shown.extend(contacts.iter().map(|&i| match assembly.contacts[i].kind {
        ContactKind::Planar => Evidence::Plane,
        ContactKind::Conical => Evidence::Taper,
        ContactKind::Spherical | ContactKind::Annular => Evidence::Ball,
        ContactKind::Cylindrical => Evidence::Fit,
    }));
    let shown = shown
        .into_iter()
        .filter_map(|evidence| kinds().shown_by(evidence));
    let mut kinds: Vec<Connection> = shown.chain(assembly.stated.connections([a, b])).collect();
    kinds.sort();
    kinds.dedup();
    Some(Edge {
        parts: [a, b],
        kinds,
        contacts,
        fits: fits.iter().map(|(fit, _)| *fit).collect(),
    })
}
