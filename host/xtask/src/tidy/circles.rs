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
use crate::rust_source::{Word, words};

/// Folders of crates that have circles still, and are not checked until these are taken out. The list only shrinks.
const NOT_YET: &[&str] = &["host/app"];

/// Deepest chain of re-exports that is followed.
const MAX_HOPS: usize = 8;

/// Names from a crate's root to a module; its own name is the last.
type Name = Vec<String>;

/// A module of a crate: a file, or a part of one in braces.
#[derive(Debug, Default)]
struct Module {
    file: PathBuf,
    /// Its file, as a module: what a circle is made of.
    node: Name,
    children: BTreeSet<String>,
    /// Names that `use` brings in, and the paths they stand for, from the root.
    aliases: BTreeMap<String, Name>,
    /// Modules that `use …::*` opens.
    globs: Vec<Name>,
    /// Items that it defines.
    items: BTreeSet<String>,
    /// Paths it names, from the root, each with its line.
    paths: Vec<(Name, usize)>,
    /// It has code of its own.
    has_code: bool,
}

/// All modules of one crate.
type Crate = BTreeMap<Name, Module>;

/// Circles in every crate whose root is among `files`.
///
/// # Errors
/// When a source cannot be read.
pub fn check(root: &Path, files: &[PathBuf]) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    for file in files.iter().filter(|file| is_root(file)) {
        if NOT_YET.iter().any(|folder| file.starts_with(folder)) {
            continue;
        }
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

/// Reads `file` as the module `name`, and the modules it declares.
fn collect(
    modules: &mut Crate,
    file: PathBuf,
    name: Name,
    read: &dyn Fn(&Path) -> Result<Option<String>>,
) -> Result<()> {
    let Some(text) = read(&file)? else {
        return Ok(());
    };
    let words = words(&text);
    let mut reader = Reader {
        words: &words,
        file: &file,
        node: name.clone(),
        modules,
        declared: Vec::new(),
    };
    reader.module(0, words.len(), &name);
    let declared = reader.declared;
    // `a.rs` and `a/mod.rs` have their children in the same folder.
    let stem = file
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let parent = file.parent().unwrap_or(Path::new(""));
    let own = name.is_empty() || stem == "mod";
    let folder = if own {
        parent.to_path_buf()
    } else {
        parent.join(stem)
    };
    for (child, within) in declared {
        let place = within.iter().fold(folder.clone(), |place, part| place.join(part));
        let candidates = [
            place.join(format!("{child}.rs")),
            place.join(&child).join("mod.rs"),
        ];
        let mut path = name.clone();
        path.extend(within);
        path.push(child);
        for candidate in candidates {
            if !modules.contains_key(&path) {
                collect(modules, candidate, path.clone(), read)?;
            }
        }
    }
    Ok(())
}

/// Reads the words of one file.
struct Reader<'a, 's> {
    words: &'a [Word<'s>],
    file: &'a Path,
    node: Name,
    modules: &'a mut Crate,
    /// Modules in files of their own: name, and the inline modules round the declaration.
    declared: Vec<(String, Name)>,
}

impl Reader<'_, '_> {
    fn text(&self, at: usize) -> &str {
        self.words.get(at).map_or("", |word| word.text)
    }

    fn is_path_sign(&self, at: usize) -> bool {
        self.text(at) == ":" && self.text(at + 1) == ":"
    }

    /// The words `from..to` as the body of the module `name`.
    fn module(&mut self, from: usize, to: usize, name: &Name) {
        let mut module = Module {
            file: self.file.to_path_buf(),
            node: self.node.clone(),
            ..Module::default()
        };
        // Children first: a path may begin with one that is declared below it.
        let mut at = from;
        while at < to {
            if self.text(at) == "mod" && is_name(self.text(at + 1)) && matches!(self.text(at + 2), ";" | "{")
            {
                module.children.insert(self.text(at + 1).to_owned());
            }
            at = if self.text(at) == "{" {
                self.closing(at)
            } else {
                at + 1
            };
        }
        let mut at = from;
        while at < to {
            at = self.item(at, name, &mut module);
        }
        self.modules.insert(name.clone(), module);
    }

    /// Reads what begins at `at`; gives where it ends.
    fn item(&mut self, at: usize, name: &Name, module: &mut Module) -> usize {
        let next = self.text(at + 1).to_owned();
        match self.text(at) {
            "mod" if is_name(&next) && self.text(at + 2) == ";" => {
                let within = name[self.node.len()..].to_vec();
                self.declared.push((next, within));
                at + 3
            }
            "mod" if is_name(&next) && self.text(at + 2) == "{" => {
                let end = self.closing(at + 2);
                let mut child = name.clone();
                child.push(next);
                self.module(at + 3, end, &child);
                end + 1
            }
            // Not of `r#use`, and no bound `use<'a>`.
            "use" if next != "<" => {
                let mut found = Vec::new();
                let end = self.tree(at + 1, &Vec::new(), &mut found);
                let line = self.words[at].line;
                for (path, alias) in found {
                    let Some(path) = absolute(&path, name, module) else {
                        continue;
                    };
                    match alias.as_str() {
                        "*" => module.globs.push(path.clone()),
                        "_" => {}
                        _ => {
                            module.aliases.insert(alias, path.clone());
                        }
                    }
                    module.paths.push((path, line));
                }
                end + 1
            }
            "#" => {
                let open = if next == "!" { at + 2 } else { at + 1 };
                self.closing(open) + 1
            }
            "pub" if next == "(" => self.closing(at + 1) + 1,
            "pub" => at + 1,
            word => {
                module.has_code = true;
                if matches!(
                    word,
                    "fn" | "struct" | "enum" | "union" | "trait" | "const" | "static" | "type"
                ) && is_name(&next)
                {
                    module.items.insert(next);
                } else if is_name(word) && self.is_path_sign(at + 1) && !self.follows_path(at) {
                    let (path, end) = self.path(at);
                    if let Some(path) = absolute(&path, name, module) {
                        module.paths.push((path, self.words[at].line));
                    }
                    return end;
                }
                at + 1
            }
        }
    }

    /// True if the word continues a path.
    fn follows_path(&self, at: usize) -> bool {
        at >= 2 && self.is_path_sign(at - 2)
    }

    /// The path in code that begins at `at`, and where it ends.
    fn path(&self, at: usize) -> (Name, usize) {
        let mut path = vec![self.text(at).to_owned()];
        let mut at = at + 1;
        while self.is_path_sign(at) && is_name(self.text(at + 2)) {
            path.push(self.text(at + 2).to_owned());
            at += 3;
        }
        (path, at)
    }

    /// The paths of a `use` from `at` on, each with the name it brings in; gives where the last word is.
    fn tree(&self, mut at: usize, before: &Name, found: &mut Vec<(Name, String)>) -> usize {
        let mut path = before.clone();
        loop {
            match self.text(at) {
                "{" => {
                    at += 1;
                    while !matches!(self.text(at), "}" | "") {
                        at = self.tree(at, &path, found);
                        if self.text(at) == "," {
                            at += 1;
                        }
                    }
                    return at + 1;
                }
                "*" => {
                    found.push((path, "*".to_owned()));
                    return at + 1;
                }
                ":" => at += 1,
                "as" => {
                    found.push((path, self.text(at + 1).to_owned()));
                    return at + 2;
                }
                word if is_name(word) => {
                    // `a::{self}` is `a`.
                    if word != "self" || path.is_empty() {
                        path.push(word.to_owned());
                    }
                    at += 1;
                }
                _ => {
                    let alias = path.last().cloned().unwrap_or_default();
                    found.push((path, alias));
                    return at;
                }
            }
        }
    }

    /// Where the bracket that opens at `open` closes.
    fn closing(&self, open: usize) -> usize {
        let mut depth = 0usize;
        for at in open..self.words.len() {
            match self.text(at) {
                "{" | "(" | "[" => depth += 1,
                "}" | ")" | "]" => {
                    depth = depth.saturating_sub(1);
                    if depth == 0 {
                        return at;
                    }
                }
                _ => {}
            }
        }
        self.words.len()
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|letter: char| letter.is_alphabetic() || letter == '_')
}

/// A path as written in the module `name`, from the crate's root; `None` for one that leads out of the crate.
fn absolute(path: &[String], name: &Name, module: &Module) -> Option<Name> {
    let mut rest = path;
    let mut base = match rest.first()?.as_str() {
        "crate" => {
            rest = &rest[1..];
            Name::new()
        }
        "self" => {
            rest = &rest[1..];
            name.clone()
        }
        "super" => name.clone(),
        first if module.children.contains(first) => name.clone(),
        _ => return None,
    };
    while rest.first().is_some_and(|part| part == "super") {
        base.pop();
        rest = &rest[1..];
    }
    base.extend(rest.iter().cloned());
    Some(base)
}

/// The module in which the item at `path` is defined.
fn resolve(modules: &Crate, path: &[String], hops: usize) -> Option<Name> {
    let mut at = Name::new();
    let mut rest = path;
    while let Some((first, after)) = rest.split_first() {
        let module = modules.get(&at)?;
        let mut child = at.clone();
        child.push(first.clone());
        if modules.contains_key(&child) {
            (at, rest) = (child, after);
            continue;
        }
        if module.items.contains(first) || hops == 0 {
            break;
        }
        let through = |to: &Name| {
            let mut path = to.clone();
            path.extend(after.iter().cloned());
            resolve(modules, &path, hops - 1)
        };
        if let Some(to) = module.aliases.get(first).filter(|to| to.as_slice() != path) {
            return through(to);
        }
        let opened = module.globs.iter().filter(|to| **to != at).find_map(|to| {
            let within = modules.get(&resolve(modules, to, hops - 1)?)?;
            let known = within.items.contains(first) || within.aliases.contains_key(first);
            known.then_some(to)
        });
        if let Some(to) = opened {
            let mut path = to.clone();
            path.extend(rest.iter().cloned());
            return resolve(modules, &path, hops - 1);
        }
        break;
    }
    Some(at)
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
