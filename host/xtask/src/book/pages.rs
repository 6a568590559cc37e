//! Pages as mdBook takes them: below `pages`, each where it is in the repository, beside the table of contents.
//!
//! A link to another page of the book stays, and so does one to a file of `docs`, which comes along. A link to a source or a folder becomes its text: the
//! book is read without the repository.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::tidy::{self, linked_file};

const SUMMARY: &str = "docs/SUMMARY.md";
/// What mdBook is to do, and the book's looks.
const SETTINGS: [&str; 2] = ["docs/book.toml", "docs/book.css"];

/// Numbers of files.
#[derive(Debug, PartialEq, Eq)]
pub struct LaidOut {
    pub pages: usize,
    /// Pictures, and tables to download.
    pub others: usize,
}

/// Writes what mdBook needs below `place`.
///
/// # Errors
/// When the table of contents names nothing, or a file cannot be read or written.
pub fn lay_out(root: &Path, place: &Path) -> Result<LaidOut> {
    let summary = read(root, Path::new(SUMMARY))?;
    let pages = chapters(&summary);
    if pages.is_empty() {
        bail!("{SUMMARY} names no page");
    }
    for file in SETTINGS.map(Path::new) {
        let name = file.file_name().context("settings without a name")?;
        write(&place.join(name), &read(root, file)?)?;
    }
    // The table of contents is above the pages, so that its links are paths from the root.
    let docs = Path::new("docs");
    let from_root = relink(&summary, |target| {
        linked_file(docs, target).map(|path| path.to_string_lossy().replace('\\', "/"))
    });
    write(&place.join("pages/SUMMARY.md"), &from_root)?;
    let mut others = BTreeSet::new();
    for page in &pages {
        let folder = page.parent().unwrap_or(Path::new(""));
        let text = relink(&read(root, page)?, |target| {
            let stays = match linked_file(folder, target) {
                Some(path) if pages.contains(&path) => true,
                Some(path) if path.starts_with(docs) && root.join(&path).is_file() => {
                    others.insert(path);
                    true
                }
                Some(_) => false,
                // The web, or a place on the same page.
                None => !target.starts_with("..") && !target.starts_with('/'),
            };
            stays.then(|| target.to_owned())
        });
        write(&place.join("pages").join(page), &text)?;
    }
    for other in &others {
        let to = place.join("pages").join(other);
        if let Some(folder) = to.parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::copy(root.join(other), &to).with_context(|| format!("copying {}", other.display()))?;
    }
    Ok(LaidOut {
        pages: pages.len(),
        others: others.len(),
    })
}

/// Pages in the table of contents, as paths from the root.
fn chapters(summary: &str) -> BTreeSet<PathBuf> {
    tidy::links(summary)
        .filter_map(|(_, target)| linked_file(Path::new("docs"), target))
        .collect()
}

fn read(root: &Path, file: &Path) -> Result<String> {
    std::fs::read_to_string(root.join(file)).with_context(|| format!("reading {}", file.display()))
}

fn write(file: &Path, text: &str) -> Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(file, text).with_context(|| format!("writing {}", file.display()))
}

/// The text with the target of each link `[text](target)` as `new` states it; where that is none, the link's text alone. Code stays as it is.
fn relink(text: &str, mut new: impl FnMut(&str) -> Option<String>) -> String {
    let mut out = String::with_capacity(text.len());
    let mut is_block = false;
    for line in text.split_inclusive('\n') {
        if line.trim_start().starts_with("```") {
            is_block = !is_block;
        } else if !is_block {
            relink_line(line, &mut new, &mut out);
            continue;
        }
        out.push_str(line);
    }
    out
}

fn relink_line(line: &str, new: &mut impl FnMut(&str) -> Option<String>, out: &mut String) {
    let mut rest = line;
    let mut is_code = false;
    while let Some(at) = rest.find("](") {
        let (before, after) = (&rest[..at], &rest[at + 2..]);
        is_code ^= before.matches('`').count() % 2 == 1;
        let end = after.find(')').filter(|_| !is_code);
        out.push_str(before);
        let Some(end) = end else {
            out.push_str("](");
            rest = after;
            continue;
        };
        match new(&after[..end]) {
            Some(target) => {
                out.push_str("](");
                out.push_str(&target);
                out.push(')');
            }
            None => unlink(out),
        }
        rest = &after[end + 1..];
    }
    out.push_str(rest);
}

/// Removes the bracket that begins the link whose text ends `out`.
fn unlink(out: &mut String) {
    let mut depth = 0;
    for (at, letter) in out.char_indices().rev() {
        match letter {
            ']' => depth += 1,
            '[' if depth == 0 => {
                out.remove(at);
                return;
            }
            '[' => depth -= 1,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell;

    #[test]
    fn links_are_kept_changed_or_become_their_text() {
        let text = "See [the *page*](a.md#x), [`tick`](../tick.rs) and [two\nlines [1]](../b.rs).\n\
            `[no](../link.rs)`, [a](a.md \"t\")\n```\n[in a block](../c.rs)\n```\n![picture](p.png)[x](../d)\n";
        let new = |target: &str| (!target.starts_with("..")).then(|| format!("docs/{target}"));
        assert_eq!(
            relink(text, new),
            "See [the *page*](docs/a.md#x), `tick` and two\nlines [1].\n\
             `[no](../link.rs)`, [a](docs/a.md \"t\")\n```\n[in a block](../c.rs)\n```\n![picture](docs/p.png)x\n"
        );
    }

    /// What mdBook would not find is found without it.
    #[test]
    fn every_link_of_the_repositorys_pages_leads_to_a_file_that_comes_along() {
        let (root, place) = (shell::root().unwrap(), tempfile::tempdir().unwrap());
        let laid_out = lay_out(&root, place.path()).unwrap();
        assert!(laid_out.pages > 40 && laid_out.others > 40, "{laid_out:?}");
        let pages = place.path().join("pages");
        for file in tidy::files(&pages).unwrap() {
            if file.extension().is_none_or(|end| end != "md") {
                continue;
            }
            let text = read(&pages, &file).unwrap();
            let folder = file.parent().unwrap();
            for (line, target) in tidy::links(&text) {
                let path = linked_file(folder, target);
                assert!(
                    path.is_none_or(|path| pages.join(path).is_file()),
                    "{}:{line}: {target}",
                    file.display()
                );
                assert!(
                    !target.starts_with("../.."),
                    "{}:{line}: {target}",
                    file.display()
                );
            }
        }
        assert!(pages.join("docs/figures/window.png").is_file());
        assert!(
            ["book.toml", "book.css"]
                .iter()
                .all(|name| place.path().join(name).is_file())
        );
    }
}
