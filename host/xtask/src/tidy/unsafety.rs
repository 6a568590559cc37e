//! Every `unsafe` block, function, trait, attribute and foreign block says why it is sound.
//!
//! Clippy's `undocumented_unsafe_blocks` covers blocks and `impl`s of the code it compiles. This check covers the rest: attributes, foreign
//! blocks, functions, and code behind another target.

use std::path::Path;

use super::finding::Finding;
use super::tree;

/// Lines a statement may have before the one with the keyword.
const STATEMENT_LINES: usize = 4;

/// Finds each use of the keyword without a reason above it.
///
/// # Errors
/// When the file cannot be read.
pub fn check(root: &Path, file: &Path) -> anyhow::Result<Vec<Finding>> {
    if !tree::has_extension(file, &["rs"]) {
        return Ok(Vec::new());
    }
    Ok(check_text(file, &tree::read(root, file)?))
}

fn check_text(file: &Path, text: &str) -> Vec<Finding> {
    let lines: Vec<&str> = text.lines().collect();
    (0..lines.len())
        .filter(|&at| uses_keyword(lines[at]) && !is_justified(&lines, at))
        .map(|at| Finding {
            file: file.to_path_buf(),
            line: at + 1,
            what: "`unsafe` without a `// SAFETY:` line (or `# Safety` section) above it".to_owned(),
        })
        .collect()
}

/// True if the line's code, its comments and strings left out, has the keyword as a word of its own.
fn uses_keyword(line: &str) -> bool {
    // In pieces, or this file would be found.
    let keyword = concat!("un", "safe");
    let code = line.split("//").next().unwrap_or_default();
    let code: String = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
    code.split(|c: char| !c.is_alphanumeric() && c != '_')
        .any(|word| word == keyword)
}

/// True if a reason stands on the line, in the comments and attributes directly above it, or above the statement it belongs to.
fn is_justified(lines: &[&str], at: usize) -> bool {
    let reason = |line: &str| line.contains("SAFETY:") || line.contains("# Safety");
    if reason(lines[at]) {
        return true;
    }
    let mut code_lines = 0;
    for line in lines[..at].iter().rev() {
        let line = line.trim();
        if reason(line) {
            return true;
        }
        if line.starts_with("//") || line.starts_with("#[") {
            continue;
        }
        code_lines += 1;
        if code_lines == STATEMENT_LINES || line.is_empty() || line.ends_with([';', '{', '}', ',']) {
            return false;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines_found(text: &str) -> Vec<usize> {
        let text = text.replace("UNSAFE", concat!("un", "safe"));
        check_text(Path::new("a.rs"), &text)
            .into_iter()
            .map(|finding| finding.line)
            .collect()
    }

    #[test]
    fn a_reason_above_or_beside_is_enough() {
        assert!(lines_found("// SAFETY: x\nUNSAFE { f() };\n").is_empty());
        assert!(lines_found("UNSAFE { f() } // SAFETY: x\n").is_empty());
        assert!(lines_found("/// # Safety\n/// x\n#[inline]\nUNSAFE fn f() {}\n").is_empty());
        assert!(lines_found("// SAFETY: x\nlet a =\n    UNSAFE { f() };\n").is_empty());
    }

    #[test]
    fn each_use_needs_its_own() {
        assert_eq!(lines_found("UNSAFE { f() };\n"), [1]);
        assert_eq!(
            lines_found("// SAFETY: x\nUNSAFE { f() };\nUNSAFE { g() };\n"),
            [3]
        );
        assert_eq!(lines_found("#[UNSAFE(no_mangle)]\nfn f() {}\n"), [1]);
        assert_eq!(lines_found("// x\nUNSAFE extern \"C\" {}\n"), [2]);
    }

    #[test]
    fn words_in_comments_strings_and_lints_are_not_uses() {
        assert!(lines_found("// UNSAFE\nlet a = \"UNSAFE\";\nUNSAFE_op_in = 1;\n").is_empty());
    }
}
