//! Serial ports: opening one by name, with errors that name the remedy.

use std::io;

use serialport::{ErrorKind, SerialPortInfo, SerialPortType};

use crate::error::RigError;
use crate::transport::{READ_WAIT, Transport};

/// Bit rate set for the port, bit/s. USB and pseudo-terminals ignore it.
const BAUD: u32 = 1_000_000;

/// Opens `port` (raw, exclusive).
pub(crate) fn open(port: &str) -> Result<Transport, RigError> {
    let reader = serialport::new(port, BAUD)
        .timeout(READ_WAIT)
        .dtr_on_open(true)
        .open()
        .map_err(|error| refine(port, error))?;
    // Discards bytes left by an earlier program.
    let _ = reader.clear(serialport::ClearBuffer::All);
    let writer = reader.try_clone().map_err(|error| refine(port, error))?;
    Ok(Transport {
        reader: Box::new(reader),
        writer: Box::new(writer),
        keep: None,
    })
}

/// Ports that the operating system lists; an empty list if the listing fails.
pub(crate) fn ports() -> Vec<SerialPortInfo> {
    // The listing of serialport 4.10 panics where /sys/class/tty is absent (some containers).
    #[cfg(target_os = "linux")]
    if !std::path::Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let mut ports = serialport::available_ports().unwrap_or_default();
    ports.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    ports
}

/// Description of the device on the port: USB names and ids, or the kind of port.
pub(crate) fn detail(port: &SerialPortInfo) -> String {
    match &port.port_type {
        SerialPortType::UsbPort(usb) => {
            let mut text = format!("USB {:04x}:{:04x}", usb.vid, usb.pid);
            for part in [&usb.manufacturer, &usb.product, &usb.serial_number]
                .into_iter()
                .flatten()
            {
                text.push(' ');
                text.push_str(part);
            }
            text
        }
        SerialPortType::BluetoothPort => "Bluetooth".into(),
        SerialPortType::PciPort => "built in".into(),
        SerialPortType::Unknown => "serial port".into(),
    }
}

fn refine(port: &str, error: serialport::Error) -> RigError {
    let port = port.to_owned();
    match error.kind {
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => RigError::Permission {
            fix: permission_fix(&port),
            port,
        },
        ErrorKind::Io(io::ErrorKind::NotFound) => RigError::NoSuchPort { known: known(), port },
        _ if is_busy(&error) => RigError::Busy { port },
        ErrorKind::NoDevice => RigError::NoSuchPort { known: known(), port },
        kind => RigError::Open {
            port,
            source: match kind {
                ErrorKind::Io(kind) => io::Error::new(kind, error.description),
                _ => io::Error::other(error.description),
            },
            hint: "check the cable and that the name is a serial port's".into(),
        },
    }
}

/// serialport reports a port held by another program as `NoDevice`; only the error text differs from that of a missing port: EBUSY or a
/// failed lock on Unix, "access is denied" on Windows.
fn is_busy(error: &serialport::Error) -> bool {
    let text = error.description.to_lowercase();
    error.kind == ErrorKind::NoDevice && ["busy", "lock", "denied"].iter().any(|word| text.contains(word))
}

fn known() -> String {
    let names: Vec<String> = ports().into_iter().map(|port| port.port_name).collect();
    if names.is_empty() {
        "none is attached, plug the board in".into()
    } else {
        format!("attached are {}", names.join(", "))
    }
}

/// How this user gets permission to open `port`.
pub(crate) fn permission_fix(port: &str) -> String {
    if cfg!(target_os = "macos") {
        return format!("allow it with `sudo chmod a+rw {port}`");
    }
    format!(
        "run `sudo usermod -aG dialout $USER` and log in again (group `uucp` on Arch), or once `sudo chmod a+rw {port}`"
    )
}
