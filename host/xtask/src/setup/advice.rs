//! Detects the operating system, and lists the commands to type where this program installs nothing.

use super::packages::{Group, Package};
use super::rust::Part;

/// Systems, distinguished by their installers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum System {
    /// Debian, Ubuntu and their derivatives.
    Apt,
    /// Fedora and its derivatives.
    Dnf,
    /// Arch and its derivatives.
    Pacman,
    /// macOS.
    Mac,
    /// Windows.
    Windows,
    /// Anything else.
    Other,
}

impl System {
    /// The system this runs on.
    pub fn this() -> Self {
        if cfg!(target_os = "macos") {
            Self::Mac
        } else if cfg!(target_os = "windows") {
            Self::Windows
        } else {
            Self::from_os_release(&std::fs::read_to_string("/etc/os-release").unwrap_or_default())
        }
    }

    fn from_os_release(text: &str) -> Self {
        let mut families = os_release_value(text, "ID").unwrap_or_default();
        families.push(' ');
        families.push_str(&os_release_value(text, "ID_LIKE").unwrap_or_default());
        families
            .split_whitespace()
            .find_map(|family| match family {
                "debian" | "ubuntu" => Some(Self::Apt),
                "fedora" | "rhel" => Some(Self::Dnf),
                "arch" => Some(Self::Pacman),
                _ => None,
            })
            .unwrap_or(Self::Other)
    }
}

/// Value of a variable in the text of `/etc/os-release`, without quotes.
pub fn os_release_value(text: &str, name: &str) -> Option<String> {
    text.lines()
        .filter_map(|line| line.split_once('='))
        .find(|(key, _)| key.trim() == name)
        .map(|(_, value)| value.trim().trim_matches(['"', '\'']).to_owned())
        .filter(|value| !value.is_empty())
}

/// The commands that a person types to install `packages` and `parts` on `system`.
pub fn commands(system: System, packages: &[&Package], parts: &[Part]) -> Vec<String> {
    let has = |group: Group| packages.iter().any(|package| package.group == group);
    let list = |name: fn(&Package) -> &'static str| {
        let mut names: Vec<&str> = Vec::new();
        for package in packages {
            if !names.contains(&name(package)) {
                names.push(name(package));
            }
        }
        names.join(" ")
    };
    let mut lines = match system {
        System::Apt => vec![format!("sudo apt-get install {}", list(|package| package.apt))],
        System::Dnf => vec![format!("sudo dnf install {}", list(|package| package.dnf))],
        System::Pacman => vec![format!(
            "sudo pacman -S --needed {}",
            list(|package| package.pacman)
        )],
        System::Mac => {
            let mut lines = Vec::new();
            if packages.iter().any(|package| package.apt == "g++") {
                lines.push("xcode-select --install".to_owned());
            }
            if has(Group::Build) {
                lines.push("brew install opencascade".to_owned());
            }
            if has(Group::Board) {
                lines.push("brew install qemu".to_owned());
            }
            lines
        }
        System::Windows => {
            let mut lines = Vec::new();
            if has(Group::Build) {
                lines.push("winget install --id Microsoft.VisualStudio.2022.BuildTools".to_owned());
                lines.push(
                    "vcpkg install opencascade:x64-windows     (or: conda install -c conda-forge occt)"
                        .to_owned(),
                );
            }
            if has(Group::Board) {
                lines.push("winget install --id SoftwareFreedomConservancy.QEMU".to_owned());
            }
            lines
        }
        System::Other => vec![format!(
            "your package manager, by Debian's names: {}",
            list(|package| package.apt)
        )],
    };
    lines.extend(parts.iter().map(|part| part.add_line()));
    lines
}

#[cfg(test)]
mod tests {
    use super::super::packages::PACKAGES;
    use super::*;

    #[test]
    fn systems_are_identified_by_id_and_family() {
        let cases = [
            ("ID=debian\nVERSION_CODENAME=bookworm\n", System::Apt),
            (
                "NAME=\"Linux Mint\"\nID=linuxmint\nID_LIKE=\"ubuntu debian\"\n",
                System::Apt,
            ),
            ("ID=\"rocky\"\nID_LIKE=\"rhel centos fedora\"\n", System::Dnf),
            ("ID=manjaro\nID_LIKE=arch\n", System::Pacman),
            ("ID=nixos\n", System::Other),
            ("", System::Other),
        ];
        for (text, system) in cases {
            assert_eq!(System::from_os_release(text), system, "{text}");
        }
        assert_eq!(
            os_release_value(cases[0].0, "VERSION_CODENAME").as_deref(),
            Some("bookworm")
        );
        assert_eq!(os_release_value("VERSION_CODENAME=\n", "VERSION_CODENAME"), None);
    }

    #[test]
    fn commands_name_each_package_once() {
        let all: Vec<&Package> = PACKAGES.iter().collect();
        let fedora = commands(System::Dnf, &all, &[Part::Target]);
        assert_eq!(fedora[0].matches("opencascade-devel").count(), 1);
        assert_eq!(fedora[1], "rustup target add thumbv7em-none-eabihf");
        let board: Vec<&Package> = PACKAGES
            .iter()
            .filter(|package| package.group == Group::Board)
            .collect();
        assert_eq!(commands(System::Mac, &board, &[]), ["brew install qemu"]);
        assert_eq!(
            commands(System::Windows, &board, &[]),
            ["winget install --id SoftwareFreedomConservancy.QEMU"]
        );
    }
}
