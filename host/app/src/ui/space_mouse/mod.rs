//! A SpaceMouse, read through the daemon spacenavd where there is one, else directly.
//!
//! A thread of its own reads it (`watch`); the window takes what it has sent once a frame.

mod daemon;
#[cfg(target_os = "linux")]
mod device;
#[cfg(target_os = "linux")]
mod model;
#[cfg(target_os = "linux")]
mod report;
mod watch;

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use egui::Context;

use self::daemon::Daemon;
pub use self::watch::{AGAIN, Event, Link, Source};
use self::watch::{News, Watch};
use crate::viewport::six_axis::Deflection;

/// A deflected cap is heard from every few hundredths of a second; after this time it counts as at rest.
const SILENT: Duration = Duration::from_millis(300);

/// State of the device, as far as it has reported it.
#[derive(Debug, Default)]
struct Heard {
    /// Whether there is a device, or a daemon that may have one.
    is_there: bool,
    deflection: Deflection,
    at: Option<Instant>,
    pressed: Vec<i32>,
    refusals: Vec<String>,
}

impl Heard {
    /// Takes in a change; whether it is one for the window.
    fn take(&mut self, news: News, now: Instant) -> bool {
        match news {
            News::Sent(Event::Deflected(deflection)) => {
                let changes = !(self.deflection.is_rest() && deflection.is_rest());
                (self.deflection, self.at) = (deflection, Some(now));
                return changes;
            }
            News::Sent(Event::Pressed(button)) => self.pressed.push(button),
            News::Refused(why) => self.refusals.push(why),
            News::Came => self.is_there = true,
            News::Went => {
                let refusals = std::mem::take(&mut self.refusals);
                *self = Self {
                    refusals,
                    ..Self::default()
                };
            }
        }
        true
    }
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
    /// Follows the daemon at its usual places, and on Linux without one the device itself.
    pub fn follow(ctx: &Context) -> Self {
        let sources: Vec<Box<dyn Source>> = vec![
            Box::new(Daemon::usual()),
            #[cfg(target_os = "linux")]
            Box::<device::Devices>::default(),
        ];
        Self::follow_sources(ctx, sources)
    }

    /// Follows a daemon that has its socket at one of these places.
    pub fn follow_at(ctx: &Context, places: Vec<PathBuf>) -> Self {
        Self::follow_sources(ctx, vec![Box::new(Daemon::at(places))])
    }

    /// Follows the first of `sources` that has a device, on a thread of its own, until this is dropped. Where none has one, they are looked for again
    /// every five seconds, and so are those before the one that is read.
    pub fn follow_sources(ctx: &Context, sources: Vec<Box<dyn Source>>) -> Self {
        let heard = Arc::new(Mutex::new(Heard::default()));
        let (kept, ctx) = (Arc::downgrade(&heard), ctx.clone());
        let watch = move || listen(Watch::new(sources), &kept, &ctx);
        // If the thread cannot start, there is no device.
        let _ = std::thread::Builder::new()
            .name("space-mouse".into())
            .spawn(watch);
        Self { heard, last: None }
    }

    /// Whether there is a device, or a daemon that may have one.
    pub fn is_there(&self) -> bool {
        lock(&self.heard).is_there
    }

    /// Why devices that are plugged in may not be read; each sentence once.
    pub fn refusals(&self) -> Vec<String> {
        std::mem::take(&mut lock(&self.heard).refusals)
    }

    /// What it wants of a frame at `now`: nothing unless the window has the focus, because every program hears of the device.
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

/// Takes in what the watch finds until nobody wants it any more.
fn listen(mut watch: Watch, kept: &Weak<Mutex<Heard>>, ctx: &Context) {
    while kept.strong_count() > 0 {
        let news = watch.turn(Instant::now());
        if !news.is_empty() {
            let Some(heard) = kept.upgrade() else {
                return;
            };
            let (mut heard, now) = (lock(&heard), Instant::now());
            let mut is_seen = false;
            for change in news {
                is_seen |= heard.take(change, now);
            }
            drop(heard);
            if is_seen {
                ctx.request_repaint();
            }
        }
        std::thread::sleep(watch.rest(Instant::now()));
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

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
                refusals: Vec::new(),
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
    #[test]
    fn only_what_the_window_shows_draws_it() {
        let (mut heard, now) = (Heard::default(), Instant::now());
        let rest = News::Sent(Event::Deflected(Deflection::default()));
        assert!(heard.take(News::Came, now));
        assert!(!heard.take(rest.clone(), now), "noise of a cap at rest");
        let deflection = Deflection {
            shift: DVec3::Y,
            turn: DVec3::ZERO,
        };
        assert!(heard.take(News::Sent(Event::Deflected(deflection)), now));
        assert!(heard.take(rest, now), "it has come to rest");
        assert!(heard.take(News::Sent(Event::Pressed(1)), now));
        assert!(heard.take(News::Refused("not yours".into()), now));
        assert!(heard.take(News::Went, now));
        assert!(!heard.is_there && heard.pressed.is_empty());
        assert_eq!(
            heard.refusals,
            ["not yours"],
            "a reason outlives the device before"
        );
    }
}
