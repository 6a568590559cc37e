//! Connections of the parts where they are: which pairs touch or fit and by what, in words, and the state of their search. Pure.

use std::time::Instant;

use glam::DAffine3;
use mortise_task::Assembly;
use mortise_task::fits::Fit;
use mortise_task::graph::{Edge, graph};
use mortise_task::taxonomy::words;

use super::document::Document;
use super::sequence::are_same;

/// Two parts that are connected.
#[derive(Clone, Debug, PartialEq)]
pub struct Connected {
    /// The parts, ascending.
    pub parts: [usize; 2],
    /// What connects them, the strongest first.
    pub kinds: String,
    /// Diameter and clearance of each shaft in its bore; equal ones once, with their number.
    pub fits: Vec<String>,
}

impl Connected {
    fn new(edge: &Edge) -> Self {
        Self {
            parts: edge.parts,
            kinds: kinds(edge),
            fits: counted(edge.fits.iter().map(fit)),
        }
    }

    /// The other part, if `part` is one of them.
    pub fn other(&self, part: usize) -> Option<usize> {
        match self.parts {
            [a, b] if a == part => Some(b),
            [a, b] if b == part => Some(a),
            _ => None,
        }
    }

    /// All of it in words.
    pub fn words(&self) -> String {
        let fits = self.fits.iter().map(|fit| format!("; {fit}"));
        fits.fold(self.kinds.clone(), |words, fit| words + &fit)
    }
}

/// Kinds of a connection in words.
fn kinds(edge: &Edge) -> String {
    match edge.kinds.is_empty() {
        true => "overlapping".to_owned(),
        false => words(&edge.kinds),
    }
}

fn fit(fit: &Fit) -> String {
    let of = if fit.is_round { "" } else { "profile in " };
    let (diameter, um) = (2.0 * fit.radius_mm, 2e3 * fit.clearance_mm);
    match um < -0.05 {
        true => format!("{of}Ø {diameter:.3} mm, overlap {:.1} µm", -um),
        false => format!("{of}Ø {diameter:.3} mm, clearance {:.1} µm", um.max(0.0)),
    }
}

/// Texts in their order, equal ones once, with their number.
fn counted(texts: impl Iterator<Item = String>) -> Vec<String> {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for text in texts {
        match counts.iter_mut().find(|(known, _)| *known == text) {
            Some((_, count)) => *count += 1,
            None => counts.push((text, 1)),
        }
    }
    let with_number = |(text, count)| match count {
        1 => text,
        count => format!("{count} × {text}"),
    };
    counts.into_iter().map(with_number).collect()
}

/// The connections of an assembly.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    /// Pairs that are connected, by ascending parts.
    pub edges: Vec<Connected>,
    /// Where the parts were.
    poses: Vec<DAffine3>,
}

impl Graph {
    /// The connections of an assembly whose parts are placed where they are.
    pub fn new(assembly: &Assembly) -> Self {
        let mut edges: Vec<Connected> = graph(assembly).edge_weights().map(Connected::new).collect();
        edges.sort_by_key(|edge| edge.parts);
        Self {
            edges,
            poses: (assembly.model.parts.iter()).map(|part| part.placement).collect(),
        }
    }

    /// Connections of a part, with the other part of each.
    pub fn of(&self, part: usize) -> impl Iterator<Item = (usize, &Connected)> {
        (self.edges.iter()).filter_map(move |edge| Some((edge.other(part)?, edge)))
    }

    /// The parts to draw of an assembly of `count` parts, at most `most` of them: all, or the selected one and those it is connected with.
    pub fn to_draw(&self, count: usize, selected: Option<usize>, most: usize) -> Vec<usize> {
        if count <= most {
            return (0..count).collect();
        }
        let Some(part) = selected else { return Vec::new() };
        let others = self.of(part).map(|(other, _)| other);
        std::iter::once(part).chain(others).take(most).collect()
    }

    /// What [`to_draw`](Self::to_draw) leaves out, in words; `None` where it is nothing.
    pub fn left_out(&self, count: usize, selected: Option<usize>, most: usize) -> Option<String> {
        if count <= most {
            return None;
        }
        let with = match selected.map(|part| self.of(part).count()) {
            None => " with those it is connected with: select one".to_owned(),
            Some(0) => ", which is connected with none".to_owned(),
            Some(1) => " with the one it is connected with".to_owned(),
            Some(others) if others < most => format!(" with the {others} it is connected with"),
            Some(others) => format!(" with {} of the {others} it is connected with", most - 1),
        };
        Some(format!("Of {count} parts the selected one is shown{with}"))
    }

    /// Whether parts have moved since.
    pub fn is_outdated(&self, document: &Document) -> bool {
        !are_same(&self.poses, &document.poses)
    }
}

/// What a search found.
pub struct ConnectionsFound {
    /// Number of the search.
    pub id: u64,
    /// The connections, or one line with the reason why there are none.
    pub result: Result<Graph, String>,
}

/// The search and what it found.
#[derive(Default)]
pub struct Connections {
    /// Number of searches so far.
    searches: u64,
    /// Start of the search under way.
    since: Option<Instant>,
    /// Document of the search.
    generation: Option<u64>,
    found: Option<Result<Graph, String>>,
}

impl Connections {
    /// Start of the search under way.
    pub fn since(&self) -> Option<Instant> {
        self.since
    }

    /// Number that changes with what is found.
    pub fn number(&self) -> u64 {
        self.searches
    }

    /// Whether a search was started in a document, also one that was cancelled or failed.
    pub fn was_asked(&self, document: &Document) -> bool {
        self.generation == Some(document.generation)
    }

    /// The connections of the open document, once they were found.
    pub fn found(&self, document: &Document) -> Option<&Graph> {
        let found = self.found.as_ref().filter(|_| self.was_asked(document));
        found?.as_ref().ok()
    }

    /// Why the search failed, in a line.
    pub fn failure(&self, document: &Document) -> Option<&str> {
        let found = self.found.as_ref().filter(|_| self.was_asked(document));
        found?.as_ref().err().map(String::as_str)
    }

    /// Begins a search in the document of this number; returns the number of the search.
    pub(super) fn begin(&mut self, generation: u64) -> u64 {
        *self = Self {
            searches: self.searches + 1,
            since: Some(Instant::now()),
            generation: Some(generation),
            found: None,
        };
        self.searches
    }

    /// Forgets the search under way: its thread ends by itself.
    pub(super) fn cancel(&mut self) {
        self.since = None;
        self.searches += 1;
    }

    /// Takes in what a search found, unless it is no longer wanted.
    pub(super) fn take_in(&mut self, found: ConnectionsFound) {
        if self.since.is_some() && found.id == self.searches {
            self.since = None;
            self.found = Some(found.result);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::DVec3;

    use super::*;

    fn of_file(file: &str) -> Assembly {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
        Assembly::new(mortise_brep::load_step(file).expect("a file of the repository")).expect("an assembly")
    }

    #[test]
    fn two_pins_in_a_plate_are_one_connection_with_its_fits() {
        let assembly = of_file("mating/tests/data/two_pin_exact.step");
        let graph = Graph::new(&assembly);
        assert_eq!(graph.edges.len(), 1);
        let edge = &graph.edges[0];
        assert_eq!(edge.parts, [0, 1]);
        assert_eq!(
            [edge.other(0), edge.other(1), edge.other(2)],
            [Some(1), Some(0), None]
        );
        assert!(
            edge.kinds.contains("inserted") && edge.kinds.contains("resting"),
            "{}",
            edge.kinds
        );
        assert!(edge.words().starts_with(&edge.kinds));
        assert!(edge.words().contains("2 × Ø ") && edge.words().contains(", clearance 0.0 µm"));
        let ends = [0, 1].map(|part| graph.of(part).map(|(other, _)| other).collect::<Vec<_>>());
        assert_eq!(ends, [vec![1], vec![0]]);
    }

    /// A hub with five others, of ten parts.
    #[test]
    fn of_a_large_assembly_the_selected_part_and_its_neighbours_are_drawn() {
        let edge = |other| Connected {
            parts: [0, other],
            kinds: String::new(),
            fits: Vec::new(),
        };
        let graph = Graph {
            edges: (1..=5).map(edge).collect(),
            poses: Vec::new(),
        };
        let drawn = |selected, most| {
            (
                graph.to_draw(10, selected, most),
                graph.left_out(10, selected, most),
            )
        };
        assert_eq!(drawn(None, 10), ((0..10).collect(), None));
        let (none, words) = drawn(None, 9);
        assert!(none.is_empty() && words.is_some_and(|words| words.ends_with("select one")));
        for (selected, most, parts, says) in [
            (0, 9, (0..6).collect(), "with the 5 it is"),
            (0, 6, (0..6).collect(), "with the 5 it is"),
            (0, 5, (0..5).collect(), "with 4 of the 5 it is"),
            (3, 5, vec![3, 0], "with the one it is"),
            (7, 5, vec![7], "connected with none"),
        ] {
            let (drawn, words) = drawn(Some(selected), most);
            assert_eq!(drawn, parts, "{selected} of {most}");
            let words = words.expect("some are left out");
            assert!(
                words.starts_with("Of 10 parts") && words.contains(says),
                "{words}"
            );
        }
    }

    #[test]
    fn a_fit_is_named_by_diameter_and_by_clearance_or_overlap() {
        let of = |clearance_mm| Fit {
            parts: [0, 1],
            is_round: true,
            is_through: true,
            center: DVec3::ZERO,
            axis: DVec3::Z,
            radius_mm: 5.0,
            clearance_mm,
            length_mm: 10.0,
        };
        assert_eq!(fit(&of(0.0125)), "Ø 10.000 mm, clearance 25.0 µm");
        assert_eq!(fit(&of(-1e-9)), "Ø 10.000 mm, clearance 0.0 µm");
        assert_eq!(fit(&of(-0.004)), "Ø 10.000 mm, overlap 8.0 µm");
        let profile = Fit {
            is_round: false,
            ..of(0.01)
        };
        assert_eq!(fit(&profile), "profile in Ø 10.000 mm, clearance 20.0 µm");
        let texts = ["a", "b", "a"].map(String::from);
        assert_eq!(counted(texts.into_iter()), ["2 × a", "b"]);
    }

    #[test]
    fn a_search_that_was_cancelled_or_replaced_gives_nothing() {
        let mut state = Connections::default();
        let first = state.begin(1);
        let second = state.begin(1);
        let found = |id| ConnectionsFound {
            id,
            result: Err("why".to_owned()),
        };
        state.take_in(found(first));
        assert!(state.since().is_some() && state.found.is_none());
        state.cancel();
        state.take_in(found(second));
        assert!(state.since().is_none() && state.found.is_none());
        let third = state.begin(1);
        state.take_in(found(third));
        assert!(state.since().is_none() && state.found.is_some());
    }
}
