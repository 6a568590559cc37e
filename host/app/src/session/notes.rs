//! Messages in words, newest first, bounded.

use std::time::{Duration, Instant};

/// Most messages kept; the oldest goes.
pub const MAX_NOTES: usize = 200;

/// How much a message matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// For the record.
    Info,
    /// Something worth having happened.
    Good,
    /// Something to know; work goes on.
    Warning,
    /// Something was not done, or motors went off.
    Error,
}

/// One message.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// Since the program started.
    pub at: Duration,
    /// How much it matters.
    pub severity: Severity,
    /// A sentence: what, where, what to do.
    pub text: String,
    /// How often it came in a row.
    pub times: u32,
}

/// The messages.
#[derive(Clone, Debug)]
pub struct Notes {
    start: Instant,
    newest_first: std::collections::VecDeque<Note>,
    count: u64,
}

impl Default for Notes {
    fn default() -> Self {
        Self {
            start: Instant::now(),
            newest_first: std::collections::VecDeque::new(),
            count: 0,
        }
    }
}

impl Notes {
    /// Adds a message; one that repeats the newest is counted instead.
    pub fn add(&mut self, severity: Severity, text: impl Into<String>) {
        let (at, text) = (self.start.elapsed(), text.into());
        self.count += 1;
        if let Some(newest) = self.newest_first.front_mut()
            && newest.text == text
            && newest.severity == severity
        {
            newest.times += 1;
            newest.at = at;
            return;
        }
        self.newest_first.truncate(MAX_NOTES - 1);
        self.newest_first.push_front(Note {
            at,
            severity,
            text,
            times: 1,
        });
    }

    /// Newest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Note> {
        self.newest_first.iter()
    }

    /// The newest.
    pub fn newest(&self) -> Option<&Note> {
        self.newest_first.front()
    }

    /// How many were ever added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.newest_first.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_give_way_and_repeats_are_counted() {
        let mut notes = Notes::default();
        for i in 0..MAX_NOTES + 5 {
            notes.add(Severity::Info, format!("message {i}"));
        }
        assert_eq!(notes.iter().len(), MAX_NOTES);
        assert_eq!(
            notes.newest().expect("some").text,
            format!("message {}", MAX_NOTES + 4)
        );
        notes.add(Severity::Warning, "again");
        notes.add(Severity::Warning, "again");
        let newest = notes.newest().expect("some");
        assert_eq!((newest.text.as_str(), newest.times), ("again", 2));
        assert_eq!(notes.iter().len(), MAX_NOTES);
    }
}
