//! No private words: terms of this project alone that a reader outside of it cannot know. The field's terms are in `docs/notation.md`.

use std::path::Path;

use super::finding::Finding;
use super::tree;

/// Words that may not be used, each with the term to use.
const BANNED: &[(&str, &str)] = &[
    ("dearest", "worst-case, longest"),
    ("purse", "reserve cap"),
    ("endowment", "initial budget"),
    ("thinned", "decimated"),
    ("thinning", "decimation"),
    ("misfit", "alignment error"),
    ("told", "reported, stated, known"),
    ("wish", "command"),
    ("wished", "commanded"),
    ("turned down", "damped for stability"),
    ("of nothing", "unaccounted for"),
    ("from nowhere", "unaccounted for"),
    ("out of all proportion", "out of range"),
];

/// Files that may: this one, and what was written down at its time.
const EXEMPT: &[&str] = &["host/xtask/src/tidy/words.rs", "docs/notes/", "CHANGELOG.md"];

/// Finds each banned word in a source or page.
///
/// # Errors
/// When the file cannot be read.
pub fn check(root: &Path, file: &Path) -> anyhow::Result<Vec<Finding>> {
    let exempt = EXEMPT
        .iter()
        .any(|path| file.starts_with(path.trim_end_matches('/')));
    if exempt || !tree::has_extension(file, &["rs", "md", "toml", "cc", "h"]) {
        return Ok(Vec::new());
    }
    Ok(check_text(file, &tree::read(root, file)?))
}

fn check_text(file: &Path, text: &str) -> Vec<Finding> {
    let finding = |line: usize, (word, term): (&str, &str)| Finding {
        file: file.to_path_buf(),
        line,
        what: format!("\"{word}\" is a private word: write \"{term}\""),
    };
    (text.lines().enumerate())
        .flat_map(|(at, line)| {
            let found = BANNED.iter().filter(move |(word, _)| has_word(line, word));
            found.map(move |&banned| (at + 1, banned))
        })
        .map(|(line, banned)| finding(line, banned))
        .collect()
}

/// True if the line has `word` with no letter on either side, in any case. Parts of names count: `is_told` has the word `told`.
fn has_word(line: &str, word: &str) -> bool {
    let line = line.to_lowercase();
    line.match_indices(word).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + word.len()..].chars().next();
        ![before, after].into_iter().flatten().any(char::is_alphabetic)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_words_are_found_in_any_case_and_within_names() {
        for line in [
            "the Dearest tick",
            "self.is_told()",
            "energy of nothing.",
            "// told",
        ] {
            assert_eq!(check_text(Path::new("a.rs"), line).len(), 1, "{line}");
        }
        for line in ["retold", "a misfitting part", "proof of nothings", "thin"] {
            assert!(check_text(Path::new("a.rs"), line).is_empty(), "{line}");
        }
    }
}
