//! Kinds of ports and connections, as data: `kinds.toml` beside this file.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize, Serializer};

/// What is known of a port.
#[derive(Clone, Debug)]
pub struct Facts {
    /// cylinder, profile, cone, plane or sphere.
    pub surface: &'static str,
    /// male or female; `None` of a plane.
    pub sex: Option<&'static str>,
    /// Of a hole: whether both ends are open.
    pub through: Option<bool>,
    /// Whether it has a thread.
    pub thread: bool,
    /// Angle of a cylinder that exists, degrees.
    pub span_deg: f64,
    /// Flats and other faces of a profile.
    pub sides: [usize; 2],
    /// Whether all sides and corners of a profile are equal.
    pub regular: bool,
    /// Length over diameter.
    pub slender: f64,
}

/// Conditions of a kind of port.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Conditions {
    surface: Option<Vec<String>>,
    sex: Option<String>,
    through: Option<bool>,
    thread: Option<bool>,
    regular: Option<bool>,
    span_deg: Option<[f64; 2]>,
    flats: Option<[usize; 2]>,
    rounds: Option<[usize; 2]>,
    slender: Option<[f64; 2]>,
}

impl Conditions {
    fn hold(&self, facts: &Facts) -> bool {
        fn same<T: PartialEq>(wanted: Option<&T>, known: Option<&T>) -> bool {
            wanted.is_none() || wanted == known
        }
        fn within<T: PartialOrd + Copy>(range: Option<[T; 2]>, value: T) -> bool {
            range.is_none_or(|[low, high]| low <= value && value <= high)
        }
        let is_of = |surfaces: &Vec<String>| surfaces.iter().any(|surface| surface == facts.surface);
        self.surface.as_ref().is_none_or(is_of)
            && same(self.sex.as_deref().as_ref(), facts.sex.as_ref())
            && same(self.through.as_ref(), facts.through.as_ref())
            && same(self.thread.as_ref(), Some(&facts.thread))
            && same(self.regular.as_ref(), Some(&facts.regular))
            && within(self.span_deg, facts.span_deg)
            && within(self.flats, facts.sides[0])
            && within(self.rounds, facts.sides[1])
            && within(self.slender, facts.slender)
    }
}

/// A kind of port.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PortKind {
    /// Its name.
    pub name: String,
    /// The more general kind.
    pub is: Option<String>,
    /// Its name in words.
    pub words: String,
    #[serde(default)]
    when: Conditions,
}

/// A kind of connection.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConnectionKind {
    /// Its name.
    pub name: String,
    /// The more general kind.
    pub is: Option<String>,
    /// Its name in words.
    pub words: String,
    /// Roth's term.
    pub roth: String,
    /// The geometry that shows it; `None`: a catalogue states it.
    #[serde(default)]
    pub from: Option<Evidence>,
    /// Directions in which the parts slide against each other.
    #[serde(default)]
    pub slides: usize,
    /// Axes about which they turn.
    #[serde(default)]
    pub turns: usize,
    /// Whether a turn is a slide, too.
    #[serde(default)]
    pub coupled: bool,
    /// Whether it does not come apart.
    #[serde(default)]
    permanent: bool,
    /// Whether neither part falls out of it.
    #[serde(default)]
    pub grips: bool,
    /// Whether it only groups others: no two parts are connected by it.
    #[serde(default)]
    pub group: bool,
}

/// Geometry that shows a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Evidence {
    /// A thread in a fit.
    Thread,
    /// A fit whose shaft is wider than its bore.
    Overlap,
    /// A profile in a profile.
    Profile,
    /// A shaft in a bore.
    Fit,
    /// Contact of tapers.
    Taper,
    /// Contact of a ball.
    Ball,
    /// Contact of planes.
    Plane,
}

/// All kinds.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Taxonomy {
    /// Kinds of ports.
    pub port: Vec<PortKind>,
    /// Kinds of connections, strongest first.
    pub connection: Vec<ConnectionKind>,
}

static KINDS: LazyLock<Taxonomy> = LazyLock::new(|| {
    // The file is part of the program, and tested; without it nothing would have a kind.
    toml::from_str(include_str!("kinds.toml")).unwrap_or(Taxonomy {
        port: Vec::new(),
        connection: Vec::new(),
    })
});

/// The kinds.
pub fn kinds() -> &'static Taxonomy {
    &KINDS
}

impl Taxonomy {
    /// The most special kind of a port, and the more general ones after it.
    pub fn of_port(&self, facts: &Facts) -> Vec<&PortKind> {
        let mut best: Vec<&PortKind> = Vec::new();
        for kind in &self.port {
            let line = self.port_line(kind);
            if line.len() > best.len() && line.iter().all(|kind| kind.when.hold(facts)) {
                best = line;
            }
        }
        best
    }

    /// A kind and the more general ones.
    fn port_line<'a>(&'a self, kind: &'a PortKind) -> Vec<&'a PortKind> {
        let above = |kind: &&'a PortKind| {
            let is = kind.is.as_ref()?;
            self.port.iter().find(|k| k.name == *is)
        };
        // A circle of kinds would have no end.
        std::iter::successors(Some(kind), above)
            .take(self.port.len())
            .collect()
    }

    /// The connection that a geometry shows.
    pub fn shown_by(&self, from: Evidence) -> Option<Connection> {
        let place = self.connection.iter().position(|kind| kind.from == Some(from))?;
        Some(Connection(place))
    }

    /// The connection of this name, if parts can be connected by it.
    pub fn named(&self, name: &str) -> Option<Connection> {
        let is_it = |kind: &ConnectionKind| kind.name == name && !kind.group;
        self.connection.iter().position(is_it).map(Connection)
    }
}

/// What connects two parts: a kind of the taxonomy, ordered strongest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Connection(usize);

impl Connection {
    /// Its kind.
    pub fn kind(self) -> &'static ConnectionKind {
        &KINDS.connection[self.0]
    }

    /// Whether it does not come apart, by itself or by a more general kind.
    pub fn is_permanent(self) -> bool {
        let above = |kind: &&'static ConnectionKind| {
            let is = kind.is.as_ref()?;
            KINDS.connection.iter().find(|k| k.name == *is)
        };
        (std::iter::successors(Some(self.kind()), above).take(KINDS.connection.len()))
            .any(|kind| kind.permanent)
    }
}

/// Kinds of connections in words.
pub fn words(kinds: &[Connection]) -> String {
    let words: Vec<&str> = kinds.iter().map(|kind| kind.kind().words.as_str()).collect();
    words.join(", ")
}

impl Serialize for Connection {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.kind().name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_one_of_a_known_kind_and_has_its_own_name() {
        let kinds: Taxonomy = toml::from_str(include_str!("kinds.toml")).expect("the kinds");
        assert!(kinds.port.len() >= 20, "{} kinds of ports", kinds.port.len());
        let ports = (kinds.port.iter()).map(|kind| (kind.name.as_str(), kind.is.as_deref()));
        let connections = (kinds.connection.iter()).map(|kind| (kind.name.as_str(), kind.is.as_deref()));
        for list in [ports.collect::<Vec<_>>(), connections.collect()] {
            for (i, (name, is)) in list.iter().enumerate() {
                assert!(
                    list[..i].iter().all(|(other, _)| other != name),
                    "{name} is twice there"
                );
                // More general kinds stand before, so there is no circle.
                let known = |is: &str| list[..i].iter().any(|(other, _)| *other == is);
                assert!(is.is_none_or(known), "{name} is a {is:?}");
            }
        }
    }

    #[test]
    fn every_geometry_shows_a_connection() {
        for from in [
            Evidence::Thread,
            Evidence::Overlap,
            Evidence::Profile,
            Evidence::Fit,
            Evidence::Taper,
            Evidence::Ball,
            Evidence::Plane,
        ] {
            assert!(kinds().shown_by(from).is_some(), "{from:?}");
        }
        assert_eq!(kinds().named("welded").map(Connection::is_permanent), Some(true));
        assert_eq!(
            kinds().named("screwed").map(Connection::is_permanent),
            Some(false)
        );
        assert_eq!(kinds().named("form_closure"), None);
    }

    /// Facts that differ in one condition have different kinds, and every kind of port is one of some facts.
    #[test]
    fn every_kind_of_port_is_reached() {
        let mut reached: Vec<&str> = Vec::new();
        for surface in ["cylinder", "profile", "cone", "plane", "sphere"] {
            for sex in [Some("male"), Some("female"), None] {
                for (through, thread, regular) in (0..8).map(|i| (i & 1 != 0, i & 2 != 0, i & 4 != 0)) {
                    for (span_deg, slender) in [(360.0, 2.0), (360.0, 0.1), (200.0, 2.0), (150.0, 2.0)] {
                        for sides in [[4, 0], [6, 0], [5, 0], [2, 2], [1, 1], [3, 5]] {
                            let facts = Facts {
                                surface,
                                sex,
                                through: Some(through),
                                thread,
                                span_deg,
                                sides,
                                regular,
                                slender,
                            };
                            let line = kinds().of_port(&facts);
                            reached.extend(line.iter().map(|kind| kind.name.as_str()));
                        }
                    }
                }
            }
        }
        for kind in &kinds().port {
            assert!(
                reached.contains(&kind.name.as_str()),
                "nothing is a {}",
                kind.name
            );
        }
    }
}
