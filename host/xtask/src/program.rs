//! Building with cargo and learning where the result lies.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use tinyjson::JsonValue;

use crate::shell;

/// Package and program name of the desktop program.
pub const MORTISE: &str = "mortise";
/// Package and program name of the experiments.
pub const LAB: &str = "mortise-lab";

/// The programs that a person runs, built.
#[derive(Clone, Debug)]
pub struct Programs {
    /// [`MORTISE`].
    pub mortise: PathBuf,
    /// [`LAB`], beside it.
    pub lab: PathBuf,
}

impl Programs {
    /// Both, among executables as (target's name, path).
    ///
    /// # Errors
    /// When one is not among them.
    pub fn pick(made: &[(String, PathBuf)]) -> Result<Self> {
        Ok(Self {
            mortise: pick(made, MORTISE)?,
            lab: pick(made, LAB)?,
        })
    }

    /// Builds both in the release profile.
    ///
    /// # Errors
    /// When one does not compile.
    pub fn build(root: &Path) -> Result<Self> {
        let mut command = shell::cargo(root);
        command.args([
            "build",
            "--release",
            "--package",
            MORTISE,
            "--package",
            LAB,
            "--bins",
        ]);
        Self::pick(&build(&mut command).context("the programs `mortise` and `mortise-lab` do not build")?)
    }

    /// Both where an earlier build left them in `folder`.
    pub fn built(folder: &Path) -> Option<Self> {
        let path = |name: &str| {
            let path = folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
            path.is_file().then_some(path)
        };
        Some(Self {
            mortise: path(MORTISE)?,
            lab: path(LAB)?,
        })
    }
}

/// Runs `build` (a `cargo build …`) and returns the executables it made, as (target's name, path).
///
/// # Errors
/// When the build fails, with its line; compiler messages have gone to standard error.
pub fn build(build: &mut Command) -> Result<Vec<(String, PathBuf)>> {
    let mut made = Vec::new();
    build.arg("--message-format=json-render-diagnostics");
    shell::run_lines(build, |line| made.extend(executable_of(line)))?;
    Ok(made)
}

/// Builds the desktop program in the release profile and returns its path. Without its window it takes a third of the time.
///
/// # Errors
/// When the package is missing or does not compile.
pub fn build_mortise(root: &Path, window: bool) -> Result<PathBuf> {
    let mut command = shell::cargo(root);
    command.args(["build", "--release", "--package", MORTISE, "--bin", MORTISE]);
    if !window {
        command.arg("--no-default-features");
    }
    let made = build(&mut command).context("the program `mortise` (host/app) does not build")?;
    pick(&made, MORTISE)
}

/// The executable called `name` among `made`.
///
/// # Errors
/// When the build made none of that name.
pub fn pick(made: &[(String, PathBuf)], name: &str) -> Result<PathBuf> {
    match made.iter().find(|(target, _)| target == name) {
        Some((_, path)) => Ok(path.clone()),
        None => bail!("the build made no program called `{name}`"),
    }
}

/// An executable that cargo made, as its JSON messages tell.
pub struct Artifact {
    /// The target's name.
    pub name: String,
    /// The package's `Cargo.toml`.
    pub manifest: PathBuf,
    /// The executable.
    pub executable: PathBuf,
    /// A program.
    pub is_bin: bool,
    /// With a test harness, under the name of what it tests.
    pub is_test: bool,
}

impl Artifact {
    /// Reads one line of cargo's JSON messages; `None` unless it names an executable.
    pub fn read(line: &str) -> Option<Self> {
        let message: JsonValue = line.parse().ok()?;
        let text = |value: &JsonValue| value.get::<String>().cloned();
        let object = message.get::<std::collections::HashMap<String, JsonValue>>()?;
        if text(object.get("reason")?)? != "compiler-artifact" {
            return None;
        }
        let executable = PathBuf::from(text(object.get("executable")?)?);
        let target = object
            .get("target")?
            .get::<std::collections::HashMap<String, JsonValue>>()?;
        let profile = object
            .get("profile")?
            .get::<std::collections::HashMap<String, JsonValue>>()?;
        Some(Self {
            name: text(target.get("name")?)?,
            manifest: PathBuf::from(text(object.get("manifest_path")?)?),
            executable,
            is_bin: target
                .get("kind")?
                .get::<Vec<JsonValue>>()?
                .iter()
                .any(|kind| text(kind).as_deref() == Some("bin")),
            is_test: profile.get("test")?.get::<bool>().copied()?,
        })
    }
}

/// The executable of a `bin` target that one line of cargo's JSON messages names.
fn executable_of(line: &str) -> Option<(String, PathBuf)> {
    let artifact = Artifact::read(line)?;
    (artifact.is_bin && !artifact.is_test).then_some((artifact.name, artifact.executable))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn executables_are_read_from_cargo_messages() {
        let bin = r#"{"reason":"compiler-artifact","manifest_path":"/p/Cargo.toml","target":{"kind":["bin"],"name":"mortise"},"profile":{"test":false},"executable":"/t/mortise"}"#;
        let test = bin.replace("\"test\":false", "\"test\":true");
        let lib = r#"{"reason":"compiler-artifact","manifest_path":"/p/Cargo.toml","target":{"kind":["lib"],"name":"x"},"profile":{"test":false},"executable":null}"#;
        assert_eq!(
            executable_of(bin),
            Some(("mortise".into(), PathBuf::from("/t/mortise")))
        );
        assert_eq!(executable_of(&test), None);
        assert_eq!(executable_of(lib), None);
        assert_eq!(
            executable_of(r#"{"reason":"build-finished","success":true}"#),
            None
        );
        assert_eq!(executable_of("warning: not JSON"), None);
    }
}
