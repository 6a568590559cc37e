//! What a STEP file cannot say of an assembly, in a small TOML file: parts with a thread that the model leaves out, or without one although they are named like
//! a screw; and connections that no geometry shows.
//!
//! ```toml
//! [[part]]
//! name = "M6 *"                          # `*` stands for any characters; upper and lower case are the same
//! thread = true
//!
//! [[connection]]
//! between = ["bracket", "plate*"]        # every pair of these that touches or fits
//! kind = "welded"                        # a connection of the taxonomy (`kinds.toml`)
//! ```

use serde::Deserialize;

use crate::assembly::Assembly;
use crate::error::TaskError;
use crate::graph;
use crate::stated::Stated;
use crate::taxonomy::kinds;

/// The file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    part: Vec<PartEntry>,
    #[serde(default)]
    connection: Vec<ConnectionEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartEntry {
    name: String,
    thread: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ConnectionEntry {
    between: [String; 2],
    kind: String,
}

/// What `text` states of `assembly`, which has no catalogue yet.
///
/// # Errors
/// [`TaskError::Catalogue`] with what is wrong: no TOML of this form, a pattern without a part, an unknown kind, or a pair that does not touch.
pub fn read(text: &str, assembly: &Assembly) -> Result<Stated, TaskError> {
    let file: File = toml::from_str(text).map_err(|error| TaskError::Catalogue {
        what: error.to_string().trim().replace('\n', " "),
    })?;
    let mut read = Stated::default();
    for entry in &file.part {
        let parts = parts(assembly, &entry.name)?;
        read.threads
            .extend(parts.into_iter().map(|part| (part, entry.thread)));
    }
    let graph = graph::graph(assembly);
    for entry in &file.connection {
        let kind = kinds().named(&entry.kind).ok_or_else(|| unknown(&entry.kind))?;
        let [first, second] = [&entry.between[0], &entry.between[1]].map(|name| parts(assembly, name));
        let (first, second) = (first?, second?);
        let are_meant = |[a, b]: [usize; 2]| {
            (first.contains(&a) && second.contains(&b)) || (first.contains(&b) && second.contains(&a))
        };
        let touching = graph.edge_weights().map(|edge| edge.parts);
        let before = read.connections.len();
        read.connections
            .extend(touching.filter(|pair| are_meant(*pair)).map(|pair| (pair, kind)));
        if read.connections.len() == before {
            let [a, b] = &entry.between;
            let what = format!(
                "`{a}` and `{b}` do not touch, so they are not {}",
                kind.kind().words
            );
            return Err(TaskError::Catalogue { what });
        }
    }
    Ok(read)
}

/// Parts whose name is like a pattern.
fn parts(assembly: &Assembly, pattern: &str) -> Result<Vec<usize>, TaskError> {
    let found: Vec<usize> = (0..assembly.count())
        .filter(|&part| is_like(&pattern.to_lowercase(), &assembly.name(part).to_lowercase()))
        .collect();
    if found.is_empty() {
        let known: Vec<&str> = (0..assembly.count()).map(|part| assembly.name(part)).collect();
        let what = format!(
            "no part is named like `{pattern}`; the parts are {}",
            known.join(", ")
        );
        return Err(TaskError::Catalogue { what });
    }
    Ok(found)
}

/// Whether a name is like a pattern, in which `*` stands for any characters.
fn is_like(pattern: &str, name: &str) -> bool {
    let Some((before, after)) = pattern.split_once('*') else {
        return pattern == name;
    };
    let Some(rest) = name.strip_prefix(before) else {
        return false;
    };
    let mut starts = (rest.char_indices().map(|(at, _)| at)).chain([rest.len()]);
    starts.any(|at| is_like(after, &rest[at..]))
}

fn unknown(kind: &str) -> TaskError {
    let known: Vec<&str> = (kinds().connection.iter())
        .filter(|kind| !kind.group)
        .map(|kind| kind.name.as_str())
        .collect();
    TaskError::Catalogue {
        what: format!(
            "no kind of connection `{kind}`; the kinds are {}",
            known.join(", ")
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_like_patterns() {
        for (pattern, name) in [
            ("*", ""),
            ("rod", "rod"),
            ("m6 *", "m6 x 20"),
            ("*screw*", "cap screw 3"),
            ("a*b*c", "abbc"),
            ("ü*", "über"),
        ] {
            assert!(is_like(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [("rod", "rods"), ("m6 *", "m6"), ("a*b*c", "acb"), ("", "x")] {
            assert!(!is_like(pattern, name), "{pattern} {name}");
        }
    }
}
