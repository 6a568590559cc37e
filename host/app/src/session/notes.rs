//! Messages to the operator, newest first, bounded.

use std::time::{Duration, Instant};

/// Largest number of messages kept; the oldest are dropped.
pub const MAX_NOTES: usize = 200;

/// Severity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// For the record.
    Info,
    /// A success.
    Good,
    /// A condition to know about; work continues.
    Warning,
    /// An action failed, or motors went off.
    Error,
}

/// One message.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// Time since the program started.
    pub at: Duration,
    /// How much it matters.
    pub severity: Severity,
    /// A sentence: what happened, where, and what to do.
    pub text: String,
    /// Number of consecutive occurrences.
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
    /// Adds a message; a repetition of the newest increments its count instead.
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

    /// Number of messages ever added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Removes all messages.
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
