//! Directional blocking graphs: which part stops which along a direction (Wilson & Latombe, "Geometric reasoning about mechanical assembly", 1994).
//!
//! Of a set of parts and a direction d, part i is blocked by part j when i, moved along d until it is beyond j, overlaps j on its way by more than the
//! pair is allowed. A group can leave the set along d as one body when none of its parts is blocked by a part outside of the group; the least such groups
//! are the strongly connected components of the graph that block no further one, so every subassembly that leaves straight is found without trying
//! subsets. An answer concerns two parts alone and holds in every subset: each is computed once, and holds for the opposite direction with the parts
//! exchanged.
//!
//! A single part is the smallest group there is, and one part in its way is enough to keep it: it stays blocked until that part has left. So single parts are
//! tried first, and whole graphs are made only of sets that no single part leaves. A part in the way is sought at a few places of the motion before any
//! whole motion is swept; equal parts that lie to each other in the same way are swept once.
//!
//! Cost: of each part and direction some distance queries for each part ahead of it, and sweeps against all of these where it leaves; by all cores.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DVec3};
use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use rayon::prelude::*;

use crate::assembly::{Assembly, Moved, SEARCH_STEP_MM};
use crate::deadline::Deadline;
use crate::mobility::leaving_mm;
use crate::motion::Motion;

/// Sweeps that are made side by side before one is looked at that meets something.
const SIDE_BY_SIDE: usize = 8;
/// Places of a motion, as eighths of the stretch on which the boxes meet, at which a part in the way is sought: the middle first.
const PROBES: [f64; 7] = [4.0, 2.0, 6.0, 1.0, 7.0, 3.0, 5.0];

/// Blocking relations of an assembly along given directions.
pub struct Blocking<'a> {
    assembly: &'a Assembly,
    directions: Vec<DVec3>,
    /// By line, blocked part and blocking part: whether the first, moved along the line's direction, meets the second.
    known: HashMap<(usize, usize, usize), bool>,
    /// The same by what it depends on.
    alike: HashMap<Alike, bool>,
    /// By part, line and sense: a part in its way.
    blockers: HashMap<(usize, usize, bool), usize>,
}

/// A group that leaves straight.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaving {
    /// Its parts, ascending.
    pub parts: Vec<usize>,
    /// Unit direction.
    pub direction: DVec3,
}

/// Time is over.
struct Over;

impl<'a> Blocking<'a> {
    /// Relations along `directions`, both ways of each.
    pub fn new(assembly: &'a Assembly, directions: Vec<DVec3>) -> Self {
        // What does not come apart is in each other's way, along every direction.
        let joined = assembly.stated.permanent().flat_map(|[a, b]| [[a, b], [b, a]]);
        let known = joined.flat_map(|[a, b]| (0..directions.len()).map(move |line| ((line, a, b), true)));
        Self {
            assembly,
            known: known.collect(),
            directions,
            alike: HashMap::new(),
            blockers: HashMap::new(),
        }
    }

    /// The directions.
    pub fn directions(&self) -> &[DVec3] {
        &self.directions
    }

    /// The smallest group of `set` that leaves it along one of the directions, of equally many parts the one of least volume, among those that `accept` takes;
    /// `None` also where `until` is over first.
    pub fn leaving(
        &mut self,
        set: &[usize],
        accept: &mut dyn FnMut(&[usize]) -> bool,
        until: &Deadline,
    ) -> Option<Leaving> {
        match self.single(set, accept, until) {
            Ok(None) => self.group(set, accept, until).ok().flatten(),
            Ok(found) => found,
            Err(Over) => None,
        }
    }

    fn volume(&self, parts: &[usize]) -> f64 {
        let volume = |&p: &usize| self.assembly.body(p).surface().shape().volume_mm3.abs();
        parts.iter().map(volume).sum()
    }

    /// The smallest part of `set` that leaves it.
    fn single(
        &mut self,
        set: &[usize],
        accept: &mut dyn FnMut(&[usize]) -> bool,
        until: &Deadline,
    ) -> Result<Option<Leaving>, Over> {
        if set.len() < 2 {
            return Ok(None);
        }
        let within: HashSet<usize> = set.iter().copied().collect();
        let mut order = set.to_vec();
        order.sort_by(|&a, &b| self.volume(&[a]).total_cmp(&self.volume(&[b])));
        for part in order {
            if !accept(&[part]) {
                continue;
            }
            for line in 0..self.directions.len() {
                for against in [false, true] {
                    let key = (part, line, against);
                    if self.blockers.get(&key).is_some_and(|by| within.contains(by)) {
                        continue;
                    }
                    let Some(by) = self.blocker(set, key, until)? else {
                        let direction = self.directions[line] * if against { -1.0 } else { 1.0 };
                        let parts = vec![part];
                        return Ok(Some(Leaving { parts, direction }));
                    };
                    self.blockers.insert(key, by);
                }
            }
        }
        Ok(None)
    }

    /// A part of `set` in the way of one of its parts along a line or against it.
    fn blocker(
        &mut self,
        set: &[usize],
        (part, line, against): (usize, usize, bool),
        until: &Deadline,
    ) -> Result<Option<usize>, Over> {
        let (assembly, along) = (self.assembly, self.directions[line]);
        let pair = |other: usize| if against { [other, part] } else { [part, other] };
        let mut open = Vec::new();
        for &other in set.iter().filter(|&&other| other != part) {
            let [i, j] = pair(other);
            match self.known.get(&(line, i, j)) {
                Some(true) => return Ok(Some(other)),
                Some(false) => {}
                None if ahead(assembly, i, j, along) => open.push(other),
                None => {}
            }
        }
        let probed = open.par_iter().find_first(|&&other| {
            let [i, j] = pair(other);
            in_the_way(assembly, i, j, along)
        });
        if let Some(&other) = probed {
            let [i, j] = pair(other);
            self.known.insert((line, i, j), true);
            return Ok(Some(other));
        }
        for some in open.chunks(SIDE_BY_SIDE) {
            let pairs: Vec<[usize; 2]> = some.iter().map(|&other| pair(other)).collect();
            self.sweep(line, &pairs, until)?;
            let met = |other: &&usize| {
                let [i, j] = pair(**other);
                self.known.get(&(line, i, j)) == Some(&true)
            };
            if let Some(&other) = some.iter().find(met) {
                return Ok(Some(other));
            }
        }
        Ok(None)
    }

    /// Makes relations of pairs along a line known.
    fn sweep(&mut self, line: usize, pairs: &[[usize; 2]], until: &Deadline) -> Result<(), Over> {
        let (assembly, along) = (self.assembly, self.directions[line]);
        let mut alike: HashMap<Alike, Vec<[usize; 2]>> = HashMap::new();
        for &[i, j] in pairs {
            let same = Alike::of(assembly, i, j, along);
            match self.alike.get(&same) {
                Some(&meets) => {
                    self.known.insert((line, i, j), meets);
                }
                None => alike.entry(same).or_default().push([i, j]),
            }
        }
        let alike: Vec<(Alike, Vec<[usize; 2]>)> = alike.into_iter().collect();
        // Of some pairs the sweeps are long: each is taken by whichever core is free.
        let meet: Option<Vec<bool>> = (alike.par_iter().with_max_len(1))
            .map(|(_, same)| {
                let [i, j] = same[0];
                (!until.is_over()).then(|| meets(assembly, i, j, along))
            })
            .collect();
        for ((one, same), meets) in alike.into_iter().zip(meet.ok_or(Over)?) {
            self.alike.insert(one, meets);
            for [i, j] in same {
                self.known.insert((line, i, j), meets);
            }
        }
        Ok(())
    }

    /// The smallest group of `set` that leaves it, by whole graphs.
    fn group(
        &mut self,
        set: &[usize],
        accept: &mut dyn FnMut(&[usize]) -> bool,
        until: &Deadline,
    ) -> Result<Option<Leaving>, Over> {
        let assembly = self.assembly;
        let mut found: Vec<Leaving> = Vec::new();
        for line in 0..self.directions.len() {
            let along = self.directions[line];
            let meets_by_now = |i, j| self.known.get(&(line, i, j)) == Some(&true);
            let pairs: Vec<[usize; 2]> = (set.par_iter())
                .flat_map_iter(|&i| set.iter().map(move |&j| [i, j]))
                .filter(|&[i, j]| i != j && (meets_by_now(i, j) || ahead(assembly, i, j, along)))
                .collect();
            let unknown = |&[i, j]: &[usize; 2]| !self.known.contains_key(&(line, i, j));
            let open: Vec<[usize; 2]> = pairs.iter().copied().filter(unknown).collect();
            self.sweep(line, &open, until)?;
            let met: Vec<[usize; 2]> = (pairs.into_iter())
                .filter(|&[i, j]| self.known.get(&(line, i, j)) == Some(&true))
                .collect();
            for against in [false, true] {
                let direction = along * if against { -1.0 } else { 1.0 };
                let groups = free_groups(set, &met, against).into_iter();
                found.extend(groups.map(|parts| Leaving { parts, direction }));
            }
        }
        found.retain(|leaving| accept(&leaving.parts));
        let least = found.into_iter().min_by(|a, b| {
            let count = a.parts.len().cmp(&b.parts.len());
            count.then_with(|| self.volume(&a.parts).total_cmp(&self.volume(&b.parts)))
        });
        Ok(least)
    }
}

/// Least groups of `set`, each ascending, of which no part meets one outside of the group; `met`: parts and those they meet, or the reverse.
fn free_groups(set: &[usize], met: &[[usize; 2]], reverse: bool) -> Vec<Vec<usize>> {
    let mut graph: DiGraph<usize, ()> = DiGraph::new();
    let nodes: HashMap<usize, NodeIndex> = set.iter().map(|&p| (p, graph.add_node(p))).collect();
    for &[i, j] in met {
        let (from, to) = if reverse { (j, i) } else { (i, j) };
        graph.add_edge(nodes[&from], nodes[&to], ());
    }
    let mut found = Vec::new();
    for component in tarjan_scc(&graph) {
        let within: HashSet<NodeIndex> = component.iter().copied().collect();
        let leaves = (component.iter()).all(|&n| graph.neighbors(n).all(|m| within.contains(&m)));
        if leaves && component.len() < set.len() {
            let mut parts: Vec<usize> = component.iter().map(|&n| graph[n]).collect();
            parts.sort_unstable();
            found.push(parts);
        }
    }
    found
}

/// What the relation of two parts along a direction depends on, in the frame of the first: equal parts that lie to each other in the same way are swept once.
#[derive(PartialEq, Eq, Hash)]
struct Alike {
    shapes: [usize; 2],
    /// Place of the second and the allowed depth in [`SAME_MM`], its axes and the direction in [`SAME_RAD`].
    rounded: [i64; 16],
}

/// Differences of places and of directions that a file's digits leave between equal ones; the depths that are allowed are thousands of times these.
const SAME_MM: f64 = 1e-7;
const SAME_RAD: f64 = 1e-9;

impl Alike {
    fn of(assembly: &Assembly, i: usize, j: usize, direction: DVec3) -> Self {
        let back = assembly.placement(i).inverse();
        let to = back * assembly.placement(j);
        let along = back.transform_vector3(direction);
        let axes = to.matrix3;
        let rows = [
            to.translation / SAME_MM,
            axes.x_axis / SAME_RAD,
            axes.y_axis / SAME_RAD,
            axes.z_axis / SAME_RAD,
            along / SAME_RAD,
        ];
        let values = rows.iter().flat_map(|row| row.to_array());
        let mut rounded = [0; 16];
        for (slot, value) in rounded
            .iter_mut()
            .zip(values.chain([assembly.allowed_mm(i, j) / SAME_MM]))
        {
            *slot = value.round() as i64;
        }
        Self {
            shapes: [i, j].map(|part| assembly.model.parts[part].shape),
            rounded,
        }
    }
}

/// The slide of part `i` along `direction` until it is beyond part `j`.
fn beyond(assembly: &Assembly, i: usize, j: usize, direction: DVec3) -> DVec3 {
    let parts = [i];
    let group = Moved {
        parts: &parts,
        by: DAffine3::IDENTITY,
    };
    direction * leaving_mm(assembly, &group, &[j], direction)
}

/// Whether the box that part `i` sweeps along `direction` until it is beyond part `j` meets the box of that.
fn ahead(assembly: &Assembly, i: usize, j: usize, direction: DVec3) -> bool {
    let motion = Motion::slide(beyond(assembly, i, j, direction));
    let (low, high) = assembly.swept(&[i], DAffine3::IDENTITY, &motion);
    let (l, h) = assembly.bounds(j, DAffine3::IDENTITY);
    (low - h).max(l - high).max_element() <= 0.0
}

/// Whether part `i` moved along `direction` overlaps part `j` at one of [`PROBES`] by more than is allowed.
fn in_the_way(assembly: &Assembly, i: usize, j: usize, direction: DVec3) -> bool {
    let by = beyond(assembly, i, j, direction);
    let (il, ih) = assembly.bounds(i, DAffine3::IDENTITY);
    let (jl, jh) = assembly.bounds(j, DAffine3::IDENTITY);
    // Shares of the motion between which the boxes meet along every axis.
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for axis in (0..3).filter(|&axis| by[axis] != 0.0) {
        let [a, b] = [jl[axis] - ih[axis], jh[axis] - il[axis]].map(|apart| apart / by[axis]);
        (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
    }
    PROBES.iter().any(|&place| {
        let group = Moved {
            parts: &[i],
            by: DAffine3::from_translation(by * (from + (to - from) * place / 8.0)),
        };
        !assembly.clear(&group, &[j])
    })
}

/// Whether part `i` moved along `direction` meets part `j`.
fn meets(assembly: &Assembly, i: usize, j: usize, direction: DVec3) -> bool {
    if in_the_way(assembly, i, j, direction) {
        return true;
    }
    let parts = [i];
    let group = Moved {
        parts: &parts,
        by: DAffine3::IDENTITY,
    };
    let motion = Motion::slide(beyond(assembly, i, j, direction));
    assembly.free_share(&group, &[j], &motion, SEARCH_STEP_MM).0 < 1.0
}
