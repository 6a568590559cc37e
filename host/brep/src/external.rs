//! A STEP file and the files it refers to, joined into one text.
//!
//! Referenced files are read only from the folder of the main file: a name with a folder, an absolute path, a symbolic link or anything but a regular
//! file is refused. A missing file is a warning. Each file is read once, regardless of the number of references to it; cycles are refused; depth,
//! number and total size are limited.

use crate::part21::check::{self, Content};
use crate::part21::documents::{self, Document};
use crate::part21::structure::{Structure, argument};
use crate::part21::{self, Exchange, Part21Error, text, units};
use crate::{BrepError, LoadOptions};
use std::collections::HashMap;
use std::fs::{File, Metadata};
use std::io::Read as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Longest chain of files, each of which refers to the next.
const MAX_DEPTH: usize = 32;
/// Most files per assembly.
const MAX_FILES: usize = 10_000;

/// The joined text.
pub struct Joined {
    /// All entities, those of the main file first.
    pub file: Exchange,
    /// Its solids and surfaces.
    pub content: Content,
    /// Names of the length units of the main file.
    pub units: Vec<String>,
    /// All files, the main one first.
    pub files: Vec<PathBuf>,
    /// Names of referenced files that are missing.
    pub missing: Vec<String>,
}

/// Reads and checks `path` and all files it refers to.
///
/// # Errors
/// A fault in the text of any file; [`BrepError::Reference`] for a refused reference.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Joined, BrepError> {
    let shown = path.display().to_string();
    let bytes = read(path, None, options.text_limit_bytes)?;
    let left = options.text_limit_bytes - bytes.len() as u64;
    let (mut main, content) = parse(&shown, &bytes)?;
    let names = units::length_units(&main).map_err(|e| text_error(&shown, e))?;
    let documents = documents::documents(&main);
    if documents.is_empty() {
        documents::forget(&mut main);
        return Ok(Joined {
            file: main,
            content,
            units: names,
            files: vec![path.to_owned()],
            missing: Vec::new(),
        });
    }
    let mut warnings = content.warnings;
    warnings.append(&mut main.warnings);
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let mut set = Set {
        folder,
        joined: Exchange::default(),
        files: vec![path.to_owned()],
        known: HashMap::new(),
        real: HashMap::new(),
        missing: Vec::new(),
        warnings,
        left,
    };
    let structure = Structure::of(&main);
    set.joined = main;
    let mut chain = vec![name_of(path)];
    let all = 0..set.joined.entities.len();
    set.follow(&shown, &documents, &structure, all, &mut chain)?;
    let mut file = set.joined;
    documents::forget(&mut file);
    // Each text is valid; together they may still contain an assembly within itself.
    let mut content = check::check(&file).map_err(|e| text_error(&shown, e))?;
    content.warnings = set.warnings;
    Ok(Joined {
        file,
        content,
        units: names,
        files: set.files,
        missing: set.missing,
    })
}

/// Files joined so far.
struct Set<'a> {
    folder: &'a Path,
    joined: Exchange,
    files: Vec<PathBuf>,
    /// Root product of each file and its representation, by name; `None` when it has no unique one.
    known: HashMap<String, Option<[usize; 2]>>,
    /// Product definitions that were replaced, and their replacements.
    real: HashMap<usize, [usize; 2]>,
    missing: Vec<String>,
    warnings: Vec<String>,
    /// Remaining limit on the bytes of text.
    left: u64,
}

impl Set<'_> {
    /// Follows the references of one file, whose entities are `text`. `chain` lists the files from the main one to this one.
    fn follow(
        &mut self,
        shown: &str,
        documents: &[Document],
        structure: &Structure,
        text: Range<usize>,
        chain: &mut Vec<String>,
    ) -> Result<(), BrepError> {
        let mut complete = 0;
        for document in documents {
            let stub = text.start + document.definition;
            let product = self.product(stub);
            if structure.has_shape(document.definition) {
                complete += 1;
                continue;
            }
            if !documents::is_step(&document.name) {
                self.warnings.push(format!(
                    "{product} is left out: its shape is in {:?}, which is not a STEP file",
                    document.name
                ));
                continue;
            }
            let refused = |what: String| BrepError::Reference {
                path: shown.to_owned(),
                line: document.line,
                what,
            };
            let Some((name, found)) = self.resolve(&document.name).map_err(refused)? else {
                self.warnings.push(format!(
                    "{product} is left out: the file {:?} is missing; put it beside {shown}",
                    document.name
                ));
                if !self.missing.contains(&document.name) {
                    self.missing.push(document.name.clone());
                }
                continue;
            };
            if chain.contains(&name) {
                let round = chain.join(", ");
                return Err(refused(format!(
                    "refers to {name:?}, which refers back to it (by {round}); export the assembly again"
                )));
            }
            let root = match self.known.get(&name) {
                Some(root) => *root,
                None => {
                    if chain.len() > MAX_DEPTH || self.files.len() > MAX_FILES {
                        return Err(refused(format!(
                            "refers to {name:?}, beyond {MAX_DEPTH} levels or {MAX_FILES} files; export it as one file"
                        )));
                    }
                    let root = self.add(&name, &found, stub, chain)?;
                    self.known.insert(name, root);
                    root
                }
            };
            let Some(root) = root else {
                self.warnings.push(format!(
                    "{product} is left out: {:?} does not have exactly one matching product",
                    document.name
                ));
                continue;
            };
            self.joined.substitute(stub, root, structure, &text);
            self.real.insert(stub, root);
        }
        if complete > 0 {
            self.warnings.push(format!(
                "{shown}: {complete} products have a shape here, so the files that they also name are not read"
            ));
        }
        Ok(())
    }

    /// Reads and appends one file and all files it refers to; returns its root product.
    fn add(
        &mut self,
        name: &str,
        found: &Metadata,
        stub: usize,
        chain: &mut Vec<String>,
    ) -> Result<Option<[usize; 2]>, BrepError> {
        let path = self.folder.join(name);
        let shown = path.display().to_string();
        let bytes = read(&path, Some(found), self.left)?;
        self.left -= bytes.len() as u64;
        let (file, content) = parse(&shown, &bytes)?;
        units::length_units(&file).map_err(|e| text_error(&shown, e))?;
        let of_this = |warning: &String| format!("{name}: {warning}");
        self.warnings
            .extend(file.warnings.iter().chain(&content.warnings).map(of_this));
        let structure = Structure::of(&file);
        let documents = documents::documents(&file);
        let offset = self
            .joined
            .append(&file, name)
            .ok_or_else(|| BrepError::Invalid {
                path: shown.clone(),
                line: 1,
                what: "its entity numbers leave no numbers for those of other files".into(),
            })?;
        self.files.push(path);
        drop(file);
        chain.push(name.to_owned());
        let text = offset..self.joined.entities.len();
        self.follow(&shown, &documents, &structure, text, chain)?;
        chain.pop();
        let with_shape =
            |root: usize| Some([root + offset, structure.representations_of(root).next()? + offset]);
        let mut roots: Vec<[usize; 2]> = structure.roots().into_iter().filter_map(with_shape).collect();
        if roots.len() > 1 {
            let wanted = self.product(stub);
            roots.retain(|&[root, _]| self.product(root) == wanted);
        }
        Ok(match roots[..] {
            [root] => Some(self.real.get(&root[0]).copied().unwrap_or(root)),
            _ => None,
        })
    }

    /// The file of this name beside the main one; `None` when there is none. A name that differs only in case is accepted, as on other systems.
    fn resolve(&self, name: &str) -> Result<Option<(String, Metadata)>, String> {
        let bare = name
            .strip_prefix("./")
            .or_else(|| name.strip_prefix(".\\"))
            .unwrap_or(name);
        let leaves = bare.contains(['/', '\\', ':', '\0']) || bare.is_empty() || bare == ".." || bare == ".";
        if leaves {
            return Err(format!(
                "refers to the file {name:?}, which names a folder; only files of the same folder are read: put it there and name it alone"
            ));
        }
        let (bare, found) = match std::fs::symlink_metadata(self.folder.join(bare)) {
            Ok(found) => (bare.to_owned(), found),
            Err(_) => match self.in_other_case(bare) {
                Some(found) => found,
                None => return Ok(None),
            },
        };
        if found.file_type().is_symlink() {
            return Err(format!(
                "refers to the file {name:?}, which is a symbolic link and is not followed; put the file itself there"
            ));
        }
        if !found.is_file() {
            return Err(format!("refers to {name:?}, which is not a regular file"));
        }
        Ok(Some((bare, found)))
    }

    /// The file whose name differs only in case, if it is the only one.
    fn in_other_case(&self, name: &str) -> Option<(String, Metadata)> {
        let wanted = name.to_lowercase();
        let mut found = std::fs::read_dir(self.folder).ok()?.filter_map(|entry| {
            let name = entry.ok()?.file_name().into_string().ok()?;
            (name.to_lowercase() == wanted).then_some(name)
        });
        let name = found.next().filter(|_| found.next().is_none())?;
        let metadata = std::fs::symlink_metadata(self.folder.join(&name)).ok()?;
        Some((name, metadata))
    }

    /// Name of a product, for messages and for locating it.
    fn product(&self, definition: usize) -> String {
        let file = &self.joined;
        let product = argument(file, definition, 2).and_then(|formation| argument(file, formation, 2));
        let arguments = product.map(|product| file.arguments(product)).unwrap_or_default();
        let texts = [1, 0].map(|index| arguments.get(index).and_then(|argument| text::decode(argument)));
        let named = texts.into_iter().flatten().map(|name| name.trim().to_owned());
        let mut named = named.filter(|name| !name.is_empty());
        named.next().unwrap_or_else(|| file.label(definition))
    }
}

fn parse(shown: &str, bytes: &[u8]) -> Result<(Exchange, Content), BrepError> {
    if bytes.is_empty() {
        return Err(BrepError::Empty { path: shown.into() });
    }
    let mut file = part21::parse(bytes).map_err(|e| text_error(shown, e))?;
    let content = check::check(&file).map_err(|e| text_error(shown, e))?;
    part21::from_identity(&mut file);
    Ok((file, content))
}

/// Reads at most `limit` bytes. `expected` is the file that was found under this name: a different file is refused.
fn read(path: &Path, expected: Option<&Metadata>, limit: u64) -> Result<Vec<u8>, BrepError> {
    let unreadable = |reason: String| BrepError::Unreadable {
        path: path.display().to_string(),
        reason,
    };
    let open = || -> std::io::Result<Vec<u8>> {
        // Before it is opened: opening a pipe waits for its writer.
        let kind = std::fs::metadata(path)?.file_type();
        if !kind.is_file() && !kind.is_dir() {
            return Err(std::io::Error::other(
                "it is a pipe or a device, not a regular file",
            ));
        }
        let file = File::open(path)?;
        let opened = file.metadata()?;
        if expected.is_some_and(|expected| !same(expected, &opened)) {
            return Err(std::io::Error::other("it was replaced while being read"));
        }
        let mut bytes = Vec::new();
        file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let bytes = open().map_err(|e| unreadable(e.to_string()))?;
    if bytes.len() as u64 > limit {
        return Err(unreadable(format!(
            "the text of all files has more than {} MiB",
            limit >> 20
        )));
    }
    Ok(bytes)
}

#[cfg(unix)]
fn same(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

#[cfg(not(unix))]
fn same(a: &Metadata, b: &Metadata) -> bool {
    b.is_file() && a.len() == b.len()
}

fn name_of(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// A text error of the file `path`.
pub fn text_error(path: &str, error: Part21Error) -> BrepError {
    let path = path.into();
    match error {
        Part21Error::NotStep(found) => BrepError::NotStep { path, found },
        Part21Error::Truncated { line, missing } => BrepError::Truncated { path, line, missing },
        Part21Error::Invalid { line, what } => BrepError::Invalid { path, line, what },
    }
}
