//! Libraries that the archive brings along: the CAD kernel and what it needs, without what belongs to every desktop.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use super::tree::copy;
use crate::shell;

/// Beginnings of names of libraries that stay with the system: its C and C++ libraries and what drivers of displays share with the program, which must
/// be as new as these; fonts and display connections, which belong to a session.
const OF_SYSTEM: [&str; 17] = [
    "ld-linux",
    "libc.",
    "libm.",
    "libdl.",
    "libpthread.",
    "librt.",
    "libgcc_s.",
    "libstdc++.",
    "libX11.",
    "libX11-xcb.",
    "libxcb.",
    "libXau.",
    "libXdmcp.",
    "libfontconfig.",
    "libfreetype.",
    "libexpat.",
    "libz.",
];
/// Beginning of names of the kernel's libraries.
const OF_KERNEL: &str = "libTK";

/// Copies what the program below `prefix` needs, with the licences if dpkg knows them, and lets the program and the libraries find them there.
pub fn bring_along(prefix: &Path) -> Result<()> {
    let program = prefix.join("bin/mortise");
    let notices = prefix.join("share/doc/mortise/libraries");
    for path in of(&program)? {
        let name = path.file_name().context("a library without a name")?;
        if belongs_to_system(&name.to_string_lossy()) {
            continue;
        }
        let own = prefix.join("lib/mortise").join(name);
        copy(&path, &own)?;
        look_in(&own, "$ORIGIN")?;
        if let Some((package, notice)) = notice(&path) {
            copy(&notice, &notices.join(package))?;
        }
    }
    look_in(&program, "$ORIGIN/../lib/mortise")
}

/// Lets a program or library look for its libraries in `folder` first.
fn look_in(file: &Path, folder: &str) -> Result<()> {
    shell::read(Command::new("patchelf").arg("--set-rpath").arg(folder).arg(file)).map(drop)
}

/// Libraries of the CAD kernel that `program` loads.
pub fn of_kernel(program: &Path) -> Result<Vec<PathBuf>> {
    let mut all = of(program)?;
    all.retain(|path| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with(OF_KERNEL))
    });
    Ok(all)
}

/// Libraries that `program` loads, those that its libraries need included.
fn of(program: &Path) -> Result<Vec<PathBuf>> {
    Ok(listed(&shell::read(
        Command::new("ldd").arg(program).env_remove("LD_LIBRARY_PATH"),
    )?))
}

/// Paths in what `ldd` says: lines as `libname.so.1 => /path/libname.so.1 (0x…)`.
fn listed(said: &str) -> Vec<PathBuf> {
    let path = |line: &str| {
        let (_, path) = line.split_once("=> ")?;
        let (path, _) = path.rsplit_once(" (0x")?;
        Some(PathBuf::from(path))
    };
    said.lines().filter_map(path).collect()
}

fn belongs_to_system(name: &str) -> bool {
    OF_SYSTEM.iter().any(|start| name.starts_with(start))
}

/// The package that a library is from, and the file with its licence.
fn notice(library: &Path) -> Option<(String, PathBuf)> {
    // By the file's name, because systems differ in which of two linked folders the list of files has.
    let real = library.canonicalize().ok()?;
    let list = Command::new("dpkg")
        .arg("-S")
        .arg(real.file_name()?)
        .output()
        .ok()?;
    let said = String::from_utf8_lossy(&list.stdout);
    let package = said.split(':').next()?.trim().to_owned();
    let file = Path::new("/usr/share/doc").join(&package).join("copyright");
    file.is_file().then_some((package, file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_read_from_ldd() {
        let said = "\tlinux-vdso.so.1 (0x00007ffc)\n\tlibTKernel.so.7 => /usr/lib/x/libTKernel.so.7 (0x00007f0)\n\
                    \t/lib64/ld-linux-x86-64.so.2 (0x00007f1)\n\tlibgone.so.1 => not found\n";
        assert_eq!(listed(said), [PathBuf::from("/usr/lib/x/libTKernel.so.7")]);
    }

    #[test]
    fn the_kernel_comes_along_and_the_c_library_does_not() {
        for name in [
            "libc.so.6",
            "libstdc++.so.6",
            "libX11.so.6",
            "ld-linux-x86-64.so.2",
        ] {
            assert!(belongs_to_system(name), "{name}");
        }
        for name in [
            "libTKernel.so.7",
            "libtbb.so.12",
            "libcrypt.so.1",
            "libmd.so.0",
            "libzstd.so.1",
        ] {
            assert!(!belongs_to_system(name), "{name}");
        }
    }
}
