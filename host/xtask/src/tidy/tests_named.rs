//! Every file of integration tests is part of a program: a module of its folder's `all.rs`, or a target in the package's manifest. Cargo ignores others
//! where a package names its test programs by itself.

use std::path::{Path, PathBuf};

use anyhow::Result;

use super::finding::Finding;
use super::tree;

/// The program of a package's integration tests.
const ALL: &str = "tests/all.rs";

/// Files beside an `all.rs` that no program contains.
///
/// # Errors
/// When a file cannot be read.
pub fn check(root: &Path, files: &[PathBuf]) -> Result<Vec<Finding>> {
    let mut findings = Vec::new();
    for all in files.iter().filter(|file| file.ends_with(ALL)) {
        let Some(folder) = all.parent() else { continue };
        let program = tree::read(root, all)?;
        let manifest = tree::read(root, &folder.with_file_name("Cargo.toml"))?;
        let beside = files
            .iter()
            .filter(|file| file.parent() == Some(folder) && *file != all);
        findings.extend(
            beside
                .filter(|file| tree::has_extension(file, &["rs"]) && !is_named(file, &program, &manifest))
                .map(|file| Finding {
                    file: file.clone(),
                    line: 0,
                    what: format!("its tests are in no program: name it in {}", all.display()),
                }),
        );
    }
    Ok(findings)
}

/// Whether a program, or the manifest, names a file of tests.
fn is_named(file: &Path, program: &str, manifest: &str) -> bool {
    let Some(name) = file.file_stem().and_then(|name| name.to_str()) else {
        return false;
    };
    let has = |text: &str, line: &str| text.lines().any(|found| found.trim() == line);
    has(program, &format!("mod {name};")) || has(manifest, &format!("name = \"{name}\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_named_by_the_program_or_the_manifest() {
        let (program, manifest) = (
            "//! All.\n\nmod a;\n#[cfg(unix)]\nmod b;\n",
            "[[test]]\nname = \"own\"\n",
        );
        let named = |file: &str| is_named(Path::new(file), program, manifest);
        assert!(named("host/x/tests/a.rs") && named("host/x/tests/b.rs") && named("host/x/tests/own.rs"));
        assert!(!named("host/x/tests/c.rs") && !named("host/x/tests/all_of_a.rs"));
    }
}
