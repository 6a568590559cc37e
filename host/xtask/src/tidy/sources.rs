//! Length of sources, and words that must not stand in them.

use std::path::Path;

use anyhow::Result;

use super::finding::Finding;
use super::tree;

/// A file longer than this holds more than one idea.
const MAX_LINES: usize = 600;

/// Files which may be longer, each with the reason.
const MAY_BE_LONGER: &[(&str, &str)] = &[(
    "protocol/src/message.rs",
    "the message table is one file, so that it can be read as one",
)];

const SOURCE: &[&str] = &["rs", "c", "cc", "cpp", "cxx", "h", "hpp", "toml", "x", "sh", "py"];
const TEXT: &[&str] = &[
    "md", "txt", "json", "csv", "svg", "step", "stp", "lock", "yml", "yaml",
];

/// Stand-ins which compile and then fail when they are reached. In pieces, or this file would be found.
const UNFINISHED: &[&str] = &[
    concat!("to", "do!("),
    concat!("unimpl", "emented!("),
    concat!("db", "g!("),
];

/// Starts of paths that mean something on one machine only.
const MACHINE_PATHS: &[&str] = &[
    concat!("/wo", "rk/"),
    concat!("/ho", "me/"),
    concat!("/ro", "ot/"),
    concat!("/tm", "p/"),
    concat!("C:\\Us", "ers\\"),
];

/// Continuations that make a path one of every machine: where X servers of Unix put their sockets.
const SYSTEM_PATHS: &[&str] = &[concat!("/tm", "p/.X11-unix")];

const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// Checks one file.
///
/// # Errors
/// When it cannot be read.
pub fn check(root: &Path, file: &Path) -> Result<Vec<Finding>> {
    let source = tree::has_extension(file, SOURCE);
    // Files without an extension are scripts and licences: read as text.
    if !source && !tree::has_extension(file, TEXT) && file.extension().is_some() {
        return Ok(Vec::new());
    }
    Ok(check_text(file, &tree::read(root, file)?, source))
}

fn check_text(file: &Path, text: &str, source: bool) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut find = |line: usize, what: String| {
        findings.push(Finding {
            file: file.to_path_buf(),
            line,
            what,
        })
    };
    let lines = text.lines().count();
    let excepted = MAY_BE_LONGER.iter().any(|(name, _)| Path::new(name) == file);
    if source && lines > MAX_LINES && !excepted {
        find(
            0,
            format!(
                "{lines} lines; split what is over {MAX_LINES}, or list it in host/xtask/src/tidy/sources.rs"
            ),
        );
    }
    for (index, line) in text.lines().enumerate() {
        if source {
            for word in UNFINISHED.iter().filter(|word| line.contains(*word)) {
                find(index + 1, format!("`{word}…)` is not finished work"));
            }
        }
        for start in MACHINE_PATHS
            .iter()
            .filter(|start| names_machine_path(line, start))
        {
            find(index + 1, format!("`{start}…` is a path of one machine"));
        }
        if file.ends_with("Cargo.lock") && line.starts_with("source = ") && !line.contains(CRATES_IO) {
            find(index + 1, "dependencies come from crates.io alone".to_owned());
        }
    }
    findings
}

/// True if `line` has a path that begins with `start`, not one which has it inside.
fn names_machine_path(line: &str, start: &str) -> bool {
    line.match_indices(start).any(|(at, _)| {
        let inside =
            line[..at].ends_with(|before: char| before.is_alphanumeric() || "._-})>*$/".contains(before));
        let system = SYSTEM_PATHS.iter().any(|path| line[at..].starts_with(path));
        !inside && !system
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whats(file: &str, text: &str, source: bool) -> Vec<String> {
        check_text(Path::new(file), text, source)
            .into_iter()
            .map(|finding| finding.to_string())
            .collect()
    }

    #[test]
    fn long_sources_are_found_and_long_texts_are_not() {
        let text = "x\n".repeat(MAX_LINES + 1);
        assert_eq!(whats("a.rs", &text, true).len(), 1);
        assert!(whats("a.rs", &"x\n".repeat(MAX_LINES), true).is_empty());
        assert!(whats("a.md", &text, false).is_empty());
    }

    #[test]
    fn stand_ins_are_found_with_their_line() {
        let text = format!("fn a() {{}}\nfn b() {{ {}) }}\n", UNFINISHED[0]);
        let found = whats("a.rs", &text, true);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("a.rs:2: "), "{found:?}");
    }

    #[test]
    fn paths_of_one_machine_are_found_and_like_ones_are_not() {
        for start in MACHINE_PATHS {
            assert!(names_machine_path(&format!("see {start}x"), start), "{start}");
            assert!(names_machine_path(&format!("\"{start}x\""), start), "{start}");
            assert!(!names_machine_path(&format!("target{start}x"), start), "{start}");
            assert!(
                !names_machine_path(&format!("${{OUT}}{start}x"), start),
                "{start}"
            );
        }
        assert!(!names_machine_path(SYSTEM_PATHS[0], MACHINE_PATHS[3]));
    }

    #[test]
    fn lock_files_name_crates_io_alone() {
        assert!(whats("Cargo.lock", &format!("source = \"{CRATES_IO}\"\n"), false).is_empty());
        assert_eq!(
            whats(
                "Cargo.lock",
                "source = \"registry+https://mirror.example/index\"\n",
                false
            )
            .len(),
            1
        );
    }
}
