//! Directional blocking graphs: which part stops which along a direction (Wilson & Latombe, "Geometric reasoning about mechanical assembly", 1994).
//!
//! Of a set of parts and a direction d, part i is blocked by part j when i, moved along d until it is beyond j, overlaps j on its way by more than the
//! pair is allowed. A group can leave the set along d as one body when none of its parts is blocked by a part outside of the group; the least such groups
//! are the strongly connected components of the graph that block no further one, so every subassembly that leaves straight is found without trying
//! subsets. An answer concerns two parts alone and holds in every subset: each is computed once, when first needed, and holds for the opposite direction with
//! the parts exchanged.

use std::collections::HashMap;
use std::time::Instant;

use glam::{DAffine3, DVec3};
use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};

use crate::assembly::{Assembly, Moved, SEARCH_STEP_MM};
use crate::mobility::leaving_mm;
use crate::motion::Motion;

/// Blocking relations of an assembly along given directions.
pub struct Blocking<'a> {
    assembly: &'a Assembly,
    directions: Vec<DVec3>,
    /// By line, blocked part and blocking part: whether the first, moved along the line's direction, meets the second.
    known: HashMap<(usize, usize, usize), bool>,
}

/// A group that leaves straight.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaving {
    /// Its parts, ascending.
    pub parts: Vec<usize>,
    /// Unit direction.
    pub direction: DVec3,
}

impl<'a> Blocking<'a> {
    /// Relations along `directions`, both ways of each.
    pub fn new(assembly: &'a Assembly, directions: Vec<DVec3>) -> Self {
        Self { assembly, directions, known: HashMap::new() }
    }

    /// The directions.
    pub fn directions(&self) -> &[DVec3] {
        &self.directions
    }

    /// Whether part `i` moved along direction `line`, or against it, meets part `j`.
    pub fn blocks(&mut self, line: usize, against: bool, i: usize, j: usize) -> bool {
        let (first, second) = if against { (j, i) } else { (i, j) };
        let Some(&direction) = self.directions.get(line) else { return false };
        let assembly = self.assembly;
        *self.known.entry((line, first, second)).or_insert_with(|| meets(assembly, first, second, direction))
    }

    /// The least groups of `set` that leave it along one of the directions, smallest first; ends at `until`.
    pub fn leaving(&mut self, set: &[usize], until: Instant) -> Vec<Leaving> {
        let mut found = Vec::new();
        for line in 0..self.directions.len() {
            for against in [false, true] {
                let mut graph: DiGraph<usize, ()> = DiGraph::new();
                let nodes: Vec<NodeIndex> = set.iter().map(|&p| graph.add_node(p)).collect();
                for (x, &i) in set.iter().enumerate() {
                    for (y, &j) in set.iter().enumerate() {
                        if Instant::now() >= until {
                            return found;
                        }
                        if i != j && self.blocks(line, against, i, j) {
                            graph.add_edge(nodes[x], nodes[y], ());
                        }
                    }
                }
                let direction = self.directions[line] * if against { -1.0 } else { 1.0 };
                for component in tarjan_scc(&graph) {
                    let leaves = component.iter().all(|&n| graph.neighbors(n).all(|m| component.contains(&m)));
                    if leaves && component.len() < set.len() {
                        let mut parts: Vec<usize> = component.iter().map(|&n| graph[n]).collect();
                        parts.sort_unstable();
                        found.push(Leaving { parts, direction });
                    }
                }
            }
        }
        let size = |l: &Leaving| l.parts.iter().map(|&p| self.assembly.body(p).surface().shape().volume_mm3.abs()).sum::<f64>();
        found.sort_by(|a, b| a.parts.len().cmp(&b.parts.len()).then(size(a).total_cmp(&size(b))));
        found
    }
}

fn meets(assembly: &Assembly, i: usize, j: usize, direction: DVec3) -> bool {
    let ((il, ih), (jl, jh)) = (assembly.bounds(i, DAffine3::IDENTITY), assembly.bounds(j, DAffine3::IDENTITY));
    let parts = [i];
    let group = Moved { parts: &parts, by: DAffine3::IDENTITY };
    let far = leaving_mm(assembly, &group, &[j], direction);
    // The box that the part sweeps.
    let by = direction * far;
    let (low, high) = (il.min(il + by), ih.max(ih + by));
    if (low - jh).max(jl - high).max_element() > 0.0 {
        return false;
    }
    assembly.free_share(&group, &[j], &Motion::slide(by), SEARCH_STEP_MM).0 < 1.0
}
