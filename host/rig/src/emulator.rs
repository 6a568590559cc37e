//! The emulated board: QEMU as a child process, its UART as a pseudo-terminal or a TCP connection.

use std::io::{self, BufRead, BufReader, Read};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use crate::error::RigError;
use crate::preload::Preload;
use crate::spec::EmulatedMode;
use crate::transport::{READ_WAIT, Transport};

/// Environment variable that names another QEMU program.
pub const QEMU_VARIABLE: &str = "MORTISE_QEMU";
/// Environment variable that names another firmware ELF.
pub const FIRMWARE_VARIABLE: &str = "MORTISE_FIRMWARE";
/// Environment variable with the connection to the UART, `pty` or `tcp`. Default `pty` on Unix, `tcp` elsewhere.
pub const SERIAL_VARIABLE: &str = "MORTISE_QEMU_SERIAL";

const BOARD: &str = "mps2-an500";
const TARGET: &str = "thumbv7em-none-eabihf";
/// Time limit for QEMU to report its UART: even a loaded machine starts it in well under a second.
const START_WAIT: Duration = Duration::from_secs(20);
const INSTALL: &str = "install QEMU (`cargo xtask setup`, or on Debian and Ubuntu `sudo apt-get install qemu-system-arm`), or name one with MORTISE_QEMU; without QEMU use the rig `sim`";

/// The QEMU process, ended when dropped.
struct Qemu(Child);

impl Drop for Qemu {
    fn drop(&mut self) {
        // An error means that it has already ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Path of the emulated board's firmware: `given`, else that of [`FIRMWARE_VARIABLE`], else the one that the workspace builds.
///
/// # Errors
/// `NoFirmware`: no such file.
pub fn firmware_path(given: Option<&Path>) -> Result<PathBuf, RigError> {
    if let Some(path) = given
        .map(Path::to_path_buf)
        .or_else(|| std::env::var_os(FIRMWARE_VARIABLE).map(PathBuf::from))
    {
        return if path.is_file() {
            Ok(path)
        } else {
            Err(RigError::NoFirmware { path })
        };
    }
    let built = Path::new("firmware/boards/target")
        .join(TARGET)
        .join("release")
        .join(BOARD);
    let program = std::env::current_exe().ok();
    let places = [
        program.as_deref(),
        std::env::var_os("CARGO_MANIFEST_DIR").as_deref().map(Path::new),
        Some(Path::new(env!("CARGO_MANIFEST_DIR"))),
    ]
    .into_iter()
    .flatten()
    .flat_map(Path::ancestors)
    .map(|place| place.join(&built))
    .find(|path| path.is_file());
    places.ok_or(RigError::NoFirmware { path: built })
}

/// Path of the QEMU program.
fn qemu() -> PathBuf {
    std::env::var_os(QEMU_VARIABLE).map_or_else(|| "qemu-system-arm".into(), PathBuf::from)
}

/// Whether QEMU and firmware are available; the error says what to do.
///
/// # Errors
/// When one of them is missing, in words.
pub fn emulator_available(firmware: Option<&Path>) -> Result<(), String> {
    let found = Command::new(qemu())
        .arg("--version")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    match found {
        Ok(status) if status.success() => {}
        _ => return Err(INSTALL.to_owned()),
    }
    firmware_path(firmware)
        .map(|_| ())
        .map_err(|error| error.to_string())
}

/// The bytes of an emulated board in lockstep that starts with the scene `image` in its flash: for a host that is no [`Client`](crate::Client).
///
/// # Errors
/// When QEMU or the firmware is missing or does not start. A scene larger than a slot is left out.
pub fn emulate(image: &[u8]) -> Result<Transport, RigError> {
    let scene = Preload::new(image).map_err(|error| RigError::Qemu {
        what: format!("the scene's file cannot be written: {error}"),
        hint: "check the folder of temporary files".into(),
    })?;
    start(EmulatedMode::Lockstep, &firmware_path(None)?, scene)
}

/// Starts QEMU and connects to its UART.
pub(crate) fn start(
    mode: EmulatedMode,
    firmware: &Path,
    scene: Option<Preload>,
) -> Result<Transport, RigError> {
    let wanted = std::env::var(SERIAL_VARIABLE).unwrap_or_default();
    let pty = match wanted.as_str() {
        "" => cfg!(unix),
        "pty" => true,
        "tcp" => false,
        other => {
            return Err(RigError::Qemu {
                what: format!("{SERIAL_VARIABLE} is `{other}`"),
                hint: "set it to `pty` or `tcp`, or leave it unset".into(),
            });
        }
    };
    if pty {
        start_on_pty(mode, firmware, scene)
    } else {
        start_on_tcp(mode, firmware, scene)
    }
}

fn command(mode: EmulatedMode, firmware: &Path, scene: Option<&Preload>, serial: &str) -> Command {
    let mut command = Command::new(qemu());
    command
        .args([
            "-machine", BOARD, "-display", "none", "-monitor", "none", "-serial", serial, "-kernel",
        ])
        .arg(firmware)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.args(scene.iter().flat_map(|scene| scene.arguments()));
    if mode != EmulatedMode::Interactive {
        // 2 ns per instruction; `sleep=off` skips idle time, so a run takes no longer than its instructions.
        command.args(["-icount", "shift=1,sleep=off"]);
    }
    command
}

/// Starts QEMU on a thread that stays with it and forwards its output. On Linux QEMU ends with this program, by a signal that is tied to
/// the thread which started it.
fn spawn(mut command: Command) -> Result<(Qemu, mpsc::Receiver<String>), RigError> {
    let program = command.get_program().to_string_lossy().into_owned();
    let (to, lines) = mpsc::sync_channel(32);
    let (started, child) = mpsc::sync_channel(1);
    #[cfg(target_os = "linux")]
    end_with_this_program(&mut command);
    std::thread::Builder::new()
        .name("mortise-qemu".into())
        .spawn(move || match command.spawn() {
            Ok(mut child) => {
                let stdout = child.stdout.take();
                // The caller waits for it.
                let _ = started.send(Ok((Qemu(child), to.clone())));
                if let Some(stdout) = stdout {
                    read_lines(stdout, &to);
                }
            }
            Err(error) => {
                let _ = started.send(Err(error));
            }
        })
        .map_err(RigError::Thread)?;
    let started = child
        .recv()
        .unwrap_or_else(|_| Err(io::ErrorKind::BrokenPipe.into()));
    let (mut qemu, to) = started.map_err(|error| RigError::Qemu {
        what: format!("`{program}` does not start: {error}"),
        hint: INSTALL.to_owned(),
    })?;
    if let Some(stderr) = qemu.0.stderr.take() {
        std::thread::Builder::new()
            .name("mortise-qemu".into())
            .spawn(move || read_lines(stderr, &to))
            .map_err(RigError::Thread)?;
    }
    Ok((qemu, lines))
}

/// Makes the kernel kill QEMU when this program ends for any reason, including SIGKILL, which leaves no time for `Drop`. The kernel does so
/// when the thread that starts `command` ends.
#[cfg(target_os = "linux")]
fn end_with_this_program(command: &mut Command) {
    use std::os::unix::process::CommandExt as _;
    let parent = std::process::id();
    // SAFETY: between fork and exec only two system calls run, which take no lock and no memory.
    unsafe {
        command.pre_exec(move || {
            if libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) != 0 {
                return Err(io::Error::last_os_error());
            }
            // If the parent had ended already, no signal would come.
            if libc::getppid().cast_unsigned() != parent {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
            Ok(())
        });
    }
}

/// Forwards the lines of `stream` until it ends, so that QEMU never blocks on a full pipe.
fn read_lines(stream: impl Read, to: &mpsc::SyncSender<String>) {
    for line in BufReader::new(stream).lines().map_while(Result::ok) {
        // After the start nothing receives the lines; they are only drained.
        let _ = to.try_send(line);
    }
}

fn start_on_pty(mode: EmulatedMode, firmware: &Path, scene: Option<Preload>) -> Result<Transport, RigError> {
    let (mut qemu, lines) = spawn(command(mode, firmware, scene.as_ref(), "pty"))?;
    let deadline = Instant::now() + START_WAIT;
    let mut said = Vec::new();
    loop {
        match lines.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(line) => {
                // "char device redirected to /dev/pts/0 (label serial0)"
                let path = line
                    .strip_prefix("char device redirected to ")
                    .and_then(|rest| rest.split_whitespace().next());
                if let Some(path) = path {
                    let mut transport = crate::serial::open(path)?;
                    transport.keep = Some(Box::new((qemu, scene)));
                    return Ok(transport);
                }
                said.push(line);
            }
            Err(_) => return Err(not_started(&mut qemu, &said)),
        }
    }
}

fn start_on_tcp(mode: EmulatedMode, firmware: &Path, scene: Option<Preload>) -> Result<Transport, RigError> {
    let no_port = |error: io::Error| RigError::Qemu {
        what: format!("no TCP port on this computer: {error}"),
        hint: "check the firewall for 127.0.0.1".into(),
    };
    // This side listens, so that the port is taken before QEMU starts and no other process can take it.
    let listener = TcpListener::bind(("127.0.0.1", 0)).map_err(no_port)?;
    listener.set_nonblocking(true).map_err(no_port)?;
    let address = listener.local_addr().map_err(no_port)?;
    let (mut qemu, lines) = spawn(command(
        mode,
        firmware,
        scene.as_ref(),
        &format!("tcp:{address},nodelay=on"),
    ))?;
    let deadline = Instant::now() + START_WAIT;
    let stream = loop {
        match listener.accept() {
            Ok((stream, _)) => break stream,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                let ended = !matches!(qemu.0.try_wait(), Ok(None));
                if ended || Instant::now() > deadline {
                    let said: Vec<String> = lines.try_iter().collect();
                    return Err(not_started(&mut qemu, &said));
                }
                std::thread::sleep(Duration::from_millis(5));
            }
            Err(error) => return Err(no_port(error)),
        }
    };
    let transport = over_tcp(stream).map_err(no_port)?;
    Ok(Transport {
        keep: Some(Box::new((qemu, scene))),
        ..transport
    })
}

fn over_tcp(stream: TcpStream) -> io::Result<Transport> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(READ_WAIT))?;
    stream.set_write_timeout(Some(READ_WAIT))?;
    Ok(Transport {
        writer: Box::new(stream.try_clone()?),
        reader: Box::new(stream),
        keep: None,
    })
}

fn not_started(qemu: &mut Qemu, said: &[String]) -> RigError {
    let ended = match qemu.0.try_wait() {
        Ok(Some(status)) => format!("QEMU ended with {status}"),
        _ => format!("QEMU opened no serial line within {} s", START_WAIT.as_secs()),
    };
    let said = if said.is_empty() {
        String::new()
    } else {
        format!(": {}", said.join("; "))
    };
    RigError::Qemu {
        what: format!("{ended}{said}"),
        hint: "QEMU 7.2 or newer with the machine mps2-an500 is needed (`cargo xtask setup`)".into(),
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// Environment variable that marks the process to be killed.
    const VICTIM: &str = "MORTISE_TEST_VICTIM";

    fn sleeper() -> Command {
        let mut command = Command::new("sleep");
        command.arg("60").stdin(Stdio::null()).stdout(Stdio::piped());
        command
    }

    /// Whether a process runs, that is, has neither ended nor become a zombie.
    fn runs(process: &str) -> bool {
        std::fs::read_to_string(format!("/proc/{process}/stat")).is_ok_and(|stat| {
            stat.rsplit(") ")
                .next()
                .is_some_and(|rest| !rest.starts_with(['Z', 'X']))
        })
    }

    #[test]
    fn it_outlives_the_thread_that_asked_for_it() {
        let asked = std::thread::spawn(|| spawn(sleeper()).expect("started"));
        let (mut qemu, _lines) = asked.join().expect("no panic");
        // Time for the signal, which the kernel sends while the thread ends.
        std::thread::sleep(Duration::from_millis(100));
        assert!(matches!(qemu.0.try_wait(), Ok(None)));
    }

    #[test]
    fn it_ends_with_a_program_that_is_killed() {
        if std::env::var_os(VICTIM).is_some() {
            let (qemu, _lines) = spawn(sleeper()).expect("started");
            println!("started {}", qemu.0.id());
            std::thread::sleep(Duration::from_secs(60));
            return;
        }
        let mut victim = Command::new(std::env::current_exe().expect("this test"))
            .args([
                "--exact",
                "emulator::tests::it_ends_with_a_program_that_is_killed",
                "--nocapture",
            ])
            .env(VICTIM, "")
            .stdout(Stdio::piped())
            .spawn()
            .expect("started");
        let said = BufReader::new(victim.stdout.take().expect("piped"))
            .lines()
            .map_while(Result::ok);
        // The harness writes the test's name before it, on the same line.
        let process = { said }.find_map(|line| Some(line.split_once("started ")?.1.to_owned()));
        let process = process.expect("it reports its QEMU process");
        assert!(runs(&process));
        victim.kill().expect("killed");
        victim.wait().expect("ended");
        let deadline = Instant::now() + Duration::from_secs(10);
        while runs(&process) {
            assert!(
                Instant::now() < deadline,
                "{process} outlived the program that started it"
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}
