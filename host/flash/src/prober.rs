//! The program `probe-rs`: finds debug probes, writes firmware through one, and reads everything back.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use crate::error::FlashError;
use crate::firmware::Firmware;
use crate::probe::Probe;

/// Name of the program.
const PROGRAM: &str = "probe-rs";
/// Longest silence of the program: a chip of 2 MiB is erased within 32 s in the worst case of its data sheet.
const SILENCE: Duration = Duration::from_secs(60);
/// Time between two calls that ask whether the operator ended it; the documentation of [`Prober::write`] has it as well.
const LOOK: Duration = Duration::from_millis(50);
/// Number of the program's last lines that an error quotes.
const QUOTED: usize = 4;
/// Longest line that is quoted, characters.
const MAX_LINE: usize = 300;

/// The program that finds probes and writes through them.
#[derive(Clone, Debug)]
pub struct Prober {
    program: PathBuf,
    silence: Duration,
}

impl Prober {
    /// Searches the program in the folders of `PATH`, and where cargo installs programs.
    ///
    /// # Errors
    /// [`FlashError::NoProgram`].
    pub fn find() -> Result<Self, FlashError> {
        let path = std::env::var_os("PATH").unwrap_or_default();
        let mut folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
        folders.extend(std::env::home_dir().map(|home| home.join(".cargo/bin")));
        let file = format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX);
        (folders.into_iter().map(|folder| folder.join(&file)))
            .find(|program| program.is_file())
            .map(Self::at)
            .ok_or(FlashError::NoProgram)
    }

    /// The program at a path.
    pub fn at(program: PathBuf) -> Self {
        Self {
            program,
            silence: SILENCE,
        }
    }

    /// With another longest silence.
    pub fn with_silence(self, silence: Duration) -> Self {
        Self { silence, ..self }
    }

    /// The probe to write through: the one that `wanted` names (all of its selector, or its beginning or end), or the only one.
    ///
    /// # Errors
    /// When there is none, several, or it may not be used.
    pub fn choose(&self, wanted: Option<&str>) -> Result<Probe, FlashError> {
        let found = self.probes()?;
        let mut fitting: Vec<Probe> = match wanted {
            None => found.clone(),
            Some(wanted) => {
                let named = |probe: &&Probe| {
                    !wanted.is_empty()
                        && (probe.selector.starts_with(wanted) || probe.selector.ends_with(wanted))
                };
                found.iter().filter(named).cloned().collect()
            }
        };
        match (fitting.len(), wanted) {
            (1, _) => {
                let probe = fitting.remove(0);
                match probe.accessible {
                    true => Ok(probe),
                    false => Err(FlashError::Forbidden { probe }),
                }
            }
            (0, Some(wanted)) if !found.is_empty() => Err(FlashError::NoSuchProbe {
                wanted: wanted.to_owned(),
                found,
            }),
            (0, _) => Err(FlashError::NoProbe),
            _ => Err(FlashError::SeveralProbes(fitting)),
        }
    }

    /// All probes that are connected.
    ///
    /// # Errors
    /// [`FlashError::NotStarted`], [`FlashError::NotListed`].
    pub fn probes(&self) -> Result<Vec<Probe>, FlashError> {
        let mut probes = Vec::new();
        self.run(
            &[OsStr::new("list")],
            &mut |line| probes.extend(Probe::in_line(line)),
            &mut || false,
        )
        .map_err(|error| match error {
            FlashError::Failed { said } => FlashError::NotListed { said },
            FlashError::Stalled { after_s } => FlashError::NotListed {
                said: format!("{PROGRAM} said nothing for {after_s:.0} s"),
            },
            other => other,
        })?;
        Ok(probes)
    }

    /// Writes firmware through a probe, reads it back, and starts the board again. `on_line` is called with each line that the program says, `ends` every
    /// 50 ms: once it is `true` the program is ended.
    ///
    /// The board stands still from the first moment, with its motors off: the chip's reset switches the outputs off.
    ///
    /// # Errors
    /// [`FlashError::Failed`], [`FlashError::NotReset`], [`FlashError::Stalled`], [`FlashError::Cancelled`], [`FlashError::NotStarted`].
    pub fn write(
        &self,
        firmware: &Firmware,
        probe: &Probe,
        on_line: &mut dyn FnMut(&str),
        ends: &mut dyn FnMut() -> bool,
    ) -> Result<(), FlashError> {
        let words = |word: &'static str| OsStr::new(word);
        let download = [
            words("download"),
            words("--non-interactive"),
            words("--disable-progressbars"),
            words("--verify"),
            words("--chip"),
            OsStr::new(firmware.chip()),
            words("--probe"),
            OsStr::new(&probe.selector),
            // No argument after this one is an option, whatever the file is called.
            words("--"),
            firmware.path().as_os_str(),
        ];
        self.run(&download, on_line, ends)?;
        let reset = [
            words("reset"),
            words("--non-interactive"),
            words("--chip"),
            OsStr::new(firmware.chip()),
            words("--probe"),
            OsStr::new(&probe.selector),
        ];
        self.run(&reset, on_line, ends).map_err(|error| match error {
            FlashError::Failed { said } => FlashError::NotReset { said },
            other => other,
        })
    }

    /// Runs the program to its end.
    fn run(
        &self,
        arguments: &[&OsStr],
        on_line: &mut dyn FnMut(&str),
        ends: &mut dyn FnMut() -> bool,
    ) -> Result<(), FlashError> {
        let mut child = Command::new(&self.program)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map(Running)
            .map_err(|why| FlashError::NotStarted {
                program: self.program.clone(),
                why,
            })?;
        let lines = lines_of(&mut child.0);
        let mut last: Vec<String> = Vec::new();
        let mut heard = Instant::now();
        loop {
            match lines.recv_timeout(LOOK) {
                Ok(line) => {
                    heard = Instant::now();
                    on_line(&line);
                    last.push(line);
                    if last.len() > QUOTED {
                        last.remove(0);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                // Both streams have ended, and the program is about to.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(LOOK),
            }
            if ends() {
                return Err(FlashError::Cancelled);
            }
            if let Ok(Some(status)) = child.0.try_wait() {
                // What is still in the pipes.
                while let Ok(line) = lines.recv_timeout(LOOK) {
                    on_line(&line);
                    last.push(line);
                }
                return match status.success() {
                    true => Ok(()),
                    false => Err(FlashError::Failed {
                        said: said(&self.program, &last, &status.to_string()),
                    }),
                };
            }
            if heard.elapsed() > self.silence {
                return Err(FlashError::Stalled {
                    after_s: self.silence.as_secs_f64(),
                });
            }
        }
    }
}

/// The end of what the program said, as one line.
fn said(program: &Path, last: &[String], status: &str) -> String {
    let program = program.file_name().unwrap_or(program.as_os_str()).display();
    let quoted = &last[last.len().saturating_sub(QUOTED)..];
    match quoted.is_empty() {
        true => format!("{program} ended with {status} and said nothing"),
        false => format!("{program} says: {}", quoted.join(" / ")),
    }
}

/// Lines of both streams, without empty ones, colours and control characters.
fn lines_of(child: &mut Child) -> Receiver<String> {
    let (sender, receiver) = channel();
    let streams: [Option<Box<dyn Read + Send>>; 2] = [
        child.stdout.take().map(|stream| Box::new(stream) as _),
        child.stderr.take().map(|stream| Box::new(stream) as _),
    ];
    for stream in streams.into_iter().flatten() {
        let sender = sender.clone();
        // Ends with the stream, which ends with the program.
        std::thread::spawn(move || {
            let mut stream = BufReader::new(stream);
            let mut bytes = Vec::new();
            while matches!(stream.read_until(b'\n', &mut bytes), Ok(1..)) {
                let line = plain(&String::from_utf8_lossy(&bytes));
                bytes.clear();
                if !line.is_empty() && sender.send(line).is_err() {
                    return;
                }
            }
        });
    }
    receiver
}

/// A line without escape sequences, trimmed, and of bounded length.
fn plain(line: &str) -> String {
    let mut text = String::new();
    let mut characters = line.chars();
    while let Some(c) = characters.next() {
        match c {
            '\u{1b}' => {
                // A sequence such as ESC [ 3 1 m ends with a letter.
                let _ = characters.find(char::is_ascii_alphabetic);
            }
            '\t' => text.push(' '),
            c if c.is_control() => {}
            c => text.push(c),
        }
    }
    text.trim().chars().take(MAX_LINE).collect()
}

/// A program that does not outlive this value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already; any other failure cannot be handled here.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_lose_their_colours() {
        assert_eq!(
            plain("\u{1b}[31mError\u{1b}[0m:\tno \u{7}probe\r\n"),
            "Error: no probe"
        );
        assert_eq!(plain(&"x".repeat(2 * MAX_LINE)).len(), MAX_LINE);
        assert_eq!(plain("\u{1b}["), "");
    }
}
