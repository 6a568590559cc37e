//! Devices that the kernel makes for a test: `/dev/uhid`, which only the system's administrator may use. Source of its messages: linux/uhid.h.

use std::fs::File;
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt;
use std::time::Instant;

use glam::DVec3;

use super::*;
use crate::viewport::six_axis::Deflection;

/// Kinds of messages.
const CREATE: u32 = 11;
const INPUT: u32 = 12;
const USB: u16 = 3;
/// Only a hang takes so long.
const PATIENCE: Duration = Duration::from_secs(20);

/// SpaceMouse Compact, for which the kernel needs no driver of its own.
const COMPACT: Id = (0x256f, 0xc635);
/// Report descriptor of a SpaceMouse of older kind: translations, rotations and two buttons.
const SPACE_MOUSE: &[u8] = &[
    0x05, 0x01, 0x09, 0x08, 0xa1, 0x01, 0xa1, 0x00, 0x85, 0x01, 0x16, 0xa2, 0xfe, 0x26, 0x5e, 0x01, 0x36,
    0x88, 0xfa, 0x46, 0x78, 0x05, 0x55, 0x0c, 0x65, 0x11, 0x09, 0x30, 0x09, 0x31, 0x09, 0x32, 0x75, 0x10,
    0x95, 0x03, 0x81, 0x06, 0xc0, 0xa1, 0x00, 0x85, 0x02, 0x09, 0x33, 0x09, 0x34, 0x09, 0x35, 0x75, 0x10,
    0x95, 0x03, 0x81, 0x06, 0xc0, 0xa1, 0x02, 0x85, 0x03, 0x05, 0x01, 0x05, 0x09, 0x19, 0x01, 0x29, 0x02,
    0x15, 0x00, 0x25, 0x01, 0x35, 0x00, 0x45, 0x01, 0x75, 0x01, 0x95, 0x02, 0x81, 0x02, 0x95, 0x0e, 0x81,
    0x03, 0xc0, 0xc0,
];
/// Of a mouse: two buttons and two axes.
const MOUSE: &[u8] = &[
    0x05, 0x01, 0x09, 0x02, 0xa1, 0x01, 0x09, 0x01, 0xa1, 0x00, 0x05, 0x09, 0x19, 0x01, 0x29, 0x02, 0x15,
    0x00, 0x25, 0x01, 0x75, 0x01, 0x95, 0x08, 0x81, 0x02, 0x05, 0x01, 0x09, 0x30, 0x09, 0x31, 0x15, 0x81,
    0x25, 0x7f, 0x75, 0x08, 0x95, 0x02, 0x81, 0x06, 0xc0, 0xc0,
];

/// A device, plugged in until this is dropped.
struct Virtual(File);

impl Virtual {
    /// `None` where the kernel makes no devices, or not for this user.
    fn plug_in(name: &str, (vendor, product): Id, descriptor: &[u8]) -> Option<Self> {
        let file = OpenOptions::new().read(true).write(true).open("/dev/uhid").ok()?;
        let mut message = CREATE.to_ne_bytes().to_vec();
        message.extend(name.bytes());
        // The name has 128 bytes, the places of port and serial number 64 each.
        message.resize(4 + 128 + 64 + 64, 0);
        let length = u16::try_from(descriptor.len()).unwrap();
        message.extend(length.to_ne_bytes());
        message.extend(USB.to_ne_bytes());
        for number in [u32::from(vendor), u32::from(product), 0, 0] {
            message.extend(number.to_ne_bytes());
        }
        message.extend(descriptor);
        let mut device = Self(file);
        device.0.write_all(&message).unwrap();
        Some(device)
    }

    fn send(&mut self, report: &[u8]) {
        let mut message = INPUT.to_ne_bytes().to_vec();
        message.extend(u16::try_from(report.len()).unwrap().to_ne_bytes());
        message.extend(report);
        self.0.write_all(&message).unwrap();
    }
}

/// Looks until there is a device, or there is none.
fn look(devices: &mut Devices, is_there: bool) -> Option<Box<dyn Link>> {
    let begun = Instant::now();
    loop {
        let found = devices.open().expect("the administrator may read it");
        if found.is_some() == is_there {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "device is there: {}", found.is_some());
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn events(link: &mut dyn Link, count: usize) -> Vec<Event> {
    let (mut events, begun) = (Vec::new(), Instant::now());
    while events.len() < count && begun.elapsed() < PATIENCE {
        link.read(Duration::from_millis(100), &mut events)
            .expect("it is there");
    }
    events
}

#[test]
fn a_space_mouse_is_read_unplugged_and_found_again_and_a_mouse_is_left_alone() {
    let Some(_mouse) = Virtual::plug_in("Mouse", (0x046d, 0xc077), MOUSE) else {
        println!("skipped: /dev/uhid is missing or not for this user, so there is no device to read");
        return;
    };
    let mut devices = Devices::default();
    for _ in 0..2 {
        assert!(look(&mut devices, false).is_none(), "only the mouse is there");
        let plugged = Virtual::plug_in("3Dconnexion SpaceMouse Compact", COMPACT, SPACE_MOUSE);
        let mut plugged = plugged.expect("as before");
        let mut link = look(&mut devices, true).expect("found");
        // Nothing is no end.
        assert_eq!(events(link.as_mut(), 0), []);
        link.read(Duration::from_millis(10), &mut Vec::new())
            .expect("it is there");
        plugged.send(&[1, 0xaf, 0, 0xa2, 0xfe, 0x23, 0]);
        plugged.send(&[2, 0, 0, 0, 0, 0xaf, 0]);
        plugged.send(&[3, 2, 0]);
        let deflected = |turn: DVec3| {
            Event::Deflected(Deflection {
                shift: DVec3::new(0.5, -0.1, -1.0),
                turn,
            })
        };
        let expected = [
            deflected(DVec3::ZERO),
            deflected(DVec3::new(0.0, -0.5, 0.0)),
            Event::Pressed(1),
        ];
        assert_eq!(events(link.as_mut(), 3), expected);
        assert_eq!(devices.found.len(), 1);
        assert!(devices.found[0].name.contains("SpaceMouse Compact"));
        drop(plugged);
        let begun = Instant::now();
        while link.read(Duration::from_millis(100), &mut Vec::new()).is_ok() {
            assert!(begun.elapsed() < PATIENCE, "it is read after it was unplugged");
        }
    }
}

#[test]
fn one_that_may_not_be_opened_is_reported_at_the_second_look_with_its_rule() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("hidraw");
    std::fs::write(&file, []).unwrap();
    let allow = |mode| std::fs::set_permissions(&file, PermissionsExt::from_mode(mode)).unwrap();
    allow(0);
    if File::open(&file).is_ok() {
        println!("skipped: this user may open every file");
        return;
    }
    let mut devices = Devices {
        api: HidApi::new().ok(),
        listed: links(Path::new(LIST)),
        found: vec![Found {
            path: CString::new(file.as_os_str().as_bytes()).unwrap(),
            name: "SpaceMouse Compact".into(),
            id: COMPACT,
            refusals: 0,
        }],
    };
    assert!(
        matches!(devices.open(), Ok(None)),
        "rules may not have taken effect yet"
    );
    let why = devices.open().err().expect("refused");
    for part in [
        "SpaceMouse Compact",
        file.to_str().unwrap(),
        &model::rule(COMPACT),
    ] {
        assert!(why.contains(part), "{why}");
    }
    // One that is open to all and no device is left alone.
    allow(0o666);
    assert!(matches!(devices.open(), Ok(None)));
}
