//! The book's table of contents names every page of `docs`. That it names no other is among the checks of links.

use std::path::{Path, PathBuf};

use super::finding::Finding;
use super::{docs, tree};

/// The table of contents, from the root.
const SUMMARY: &str = "docs/SUMMARY.md";

/// Pages that the table of contents does not name, or names again.
///
/// # Errors
/// When it cannot be read.
pub fn check(root: &Path, files: &[PathBuf]) -> anyhow::Result<Vec<Finding>> {
    Ok(check_text(&tree::read(root, Path::new(SUMMARY))?, files))
}

fn check_text(summary: &str, files: &[PathBuf]) -> Vec<Finding> {
    let finding = |line: usize, what: String| Finding {
        file: SUMMARY.into(),
        line,
        what,
    };
    let mut named: Vec<PathBuf> = Vec::new();
    let mut findings = Vec::new();
    for (line, target) in docs::links(summary) {
        if let Some(page) = docs::linked_file(Path::new("docs"), target) {
            if named.contains(&page) {
                findings.push(finding(line, format!("{} is named twice", page.display())));
            }
            named.push(page);
        }
    }
    let is_page = |file: &&PathBuf| {
        file.starts_with("docs") && tree::has_extension(file, &["md"]) && *file != Path::new(SUMMARY)
    };
    let missing = (files.iter().filter(is_page)).filter(|page| !named.contains(page));
    findings.extend(missing.map(|page| finding(0, format!("the page {} is missing", page.display()))));
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_named_once() {
        let files = [
            "README.md",
            "docs/SUMMARY.md",
            "docs/a.md",
            "docs/figures/b.md",
            "docs/figures/c.csv",
        ]
        .map(PathBuf::from);
        let whole = "[Introduction](../README.md)\n- [A](a.md)\n- [B](figures/b.md)\n";
        assert_eq!(check_text(whole, &files), []);
        let found = |summary: &str| -> Vec<String> {
            let findings = check_text(summary, &files);
            findings.iter().map(ToString::to_string).collect()
        };
        assert_eq!(
            found("- [A](a.md)\n- [Again](a.md)\n"),
            [
                "docs/SUMMARY.md:2: docs/a.md is named twice",
                "docs/SUMMARY.md: the page docs/figures/b.md is missing"
            ]
        );
    }
}
