//! Groups in projects: written, and joined again from the names of their parts. Pure.

use std::collections::BTreeMap;

use glam::DAffine3;

use super::document::Document;
use super::groups::{Group, Groups};
use crate::kept::project::KeptGroup;

/// A group of a project that the document does not have.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// Those of its parts that exist.
    pub parts: Vec<usize>,
    /// What is left out and why, as a sentence.
    pub why: String,
}

/// The groups of a document, as a project has them.
pub fn kept(document: &Document) -> Vec<KeptGroup> {
    let names = |group: &Group| {
        let parts = group.parts().iter();
        parts
            .filter_map(|&part| document.names.get(part).cloned())
            .collect()
    };
    (document.groups().iter())
        .map(|group| KeptGroup {
            name: group.name.clone(),
            parts: names(group),
        })
        .collect()
}

/// The groups of a project with the parts at `poses`, and those that cannot be joined.
pub fn joined(document: &Document, kept: &[KeptGroup], poses: &[DAffine3]) -> (Groups, Vec<LeftOut>) {
    let numbers: BTreeMap<_, usize> = document.names.iter().zip(0..).collect();
    let file: Vec<DAffine3> = document.model.parts.iter().map(|part| part.placement).collect();
    let (mut groups, mut left_out) = (Groups::default(), Vec::new());
    for group in kept {
        let found = group.parts.iter().map(|name| (name, numbers.get(name)));
        let missing = found.clone().find(|(_, part)| part.is_none());
        let parts: Vec<usize> = found.filter_map(|(_, part)| part.copied()).collect();
        let taken = parts.iter().find(|part| groups.of(**part).is_some());
        let joined = Group::new(group.name.clone(), parts.clone(), poses, &file);
        let why = match (missing, taken, joined) {
            (None, None, Some(_)) if parts.len() == poses.len() => "it has all parts of the model".to_owned(),
            (None, None, Some(joined)) => {
                groups = groups.with(joined);
                continue;
            }
            (Some((name, _)), ..) => format!("its part {} does not exist", name.name),
            (_, Some(part), _) => format!("{} is in another group", document.part_name(*part)),
            _ => "it has fewer than two parts".to_owned(),
        };
        let why = format!(
            "The group \"{}\" is left out: {why}; group its parts anew",
            group.name
        );
        left_out.push(LeftOut { parts, why });
    }
    (groups, left_out)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use glam::DVec3;
    use mortise_brep::CadModel;

    use super::*;
    use crate::kept::project::PartName;

    /// The sample with two more pegs.
    fn document() -> Document {
        let sample = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        let mut model = CadModel::clone(&sample.model);
        for number in 1..3 {
            let mut peg = model.parts[1].clone();
            peg.name = format!("peg {number}");
            peg.placement.translation += 30.0 * f64::from(number) * DVec3::X;
            model.parts.push(peg);
        }
        Document::of(model, None, "pegs".into(), 1)
    }

    #[test]
    fn groups_come_back_and_what_cannot_be_joined_is_named_with_the_reason() {
        let mut document = document();
        let name = |part: usize| document.names[part].clone();
        let unknown = PartName {
            within: vec![],
            name: "washer".into(),
            number: 0,
        };
        let group = |of: &str, parts: Vec<PartName>| KeptGroup {
            name: of.into(),
            parts,
        };
        let pegs = group("pegs", vec![name(1), name(3)]);
        let wrong = [
            (group("one", vec![name(2), name(2)]), "fewer than two"),
            (group("none", vec![]), "fewer than two"),
            (group("both", vec![name(2), name(3)]), "peg 2 is in another group"),
            (group("old", vec![name(2), unknown]), "washer does not exist"),
            (group("all", (0..4).map(name).collect()), "another group"),
        ];
        let all: Vec<KeptGroup> = std::iter::once(pegs.clone())
            .chain(wrong.iter().map(|(group, _)| group.clone()))
            .collect();
        let (groups, left_out) = joined(&document, &all, &document.poses);
        assert_eq!(left_out.len(), wrong.len());
        for (found, (group, words)) in left_out.iter().zip(&wrong) {
            assert!(
                found.why.contains(words) && found.why.contains(&group.name),
                "{found:?}"
            );
        }
        let whole = group("all", (0..4).map(name).collect());
        let (none, left_out) = joined(&document, &[whole], &document.poses);
        assert!(none.is_empty() && left_out[0].why.contains("all parts"));
        document.regroup(groups);
        assert_eq!(kept(&document), [pegs]);
    }
}
