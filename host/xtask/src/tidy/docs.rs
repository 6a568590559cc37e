//! What pages name: paths in backticks, links, and commands.

use std::path::{Component, Path, PathBuf};

use anyhow::Result;

use super::finding::Finding;
use super::tree;

/// Pages whose words are about what is, not about what was.
pub fn pages(files: &[PathBuf]) -> Vec<&PathBuf> {
    files
        .iter()
        .filter(|file| tree::has_extension(file, &["md"]) && !file.ends_with("CHANGELOG.md"))
        .collect()
}

/// Finds paths in backticks and links that lead nowhere.
///
/// # Errors
/// When a page cannot be read.
pub fn check_paths(root: &Path, files: &[PathBuf]) -> Result<Vec<Finding>> {
    let tops = top_level(files);
    let mut findings = Vec::new();
    for page in pages(files) {
        let text = tree::read(root, page)?;
        for (line, span) in code_spans(&text) {
            if let Some(path) = repository_path(span, &tops)
                && !expand(path).iter().any(|pattern| exists(files, pattern))
            {
                let what = format!("`{span}` names nothing in the repository");
                findings.push(Finding {
                    file: page.clone(),
                    line,
                    what,
                });
            }
        }
        for (line, target) in links(&text) {
            let from = page.parent().unwrap_or(Path::new(""));
            if let Some(path) = linked_file(from, target)
                && !exists(files, &path)
            {
                let what = format!("the link to `{target}` leads nowhere");
                findings.push(Finding {
                    file: page.clone(),
                    line,
                    what,
                });
            }
        }
    }
    Ok(findings)
}

/// `cargo xtask …`, `mortise …` and `mortise-lab …` in backticks or as a line of a code block, with their line.
pub fn commands(text: &str) -> Vec<(usize, String)> {
    let in_blocks = block_lines(text).map(|(line, content)| (line, content.trim().trim_start_matches("$ ")));
    in_blocks
        .chain(code_spans(text))
        .filter_map(|(line, content)| Some((line, command(content)?)))
        .collect()
}

/// The command at the start of `text`, without what the shell does with its output.
fn command(text: &str) -> Option<String> {
    let ours = ["cargo xtask", "mortise", "mortise-lab"];
    let start = ours.iter().find(|start| {
        text.strip_prefix(**start)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
    })?;
    // A single word is the program's name more often than a call without arguments.
    if text.len() == start.len() {
        return None;
    }
    let end = [" #", " | ", " && ", " > ", " < ", ";"]
        .iter()
        .filter_map(|mark| text.find(mark))
        .min();
    Some(text[..end.unwrap_or(text.len())].trim().to_owned())
}

/// Names at the root: a path that begins with another one is not ours.
fn top_level(files: &[PathBuf]) -> Vec<&str> {
    let mut names: Vec<&str> = files
        .iter()
        .filter_map(|file| match file.components().next() {
            Some(Component::Normal(name)) => name.to_str(),
            _ => None,
        })
        .collect();
    names.dedup();
    names
}

/// The part of a code span that is a path from the root, if it looks like one.
fn repository_path<'a>(span: &'a str, tops: &[&str]) -> Option<&'a str> {
    // `path:line`, `path::item` and `path#anchor` name places in a file.
    let path = span.split([':', '#']).next()?.trim_end_matches('/');
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "._-/*{},".contains(letter);
    let first = path.split('/').next()?;
    let is_path = path.contains('/') || span.ends_with('/') || path.contains('.');
    (is_path && path.chars().all(plain) && tops.contains(&first)).then_some(path)
}

/// Alternatives of `a/{b,c}/d`.
fn expand(path: &str) -> Vec<PathBuf> {
    if let Some((before, rest)) = path.split_once('{')
        && let Some((inner, after)) = rest.split_once('}')
    {
        return inner
            .split(',')
            .flat_map(|choice| expand(&format!("{before}{choice}{after}")))
            .collect();
    }
    vec![PathBuf::from(path)]
}

/// True if a file is `pattern` or lies below it; `*` stands for any part of a name.
fn exists(files: &[PathBuf], pattern: &Path) -> bool {
    files.iter().any(|file| {
        let mut parts = file.components();
        pattern.components().all(|wanted| {
            parts.next().is_some_and(|part| {
                matches_name(
                    &wanted.as_os_str().to_string_lossy(),
                    &part.as_os_str().to_string_lossy(),
                )
            })
        })
    })
}

fn matches_name(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((start, rest)) => name.strip_prefix(start).is_some_and(|name| {
            (0..=name.len())
                .filter(|at| name.is_char_boundary(*at))
                .any(|at| matches_name(rest, &name[at..]))
        }),
    }
}

/// The file a link leads to, from the root; `None` for the web, for this page and for what lies outside.
pub fn linked_file(from: &Path, target: &str) -> Option<PathBuf> {
    let target = target.split('#').next()?;
    if target.is_empty() || target.contains("://") || target.starts_with("mailto:") {
        return None;
    }
    let mut path = PathBuf::new();
    for part in from.join(target).components() {
        match part {
            Component::Normal(name) => path.push(name),
            // Above the root are the test parts, which are not part of the repository.
            Component::ParentDir => path.pop().then_some(())?,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return Some(PathBuf::from(target)),
        }
    }
    Some(path)
}

/// Lines with their number and whether they stand in a code block; fences themselves are left out.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str, bool)> {
    let mut block = false;
    text.lines().enumerate().filter_map(move |(index, line)| {
        if line.trim_start().starts_with("```") {
            block = !block;
            return None;
        }
        Some((index + 1, line, block))
    })
}

fn block_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    lines(text)
        .filter(|(.., block)| *block)
        .map(|(number, line, _)| (number, line))
}

fn code_spans(text: &str) -> impl Iterator<Item = (usize, &str)> {
    lines(text)
        .filter(|(.., block)| !block)
        .flat_map(|(number, line, _)| line.split('`').skip(1).step_by(2).map(move |span| (number, span)))
}

/// Targets of the links of a page, with their lines; those in code blocks are none.
pub fn links(text: &str) -> impl Iterator<Item = (usize, &str)> {
    lines(text)
        .filter(|(.., block)| !block)
        .flat_map(|(number, line, _)| {
            line.split("](").skip(1).filter_map(move |rest| {
                let target = rest.split(')').next()?;
                // `](path "title")`.
                Some((number, target.split(' ').next()?))
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files() -> Vec<PathBuf> {
        [
            "Cargo.toml",
            "README.md",
            "docs/safety.md",
            "firmware/rigs/hapkit.toml",
            "host/app/src/main.rs",
        ]
        .map(PathBuf::from)
        .to_vec()
    }

    #[test]
    fn only_what_looks_like_a_path_from_the_root_is_looked_for() {
        let tops = ["Cargo.toml", "docs", "firmware", "host"];
        let cases = [
            ("host/app/src/main.rs:12", Some("host/app/src/main.rs")),
            ("docs/", Some("docs")),
            ("Cargo.toml", Some("Cargo.toml")),
            ("firmware/rigs/*.toml", Some("firmware/rigs/*.toml")),
            ("host", None),
            ("firmware/boards/<board>", None),
            ("src/main.rs", None),
            ("cargo xtask test", None),
            ("N/m", None),
        ];
        for (span, path) in cases {
            assert_eq!(repository_path(span, &tops), path, "{span}");
        }
    }

    #[test]
    fn patterns_match_files_and_directories() {
        let files = files();
        let found = |path: &str| expand(path).iter().any(|pattern| exists(&files, pattern));
        assert!(found("host/app"));
        assert!(found("firmware/rigs/*.toml"));
        assert!(found("host/{app,rig}/src/*.rs"));
        assert!(!found("host/ap"));
        assert!(!found("firmware/rigs/*.md"));
    }

    #[test]
    fn links_are_followed_from_the_page() {
        let docs = Path::new("docs");
        assert_eq!(linked_file(docs, "../README.md#demo"), Some("README.md".into()));
        assert_eq!(linked_file(docs, "./safety.md"), Some("docs/safety.md".into()));
        assert_eq!(linked_file(docs, "https://example.org/x"), None);
        assert_eq!(linked_file(docs, "#here"), None);
        assert_eq!(linked_file(docs, "../../shared/cad"), None);
        assert_eq!(
            links("[a](x.md \"t\") and ![b](y.png)")
                .map(|(_, link)| link)
                .collect::<Vec<_>>(),
            ["x.md", "y.png"]
        );
    }

    #[test]
    fn commands_are_found_in_text_and_blocks_without_the_shells_part() {
        let text = "Run `cargo xtask demo`, or `mortise inspect FILE --json`; the program `mortise` and `mortise-brep`.\n\
            ```\ncargo xtask test      # everything CI runs\n$ mortise bake a.step -o a.image && ls\nmortise-lab rate | head\nmortised\n```\n";
        let found = commands(text);
        let of: Vec<(usize, &str)> = found
            .iter()
            .map(|(line, command)| (*line, command.as_str()))
            .collect();
        assert_eq!(
            of,
            [
                (3, "cargo xtask test"),
                (4, "mortise bake a.step -o a.image"),
                (5, "mortise-lab rate"),
                (1, "cargo xtask demo"),
                (1, "mortise inspect FILE --json"),
            ]
        );
    }
}
