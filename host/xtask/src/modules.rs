//! Modules of a crate, and the paths by which they name each other: in `use` and in code, tests included, doc links and comments left out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::rust_source::{Word, words};

/// Deepest chain of re-exports that is followed.
pub const MAX_HOPS: usize = 8;

/// Names from a crate's root to a module; its own name is the last.
pub type Name = Vec<String>;

/// A module of a crate: a file, or a part of one in braces.
#[derive(Debug, Default)]
pub struct Module {
    pub file: PathBuf,
    /// Its file, as a module: what a circle is made of.
    pub node: Name,
    pub children: BTreeSet<String>,
    /// Names that `use` brings in, and the paths they stand for, from the root.
    pub aliases: BTreeMap<String, Name>,
    /// Modules that `use …::*` opens.
    pub globs: Vec<Name>,
    /// Items that it defines.
    pub items: BTreeSet<String>,
    /// Paths it names, from the root, each with its line.
    pub paths: Vec<(Name, usize)>,
    /// It has code of its own.
    pub has_code: bool,
}

/// All modules of one crate.
pub type Crate = BTreeMap<Name, Module>;

/// The files that each file of a crate names, tests included, a path through a re-export leading to the file that defines the item. `crate_root`: its
/// `lib.rs` or `main.rs`, from `root`.
///
/// # Errors
/// When a source cannot be read.
pub fn uses(root: &Path, crate_root: &Path) -> Result<BTreeMap<PathBuf, BTreeSet<PathBuf>>> {
    let read = |file: &Path| -> Result<Option<String>> {
        let known = root.join(file).is_file();
        known
            .then(|| {
                std::fs::read_to_string(root.join(file))
                    .with_context(|| format!("reading {}", file.display()))
            })
            .transpose()
    };
    let mut modules = Crate::new();
    collect(&mut modules, crate_root.to_path_buf(), Vec::new(), &read)?;
    let mut uses: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
    for module in modules.values() {
        let named = uses.entry(module.file.clone()).or_default();
        for (path, _) in &module.paths {
            named.extend(resolve(&modules, path, MAX_HOPS).map(|to| modules[&to].file.clone()));
        }
    }
    Ok(uses)
}

/// Reads `file` as the module `name`, and the modules it declares.
pub fn collect(
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
pub fn resolve(modules: &Crate, path: &[String], hops: usize) -> Option<Name> {
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
