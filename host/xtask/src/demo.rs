//! `cargo xtask demo`: from nothing to the sample insertion, on the best rig this machine has.

use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result};

use crate::arguments::Demo;
use crate::setup::{self, Consent, Group};
use crate::{firmware, program, shell};

/// Builds what is needed and runs `mortise demo` with the caller's arguments.
pub fn command(arguments: &Demo) -> Result<ExitCode> {
    let root = shell::root()?;
    let consent = Consent::from(arguments.installing);
    let mut headless = arguments.headless;
    if !headless && !display_is_there() {
        eprintln!("There is no display here: running with --headless, and building without the window.");
        headless = true;
    }
    let needed: &[Group] = if headless {
        &[Group::Build]
    } else {
        &[Group::Build, Group::Window]
    };
    if !setup::ensure(needed, consent)? {
        return Ok(ExitCode::FAILURE);
    }
    let mut rig = arguments.rig.clone();
    if rig.as_deref().is_none_or(|rig| rig == "emulated") {
        if setup::ensure(&[Group::Board], consent)? {
            firmware::build(&root, firmware::EMULATED)?;
            rig = Some("emulated".to_owned());
        } else if rig.is_some() {
            eprintln!("The emulated board was asked for and cannot run without what is missing.");
            return Ok(ExitCode::FAILURE);
        } else {
            eprintln!("Without the emulated board: running in this process.");
            rig = Some("sim".to_owned());
        }
    }
    let mut words: Vec<String> = arguments.file.iter().cloned().collect();
    for (given, option) in [(headless, "--headless"), (arguments.json, "--json")] {
        words.extend(given.then(|| option.to_owned()));
    }
    words.extend(rig.into_iter().flat_map(|rig| ["--rig".to_owned(), rig]));
    words.extend(arguments.further.iter().cloned());
    run(&program::build_mortise(&root, !headless)?, &words)
}

fn run(program: &Path, arguments: &[String]) -> Result<ExitCode> {
    eprintln!("$ mortise demo {}", arguments.join(" "));
    // In the caller's directory, so that relative paths among the arguments mean what was meant.
    let status = Command::new(program)
        .arg("demo")
        .args(arguments)
        .status()
        .with_context(|| format!("{} cannot be started", program.display()))?;
    Ok(status
        .code()
        .and_then(|code| u8::try_from(code).ok())
        .map_or(ExitCode::FAILURE, ExitCode::from))
}

/// True if a window can be opened: macOS and Windows always say so, Linux by its variables.
fn display_is_there() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    if let Some(name) = set("WAYLAND_DISPLAY") {
        // Relative to the session's directory, unless absolute.
        let socket = Path::new(&set("XDG_RUNTIME_DIR").unwrap_or_default()).join(name);
        if socket.exists() {
            return true;
        }
    }
    set("DISPLAY").is_some_and(|display| x_server_answers(&display))
}

/// A variable left behind by a session that is gone must not pass for a display. Remote displays
/// (`host:0`) are believed.
fn x_server_answers(display: &str) -> bool {
    #[cfg(target_os = "linux")]
    if let Some(number) = local_display_number(display) {
        use std::os::linux::net::SocketAddrExt;
        use std::os::unix::net::{SocketAddr, UnixStream};
        let path = format!("/tmp/.X11-unix/X{number}");
        let abstract_socket = SocketAddr::from_abstract_name(path.as_bytes())
            .and_then(|address| UnixStream::connect_addr(&address));
        return UnixStream::connect(&path).is_ok() || abstract_socket.is_ok();
    }
    !display.is_empty()
}

/// `:1.0` and `unix:1` are display 1 of this machine.
#[cfg(target_os = "linux")]
fn local_display_number(display: &str) -> Option<u32> {
    let (host, rest) = display.rsplit_once(':')?;
    if !matches!(host, "" | "unix") {
        return None;
    }
    rest.split('.').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn displays_of_this_machine_are_distinguished_from_remote_ones() {
        assert_eq!(local_display_number(":1.0"), Some(1));
        assert_eq!(local_display_number("unix:12"), Some(12));
        assert_eq!(local_display_number("localhost:10.0"), None);
        assert_eq!(local_display_number(""), None);
        // No X server has this number: 65535 is beyond the ports they would use.
        assert!(!x_server_answers(":65535"));
    }
}
