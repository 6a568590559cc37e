//! The daemon spacenavd, which serves a SpaceMouse to all programs.
//!
//! It sends packets of eight 32-bit numbers over a local socket: the kind (0 motion, 1 button pressed, 2 released), then for a motion the deflection
//! along x (right), y (up), z (away from the viewer), about x, y and z, and the time since the last one; for a button its number. A deflection of about
//! 350 is full. Source: proto.h, spnav.c and util.c of libspnav 1.2; protocol version 0, which a client speaks that asks for no other.

use std::io::{self, ErrorKind, Read as _};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use glam::DVec3;

use super::watch::{Event, Link, Source};
use crate::viewport::six_axis::Deflection;

/// Where the daemon has its socket unless it is set up otherwise.
const SOCKET: &str = "/var/run/spnav.sock";
const SETTINGS: &str = "/etc/spnavrc";
const VARIABLE: &str = "SPNAV_SOCKET";
/// Full deflection, units of the daemon.
const FULL: f64 = 350.0;

/// Size of a packet, and its kinds.
const PACKET: usize = 32;
const MOTION: i32 = 0;
const PRESS: i32 = 1;

/// The daemon at its socket, which may be at one of several places.
pub struct Daemon {
    places: Vec<PathBuf>,
}

impl Daemon {
    /// At its usual places: the one that the environment names, the one of its settings, its own.
    pub fn usual() -> Self {
        let variable = std::env::var_os(VARIABLE).map(PathBuf::from);
        let settings = std::fs::read_to_string(SETTINGS).ok();
        let set = settings.as_deref().and_then(socket_in);
        let usual = [variable, set, Some(PathBuf::from(SOCKET))];
        Self::at(usual.into_iter().flatten().collect())
    }

    /// At one of `places`.
    pub fn at(places: Vec<PathBuf>) -> Self {
        Self { places }
    }
}

impl Source for Daemon {
    fn open(&mut self) -> Result<Option<Box<dyn Link>>, String> {
        let stream = self
            .places
            .iter()
            .find_map(|place| UnixStream::connect(place).ok());
        Ok(stream.map(|stream| {
            Box::new(Connection {
                stream,
                packet: [0; PACKET],
                filled: 0,
            }) as Box<dyn Link>
        }))
    }
}

/// A connection, with the part of a packet that has come.
struct Connection {
    stream: UnixStream,
    packet: [u8; PACKET],
    filled: usize,
}

impl Link for Connection {
    fn read(&mut self, wait: Duration, events: &mut Vec<Event>) -> io::Result<()> {
        self.stream.set_read_timeout(Some(wait))?;
        match self.stream.read(&mut self.packet[self.filled..]) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => self.filled += count,
            Err(why)
                if matches!(
                    why.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) => {}
            Err(why) => return Err(why),
        }
        if self.filled == PACKET {
            self.filled = 0;
            events.extend(event(&self.packet));
        }
        Ok(())
    }
}

/// Meaning of a packet; `None` for those that need no answer.
fn event(packet: &[u8; PACKET]) -> Option<Event> {
    let (words, _) = packet.as_chunks::<4>();
    let word = |i: usize| i32::from_ne_bytes(words[i]);
    let share = |i: usize| (f64::from(word(i)) / FULL).clamp(-1.0, 1.0);
    match word(0) {
        MOTION => Some(Event::Deflected(Deflection {
            shift: DVec3::new(share(1), share(2), -share(3)),
            turn: DVec3::new(share(4), share(5), -share(6)),
        })),
        PRESS => Some(Event::Pressed(word(1))),
        _ => None,
    }
}

/// The socket that the daemon's settings name: a line `socket = path`.
fn socket_in(settings: &str) -> Option<PathBuf> {
    let named = settings.lines().find_map(|line| {
        let (key, value) = line.split_once('=')?;
        (key.trim() == "socket" && !value.trim().is_empty()).then(|| value.trim())
    })?;
    Some(Path::new(named).to_owned())
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;
    use std::os::unix::net::UnixListener;

    use super::*;

    fn packet(words: [i32; 8]) -> [u8; PACKET] {
        let mut packet = [0; PACKET];
        for (bytes, word) in packet.chunks_exact_mut(4).zip(words) {
            bytes.copy_from_slice(&word.to_ne_bytes());
        }
        packet
    }

    #[test]
    fn packets_are_read_in_the_screens_directions() {
        let motion = event(&packet([0, 175, -350, 35, 0, 70, 350, 16]));
        let expected = Deflection {
            shift: DVec3::new(0.5, -1.0, -0.1),
            turn: DVec3::new(0.0, 0.2, -1.0),
        };
        assert_eq!(motion, Some(Event::Deflected(expected)));
        assert_eq!(event(&packet([1, 1, 0, 0, 0, 0, 0, 0])), Some(Event::Pressed(1)));
        assert_eq!(event(&packet([2, 1, 0, 0, 0, 0, 0, 0])), None);
        let garbage = event(&packet([0, i32::MAX, i32::MIN, 0, 0, 0, 0, -1]));
        let bounded = Deflection {
            shift: DVec3::new(1.0, -1.0, 0.0),
            turn: DVec3::ZERO,
        };
        assert_eq!(garbage, Some(Event::Deflected(bounded)));
        assert_eq!(event(&packet([-7, 1, 1, 1, 1, 1, 1, 1])), None);
    }

    #[test]
    fn a_packet_that_comes_in_pieces_is_put_together() {
        let place = tempfile::tempdir().unwrap();
        let socket = place.path().join("spnav.sock");
        let listener = UnixListener::bind(&socket).unwrap();
        let mut daemon = Daemon::at(vec![place.path().join("none.sock"), socket]);
        let mut link = daemon.open().unwrap().expect("it is there");
        let (mut there, _) = listener.accept().unwrap();
        let mut events = Vec::new();
        let bytes = packet([1, 3, 0, 0, 0, 0, 0, 0]);
        for piece in [&bytes[..5], &bytes[5..31], &bytes[31..]] {
            assert_eq!(events, []);
            there.write_all(piece).unwrap();
            link.read(Duration::from_secs(60), &mut events).unwrap();
        }
        assert_eq!(events, [Event::Pressed(3)]);
        // Silence is no end; the daemon's is.
        link.read(Duration::from_millis(1), &mut events).unwrap();
        drop(there);
        assert!(link.read(Duration::from_secs(60), &mut events).is_err());
        drop(listener);
        assert!(daemon.open().unwrap().is_none());
    }

    #[test]
    fn settings_name_the_socket() {
        let settings = "# socket = /none\ndead-zone = 2\n  socket =  /run/user/1000/spnav.sock \n";
        assert_eq!(
            socket_in(settings),
            Some(PathBuf::from("/run/user/1000/spnav.sock"))
        );
        assert_eq!(socket_in("socket =\n"), None);
        assert_eq!(socket_in(""), None);
    }
}
