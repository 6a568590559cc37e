//! Sources of a SpaceMouse's events, in order of preference, and the one that is read.

use std::collections::HashSet;
use std::io;
use std::time::{Duration, Instant};

use crate::viewport::six_axis::Deflection;

/// Time after which sources are looked for again: all of them while there is none, else those that come before the one that is read.
pub const AGAIN: Duration = Duration::from_secs(5);
/// Longest time that one reading waits for an event.
const WAIT: Duration = Duration::from_secs(1);

/// Something that the device has sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The cap's deflection from now on.
    Deflected(Deflection),
    /// A button went down: its number, from 0, as the daemon numbers them.
    Pressed(i32),
}

/// A place where a SpaceMouse may be found.
pub trait Source: Send {
    /// The device, if it is there.
    ///
    /// # Errors
    /// A sentence for the operator when it is there and may not be read.
    fn open(&mut self) -> Result<Option<Box<dyn Link>>, String>;
}

/// A SpaceMouse that is read.
pub trait Link: Send {
    /// Adds what the device sends within `wait` to `events`; returns once there is something.
    ///
    /// # Errors
    /// When the device is gone.
    fn read(&mut self, wait: Duration, events: &mut Vec<Event>) -> io::Result<()>;
}

/// A change that a turn of the watch brought.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum News {
    /// A device is read.
    Came,
    /// It is not read any more.
    Went,
    /// It has sent something.
    Sent(Event),
    /// One is there and may not be read: a sentence, reported once.
    Refused(String),
}

/// The sources, and the one that is read.
pub(super) struct Watch {
    sources: Vec<Box<dyn Source>>,
    /// Index of the source that is read, and its device.
    read: Option<(usize, Box<dyn Link>)>,
    /// When sources are looked for again.
    due: Option<Instant>,
    reported: HashSet<String>,
}

impl Watch {
    /// Sources, the preferred ones first.
    pub(super) fn new(sources: Vec<Box<dyn Source>>) -> Self {
        Self {
            sources,
            read: None,
            due: None,
            reported: HashSet::new(),
        }
    }

    /// Looks for a better source when it is time to; where that brings nothing new, waits up to a second for what the device sends.
    pub(super) fn turn(&mut self, now: Instant) -> Vec<News> {
        let mut news = Vec::new();
        if self.due.is_none_or(|due| now >= due) {
            self.due = Some(now + AGAIN);
            self.look(&mut news);
            if !news.is_empty() {
                return news;
            }
        }
        if let Some((_, link)) = &mut self.read {
            let mut events = Vec::new();
            let ended = link.read(WAIT, &mut events).is_err();
            news.extend(events.into_iter().map(News::Sent));
            if ended {
                self.read = None;
                news.push(News::Went);
            }
        }
        news
    }

    /// Time to wait before the next turn, which is none while a device is read.
    pub(super) fn rest(&self, now: Instant) -> Duration {
        match (&self.read, self.due) {
            (None, Some(due)) => due.saturating_duration_since(now),
            _ => Duration::ZERO,
        }
    }

    /// Reads the first source that has a device, of those before the one that is read.
    fn look(&mut self, news: &mut Vec<News>) {
        let end = self.read.as_ref().map_or(self.sources.len(), |(at, _)| *at);
        for (at, source) in self.sources[..end].iter_mut().enumerate() {
            match source.open() {
                Ok(None) => {}
                Ok(Some(link)) => {
                    if self.read.replace((at, link)).is_some() {
                        news.push(News::Went);
                    }
                    news.push(News::Came);
                    return;
                }
                Err(why) => {
                    if self.reported.insert(why.clone()) {
                        news.push(News::Refused(why));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::sync::{Arc, Mutex};

    use glam::DVec3;

    use super::*;

    /// A source whose state the test sets.
    #[derive(Clone, Default)]
    struct Fake(Arc<Mutex<State>>);

    #[derive(Default)]
    struct State {
        is_there: bool,
        refusal: Option<String>,
        sends: VecDeque<Event>,
        opened: usize,
    }

    impl Fake {
        fn set(&self, change: impl FnOnce(&mut State)) {
            change(&mut self.0.lock().unwrap());
        }

        fn opened(&self) -> usize {
            self.0.lock().unwrap().opened
        }
    }

    impl Source for Fake {
        fn open(&mut self) -> Result<Option<Box<dyn Link>>, String> {
            let mut state = self.0.lock().unwrap();
            state.opened += 1;
            if let Some(why) = &state.refusal {
                return Err(why.clone());
            }
            Ok(state.is_there.then(|| Box::new(self.clone()) as Box<dyn Link>))
        }
    }

    impl Link for Fake {
        fn read(&mut self, _wait: Duration, events: &mut Vec<Event>) -> io::Result<()> {
            let mut state = self.0.lock().unwrap();
            events.extend(state.sends.drain(..));
            if state.is_there {
                Ok(())
            } else {
                Err(io::ErrorKind::UnexpectedEof.into())
            }
        }
    }

    fn sources() -> (Fake, Fake, Watch) {
        let (daemon, device) = (Fake::default(), Fake::default());
        let watch = Watch::new(vec![Box::new(daemon.clone()), Box::new(device.clone())]);
        (daemon, device, watch)
    }

    #[test]
    fn the_daemon_comes_first_and_the_device_serves_without_it() {
        let (daemon, device, mut watch) = sources();
        let begin = Instant::now();
        let at = |s: f64| begin + Duration::from_secs_f64(s);
        assert_eq!(watch.turn(at(0.0)), []);
        assert_eq!(
            watch.rest(at(1.0)),
            Duration::from_secs(4),
            "nothing is polled meanwhile"
        );
        device.set(|state| state.is_there = true);
        assert_eq!(watch.turn(at(4.9)), [], "not yet looked for");
        assert_eq!(watch.turn(at(5.0)), [News::Came]);
        assert_eq!(watch.rest(at(5.0)), Duration::ZERO);
        device.set(|state| state.sends.push_back(Event::Pressed(1)));
        assert_eq!(watch.turn(at(5.1)), [News::Sent(Event::Pressed(1))]);
        // The daemon starts: it is read from then on.
        daemon.set(|state| state.is_there = true);
        device.set(|state| state.sends.push_back(Event::Pressed(0)));
        assert_eq!(watch.turn(at(9.9)), [News::Sent(Event::Pressed(0))]);
        assert_eq!(watch.turn(at(10.0)), [News::Went, News::Came]);
        device.set(|state| state.sends.push_back(Event::Pressed(0)));
        let opened = device.opened();
        assert_eq!(
            watch.turn(at(15.0)),
            [],
            "the device is not read beside the daemon"
        );
        assert_eq!(device.opened(), opened);
        // It ends, what it had sent is still taken, and the device serves again.
        let deflected = Event::Deflected(Deflection {
            shift: DVec3::X,
            turn: DVec3::ZERO,
        });
        daemon.set(|state| {
            state.is_there = false;
            state.sends.push_back(deflected);
        });
        assert_eq!(watch.turn(at(16.0)), [News::Sent(deflected), News::Went]);
        assert_eq!(watch.turn(at(20.0)), [News::Came]);
        assert_eq!(watch.turn(at(20.1)), [News::Sent(Event::Pressed(0))]);
    }

    #[test]
    fn a_device_is_found_again_after_it_was_unplugged() {
        let (_, device, mut watch) = sources();
        let begin = Instant::now();
        for round in 0..3 {
            device.set(|state| state.is_there = true);
            let at = begin + 2 * round * AGAIN;
            assert_eq!(watch.turn(at), [News::Came]);
            device.set(|state| state.is_there = false);
            assert_eq!(watch.turn(at + AGAIN / 2), [News::Went]);
            assert_eq!(watch.turn(at + AGAIN), [], "still unplugged");
        }
    }

    #[test]
    fn a_device_that_may_not_be_read_is_reported_once() {
        let (_, device, mut watch) = sources();
        let begin = Instant::now();
        device.set(|state| state.refusal = Some("not yours".into()));
        assert_eq!(watch.turn(begin), [News::Refused("not yours".into())]);
        assert_eq!(watch.turn(begin + AGAIN), []);
        device.set(|state| state.refusal = Some("nor is this one".into()));
        assert_eq!(
            watch.turn(begin + 2 * AGAIN),
            [News::Refused("nor is this one".into())]
        );
        device.set(|state| {
            state.refusal = None;
            state.is_there = true;
        });
        assert_eq!(watch.turn(begin + 3 * AGAIN), [News::Came]);
    }
}
