//! Import circles: modules of one crate that need each other.
//!
//! A module is a node, a path to another module of the crate an edge: in `use` and in code, tests included, doc links and comments left out. A path
//! through a re-export leads to the module that defines the item. A folder of modules counts as one node among its neighbours; within the folder
//! its files are nodes again, and so is the folder's own file unless it only declares and re-exports.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::Result;

use super::finding::Finding;
use super::tree;
use crate::modules::{Crate, MAX_HOPS, Name, collect, resolve};

/// Circles in every crate whose root is among `files`.
///
/// # Errors
/// When a source cannot be read.
pub fn check(root: &Path, files: &[PathBuf]) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    for file in files.iter().filter(|file| is_root(file)) {
        let read = |file: &Path| -> Result<Option<String>> {
            let known = files.binary_search(&file.to_path_buf()).is_ok();
            known.then(|| tree::read(root, file)).transpose()
        };
        let mut modules = Crate::new();
        collect(&mut modules, file.clone(), Vec::new(), &read)?;
        findings.extend(circles(&modules));
    }
    Ok(findings)
}

/// A crate's root: of a library, a program, a test or an example.
fn is_root(file: &Path) -> bool {
    let folder = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let (name, parent) = (folder(file), file.parent().map(folder).unwrap_or_default());
    match parent.as_str() {
        "src" => name == "lib.rs" || name == "main.rs",
        "bin" | "tests" | "examples" | "fuzz_targets" => {
            // Not a folder of tests among the modules of a crate.
            let within = file.ancestors().skip(2).any(|place| place.ends_with("src"));
            name.ends_with(".rs") && !(within && parent != "bin")
        }
        _ => false,
    }
}

/// A use of one node by another, and where it stands.
type Edges = BTreeMap<String, BTreeMap<String, (PathBuf, usize)>>;

/// One finding for each group of nodes that need each other.
fn circles(modules: &Crate) -> Vec<Finding> {
    // Folder by folder; the folder's own file is the node of no name.
    let mut folders: BTreeMap<Name, Edges> = BTreeMap::new();
    for module in modules.values() {
        let from = &module.node;
        for (path, line) in &module.paths {
            let Some(to) = resolve(modules, path, MAX_HOPS) else {
                continue;
            };
            let to = &modules[&to].node;
            if to == from {
                continue;
            }
            let common = from.iter().zip(to).take_while(|(a, b)| a == b).count();
            let node = |name: &Name| name.get(common).cloned().unwrap_or_default();
            let folder = &from[..common];
            let facade = |name: &Name| {
                name.len() == common && !modules.values().any(|part| part.node == *name && part.has_code)
            };
            if facade(from) || facade(to) {
                continue;
            }
            let edges = folders.entry(folder.to_vec()).or_default();
            let place = (module.file.clone(), *line);
            edges
                .entry(node(from))
                .or_default()
                .entry(node(to))
                .or_insert(place);
        }
    }
    folders
        .iter()
        .flat_map(|(folder, edges)| folder_circles(folder, edges))
        .collect()
}

/// The shortest circle through each node that is in one, each circle once.
fn folder_circles(folder: &Name, edges: &Edges) -> Vec<Finding> {
    let mut seen: BTreeSet<BTreeSet<&str>> = BTreeSet::new();
    let mut findings = Vec::new();
    for start in edges.keys() {
        let Some(circle) = shortest(start, edges) else {
            continue;
        };
        if !seen.insert(circle.iter().copied().collect()) {
            continue;
        }
        let shown = |node: &str| {
            let whole: Vec<&str> = folder.iter().map(String::as_str).chain([node]).collect();
            let path = whole.join("::");
            let path = path.trim_end_matches("::").to_owned();
            if path.is_empty() {
                "the crate's root".to_owned()
            } else {
                path
            }
        };
        let steps: Vec<String> = circle
            .iter()
            .zip(circle.iter().cycle().skip(1))
            .map(|(from, to)| {
                let (file, line) = &edges[*from][*to];
                format!("{} needs {} ({}:{line})", shown(from), shown(to), file.display())
            })
            .collect();
        let (file, line) = edges[circle[0]][circle[1 % circle.len()]].clone();
        let what = format!("modules need each other: {}", steps.join(", "));
        findings.push(Finding { file, line, what });
    }
    findings
}

/// The nodes of the shortest circle through `start`, from it on.
fn shortest<'e>(start: &'e str, edges: &'e Edges) -> Option<Vec<&'e str>> {
    let mut before: BTreeMap<&str, &str> = BTreeMap::new();
    let mut wave = vec![start];
    while !wave.is_empty() {
        let mut next = Vec::new();
        for from in wave {
            for to in edges.get(from).into_iter().flat_map(BTreeMap::keys) {
                if to == start {
                    let mut circle = vec![from];
                    while let Some(previous) = before.get(circle[circle.len() - 1]) {
                        circle.push(previous);
                    }
                    circle.reverse();
                    return Some(circle);
                }
                if !before.contains_key(to.as_str()) {
                    before.insert(to, from);
                    next.push(to.as_str());
                }
            }
        }
        wave = next;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Circles of a crate with these files below `src`, each as the words after the place.
    fn found(sources: &[(&str, &str)]) -> Vec<String> {
        let read = |file: &Path| -> Result<Option<String>> {
            let known = sources
                .iter()
                .find(|(name, _)| Path::new("src").join(name) == file);
            Ok(known.map(|(_, text)| (*text).to_owned()))
        };
        let mut modules = Crate::new();
        collect(&mut modules, "src/lib.rs".into(), Name::new(), &read).unwrap();
        circles(&modules)
            .into_iter()
            .map(|finding| finding.what)
            .collect()
    }

    #[test]
    fn two_modules_that_need_each_other_are_found_with_their_lines() {
        let sources = [
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "use crate::b::B;\npub struct A(B);"),
            ("b.rs", "pub struct B;\nfn f() { super::c::g(); }"),
            ("c.rs", "pub fn g() -> crate::a::A { todo() }"),
        ];
        assert_eq!(
            found(&sources),
            [
                "modules need each other: a needs b (src/a.rs:1), b needs c (src/b.rs:2), c needs a (src/c.rs:1)"
            ]
        );
    }

    #[test]
    fn comments_and_doc_links_are_no_use() {
        let sources = [
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", "use crate::b::B;\npub struct A(B);"),
            ("b.rs", "//! See [`crate::a::A`].\npub struct B; // crate::a::A"),
        ];
        assert!(found(&sources).is_empty());
    }

    #[test]
    fn a_path_through_a_re_export_leads_to_the_definition() {
        let lib = "mod a; mod b; pub use a::A; pub use b::*;";
        let sources = [
            ("lib.rs", lib),
            ("a.rs", "use crate::B; pub struct A(B);"),
            ("b.rs", "pub struct B;"),
        ];
        assert!(found(&sources).is_empty(), "{:?}", found(&sources));
        let both = [sources[0], sources[1], ("b.rs", "use crate::A; pub struct B(A);")];
        assert_eq!(found(&both).len(), 1);
    }

    #[test]
    fn a_folder_is_one_node_and_its_own_file_another_when_it_has_code() {
        let facade = [
            ("lib.rs", "mod a; mod z;"),
            ("a/mod.rs", "mod one; mod two; pub use one::One;"),
            ("a/one.rs", "pub struct One; use super::two::Two;"),
            ("a/two.rs", "pub struct Two; use crate::z::Z;"),
            ("z.rs", "pub struct Z;"),
        ];
        assert!(found(&facade).is_empty(), "{:?}", found(&facade));
        let mut back = facade;
        back[4] = ("z.rs", "pub struct Z; use crate::a::One;");
        assert_eq!(found(&back).len(), 1, "a needs z, z needs a");
        let mut own = facade;
        own[1] = ("a/mod.rs", "mod one; mod two; pub struct Own(one::One);");
        own[3] = ("a/two.rs", "pub struct Two; use super::Own;");
        assert_eq!(found(&own).len(), 1);
    }

    #[test]
    fn tests_beside_the_code_count_for_their_file() {
        let sources = [
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", "pub struct A; use crate::b::B;"),
            (
                "b.rs",
                "pub struct B; mod tests { use super::*; use super::super::a::A; }",
            ),
        ];
        assert_eq!(found(&sources).len(), 1);
    }
}
