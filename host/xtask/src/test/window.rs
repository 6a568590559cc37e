//! Plays the sample insertion in the real program's window, on a virtual screen, and checks that it is drawn and moves; then, at twice the scale,
//! that the window fits the screen, and how much processor time it uses with a rig connected and the motors off.
//!
//! Needs no display and no GPU: Xvfb is the screen, Mesa draws in software.

use std::collections::HashSet;
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::bench::Bench;
use crate::shell;

/// Longest time for the window to appear and be drawn; software rendering of the first frame takes seconds.
const PATIENCE: Duration = Duration::from_secs(120);

/// Smallest number of colours of a drawn window: a blank one has one, an empty panel a handful; text with its smoothed edges alone has more than
/// this.
const COLOURS_MIN: u32 = 64;

/// Size of the virtual screen, pixels.
const SCREEN: (u32, u32) = (1600, 1000);
const SAMPLE: &str = "host/app/samples/pair_d18.75_clear1.00.step";
/// Largest processor time of drawing in an idle minute by software, in times of [`bake_s`] on the same computer, whose speed cancels out.
const DRAWING_MAX: f64 = 1.5;
/// Largest processor time of the program's own threads in an idle minute, in times of [`waits_s`] in the same minute. They wait, a thousand times a second
/// for the rig's ticks: what the system takes for that differs by nearly a factor of two, even on one computer from day to day.
const WAITING_MAX: f64 = 3.0;
/// What the names of these threads begin with; the main thread draws, and those of the renderer.
const OWN_THREADS: &str = "mortise-";
/// Name of the in-process rig's thread, which exists once the rig is connected.
const BOARD_THREAD: &str = "mortise-board";
/// Duration of a measurement: the time between two frames of an idle window.
const IDLE_SPAN: Duration = Duration::from_secs(60);
/// Number of measurements, of which one must hold: something else on the computer may slow one.
const IDLE_SPANS: usize = 3;
/// The window is idle once it has drawn nothing in each of so many seconds: reading, baking and connecting come first.
const QUIET: u32 = 4;
/// Processor time of a second in which nothing is drawn, s: a frame of this size takes ten times as much or more.
const QUIET_S: f64 = 0.03;

/// Smallest number of different frames: opening and baking the sample show a few, and live plots a new one each time.
const PICTURES_MIN: usize = 10;

pub fn run(bench: &mut Bench) -> Result<String> {
    if !cfg!(target_os = "linux") {
        return Ok("not run: there is no Xvfb on this system".to_owned());
    }
    let program = bench.programs()?.mortise;
    // Beside the build, where temporary files of a run belong.
    let place = program.parent().unwrap_or(Path::new(".")).join("window-test");
    std::fs::create_dir_all(&place)?;
    let screen = Screen::start(&place)?;
    let log = place.join("mortise.log");
    let mut child = start(&bench.root, &program, &screen, &log, 1, &["demo", "--rig", "sim"])?;
    let picture = place.join("window.png");
    let deadline = Instant::now() + PATIENCE;
    let mut seen = HashSet::new();
    loop {
        ended(&mut child, &log)?;
        if let Some(window) = visible_window(&screen.display) {
            take_picture(&screen.display, &window, &picture)?;
            let look = look_of(&picture)?;
            if look.colours >= COLOURS_MIN {
                seen.insert(look.signature);
                if seen.len() >= PICTURES_MIN {
                    let picture = shown(&bench.root, &picture);
                    drop(child);
                    let idle = idle_times(&bench.root, &program, &screen, &place)?;
                    return Ok(format!(
                        "drawn and moving, {} colours in {picture}; idle: {idle}",
                        look.colours
                    ));
                }
            }
        }
        if Instant::now() > deadline {
            bail!(
                "no window that {} within {} s (picture: {}); the program's output:\n{}",
                if seen.is_empty() { "is drawn" } else { "moves" },
                PATIENCE.as_secs(),
                shown(&bench.root, &picture),
                tail(&log)
            );
        }
        std::thread::sleep(Duration::from_millis(500));
    }
}

/// The program on the virtual screen.
fn start(
    root: &Path,
    program: &Path,
    screen: &Screen,
    log: &Path,
    scale: u32,
    arguments: &[&str],
) -> Result<Running> {
    let log = File::create(log)?;
    let child = Command::new(program)
        .args(arguments)
        .current_dir(root)
        .env("DISPLAY", &screen.display)
        .env("WINIT_X11_SCALE_FACTOR", scale.to_string())
        // Otherwise the window would open on the user's desktop.
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .stdin(Stdio::null())
        .stdout(log.try_clone()?)
        .stderr(log)
        .spawn()
        .with_context(|| format!("{} cannot be started", program.display()))?;
    Ok(Running(child))
}

/// Checks the processor time that the program uses with the sample open, the in-process rig connected, and its motors off, and returns it in words.
fn idle_times(root: &Path, program: &Path, screen: &Screen, place: &Path) -> Result<String> {
    let bake_s = bake_s(root, program, place)?;
    let log = place.join("idle.log");
    let arguments = ["open", SAMPLE, "--connect", "sim"];
    let mut child = start(root, program, screen, &log, 2, &arguments)?;
    let deadline = Instant::now() + PATIENCE;
    let window = loop {
        ended(&mut child, &log)?;
        match visible_window(&screen.display) {
            Some(window)
                if threads(child.0.id())
                    .iter()
                    .any(|thread| thread.1 == BOARD_THREAD) =>
            {
                break window;
            }
            _ if Instant::now() > deadline => bail!(
                "no rig is connected within {} s; the program's output:\n{}",
                PATIENCE.as_secs(),
                tail(&log)
            ),
            _ => std::thread::sleep(Duration::from_millis(500)),
        }
    };
    let (wide, high) = size_of(&screen.display, &window)?;
    if wide > SCREEN.0 || high > SCREEN.1 {
        bail!("at twice the scale the window is {wide} × {high}, larger than the screen");
    }
    quiet(&mut child, &log)?;
    let mut said = String::new();
    for _ in 0..IDLE_SPANS {
        let before = processor_s(child.0.id())?;
        let waits_s = waits_s()?;
        ended(&mut child, &log)?;
        let [drawing, waiting] = processor_s(child.0.id())?;
        let times = (drawing - before[0]) / bake_s;
        let waiting = waiting - before[1];
        let of_waits = waiting / waits_s;
        said = format!(
            "in a minute drawing takes {times:.1} times a bake of {bake_s:.2} s, the program's own threads {:.1} % of a core, {of_waits:.1} times what a thousand waits a second take",
            100.0 * waiting / IDLE_SPAN.as_secs_f64()
        );
        if times <= DRAWING_MAX && of_waits <= WAITING_MAX {
            take_picture(&screen.display, &window, &place.join("idle.png"))?;
            return Ok(said);
        }
        println!("{said}");
    }
    bail!("idle, with a rig connected, {said}; bounds: {DRAWING_MAX} and {WAITING_MAX} times")
}

/// Waits for [`IDLE_SPAN`], a thousand times a second, and returns the processor time that this takes, s.
fn waits_s() -> Result<f64> {
    let waiting = std::thread::spawn(|| {
        let begun = Instant::now();
        let mut next = Duration::ZERO;
        while next < IDLE_SPAN {
            next += Duration::from_millis(1);
            std::thread::sleep(next.saturating_sub(begun.elapsed()));
        }
        times_s("thread-self", 11)
    });
    let waits_s = waiting
        .join()
        .map_err(|_| anyhow::anyhow!("a thread that waits panicked"))??;
    if waits_s <= 0.0 {
        bail!("waiting takes no processor time: {waits_s} s");
    }
    Ok(waits_s)
}

/// Waits until the window draws nothing any more.
fn quiet(child: &mut Running, log: &Path) -> Result<()> {
    let deadline = Instant::now() + PATIENCE;
    let mut seconds = 0;
    while seconds < QUIET {
        let [before, _] = processor_s(child.0.id())?;
        std::thread::sleep(Duration::from_secs(1));
        ended(child, log)?;
        let [after, _] = processor_s(child.0.id())?;
        seconds = if after - before <= QUIET_S { seconds + 1 } else { 0 };
        if Instant::now() > deadline {
            bail!(
                "the window still draws after {} s with nothing moving",
                PATIENCE.as_secs()
            );
        }
    }
    Ok(())
}

/// An error if the program has ended.
fn ended(child: &mut Running, log: &Path) -> Result<()> {
    match child.0.try_wait()? {
        Some(status) => bail!(
            "the program ended by itself ({status}); its output:\n{}",
            tail(log)
        ),
        None => Ok(()),
    }
}

/// Processor time of baking the sample anew, s: the smallest of several.
fn bake_s(root: &Path, program: &Path, place: &Path) -> Result<f64> {
    let mut least = f64::INFINITY;
    for _ in 0..3 {
        let before = children_s()?;
        let mut bake = Command::new(program);
        bake.args(["bake", SAMPLE, "--no-cache", "--force", "-o"])
            .arg(place.join("sample.img"));
        shell::read(bake.current_dir(root))?;
        least = least.min(children_s()? - before);
    }
    if least <= 0.0 {
        bail!("baking the sample takes no processor time: {least} s");
    }
    Ok(least)
}

/// Processor time of a process so far, s: of drawing, and of [`OWN_THREADS`].
fn processor_s(process: u32) -> Result<[f64; 2]> {
    let all = times_s(&process.to_string(), 11)?;
    let own = threads(process)
        .into_iter()
        .filter(|(_, name)| name.starts_with(OWN_THREADS));
    // One that ends meanwhile has no file any more.
    let waiting = own
        .filter_map(|(thread, _)| times_s(&format!("{process}/task/{thread}"), 11).ok())
        .sum();
    Ok([all - waiting, waiting])
}

/// Threads of a process, with their names.
fn threads(process: u32) -> Vec<(String, String)> {
    let threads = std::fs::read_dir(format!("/proc/{process}/task"));
    (threads.into_iter().flatten().flatten())
        .filter_map(|thread| {
            let name = std::fs::read_to_string(thread.path().join("comm")).ok()?;
            Some((
                thread.file_name().to_string_lossy().into_owned(),
                name.trim().to_owned(),
            ))
        })
        .collect()
}

/// Processor time of the children of this program that have ended, s.
fn children_s() -> Result<f64> {
    times_s("self", 13)
}

/// The sum of user and system time of a process, s, which stand after `before` fields that follow its name.
fn times_s(process: &str, before: usize) -> Result<f64> {
    let path = format!("/proc/{process}/stat");
    let text = std::fs::read_to_string(&path).with_context(|| format!("reading {path}"))?;
    // The name, in parentheses, may contain spaces; times are in hundredths of a second (USER_HZ, the same on every Linux).
    let fields = text.rsplit_once(')').map_or("", |(_, fields)| fields);
    let times: Vec<f64> = (fields.split_whitespace().skip(before).take(2))
        .filter_map(|field| field.parse().ok())
        .collect();
    match times[..] {
        [user, system] => Ok((user + system) / 100.0),
        _ => bail!("{path} has no times: {text}"),
    }
}

/// Pixels of a window.
fn size_of(display: &str, window: &str) -> Result<(u32, u32)> {
    let mut command = Command::new("xdotool");
    command
        .args(["getwindowgeometry", "--shell", window])
        .env("DISPLAY", display);
    let text = shell::read(&mut command)?;
    let read = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key));
        line.and_then(|value| value.trim().parse().ok())
    };
    (read("WIDTH=").zip(read("HEIGHT="))).with_context(|| format!("`xdotool` printed `{}`", text.trim()))
}

/// A child process that is killed when the value is dropped.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already; any other failure cannot be handled here.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A virtual screen with an unused display number.
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
                    &format!("{}x{}x24", SCREEN.0, SCREEN.1),
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
                "Xvfb found no free display; its output:\n{}",
                tail(&place.join("xvfb.log"))
            );
        }
        Ok(Self {
            display: format!(":{}", line.trim()),
            _server: server,
        })
    }
}

/// Number of the program's window, once it is visible.
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

/// Fingerprint of a frame.
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
fn tail(log: &Path) -> String {
    let text = std::fs::read(log)
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(20)..].join("\n")
}

fn shown(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}
