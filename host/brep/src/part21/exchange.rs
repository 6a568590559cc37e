//! The scanned DATA of a STEP file, and how its arguments are read.

use std::collections::HashMap;
use std::ops::Range;

/// Largest coordinate or radius, in the file's unit: a thousand kilometres in millimetres, where a double still resolves 0.1 µm.
pub const LARGEST_LENGTH: f64 = 1e9;

/// A text error: its line and description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part21Error {
    /// The text does not begin with `ISO-10303-21;`.
    NotStep(String),
    /// The text ends before `END-ISO-10303-21;`.
    Truncated {
        /// Last line.
        line: u32,
        /// What is missing.
        missing: String,
    },
    /// Any other error.
    Invalid {
        /// Line, from 1.
        line: u32,
        /// Description of the error.
        what: String,
    },
}

/// One entity instance: `#id = body;`.
#[derive(Clone, Debug)]
pub struct Entity {
    /// Number, unique in the [`Exchange`].
    pub id: u64,
    /// Number as written in the file.
    pub written: u64,
    /// 0, or 1 + the index of its file in [`Exchange::files`].
    pub file: u32,
    /// Line in the file.
    pub line: u32,
    /// Range of its body in [`Exchange::bodies`].
    pub body: Range<usize>,
    /// Range of its references in [`Exchange::references`].
    pub references: Range<usize>,
}

/// The scanned DATA of a STEP file.
#[derive(Clone, Debug, Default)]
pub struct Exchange {
    /// Text between `HEADER;` and its `ENDSEC;`, without comments.
    pub header: Vec<u8>,
    /// Bodies of all entities, without comments and without space outside strings.
    pub bodies: Vec<u8>,
    /// Entities in file order.
    pub entities: Vec<Entity>,
    /// All references, entity after entity.
    pub references: Vec<u64>,
    /// Largest number in use.
    pub largest: u64,
    /// Index in `entities` by number.
    pub index: HashMap<u64, u32>,
    /// Entities with a number that is not a finite double, and the number.
    pub bad_numbers: Vec<(u32, String)>,
    /// Entities with a number beyond [`LARGEST_LENGTH`], and the number.
    pub large_numbers: Vec<(u32, f64)>,
    /// Names of the files appended to the first.
    pub files: Vec<String>,
    /// Signed scale of occurrences that mirror (negative) or scale; see [`super::operators`].
    pub scales: HashMap<usize, f64>,
    /// Skipped content, as text.
    pub warnings: Vec<String>,
}

impl Exchange {
    /// Body of an entity: `TYPE(…)`, or `(A(…)B(…))` for a complex one.
    pub fn body(&self, entity: usize) -> &[u8] {
        &self.bodies[self.entities[entity].body.clone()]
    }

    /// Numbers of the entities that an entity refers to.
    pub fn references_of(&self, entity: usize) -> &[u64] {
        &self.references[self.entities[entity].references.clone()]
    }

    /// Index of the entity with this number.
    pub fn find(&self, id: u64) -> Option<usize> {
        self.index.get(&id).map(|&i| i as usize)
    }

    /// Type of a simple entity; empty for a complex one.
    pub fn kind(&self, entity: usize) -> &str {
        keyword(self.body(entity))
    }

    /// Types of an entity: one, or all of a complex one.
    pub fn kinds(&self, entity: usize) -> Vec<&str> {
        let body = self.body(entity);
        match body.first() {
            Some(b'(') => split(&body[1..body.len() - 1], Cut::AfterGroup)
                .into_iter()
                .map(keyword)
                .collect(),
            _ => vec![keyword(body)],
        }
    }

    /// Arguments of a simple entity.
    pub fn arguments(&self, entity: usize) -> Vec<&[u8]> {
        arguments(self.body(entity))
    }

    /// Arguments of one of the types of a complex (or simple) entity.
    pub fn arguments_as(&self, entity: usize, kind: &str) -> Option<Vec<&[u8]>> {
        let body = self.body(entity);
        let parts = match body.first() {
            Some(b'(') => split(&body[1..body.len() - 1], Cut::AfterGroup),
            _ => vec![body],
        };
        parts
            .into_iter()
            .find(|part| keyword(part) == kind)
            .map(arguments)
    }

    /// "#12 CYLINDRICAL_SURFACE": label of an entity for a message.
    pub fn label(&self, entity: usize) -> String {
        let Entity { written, file, .. } = &self.entities[entity];
        let label = format!("#{written} {}", self.kinds(entity).join("+"));
        match (*file as usize)
            .checked_sub(1)
            .and_then(|file| self.files.get(file))
        {
            Some(name) => format!("{label} of {name}"),
            None => label,
        }
    }
}

/// The number in `#12`.
pub fn reference(argument: &[u8]) -> Option<u64> {
    std::str::from_utf8(argument.strip_prefix(b"#")?)
        .ok()?
        .parse()
        .ok()
}

/// All numbers in `(#1,#2)`.
pub fn references(argument: &[u8]) -> Vec<u64> {
    let inner = argument
        .strip_prefix(b"(")
        .and_then(|a| a.strip_suffix(b")"))
        .unwrap_or(argument);
    split(inner, Cut::AtComma)
        .into_iter()
        .filter_map(reference)
        .collect()
}

fn keyword(body: &[u8]) -> &str {
    let end = body.iter().position(|&b| b == b'(').unwrap_or(body.len());
    std::str::from_utf8(&body[..end]).unwrap_or_default()
}

fn arguments(body: &[u8]) -> Vec<&[u8]> {
    let start = body.iter().position(|&b| b == b'(').map_or(body.len(), |i| i + 1);
    let inner = &body[start..body.len().saturating_sub(1).max(start)];
    if inner.is_empty() {
        Vec::new()
    } else {
        split(inner, Cut::AtComma)
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Cut {
    AtComma,
    AfterGroup,
}

/// Splits the text at depth 0 and outside strings.
fn split(text: &[u8], cut: Cut) -> Vec<&[u8]> {
    let (mut parts, mut start, mut depth, mut quoted) = (Vec::new(), 0, 0usize, false);
    for (i, &byte) in text.iter().enumerate() {
        match byte {
            // A doubled quote closes and reopens the string, which has the same result.
            b'\'' => quoted = !quoted,
            _ if quoted => {}
            b'(' => depth += 1,
            b')' => {
                depth = depth.saturating_sub(1);
                if depth == 0 && cut == Cut::AfterGroup {
                    parts.push(&text[start..=i]);
                    start = i + 1;
                }
            }
            b',' if depth == 0 && cut == Cut::AtComma => {
                parts.push(&text[start..i]);
                start = i + 1;
            }
            _ => {}
        }
    }
    if cut == Cut::AtComma {
        parts.push(&text[start..]);
    }
    parts
}
