//! Detects what is installed on this machine, without root rights and without starting a program.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use super::packages::{Package, Sign};

/// Depth of font folders: by kind, then by family.
const FONT_FOLDERS: usize = 3;

/// The directories to search. Tests point `root` at a directory of their own.
#[derive(Debug)]
pub struct Machine {
    root: PathBuf,
    path: Vec<PathBuf>,
    prefixes: Vec<PathBuf>,
    installed: HashSet<String>,
}

impl Machine {
    /// The machine this runs on.
    ///
    /// # Errors
    /// When dpkg's status file exists and cannot be read.
    pub fn this() -> Result<Self> {
        let status = Path::new("/var/lib/dpkg/status");
        let installed = if status.is_file() {
            let text = std::fs::read(status).with_context(|| format!("reading {}", status.display()))?;
            installed_packages(&String::from_utf8_lossy(&text))
        } else {
            HashSet::new()
        };
        let mut prefixes: Vec<PathBuf> = Vec::new();
        // A user's own OpenCASCADE, or conda's, counts like the system's.
        prefixes.extend(
            ["OCCT_ROOT", "CASROOT", "CONDA_PREFIX"]
                .iter()
                .filter_map(std::env::var_os)
                .map(PathBuf::from),
        );
        prefixes.extend(std::env::var_os("CONDA_PREFIX").map(|conda| Path::new(&conda).join("Library")));
        prefixes.extend(
            std::env::var_os("VCPKG_ROOT")
                .map(|vcpkg| Path::new(&vcpkg).join("installed").join("x64-windows")),
        );
        prefixes.extend(
            ["usr", "usr/local", "opt/homebrew", "opt/local"]
                .iter()
                .map(|prefix| Path::new("/").join(prefix)),
        );
        let path = std::env::var_os("PATH").unwrap_or_default();
        Ok(Self {
            root: "/".into(),
            path: std::env::split_paths(&path).collect(),
            prefixes,
            installed,
        })
    }

    /// True if `package`, or its equivalent from another source, is installed.
    pub fn has(&self, package: &Package) -> bool {
        self.installed.contains(package.apt) || self.shows(package.sign)
    }

    fn shows(&self, sign: Sign) -> bool {
        match sign {
            // The Windows compiler is not in `PATH`; the build finds it through its own registry.
            Sign::Program("c++") if cfg!(windows) => true,
            Sign::Program(name) => {
                let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
                self.path.iter().any(|place| place.join(&file).is_file())
            }
            Sign::Header(name) => self
                .prefixes
                .iter()
                .any(|prefix| prefix.join("include").join(name).is_file()),
            Sign::Library(name) => self
                .library_places()
                .iter()
                .any(|place| place.join(name).is_file()),
            Sign::VulkanDriver => [
                "usr/share/vulkan/icd.d",
                "usr/local/share/vulkan/icd.d",
                "etc/vulkan/icd.d",
            ]
            .iter()
            .any(|place| {
                entries(&self.root.join(place))
                    .iter()
                    .any(|file| file.extension().is_some_and(|end| end == "json"))
            }),
            Sign::Font(names) => ["usr/share/fonts", "usr/local/share/fonts"]
                .iter()
                .any(|place| holds_font(&self.root.join(place), names, FONT_FOLDERS)),
        }
    }

    /// `lib`, `lib64` and the multi-architecture directories below each prefix.
    fn library_places(&self) -> Vec<PathBuf> {
        let own = format!("{}-linux-gnu", std::env::consts::ARCH);
        self.prefixes
            .iter()
            .flat_map(|prefix| {
                [
                    prefix.join("lib"),
                    prefix.join("lib64"),
                    prefix.join("lib").join(&own),
                ]
            })
            .collect()
    }
}

/// True if the name of a file below `folder`, at most `depth` folders down, begins with one of `names`.
fn holds_font(folder: &Path, names: &[&str], depth: usize) -> bool {
    entries(folder).iter().any(|entry| {
        let name = entry.file_name().unwrap_or_default().to_string_lossy();
        names.iter().any(|known| name.starts_with(known))
            || (depth > 0 && holds_font(entry, names, depth - 1))
    })
}

/// Names of the packages that a dpkg status file lists as installed, without their architecture.
pub fn installed_packages(status: &str) -> HashSet<String> {
    let mut installed = HashSet::new();
    let mut name = None;
    for line in status.lines() {
        if line.is_empty() {
            name = None;
        } else if let Some(value) = line.strip_prefix("Package:") {
            name = Some(value.trim());
        } else if let Some(value) = line.strip_prefix("Status:") {
            // "want error state": `deinstall ok config-files` is a removed package, `half-installed` a broken one.
            if value.split_whitespace().nth(2) == Some("installed")
                && let Some(name) = name
            {
                installed.insert(name.to_owned());
            }
        }
    }
    installed
}

fn entries(directory: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(directory)
        .map(|entries| {
            entries
                .filter_map(|entry| entry.ok().map(|entry| entry.path()))
                .collect()
        })
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::packages::{Group, PACKAGES};
    use super::*;

    const STATUS: &str = "\
Package: g++
Status: install ok installed
Priority: optional
Architecture: amd64
Description: GNU C++ compiler
 This is a long text: Status: install ok installed

Package: xvfb
Status: deinstall ok config-files
Architecture: amd64

Package: libvulkan1
Status: hold ok installed
Architecture: arm64
Multi-Arch: same

Package: xdotool
Status: install reinstreq half-installed
";

    fn machine(root: &Path, status: &str) -> Machine {
        Machine {
            root: root.into(),
            path: vec![root.join("usr/bin")],
            prefixes: vec![root.join("usr")],
            installed: installed_packages(status),
        }
    }

    fn touch(path: PathBuf) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }

    #[test]
    fn only_wholly_installed_packages_count() {
        let mut names: Vec<_> = installed_packages(STATUS).into_iter().collect();
        names.sort();
        assert_eq!(names, ["g++", "libvulkan1"]);
        assert!(installed_packages("").is_empty());
    }

    #[test]
    fn an_empty_machine_lacks_every_package() {
        let place = tempfile::tempdir().unwrap();
        let machine = machine(place.path(), "");
        assert!(PACKAGES.iter().all(|package| !machine.has(package)));
    }

    #[test]
    fn what_dpkg_does_not_know_is_found_by_its_files() {
        let place = tempfile::tempdir().unwrap();
        let usr = place.path().join("usr");
        touch(
            usr.join("bin")
                .join(format!("c++{}", std::env::consts::EXE_SUFFIX)),
        );
        touch(usr.join("include/opencascade/STEPCAFControl_Reader.hxx"));
        touch(usr.join(format!("lib/{}-linux-gnu/libvulkan.so.1", std::env::consts::ARCH)));
        touch(usr.join("share/vulkan/icd.d/lvp_icd.x86_64.json"));
        let machine = machine(place.path(), "");
        let mut found: Vec<_> = PACKAGES
            .iter()
            .filter(|package| machine.has(package))
            .map(|package| package.apt)
            .collect();
        found.sort_unstable();
        assert_eq!(
            found,
            [
                "g++",
                "libocct-data-exchange-dev",
                "libvulkan1",
                "mesa-vulkan-drivers"
            ]
        );
    }

    #[test]
    fn names_are_unique_and_every_group_but_checks_has_packages() {
        let names: HashSet<_> = PACKAGES.iter().map(|package| package.apt).collect();
        assert_eq!(names.len(), PACKAGES.len());
        for group in Group::ALL {
            let any = PACKAGES.iter().any(|package| package.group == group);
            assert_eq!(any, group != Group::Checks, "{group:?}");
        }
    }
}
