//! Who may depend on whom: folders are layers.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use tinyjson::JsonValue;

use super::finding::Finding;
use super::tree;
use crate::shell;

type Object = HashMap<String, JsonValue>;

/// The only crate that may name the CAD kernel.
const KERNEL_CRATE: &str = "host/brep";
const KERNEL_BRIDGES: &[&str] = &[
    "cxx",
    "cxx-build",
    "cxx-gen",
    "autocxx",
    "bindgen",
    "opencascade",
    "opencascade-sys",
];
/// Marks of the CAD kernel in sources: its headers, and the bridge to it.
const KERNEL_MARKS: &[&str] = &[concat!(".hx", "x"), concat!("cx", "x::")];

/// Our crates that a crate in a folder may depend on. Longest folder first. A folder that is not
/// here is the host's, and may depend on anything but programs.
const LAYERS: &[(&str, &[&str])] = &[
    (
        "firmware/boards",
        &[
            "mortise-board",
            "mps2",
            "stm32h743",
            "mortise-firmware",
            "mortise-mechanism",
            "mortise-simulation",
            "mortise-haptics",
            "mortise-protocol",
        ],
    ),
    (
        "firmware/app",
        &[
            "mortise-mechanism",
            "mortise-haptics",
            "mortise-protocol",
            // By its tests alone: the simulation depends on the application.
            "mortise-simulation",
        ],
    ),
    (
        "firmware/simulation",
        &[
            "mortise-firmware",
            "mortise-mechanism",
            "mortise-haptics",
            "mortise-protocol",
        ],
    ),
    (
        "firmware/orders",
        &[
            "mortise-firmware",
            "mortise-mechanism",
            "mortise-haptics",
            "mortise-protocol",
        ],
    ),
    ("firmware/mechanism", &["mortise-haptics", "mortise-protocol"]),
    ("firmware/haptics", &["mortise-protocol"]),
    ("firmware", &["mortise-haptics", "mortise-protocol"]),
    ("protocol", &[]),
    ("host/mating", &["mortise-brep", "mortise-protocol"]),
    (
        "host/task",
        &["mortise-bake", "mortise-brep", "mortise-mating", "mortise-shapes"],
    ),
    (
        "host/energy",
        &[
            "mortise-bake",
            "mortise-brep",
            "mortise-fit",
            "mortise-protocol",
            "mortise-shapes",
        ],
    ),
    ("host/shapes", &[]),
    ("host/flash", &["mortise-protocol"]),
    (
        "host/fit",
        &["mortise-bake", "mortise-brep", "mortise-mating", "mortise-shapes"],
    ),
    ("host/inspect", &["mortise-bake", "mortise-brep", "mortise-task"]),
    (
        "host/record",
        &[
            // Its tests play and record scenarios.
            "mortise-brep",
            "mortise-mechanism",
            "mortise-protocol",
            "mortise-rig",
            "mortise-scenario",
        ],
    ),
    ("host/words", &["mortise-brep", "mortise-mating", "mortise-task"]),
    ("host/page", &["mortise-brep", "mortise-task"]),
    (
        "host/guide",
        &[
            "mortise-brep",
            "mortise-fit",
            "mortise-mating",
            "mortise-protocol",
        ],
    ),
    (
        "host/scenario",
        &[
            "mortise-bake",
            "mortise-brep",
            "mortise-firmware",
            "mortise-guide",
            "mortise-haptics",
            "mortise-mating",
            "mortise-mechanism",
            "mortise-protocol",
            "mortise-rig",
            "mortise-simulation",
            "mortise-task",
        ],
    ),
    // Experiments are a program of their own.
    (
        "host/app",
        &[
            "mortise-bake",
            "mortise-brep",
            "mortise-energy",
            "mortise-fit",
            "mortise-flash",
            "mortise-guide",
            "mortise-inspect",
            "mortise-mating",
            // Kinematics and the simulated handle, for the picture of a mechanism and its stability margin.
            "mortise-mechanism",
            "mortise-output",
            "mortise-page",
            "mortise-protocol",
            "mortise-record",
            "mortise-rig",
            "mortise-scenario",
            "mortise-simulation",
            "mortise-task",
            "mortise-words",
        ],
    ),
    (
        "hil-tests",
        &[
            "mortise-brep",
            "mortise-protocol",
            "mortise-record",
            "mortise-rig",
            "mortise-scenario",
        ],
    ),
];

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Package {
    name: String,
    /// Directory from the root, with `/`.
    directory: String,
    dependencies: Vec<String>,
}

/// Checks dependencies of all crates, and kernel names in sources.
///
/// # Errors
/// When cargo cannot describe a workspace, or a file cannot be read.
pub fn check(root: &Path, files: &[PathBuf]) -> Result<Vec<Finding>> {
    let mut packages = packages(root, root)?;
    // Boards are workspaces apart, together or each alone.
    let boards = root.join("firmware/boards");
    if boards.join("Cargo.toml").is_file() {
        packages.extend(self::packages(root, &boards)?);
    } else if boards.is_dir() {
        for board in crate::firmware::crates(root).unwrap_or_default() {
            packages.extend(self::packages(root, &boards.join(board))?);
        }
    }
    let mut findings = complaints(&packages);
    for file in files
        .iter()
        .filter(|file| tree::has_extension(file, &["rs", "h", "hpp", "cc", "cpp"]))
    {
        if !file.starts_with(KERNEL_CRATE) {
            let text = tree::read(root, file)?;
            for (index, _) in text
                .lines()
                .enumerate()
                .filter(|(_, line)| names_kernel(file, line))
            {
                let what = format!("only {KERNEL_CRATE} names the CAD kernel");
                findings.push(Finding {
                    file: file.clone(),
                    line: index + 1,
                    what,
                });
            }
        }
    }
    Ok(findings)
}

/// Where cargo puts what it builds for the host.
///
/// # Errors
/// When cargo cannot describe the workspace.
pub fn target_directory(root: &Path) -> Result<PathBuf> {
    let described = metadata(root)?;
    let path: &String = described
        .get("target_directory")
        .and_then(JsonValue::get)
        .context("no target_directory")?;
    Ok(PathBuf::from(path))
}

/// The set-up command looks for a header of the kernel, which it has to name.
fn names_kernel(file: &Path, line: &str) -> bool {
    !file.starts_with("host/xtask/src/setup") && KERNEL_MARKS.iter().any(|mark| line.contains(mark))
}

fn complaints(packages: &[Package]) -> Vec<Finding> {
    let ours: HashSet<&str> = packages.iter().map(|package| package.name.as_str()).collect();
    let mut findings = Vec::new();
    for package in packages {
        let within = |folder: &str| {
            package
                .directory
                .strip_prefix(folder)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        };
        let mut find = |what: String| {
            let file = Path::new(&package.directory).join("Cargo.toml");
            findings.push(Finding { file, line: 0, what });
        };
        let allowed = LAYERS
            .iter()
            .find(|(folder, _)| within(folder))
            .map(|(_, allowed)| *allowed);
        for dependency in &package.dependencies {
            let name = dependency.as_str();
            if let Some(allowed) = allowed
                && ours.contains(name)
                && !allowed.contains(&name)
            {
                find(format!("{} must not depend on {name}", package.name));
            }
            if KERNEL_BRIDGES.contains(&name) && !within(KERNEL_CRATE) {
                find(format!(
                    "{} depends on {name}; only {KERNEL_CRATE} knows the CAD kernel",
                    package.name
                ));
            }
        }
    }
    findings
}

fn packages(root: &Path, workspace: &Path) -> Result<Vec<Package>> {
    let described = metadata(workspace)?;
    let list: &Vec<JsonValue> = described
        .get("packages")
        .and_then(JsonValue::get)
        .context("no packages")?;
    list.iter()
        .map(|package| read_package(root, package).context("in cargo's description of a package"))
        .collect()
}

fn read_package(root: &Path, value: &JsonValue) -> Result<Package> {
    let fields: &Object = value.get().context("not an object")?;
    let name: &String = fields.get("name").and_then(JsonValue::get).context("no name")?;
    let manifest: &String = fields
        .get("manifest_path")
        .and_then(JsonValue::get)
        .context("no manifest_path")?;
    let directory = Path::new(manifest).parent().unwrap_or(Path::new(""));
    let directory = directory
        .strip_prefix(root)
        .unwrap_or(directory)
        .to_string_lossy()
        .replace('\\', "/");
    let list: &Vec<JsonValue> = fields
        .get("dependencies")
        .and_then(JsonValue::get)
        .context("no dependencies")?;
    let dependencies = list
        .iter()
        .filter_map(|dependency| dependency.get::<Object>()?.get("name")?.get::<String>().cloned())
        .collect();
    Ok(Package {
        name: name.clone(),
        directory,
        dependencies,
    })
}

fn metadata(workspace: &Path) -> Result<Object> {
    let text = shell::read(shell::cargo(workspace).args([
        "metadata",
        "--no-deps",
        "--format-version",
        "1",
        "--offline",
    ]))?;
    let value: JsonValue = text
        .parse()
        .map_err(|error| anyhow::anyhow!("cargo metadata: {error}"))?;
    value
        .try_into()
        .map_err(|_| anyhow::anyhow!("cargo metadata printed no object"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(name: &str, directory: &str, dependencies: &[&str]) -> Package {
        Package {
            name: name.into(),
            directory: directory.into(),
            dependencies: dependencies.iter().map(|name| (*name).to_owned()).collect(),
        }
    }

    #[test]
    fn layers_that_hold_pass() {
        let packages = [
            package("mortise-protocol", "protocol", &["serde", "postcard"]),
            package(
                "mortise-haptics",
                "firmware/haptics",
                &["mortise-protocol", "glam"],
            ),
            package(
                "mortise-firmware",
                "firmware/app",
                &["mortise-protocol", "mortise-haptics", "rtic"],
            ),
            package(
                "nucleo-h743zi",
                "firmware/boards/nucleo-h743zi",
                &["mortise-firmware", "embassy-stm32"],
            ),
            package("mortise-brep", "host/brep", &["cxx", "cxx-build"]),
            package(
                "mortise-rig",
                "host/rig",
                &["mortise-firmware", "mortise-protocol"],
            ),
        ];
        assert_eq!(complaints(&packages), []);
    }

    #[test]
    fn dependencies_against_the_layers_are_found() {
        let packages = [
            package("mortise-brep", "host/brep", &[]),
            package("mortise-bake", "host/bake", &["cxx"]),
            package("mortise-protocol", "protocol", &["mortise-haptics"]),
            package("mortise-haptics", "firmware/haptics", &["mortise-brep"]),
            package("mortise-haptics-two", "firmware/haptics-two", &["mortise-brep"]),
            package("mortise-mating", "host/mating", &["mortise-brep", "mortise-bake"]),
        ];
        let found: Vec<String> = complaints(&packages).iter().map(ToString::to_string).collect();
        assert_eq!(
            found,
            [
                "host/bake/Cargo.toml: mortise-bake depends on cxx; only host/brep knows the CAD kernel",
                "protocol/Cargo.toml: mortise-protocol must not depend on mortise-haptics",
                "firmware/haptics/Cargo.toml: mortise-haptics must not depend on mortise-brep",
                "firmware/haptics-two/Cargo.toml: mortise-haptics-two must not depend on mortise-brep",
                "host/mating/Cargo.toml: mortise-mating must not depend on mortise-bake",
            ]
        );
    }

    #[test]
    fn this_repository_is_described() {
        let root = shell::root().unwrap();
        let found = packages(&root, &root).unwrap();
        let xtask = found.iter().find(|package| package.name == "xtask").unwrap();
        assert_eq!(xtask.directory, "host/xtask");
        assert!(xtask.dependencies.contains(&"tinyjson".to_owned()));
    }
}
