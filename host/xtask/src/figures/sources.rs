//! A hash of the sources that an artefact depends on.
//!
//! For Rust files it covers the tokens: comments, documentation, white space and code compiled only for tests are excluded, so that rewording makes
//! no chart stale. Other files are hashed byte for byte. The hash is FNV-1a of 64 bits: it detects changes, and does not protect against deliberate
//! collisions.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::modules;
use crate::rust_source::words;

/// Roots of crates in which a figure depends on a few files: those it names, and the files that these use.
const FOLLOWED: &[&str] = &["host/lab/src/lib.rs", "host/scenario/src/lib.rs"];

/// What is used only to show what was measured, or to start it: not followed.
const SHOWN: &[&str] = &[
    "host/lab/src/chart",
    "host/lab/src/cli",
    "host/lab/src/error.rs",
    "host/lab/src/experiment.rs",
    "host/lab/src/experiments.rs",
    "host/lab/src/figures/mod.rs",
    "host/lab/src/lib.rs",
    "host/lab/src/table.rs",
    "host/scenario/src/error.rs",
    "host/scenario/src/lib.rs",
];

/// Hash of all files at and below `places`, paths from `root`, and in the crates of [`FOLLOWED`] of those that they use; files of tests are left out.
///
/// # Errors
/// When a place does not exist or cannot be read.
pub fn hash(root: &Path, places: &[&str]) -> Result<String> {
    let mut files = Vec::new();
    for place in places {
        let before = files.len();
        collect(root, Path::new(place), &mut files)?;
        if files.len() == before {
            bail!(
                "{place}, which a figure depends on, holds no file: correct host/xtask/src/figures/artefacts.rs"
            );
        }
    }
    let files = with_uses(root, files)?;
    let mut hash = Fnv::default();
    for file in files {
        let bytes = std::fs::read(root.join(&file)).with_context(|| format!("reading {}", file.display()))?;
        let name = file.to_string_lossy().replace('\\', "/");
        hash.add(name.as_bytes());
        if file.extension().is_some_and(|end| end == "rs") {
            hash.add(tokens(&String::from_utf8_lossy(&bytes)).as_bytes());
        } else {
            hash.add(&bytes);
        }
    }
    Ok(hash.text())
}

/// `files`, and those that they use.
fn with_uses(root: &Path, files: Vec<PathBuf>) -> Result<BTreeSet<PathBuf>> {
    let mut found: BTreeSet<PathBuf> = files.into_iter().collect();
    for crate_root in FOLLOWED
        .iter()
        .map(Path::new)
        .filter(|path| root.join(path).is_file())
    {
        let uses = modules::uses(root, crate_root)?;
        let mut open: Vec<PathBuf> = found.iter().cloned().collect();
        while let Some(file) = open.pop() {
            for used in uses.get(&file).into_iter().flatten() {
                let shown = SHOWN.iter().any(|place| used.starts_with(place));
                if !shown && found.insert(used.clone()) {
                    open.push(used.clone());
                }
            }
        }
    }
    Ok(found)
}

fn collect(root: &Path, place: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let full = root.join(place);
    let test = |path: &Path| path.file_stem().is_some_and(|name| name == "tests");
    if full.is_file() {
        files.push(place.to_path_buf());
        return Ok(());
    }
    let entries = std::fs::read_dir(&full).with_context(|| {
        format!(
            "reading {}, which a figure depends on (host/xtask/src/figures/artefacts.rs)",
            place.display()
        )
    })?;
    for entry in entries {
        let path = place.join(entry?.file_name());
        if !test(&path) {
            collect(root, &path, files)?;
        }
    }
    Ok(())
}

/// FNV-1a, 64 bits (Fowler, Noll, Vo).
pub struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    /// Adds bytes, followed by their length.
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes.iter().copied().chain((bytes.len() as u64).to_le_bytes()) {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// The hash as 16 hexadecimal digits.
    pub fn text(&self) -> String {
        format!("{:016x}", self.0)
    }
}

/// The tokens of a Rust source, separated by single spaces where two words had white space between them, without items under `#[cfg(test)]`.
fn tokens(source: &str) -> String {
    let words: Vec<&str> = words(source).iter().map(|word| word.text).collect();
    without_tests(&words).join(" ")
}

/// Drops what follows `#[cfg(test)]`: attributes, and an item to its `;` or closing brace.
fn without_tests<'s>(words: &[&'s str]) -> Vec<&'s str> {
    const TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut at = 0;
    while at < words.len() {
        let starts =
            words.len() - at >= TEST.len() && words[at..].iter().zip(TEST).all(|(word, test)| *word == test);
        if starts {
            at = end_of_item(words, at + TEST.len());
        } else {
            kept.push(words[at]);
            at += 1;
        }
    }
    kept
}

fn end_of_item(words: &[&str], mut at: usize) -> usize {
    let mut depth = 0usize;
    while at < words.len() {
        match words[at] {
            "{" | "(" | "[" => depth += 1,
            ")" | "]" => depth = depth.saturating_sub(1),
            "}" => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return at + 1;
                }
            }
            ";" if depth == 0 => return at + 1,
            _ => {}
        }
        at += 1;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = r##"
        //! Words.
        /// More /* words */.
        fn a<'a>(x: &'a str) -> char { /* none /* at */ all */ let _ = "// kept \" {"; let _ = r#"/* kept "#; '{' }
        #[cfg(test)]
        mod tests {
            use super::*; fn b() { '}' }
        }
        const C: u8 = b'\''; // the end
    "##;

    #[test]
    fn words_and_tests_do_not_count_and_all_else_does() {
        let found = tokens(SOURCE);
        assert!(found.contains(r#""// kept \" {""#), "{found}");
        assert!(found.contains(r##"r#"/* kept "#"##), "{found}");
        assert!(found.ends_with(r"const C : u8 = b '\'' ;"), "{found}");
        for gone in ["Words", "none", "all", "tests", "fn b", "the end"] {
            assert!(!found.contains(gone), "{gone}: {found}");
        }
        let reworded = SOURCE
            .replace("Words", "Other words")
            .replace("fn b()", "fn other()")
            .replace("{ /*", "{\n\n/*");
        assert_eq!(tokens(&reworded), found);
        assert_ne!(tokens(&SOURCE.replace("kept", "lost")), found);
        assert_ne!(tokens(&SOURCE.replace("u8", "u16")), found);
    }

    #[test]
    fn a_hash_sees_every_file_but_those_of_tests() {
        let place = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = place.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let now = || hash(place.path(), &["src", "data.toml"]).unwrap();
        write("src/deep/a.rs", "fn a() {}");
        write("data.toml", "a = 1");
        let first = now();
        write("src/deep/a.rs", "fn a() {} // words");
        write("src/deep/tests.rs", "fn t() {}");
        write("src/tests/t.rs", "fn t() {}");
        assert_eq!(now(), first);
        write("data.toml", "a = 2");
        let second = now();
        assert_ne!(second, first);
        write("src/b.rs", "");
        assert_ne!(now(), second);
        assert!(hash(place.path(), &["gone"]).is_err());
    }

    #[test]
    fn the_hash_is_fnv_1a() {
        // The published value for "a"; `add` appends the length.
        let mut hash = Fnv::default();
        hash.0 = (hash.0 ^ u64::from(b'a')).wrapping_mul(0x0000_0100_0000_01b3);
        assert_eq!(hash.text(), "af63dc4c8601ec8c");
    }

    #[test]
    fn what_measures_is_followed_and_what_shows_is_not() {
        let root = crate::shell::root().unwrap();
        let files = with_uses(&root, vec!["host/lab/src/figures/contact/ghosts.rs".into()]).unwrap();
        assert!(
            files.contains(Path::new("host/lab/src/least_distance.rs")),
            "{files:?}"
        );
        assert!(
            files.iter().all(|file| !file.starts_with("host/lab/src/chart")),
            "{files:?}"
        );
    }

    #[test]
    fn places_that_are_not_followed_exist() {
        let root = crate::shell::root().unwrap();
        for place in SHOWN.iter().chain(FOLLOWED) {
            assert!(root.join(place).exists(), "{place}");
        }
    }
}
