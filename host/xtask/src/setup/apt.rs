//! Installing with apt-get, as root or through sudo.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use super::advice;
use super::sources::{self, Backports, Source};
use crate::shell;

/// Package that apt-get can refuse to install from the release's own suite when newer packages of the same source (`qemu-utils`) are installed from
/// backports.
const FROM_BACKPORTS_IF_REFUSED: &str = "qemu-system-arm";

/// The file that this program may add. It is separate, so that none of the user's files is edited.
const BACKPORTS_FILE: &str = "/etc/apt/sources.list.d/mortise-backports.list";

/// Options that install only the named packages and their dependencies and never remove a package of the user's: apt-get would remove a newer
/// `qemu-utils` to install an older emulator.
const SPARING: [&str; 2] = ["--no-install-recommends", "--no-remove"];

/// Installs `packages`, none of which is installed.
///
/// # Errors
/// When there are neither root rights nor sudo, or apt-get fails; its output was passed through.
pub fn install(packages: &[&str]) -> Result<()> {
    let rights = Rights::find(packages)?;
    if lists_are_absent(Path::new("/var/lib/apt/lists")) {
        rights.apt_get(&["update"])?;
    }
    if !would_install(packages)? {
        // The package lists may be too old to contain the packages: update them first.
        rights.apt_get(&["update"])?;
    }
    let (refused, plain): (Vec<&str>, Vec<&str>) = if would_install(packages)? {
        (Vec::new(), packages.to_vec())
    } else {
        packages
            .iter()
            .partition(|name| **name == FROM_BACKPORTS_IF_REFUSED)
    };
    if !plain.is_empty() {
        install_from(&rights, None, &plain)?;
    }
    if !refused.is_empty() {
        let suite = add_backports(&rights)?;
        install_from(&rights, Some(&suite), &refused)?;
    }
    Ok(())
}

/// The command that a person types.
pub fn install_line(packages: &[&str]) -> String {
    format!("apt-get install {} {}", SPARING.join(" "), packages.join(" "))
}

fn install_from(rights: &Rights, suite: Option<&str>, packages: &[&str]) -> Result<()> {
    let mut arguments = vec!["install", "--yes"];
    arguments.extend(SPARING);
    if let Some(suite) = suite {
        arguments.extend(["--target-release", suite]);
    }
    arguments.extend(packages);
    if rights.apt_get(&arguments).is_err() {
        // Mirrors drop superseded versions, so a stale list names files that no longer exist.
        eprintln!("apt-get failed; trying once more with fresh lists.");
        rights.apt_get(&["update"])?;
        rights.apt_get(&arguments)?;
    }
    Ok(())
}

/// True if apt-get can install `packages`, by a simulation that needs no root rights.
fn would_install(packages: &[&str]) -> Result<bool> {
    let output = Command::new("apt-get")
        .args(["--simulate", "install"])
        .args(SPARING)
        .args(packages)
        .stdin(Stdio::null())
        .output()
        .context("`apt-get` cannot be started")?;
    Ok(output.status.success())
}

/// Adds the backports suite and returns its name.
fn add_backports(rights: &Rights) -> Result<String> {
    let release = std::fs::read_to_string("/etc/os-release").context("reading /etc/os-release")?;
    let Some(codename) = advice::os_release_value(&release, "VERSION_CODENAME") else {
        bail!("/etc/os-release has no VERSION_CODENAME, so the name of its backports suite is unknown");
    };
    if let Backports::Add(line) = sources::backports(&read_sources(Path::new("/etc/apt"))?, &codename)? {
        eprintln!(
            "{FROM_BACKPORTS_IF_REFUSED} cannot be installed from {codename} beside what is there; \
             adding {BACKPORTS_FILE}:\n  {line}"
        );
        rights.write(Path::new(BACKPORTS_FILE), &format!("{line}\n"))?;
    }
    rights.apt_get(&["update"])?;
    Ok(format!("{codename}-backports"))
}

/// All enabled sources below `etc_apt`, which is `/etc/apt`.
fn read_sources(etc_apt: &Path) -> Result<Vec<Source>> {
    let mut files = vec![etc_apt.join("sources.list")];
    if let Ok(entries) = std::fs::read_dir(etc_apt.join("sources.list.d")) {
        files.extend(entries.filter_map(|entry| entry.ok().map(|entry| entry.path())));
    }
    files.sort();
    let mut found = Vec::new();
    for file in files.iter().filter(|file| file.is_file()) {
        let read = || std::fs::read_to_string(file).with_context(|| format!("reading {}", file.display()));
        match file.extension().and_then(|end| end.to_str()) {
            Some("list") => found.extend(sources::parse_list(&read()?)),
            Some("sources") => found.extend(sources::parse_deb822(&read()?)),
            _ => {}
        }
    }
    Ok(found)
}

/// True if apt's package lists were never downloaded, as in a fresh container.
fn lists_are_absent(lists: &Path) -> bool {
    let entries: Vec<PathBuf> = std::fs::read_dir(lists)
        .map(|entries| {
            entries
                .filter_map(|entry| entry.ok().map(|entry| entry.path()))
                .collect()
        })
        .unwrap_or_default();
    !entries.iter().any(|file| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        // Files are plain or compressed: `…_Packages`, `…_Packages.lz4`.
        name.rsplit_once("_Packages")
            .is_some_and(|(_, end)| end.is_empty() || end.starts_with('.'))
    })
}

/// How commands get root rights.
enum Rights {
    Root,
    Sudo,
}

impl Rights {
    fn find(packages: &[&str]) -> Result<Self> {
        let user = shell::read(Command::new("id").arg("-u"))?;
        if user.trim() == "0" {
            Ok(Self::Root)
        } else if shell::find_program("sudo").is_some() {
            Ok(Self::Sudo)
        } else {
            bail!(
                "installing needs root and there is no sudo; as root, run: {}",
                install_line(packages)
            )
        }
    }

    fn command(&self, program: &str) -> Command {
        match self {
            Self::Root => Command::new(program),
            Self::Sudo => {
                let mut command = Command::new("sudo");
                command.arg(program);
                command
            }
        }
    }

    fn apt_get(&self, arguments: &[&str]) -> Result<()> {
        // Through `env`, because sudo does not pass the caller's environment on.
        shell::run(
            self.command("env")
                .args(["DEBIAN_FRONTEND=noninteractive", "apt-get"])
                // A machine just started may be updating itself: wait for its lock, s.
                .args(["-o", "DPkg::Lock::Timeout=300"])
                .args(arguments)
                .stdin(Stdio::null()),
        )
    }

    fn write(&self, path: &Path, text: &str) -> Result<()> {
        let mut command = self.command("tee");
        let mut child = command
            .arg(path)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .context("`tee` cannot be started")?;
        if let Some(mut input) = child.stdin.take() {
            input.write_all(text.as_bytes())?;
        }
        if !child.wait()?.success() {
            bail!("{} cannot be written", path.display());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_count_whether_compressed_or_not() {
        let place = tempfile::tempdir().unwrap();
        assert!(lists_are_absent(&place.path().join("none")));
        std::fs::write(place.path().join("lock"), "").unwrap();
        std::fs::write(
            place.path().join("deb.example_debian_dists_bookworm_InRelease"),
            "",
        )
        .unwrap();
        assert!(lists_are_absent(place.path()));
        std::fs::write(
            place
                .path()
                .join("deb.example_dists_bookworm_main_binary-amd64_Packages.lz4"),
            "",
        )
        .unwrap();
        assert!(!lists_are_absent(place.path()));
    }

    #[test]
    fn both_kinds_of_source_files_are_read_and_others_are_not() {
        let place = tempfile::tempdir().unwrap();
        let more = place.path().join("sources.list.d");
        std::fs::create_dir(&more).unwrap();
        std::fs::write(
            place.path().join("sources.list"),
            "deb http://a.example/debian bookworm main\n",
        )
        .unwrap();
        std::fs::write(
            more.join("b.sources"),
            "Types: deb\nURIs: http://b.example\nSuites: bookworm-backports\nComponents: main\n",
        )
        .unwrap();
        std::fs::write(
            more.join("c.list.disabled"),
            "deb http://c.example bookworm main\n",
        )
        .unwrap();
        let found = read_sources(place.path()).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!(
            sources::backports(&found, "bookworm").unwrap(),
            Backports::Present
        );
    }
}
