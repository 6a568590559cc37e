//! The assembly as a tree, for the list of parts. Pure.

use mortise_brep::CadModel;

use super::groups::Groups;

/// A node of the tree.
#[derive(Clone, Debug, PartialEq)]
pub enum Branch {
    /// A subassembly and its children.
    Assembly {
        /// Its name.
        name: String,
        /// In file order.
        children: Vec<Branch>,
    },
    /// Parts that move as one.
    Group {
        /// Its name.
        name: String,
        /// Its parts, ascending.
        parts: Vec<usize>,
    },
    /// A part, by its index.
    Part(usize),
}

impl Branch {
    /// The parts of it, in its order.
    pub fn parts(&self) -> Vec<usize> {
        match self {
            Self::Assembly { children, .. } => children.iter().flat_map(Self::parts).collect(),
            Self::Group { parts, .. } => parts.clone(),
            Self::Part(part) => vec![*part],
        }
    }
}

/// The tree of a model's parts: groups first, then the others. Neighbours with the same path share a subassembly; the order is the file's.
pub fn tree(model: &CadModel, groups: &Groups) -> Vec<Branch> {
    let mut roots: Vec<Branch> = (groups.iter())
        .map(|group| Branch::Group {
            name: group.name.clone(),
            parts: group.parts().to_vec(),
        })
        .collect();
    for (index, part) in model.parts.iter().enumerate() {
        if groups.of(index).is_none() {
            insert(&mut roots, &part.path, index);
        }
    }
    roots
}

/// Name of the subassembly that consists of just these parts, ascending; of several within one another the innermost.
pub fn assembly_of<'a>(branches: &'a [Branch], parts: &[usize]) -> Option<&'a str> {
    branches.iter().find_map(|branch| match branch {
        Branch::Assembly { name, children } => {
            let inner = assembly_of(children, parts);
            inner.or_else(|| (branch.parts() == parts).then_some(name.as_str()))
        }
        _ => None,
    })
}

fn insert(branches: &mut Vec<Branch>, path: &[String], part: usize) {
    let Some((first, rest)) = path.split_first() else {
        branches.push(Branch::Part(part));
        return;
    };
    if let Some(Branch::Assembly { name, children }) = branches.last_mut()
        && name == first
    {
        insert(children, rest, part);
        return;
    }
    let mut children = Vec::new();
    insert(&mut children, rest, part);
    branches.push(Branch::Assembly {
        name: first.clone(),
        children,
    });
}

/// What of the tree a search finds: parts whose name, or whose subassembly's name, has every word of `query`, whatever the case of its letters.
pub fn found(branches: &[Branch], model: &CadModel, query: &str) -> Vec<Branch> {
    let words: Vec<String> = query.split_whitespace().map(str::to_lowercase).collect();
    matching(branches, model, &words)
}

fn matching(branches: &[Branch], model: &CadModel, words: &[String]) -> Vec<Branch> {
    let has = |name: &str| {
        let name = name.to_lowercase();
        words.iter().all(|word| name.contains(word.as_str()))
    };
    let kept = |branch: &Branch| match branch {
        Branch::Part(part) => {
            let name = model.parts.get(*part).map(|part| part.name.as_str());
            name.is_some_and(has).then(|| branch.clone())
        }
        Branch::Assembly { name, .. } | Branch::Group { name, .. } if has(name) => Some(branch.clone()),
        Branch::Group { name, parts } => {
            let of_part = |part: &&usize| model.parts.get(**part).is_some_and(|part| has(&part.name));
            let parts: Vec<usize> = parts.iter().filter(of_part).copied().collect();
            (!parts.is_empty()).then(|| Branch::Group {
                name: name.clone(),
                parts,
            })
        }
        Branch::Assembly { name, children } => {
            let children = matching(children, model, words);
            (!children.is_empty()).then(|| Branch::Assembly {
                name: name.clone(),
                children,
            })
        }
    };
    branches.iter().filter_map(kept).collect()
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;
    use mortise_brep::Part;
    use proptest::prelude::*;

    use super::*;
    use crate::session::groups::Group;

    #[test]
    fn parts_hang_under_their_subassemblies_in_file_order() {
        let part = |path: &[&str]| Part {
            name: "p".into(),
            path: path.iter().map(|s| (*s).to_owned()).collect(),
            shape: 0,
            placement: DAffine3::IDENTITY,
            color: None,
        };
        let model = CadModel {
            parts: vec![
                part(&[]),
                part(&["a"]),
                part(&["a", "b"]),
                part(&["a"]),
                part(&["c"]),
            ],
            ..CadModel::default()
        };
        let group = |name: &str, children| Branch::Assembly {
            name: name.into(),
            children,
        };
        assert_eq!(
            tree(&model, &Groups::default()),
            vec![
                Branch::Part(0),
                group(
                    "a",
                    vec![
                        Branch::Part(1),
                        group("b", vec![Branch::Part(2)]),
                        Branch::Part(3)
                    ]
                ),
                group("c", vec![Branch::Part(4)]),
            ]
        );
    }

    fn part(path: &[&str], name: &str) -> Part {
        Part {
            name: name.into(),
            path: path.iter().map(|s| (*s).to_owned()).collect(),
            shape: 0,
            placement: DAffine3::IDENTITY,
            color: None,
        }
    }

    fn parts_of(branches: &[Branch]) -> Vec<usize> {
        branches.iter().flat_map(Branch::parts).collect()
    }

    #[test]
    fn groups_come_first_and_a_subassembly_is_known_by_its_parts() {
        let model = CadModel {
            parts: vec![
                part(&[], "base"),
                part(&["gearbox"], "cover"),
                part(&["gearbox", "shaft"], "key"),
                part(&["gearbox", "shaft"], "wheel"),
            ],
            ..CadModel::default()
        };
        let poses = vec![DAffine3::IDENTITY; 4];
        let plain = tree(&model, &Groups::default());
        let name = |parts: &[usize]| assembly_of(&plain, parts);
        assert_eq!(name(&[2, 3]), Some("shaft"));
        assert_eq!(name(&[1, 2, 3]), Some("gearbox"));
        assert_eq!([name(&[1, 2]), name(&[0])], [None; 2]);
        let group = Group::new("lid".into(), vec![0, 2], &poses, &poses).expect("two parts");
        let all = tree(&model, &Groups::default().with(group));
        assert_eq!(parts_of(&all), [0, 2, 1, 3]);
        let find = |query: &str| parts_of(&found(&all, &model, query));
        assert_eq!(find("lid"), [0, 2], "by the group's name");
        assert_eq!(find("key"), [2], "or that of one of its parts");
    }

    #[test]
    fn a_search_finds_parts_by_all_words_of_their_own_or_their_subassembly() {
        let model = CadModel {
            parts: vec![
                part(&[], "Cover plate"),
                part(&["gearbox"], "cover"),
                part(&["gearbox", "shaft"], "key"),
                part(&["motor"], "Plate, upper cover"),
            ],
            ..CadModel::default()
        };
        let find = |query: &str| parts_of(&found(&tree(&model, &Groups::default()), &model, query));
        assert_eq!(find("COVER"), [0, 1, 3]);
        assert_eq!(find(" cover  plate"), [0, 3]);
        assert_eq!(find("gear"), [1, 2]);
        assert_eq!(find("bolt"), [0; 0]);
        assert_eq!(find(" "), [0, 1, 2, 3]);
    }

    proptest! {
        #[test]
        fn a_search_keeps_order_and_finds_every_name(names in prop::collection::vec("[a-cÄß ]{1,6}", 1..12), query in "[a-cÄß ]{0,4}") {
            let model = CadModel {
                parts: names.iter().enumerate().map(|(n, name)| part(&[["u", "v"][n % 2]], name)).collect(),
                ..CadModel::default()
            };
            let all = tree(&model, &Groups::default());
            let hits = parts_of(&found(&all, &model, &query));
            prop_assert!(hits.is_sorted_by(|a, b| a < b), "{hits:?}");
            let words: Vec<String> = query.to_lowercase().split_whitespace().map(str::to_owned).collect();
            let has = |n: &usize| words.iter().all(|word| names[*n].to_lowercase().contains(word));
            prop_assert!((0..names.len()).filter(has).eq(hits.iter().copied()));
            for (n, name) in names.iter().enumerate() {
                prop_assert!(parts_of(&found(&all, &model, name)).contains(&n));
            }
        }
    }
}
