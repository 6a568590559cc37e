//! A SpaceMouse, read through the daemon spacenavd.
//!
//! The daemon sends packets of eight 32-bit numbers over a local socket: the kind (0 motion, 1 button pressed, 2 released), then for a motion the deflection
//! along x (right), y (up), z (away from the viewer), about x, y and z, and the time since the last one; for a button its number. A deflection of about
//! 350 is full. Source: proto.h, spnav.c and util.c of libspnav 1.2; protocol version 0, which a client speaks that asks for no other.

use std::io::Read as _;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use egui::Context;
use glam::DVec3;

use crate::viewport::six_axis::Deflection;

/// Where the daemon has its socket unless it is set up otherwise.
const SOCKET: &str = "/var/run/spnav.sock";
const SETTINGS: &str = "/etc/spnavrc";
const VARIABLE: &str = "SPNAV_SOCKET";
/// Full deflection, units of the daemon.
const FULL: f64 = 350.0;
/// Time after which the daemon is looked for again.
const AGAIN: Duration = Duration::from_secs(5);
/// A deflected cap is heard from every few hundredths of a second; after this time it counts as at rest.
const SILENT: Duration = Duration::from_millis(300);

/// Size of a packet, and its kinds.
const PACKET: usize = 32;
const MOTION: i32 = 0;
const PRESS: i32 = 1;

/// Something that the device has sent.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Event {
    Deflected(Deflection),
    Pressed(i32),
}

/// State of the device, as far as the daemon has reported it.
#[derive(Debug, Default)]
struct Heard {
    /// Whether there is a daemon.
    is_there: bool,
    deflection: Deflection,
    at: Option<Instant>,
    pressed: Vec<i32>,
}

/// A SpaceMouse that may come and go.
pub struct SpaceMouse {
    heard: Arc<Mutex<Heard>>,
    /// Time of the frame before, while the cap is deflected.
    last: Option<Instant>,
}

/// What the device wants of a frame.
pub struct Wanted {
    /// Deflection of the cap.
    pub deflection: Deflection,
    /// Time for which it is to act, s.
    pub seconds: f64,
    /// Buttons pressed, from 0.
    pub pressed: Vec<i32>,
}

impl SpaceMouse {
    /// Follows the daemon, at its usual places.
    pub fn follow(ctx: &Context) -> Self {
        let variable = std::env::var_os(VARIABLE).map(PathBuf::from);
        let settings = std::fs::read_to_string(SETTINGS).ok();
        let set = settings.as_deref().and_then(socket_in);
        let usual = [variable, set, Some(PathBuf::from(SOCKET))];
        Self::follow_at(ctx, usual.into_iter().flatten().collect())
    }

    /// Follows a daemon that has its socket at one of these places, on a thread of its own, until this is dropped. Without a daemon it is looked for again
    /// every five seconds.
    pub fn follow_at(ctx: &Context, places: Vec<PathBuf>) -> Self {
        let heard = Arc::new(Mutex::new(Heard::default()));
        let (kept, ctx) = (Arc::downgrade(&heard), ctx.clone());
        let watch = move || {
            while kept.strong_count() > 0 {
                let daemon = places.iter().find_map(|place| UnixStream::connect(place).ok());
                if let Some(daemon) = daemon {
                    listen(daemon, &kept, &ctx);
                }
                std::thread::sleep(AGAIN);
            }
        };
        // If the thread cannot start, there is no device.
        let _ = std::thread::Builder::new()
            .name("space-mouse".into())
            .spawn(watch);
        Self { heard, last: None }
    }

    /// Whether there is a daemon.
    pub fn is_there(&self) -> bool {
        lock(&self.heard).is_there
    }

    /// What it wants of a frame at `now`: nothing unless the window has the focus, because the daemon sends to every program.
    pub fn frame(&mut self, now: Instant, has_focus: bool) -> Wanted {
        let mut heard = lock(&self.heard);
        let is_fresh = heard
            .at
            .is_some_and(|at| now.saturating_duration_since(at) < SILENT);
        let pressed = std::mem::take(&mut heard.pressed);
        if !has_focus || !is_fresh || heard.deflection.is_rest() {
            self.last = None;
            let pressed = if has_focus { pressed } else { Vec::new() };
            return Wanted {
                deflection: Deflection::default(),
                seconds: 0.0,
                pressed,
            };
        }
        let since = self.last.replace(now).unwrap_or(now);
        Wanted {
            deflection: heard.deflection,
            seconds: now.saturating_duration_since(since).as_secs_f64(),
            pressed,
        }
    }
}

fn lock(heard: &Mutex<Heard>) -> MutexGuard<'_, Heard> {
    heard.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes in what the daemon sends until it ends or nobody wants it any more.
fn listen(mut daemon: UnixStream, kept: &Weak<Mutex<Heard>>, ctx: &Context) {
    let note = |of: &dyn Fn(&mut Heard)| {
        let heard = kept.upgrade();
        if let Some(heard) = &heard {
            of(&mut lock(heard));
            ctx.request_repaint();
        }
        heard.is_some()
    };
    let mut packet = [0; PACKET];
    let mut goes_on = note(&|heard| heard.is_there = true);
    while goes_on && daemon.read_exact(&mut packet).is_ok() {
        goes_on = match event(&packet) {
            Some(Event::Deflected(deflection)) => note(&|heard| {
                (heard.deflection, heard.at) = (deflection, Some(Instant::now()));
            }),
            Some(Event::Pressed(button)) => note(&|heard| heard.pressed.push(button)),
            None => kept.strong_count() > 0,
        };
    }
    note(&|heard| *heard = Heard::default());
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
    fn settings_name_the_socket() {
        let settings = "# socket = /none\ndead-zone = 2\n  socket =  /run/user/1000/spnav.sock \n";
        assert_eq!(
            socket_in(settings),
            Some(PathBuf::from("/run/user/1000/spnav.sock"))
        );
        assert_eq!(socket_in("socket =\n"), None);
        assert_eq!(socket_in(""), None);
    }

    #[test]
    fn a_cap_that_falls_silent_or_a_window_without_focus_is_at_rest() {
        let now = Instant::now();
        let deflection = Deflection {
            shift: DVec3::X,
            turn: DVec3::ZERO,
        };
        let mut mouse = SpaceMouse {
            heard: Arc::new(Mutex::new(Heard {
                is_there: true,
                deflection,
                at: Some(now),
                pressed: vec![0],
            })),
            last: None,
        };
        let after = |ms: u64| now + Duration::from_millis(ms);
        let first = mouse.frame(after(0), true);
        assert_eq!(
            (first.deflection, first.seconds, first.pressed),
            (deflection, 0.0, vec![0])
        );
        let second = mouse.frame(after(40), true);
        assert_eq!((second.deflection, second.seconds), (deflection, 0.04));
        assert!(second.pressed.is_empty(), "reported once");
        assert!(mouse.frame(after(50), false).deflection.is_rest());
        assert_eq!(mouse.frame(after(60), true).seconds, 0.0, "begins anew");
        assert!(mouse.frame(after(301), true).deflection.is_rest());
    }
}
