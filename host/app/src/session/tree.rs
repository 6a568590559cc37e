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

#[cfg(test)]
mod tests {
    use glam::DAffine3;
    use mortise_brep::Part;

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
}
