//! Length of the board-side functions, and of the board crates.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Result;

use super::finding::Finding;
use super::tree;
use crate::rust_source::{Word, words};

/// A function with more lines does more than one thing.
const MAX_LINES: usize = 60;
/// A board crate with more lines does more than wiring.
const MAX_BOARD_LINES: usize = 300;

/// Functions that may be longer, each with the reason.
const MAY_BE_LONGER: &[(&str, &str, &str)] = &[
    (
        "firmware/app/src/link.rs",
        "carry_out",
        "one arm for each message: in two matches the compiler could not check that none is missing",
    ),
    (
        "firmware/app/src/control/requests.rs",
        "execute",
        "one arm for each command: in two matches the compiler could not check that none is missing",
    ),
    (
        "firmware/app/src/safety.rs",
        "step",
        "the whole table of transitions, which the safety page shows as one",
    ),
    (
        "firmware/haptics/src/collision/edge_search.rs",
        "edges",
        "the innermost loop of the edges' traversal, its state in registers",
    ),
    (
        "firmware/haptics/src/collision/search.rs",
        "nodes",
        "the innermost loop of the points' traversal, its state in registers",
    ),
    (
        "firmware/haptics/src/probe/clearance.rs",
        "search",
        "one branch-and-bound loop, whose bounds use each other",
    ),
];

/// Finds long functions in `firmware/`, exceptions that need none, and board crates that are not wiring alone.
///
/// # Errors
/// When a file cannot be read.
pub fn check(root: &Path, files: &[PathBuf]) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    let mut boards: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for file in files.iter().filter(|file| is_source(file)) {
        let text = tree::read(root, file)?;
        findings.extend(check_text(file, &text, MAY_BE_LONGER));
        // A board is a crate with a linker script.
        if let Some(board) = file.parent().and_then(Path::parent)
            && files.binary_search(&board.join("memory.x")).is_ok()
        {
            *boards.entry(board.to_path_buf()).or_default() += text.lines().count();
        }
    }
    let too_long = boards.into_iter().filter(|(_, lines)| *lines > MAX_BOARD_LINES);
    findings.extend(too_long.map(|(file, lines)| Finding {
        file,
        line: 0,
        what: format!(
            "a board crate is wiring, and this one has {lines} lines: move what is over {MAX_BOARD_LINES} to its chip's crate or firmware/boards/common"
        ),
    }));
    Ok(findings)
}

fn is_source(file: &Path) -> bool {
    file.starts_with("firmware")
        && tree::has_extension(file, &["rs"])
        && file.components().any(|part| part.as_os_str() == "src")
}

fn check_text(file: &Path, text: &str, exceptions: &[(&str, &str, &str)]) -> Vec<Finding> {
    let mut excepted: Vec<&str> = (exceptions.iter())
        .filter(|(at, ..)| Path::new(at) == file)
        .map(|(_, name, _)| *name)
        .collect();
    let mut findings = Vec::new();
    for function in functions(text)
        .into_iter()
        .filter(|found| found.lines > MAX_LINES)
    {
        let Function { name, line, lines } = function;
        match excepted.iter().position(|allowed| *allowed == name) {
            Some(at) => _ = excepted.remove(at),
            None => findings.push(Finding {
                file: file.to_path_buf(),
                line,
                what: format!(
                    "`{name}` has {lines} lines: split what is over {MAX_LINES}, or list it with its reason in host/xtask/src/tidy/functions.rs"
                ),
            }),
        }
    }
    findings.extend(excepted.iter().map(|name| Finding {
        file: file.to_path_buf(),
        line: 0,
        what: format!(
            "`{name}` has no more than {MAX_LINES} lines: take it from host/xtask/src/tidy/functions.rs"
        ),
    }));
    findings
}

struct Function<'s> {
    name: &'s str,
    line: usize,
    /// From its `fn` to its closing brace.
    lines: usize,
}

/// Functions with a body.
fn functions(text: &str) -> Vec<Function<'_>> {
    let words = words(text);
    let named = |at: usize| {
        let name = words.get(at + 1)?;
        let begins = name.text.chars().next()?;
        (words[at].text == "fn" && (begins.is_alphabetic() || begins == '_')).then_some(name)
    };
    (0..words.len())
        .filter_map(|at| {
            let name = named(at)?;
            let end = body_end(&words, at)?;
            Some(Function {
                name: name.text,
                line: words[at].line,
                lines: end - words[at].line + 1,
            })
        })
        .collect()
}

/// Line of the brace that closes the body of the function at `at`; `None` for a declaration.
fn body_end(words: &[Word<'_>], at: usize) -> Option<usize> {
    let mut depth = 0usize;
    let mut in_body = false;
    for word in &words[at..] {
        match word.text {
            ";" if depth == 0 => return None,
            "{" | "(" | "[" => {
                // Before the body only the brackets of arguments and types open, and braces of constants in them.
                in_body |= depth == 0 && word.text == "{";
                depth += 1;
            }
            "}" | ")" | "]" => {
                depth = depth.saturating_sub(1);
                if depth == 0 && in_body {
                    return Some(word.line);
                }
            }
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str, exceptions: &[(&str, &str, &str)]) -> Vec<String> {
        let findings = check_text(Path::new("a.rs"), text, exceptions);
        findings.iter().map(ToString::to_string).collect()
    }

    fn long(name: &str, lines: usize) -> String {
        let body = "    // { a brace in a comment\n    let text = \"}\";\n".repeat(lines / 2);
        format!(
            "trait T {{\n    fn declared(x: [u8; 4]);\n}}\n/// Long.\nfn {name}() {{\n{body}}}\nfn after() {{}}\n"
        )
    }

    #[test]
    fn a_long_function_is_found_where_it_begins() {
        assert!(found(&long("fits", 58), &[]).is_empty());
        let findings = found(&long("too_long", 60), &[]);
        assert_eq!(findings.len(), 1);
        assert!(
            findings[0].starts_with("a.rs:5: `too_long` has 62 lines"),
            "{findings:?}"
        );
    }

    #[test]
    fn an_exception_is_for_one_function_and_only_while_it_is_needed() {
        let exceptions = [("a.rs", "one", "it must"), ("b.rs", "two", "it must")];
        assert!(found(&long("one", 60), &exceptions).is_empty());
        assert_eq!(found(&long("two", 60), &exceptions).len(), 2);
        assert_eq!(found(&long("one", 40), &exceptions).len(), 1);
    }

    #[test]
    fn every_function_of_a_source_is_seen() {
        let text = "const fn a<const N: usize>() -> [u8; { N + 1 }] where [u8; N]: Sized { [0; { N + 1 }] }\nimpl X { pub(crate) unsafe fn b(&self) {\n let f = |x: fn(u8) -> u8| x;\n} }\n";
        let seen: Vec<_> = functions(text).iter().map(|f| (f.name, f.lines)).collect();
        assert_eq!(seen, [("a", 1), ("b", 3)]);
    }
}
