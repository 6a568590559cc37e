//! A SpaceMouse that is read directly, through the kernel's hidraw devices.
//!
//! Devices are listed by the library `hidapi`, and only when the kernel's list of hidraw devices has changed: a listing reads every attribute of each
//! device and of what it is plugged into.

use std::ffi::{CStr, CString, OsStr};
use std::fs::OpenOptions;
use std::io::{self, ErrorKind};
use std::os::unix::ffi::OsStrExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use hidapi::{DeviceInfo, HidApi, HidDevice};

use super::model::{self, Id};
use super::report::Decoder;
use super::watch::{Event, Link, Source};

/// The kernel's list: a link for each device, to a path with a number that is not used again.
const LIST: &str = "/sys/class/hidraw";
/// Longest report of any known model is a quarter of it.
const REPORT: usize = 64;
/// Times that a device must refuse before it is reported: the rules of udev take effect a moment after it is plugged in.
const REFUSALS: usize = 2;

/// SpaceMice that are plugged in.
#[derive(Default)]
pub struct Devices {
    api: Option<HidApi>,
    /// What the kernel's list had at the last listing.
    listed: Vec<PathBuf>,
    found: Vec<Found>,
}

/// One that is plugged in.
struct Found {
    path: CString,
    name: String,
    id: Id,
    refusals: usize,
}

impl Source for Devices {
    fn open(&mut self) -> Result<Option<Box<dyn Link>>, String> {
        self.list();
        let Some(api) = &self.api else {
            return Ok(None);
        };
        let mut refused = None;
        for found in &mut self.found {
            if let Ok(device) = api.open_path(&found.path) {
                found.refusals = 0;
                let decoder = Decoder::new(model::first_button(found.id));
                return Ok(Some(Box::new(Device { device, decoder })));
            }
            if is_forbidden(&found.path) {
                found.refusals += 1;
                refused = refused.or((found.refusals >= REFUSALS).then(|| found.refusal()));
            }
        }
        refused.map_or(Ok(None), Err)
    }
}

impl Devices {
    /// Lists SpaceMice again if devices have come or gone.
    fn list(&mut self) {
        let present = links(Path::new(LIST));
        if present == self.listed {
            return;
        }
        self.listed = present;
        self.found.clear();
        self.api = HidApi::new().ok();
        for device in self.api.iter().flat_map(HidApi::device_list) {
            let id = (device.vendor_id(), device.product_id());
            let is_new = self.found.iter().all(|found| *found.path != *device.path());
            if is_new && model::is_space_mouse(id, (device.usage_page(), device.usage())) {
                self.found.push(Found {
                    path: device.path().to_owned(),
                    name: name_of(device),
                    id,
                    refusals: 0,
                });
            }
        }
    }
}

impl Found {
    /// What to do where the user may not read it.
    fn refusal(&self) -> String {
        format!(
            "{} is plugged in but may not be read by you ({}). Once as a command: echo '{}' | sudo tee /etc/udev/rules.d/70-mortise-space-mouse.rules; then \
             unplug it and plug it in again. The daemon spacenavd (apt install spacenavd) needs no rule.",
            self.name,
            self.path.to_string_lossy(),
            model::rule(self.id)
        )
    }
}

/// What the device calls itself, in one line.
fn name_of(device: &DeviceInfo) -> String {
    let own = device.product_string().unwrap_or_default();
    let name: String = own
        .chars()
        .filter(|letter| !letter.is_control())
        .take(60)
        .collect();
    match name.trim() {
        "" => "A SpaceMouse".to_owned(),
        name => name.to_owned(),
    }
}

/// Where the links of a folder lead, sorted; none if there is no such folder.
fn links(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut links: Vec<PathBuf> = entries
        .filter_map(|entry| std::fs::read_link(entry.path()).ok())
        .collect();
    links.sort();
    links
}

/// Whether the user's rights are why a file does not open. The library states the reason as text alone, so the file is opened as it opens it.
fn is_forbidden(path: &CStr) -> bool {
    let opened = OpenOptions::new()
        .read(true)
        .write(true)
        .open(OsStr::from_bytes(path.to_bytes()));
    opened.is_err_and(|why| why.kind() == ErrorKind::PermissionDenied)
}

/// One that is read.
struct Device {
    device: HidDevice,
    decoder: Decoder,
}

impl Link for Device {
    fn read(&mut self, wait: Duration, events: &mut Vec<Event>) -> io::Result<()> {
        let mut report = [0; REPORT];
        let wait = i32::try_from(wait.as_millis()).unwrap_or(i32::MAX);
        let count = self
            .device
            .read_timeout(&mut report, wait)
            .map_err(io::Error::other)?;
        self.decoder.take(&report[..count], events);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
