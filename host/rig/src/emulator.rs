//! The emulated board: QEMU as a child process, its UART as a pseudo-terminal or a TCP connection.

use std::io::{self, BufRead, BufReader, Read};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use crate::error::RigError;
use crate::spec::EmulatedMode;
use crate::transport::{READ_WAIT, Transport};

/// Names another QEMU program.
pub const QEMU_VARIABLE: &str = "MORTISE_QEMU";
/// Names another firmware ELF.
pub const FIRMWARE_VARIABLE: &str = "MORTISE_FIRMWARE";
/// `pty` or `tcp`: how the UART is reached. Default `pty` on Unix, `tcp` elsewhere.
pub const SERIAL_VARIABLE: &str = "MORTISE_QEMU_SERIAL";

const BOARD: &str = "mps2-an500";
const TARGET: &str = "thumbv7em-none-eabihf";
/// Longest QEMU may take to say where its UART is: a loaded machine starts it in well under a second.
const START_WAIT: Duration = Duration::from_secs(20);
const INSTALL: &str = "install QEMU (`cargo xtask setup`, or on Debian and Ubuntu `sudo apt-get install qemu-system-arm`), or name one with MORTISE_QEMU; without QEMU use the rig `sim`";

/// Ends QEMU when dropped.
struct Qemu(Child);

impl Drop for Qemu {
    fn drop(&mut self) {
        // Already gone is as good.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Path of the emulated board's firmware: `given`, else the environment's ([`FIRMWARE_VARIABLE`]), else the one the workspace builds.
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

/// The QEMU program to start.
fn qemu() -> PathBuf {
    std::env::var_os(QEMU_VARIABLE).map_or_else(|| "qemu-system-arm".into(), PathBuf::from)
}

/// Whether QEMU and firmware are there, else what to do.
pub(crate) fn available(firmware: Option<&Path>) -> Result<(), String> {
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

/// Starts QEMU and connects to its UART.
pub(crate) fn start(mode: EmulatedMode, firmware: &Path) -> Result<Transport, RigError> {
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
        start_on_pty(mode, firmware)
    } else {
        start_on_tcp(mode, firmware)
    }
}

fn command(mode: EmulatedMode, firmware: &Path, serial: &str) -> Command {
    let mut command = Command::new(qemu());
    command
        .args([
            "-machine", BOARD, "-display", "none", "-monitor", "none", "-serial", serial, "-kernel",
        ])
        .arg(firmware)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    if mode != EmulatedMode::Interactive {
        // 2 ns an instruction; `sleep=off`: idle time is skipped, so a run takes no longer than its instructions.
        command.args(["-icount", "shift=1,sleep=off"]);
    }
    command
}

fn spawn(mut command: Command) -> Result<Qemu, RigError> {
    command.spawn().map(Qemu).map_err(|error| RigError::Qemu {
        what: format!(
            "`{}` does not start: {error}",
            command.get_program().to_string_lossy()
        ),
        hint: INSTALL.to_owned(),
    })
}

/// Passes the lines of `stream` on for as long as it lives, so that QEMU never blocks on a full pipe.
fn lines_of(stream: impl Read + Send + 'static, to: mpsc::SyncSender<String>) -> Result<(), RigError> {
    std::thread::Builder::new()
        .name("mortise-qemu".into())
        .spawn(move || {
            for line in BufReader::new(stream).lines().map_while(Result::ok) {
                // Nobody listens after the start: then lines are only read away.
                let _ = to.try_send(line);
            }
        })
        .map(|_| ())
        .map_err(RigError::Thread)
}

fn start_on_pty(mode: EmulatedMode, firmware: &Path) -> Result<Transport, RigError> {
    let mut qemu = spawn(command(mode, firmware, "pty"))?;
    let lines = listen(&mut qemu)?;
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
                    transport.keep = Some(Box::new(qemu));
                    return Ok(transport);
                }
                said.push(line);
            }
            Err(_) => return Err(not_started(&mut qemu, &said)),
        }
    }
}

fn start_on_tcp(mode: EmulatedMode, firmware: &Path) -> Result<Transport, RigError> {
    let no_port = |error: io::Error| RigError::Qemu {
        what: format!("no TCP port on this computer: {error}"),
        hint: "check the firewall for 127.0.0.1".into(),
    };
    // This side listens, so that the port is taken before QEMU starts and nobody can be faster.
    let listener = TcpListener::bind(("127.0.0.1", 0)).map_err(no_port)?;
    listener.set_nonblocking(true).map_err(no_port)?;
    let address = listener.local_addr().map_err(no_port)?;
    let mut qemu = spawn(command(mode, firmware, &format!("tcp:{address},nodelay=on")))?;
    let lines = listen(&mut qemu)?;
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
        keep: Some(Box::new(qemu)),
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

fn listen(qemu: &mut Qemu) -> Result<mpsc::Receiver<String>, RigError> {
    let (to, lines) = mpsc::sync_channel(32);
    if let Some(stream) = qemu.0.stdout.take() {
        lines_of(stream, to.clone())?;
    }
    if let Some(stream) = qemu.0.stderr.take() {
        lines_of(stream, to)?;
    }
    Ok(lines)
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
