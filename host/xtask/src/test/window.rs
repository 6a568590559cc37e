//! Opens the real program in a window on a virtual screen and looks at what it draws.
//!
//! Needs no display and no GPU: Xvfb is the screen, Mesa draws in software.

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
    let mut child = Running(
        Command::new(&program)
            .current_dir(&bench.root)
            .env("DISPLAY", &screen.display)
            // Or the window would open on the desktop of whoever runs this.
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .stdin(Stdio::null())
            .stdout(File::create(&log)?)
            .stderr(File::options().append(true).open(&log)?)
            .spawn()
            .with_context(|| format!("{} cannot be started", program.display()))?,
    );
    let picture = place.join("window.png");
    let deadline = Instant::now() + PATIENCE;
    loop {
        if let Some(status) = child.0.try_wait()? {
            bail!("the program ended by itself ({status}); it said:\n{}", tail(&log));
        }
        if let Some(window) = visible_window(&screen.display) {
            take_picture(&screen.display, &window, &picture)?;
            let colours = colours_in(&picture)?;
            if colours >= COLOURS_MIN {
                return Ok(format!("{colours} colours in {}", shown(&bench.root, &picture)));
            }
        }
        if Instant::now() > deadline {
            bail!(
                "no drawn window within {} s (picture: {}); the program said:\n{}",
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

fn colours_in(picture: &Path) -> Result<u32> {
    let text = shell::read(Command::new("identify").args(["-format", "%k"]).arg(picture))?;
    text.trim()
        .parse()
        .with_context(|| format!("`identify` printed `{}`", text.trim()))
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
