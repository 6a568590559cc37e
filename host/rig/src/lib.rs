//! One client for every rig: the board's own code in this process, the emulated board in QEMU, a board on a serial port.
//!
//! ```no_run
//! use mortise_protocol::message::ToDevice;
//! use mortise_rig::{Client, Event, RigSpec};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let rig: RigSpec = "emulated".parse()?;
//! let client = Client::connect(&rig)?;
//! client.upload(&std::fs::read("pair.image")?, &mut |_| {})?;
//! client.request(ToDevice::Arm)?;
//! client.request(ToDevice::Grab { part: 1 })?;
//! client.request(ToDevice::SetTelemetry { every_ticks: 20 })?;
//! if let Event::Telemetry(sample) = client.events().recv_timeout(std::time::Duration::from_secs(1))? {
//!     println!("{:?}", sample.handle);
//! }
//! client.stop()?;
//! # Ok(())
//! # }
//! ```
//!
//! A separate thread reads and sorts the board's messages: answers go to their waiting callers, all others into a bounded queue of
//! [`Event`]s. Another thread keeps the link alive and detects its loss. The protocol is in `docs/protocol.md`.

mod client;
pub mod commissioning;
mod description;
mod emulator;
mod error;
mod event;
mod exchange;
mod faults;
mod heartbeat;
mod link;
mod list;
mod log;
mod observer;
mod pipe;
mod preload;
mod real_time;
mod replayed;
mod serial;
mod simulated;
mod spec;
mod transport;
mod upload;
mod words;

pub use client::{Client, LinkCounts, Ran};
pub use description::{Abilities, DescriptionError, EXAMPLES, abilities, load_rig, parse_rig, write_rig};
pub use emulator::{
    FIRMWARE_VARIABLE, QEMU_VARIABLE, SERIAL_VARIABLE, emulate, emulator_available, firmware_path,
};
pub use error::{RigError, version_words};
pub use event::{Event, Events, MAX_EVENTS};
pub use exchange::{ATTEMPTS, Patience};
pub use faults::{FaultCounts, FaultLine, Faults, InputFault, InputFaultName, Window};
pub use list::{RigEntry, list};
pub use observer::Observer;
pub use pipe::{PIPE_CAPACITY, PipeReader, PipeWriter, pipe};
pub use replayed::Readings;
pub use simulated::{Flash, TickWork, simulate, simulate_counted, simulate_readings};
pub use spec::{EmulatedMode, RigSpec, SpecError};
pub use transport::{READ_WAIT, Transport};
pub use upload::{UPLOAD_WINDOW, UploadProgress, begin_message, chunk_message};
pub use words::{Words, describe, describe_flags};
