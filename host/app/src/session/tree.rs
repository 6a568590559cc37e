//! The assembly as a tree, for the list of parts. Pure.

use mortise_brep::CadModel;

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
    /// A part, by its index.
    Part(usize),
}

/// The tree of a model's parts. Neighbours with the same path share a subassembly; the order is the file's.
pub fn tree(model: &CadModel) -> Vec<Branch> {
    let mut roots = Vec::new();
    for (index, part) in model.parts.iter().enumerate() {
        insert(&mut roots, &part.path, index);
    }
    roots
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
        Branch::Assembly { name, .. } if has(name) => Some(branch.clone()),
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
            tree(&model),
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
        let of = |branch: &Branch| match branch {
            Branch::Part(part) => vec![*part],
            Branch::Assembly { children, .. } => parts_of(children),
        };
        branches.iter().flat_map(of).collect()
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
        let find = |query: &str| parts_of(&found(&tree(&model), &model, query));
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
            let all = tree(&model);
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
