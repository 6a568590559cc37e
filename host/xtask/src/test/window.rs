//! Plays the sample insertion in the real program's window, on a virtual screen, and looks whether it
//! is drawn and moves.
//!
//! Needs no display and no GPU: Xvfb is the screen, Mesa draws in software.

use std::collections::HashSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::Bench;
use crate::shell;

/// Time for the window to appear and be drawn; software rendering of the first frame takes seconds.
const PATIENCE: Duration = Duration::from_secs(120);

/// A blank window has one colour and an empty panel a handful; text alone, with its smoothed
/// edges, has more than this.
const COLOURS_MIN: u32 = 64;

/// Different pictures to be seen: opening and baking the sample show a few, live plots one each time.
const PICTURES_MIN: usize = 10;

pub fn run(bench: &mut Bench) -> Result<String> {
    if !cfg!(target_os = "linux") {
        return Ok("not run: there is no Xvfb on this system".to_owned());
    }
    let program = bench.program()?;
    // Beside the build, which is where passing files of a run belong.
    let place = program.parent().unwrap_or(Path::new(".")).join("window-test");
    std::fs::create_dir_all(&place)?;
    let screen = Screen::start(&place)?;
    let log = place.join("mortise.log");
    let log_file = File::create(&log)?;
    let mut child = Running(
        Command::new(&program)
            .args(["demo", "--rig", "sim"])
            .current_dir(&bench.root)
            .env("DISPLAY", &screen.display)
            // Or the window would open on the desktop of whoever runs this.
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .stdin(Stdio::null())
            .stdout(log_file.try_clone()?)
            .stderr(log_file)
            .spawn()
            .with_context(|| format!("{} cannot be started", program.display()))?,
    );
    let picture = place.join("window.png");
    let deadline = Instant::now() + PATIENCE;
    let mut seen = HashSet::new();
    loop {
        if let Some(status) = child.0.try_wait()? {
            bail!("the program ended by itself ({status}); it said:\n{}", tail(&log));
        }
        if let Some(window) = visible_window(&screen.display) {
            take_picture(&screen.display, &window, &picture)?;
            let look = look_of(&picture)?;
            if look.colours >= COLOURS_MIN {
                seen.insert(look.signature);
                if seen.len() >= PICTURES_MIN {
                    let picture = shown(&bench.root, &picture);
                    return Ok(format!("drawn and moving, {} colours in {picture}", look.colours));
                }
            }
        }
        if Instant::now() > deadline {
            bail!(
                "no window that {} within {} s (picture: {}); the program said:\n{}",
                if seen.is_empty() { "is drawn" } else { "moves" },
                PATIENCE.as_secs(),
                shown(&bench.root, &picture),
                tail(&log)
            );
        }
        std::thread::sleep(Duration::from_millis(500));
    }
}

/// A child that does not outlive its value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already; there is nothing to do about any other failure here.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A virtual screen with a number that was free.
struct Screen {
    display: String,
    _server: Running,
}

impl Screen {
    fn start(place: &Path) -> Result<Self> {
        let mut server = Running(
            Command::new("Xvfb")
                .args([
                    "-displayfd",
                    "1",
                    "-screen",
                    "0",
                    "1600x1000x24",
                    "-nolisten",
                    "tcp",
                ])
                .stdin(Stdio::null())
                .stdout(Stdio::piped())
                .stderr(File::create(place.join("xvfb.log"))?)
                .spawn()
                .context("`Xvfb` cannot be started")?,
        );
        let output = server.0.stdout.take().context("standard output was not piped")?;
        let mut line = String::new();
        std::io::BufRead::read_line(&mut std::io::BufReader::new(output), &mut line)?;
        if line.trim().is_empty() {
            bail!(
                "Xvfb found no free display; it said:\n{}",
                tail(&place.join("xvfb.log"))
            );
        }
        Ok(Self {
            display: format!(":{}", line.trim()),
            _server: server,
        })
    }
}

/// Number of the program's window, once it is shown.
fn visible_window(display: &str) -> Option<String> {
    let output = Command::new("xdotool")
        .args(["search", "--onlyvisible", "--name", "[Mm]ortise"])
        .env("DISPLAY", display)
        .output()
        .ok()?;
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .next()
        .map(str::to_owned)
}

fn take_picture(display: &str, window: &str, picture: &Path) -> Result<()> {
    let mut command = Command::new("import");
    command
        .env("DISPLAY", display)
        .args(["-window", window])
        .arg(picture);
    let status = command
        .status()
        .context("`import` (ImageMagick) cannot be started")?;
    if !status.success() {
        bail!("`{}` failed ({status})", shell::line_of(&command));
    }
    Ok(())
}

/// What tells one picture from another.
#[derive(Debug)]
struct Look {
    colours: u32,
    /// Hash of all pixels.
    signature: String,
}

fn look_of(picture: &Path) -> Result<Look> {
    let text = shell::read(Command::new("identify").args(["-format", "%k %#"]).arg(picture))?;
    let parsed = text.split_once(' ').and_then(|(colours, signature)| {
        Some(Look {
            colours: colours.parse().ok()?,
            signature: signature.trim().to_owned(),
        })
    });
    parsed.with_context(|| format!("`identify` printed `{}`", text.trim()))
}

/// The last lines of a log.
fn tail(log: &PathBuf) -> String {
    let text = std::fs::read(log)
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(20)..].join("\n")
}

fn shown(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}
