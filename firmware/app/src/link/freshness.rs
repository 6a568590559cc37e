//! Check that a command is new: it names this session, and its count exceeds that of every earlier such command.
//!
//! This refuses a frame that was repeated, delayed, or sent by a host whose session is over, whatever its order among others.

use mortise_protocol::frame::Stamp;
use mortise_protocol::message::Refusal;

/// The session's name and the highest count accepted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Freshness {
    /// Derived from this start's entropy.
    base: u32,
    session: u32,
    newest: Option<u32>,
}

impl Freshness {
    pub const fn new(entropy: u64) -> Self {
        let base = mixed(entropy);
        Self {
            base,
            session: base,
            newest: None,
        }
    }

    /// Begins session `number`. The 2³² sessions of one start have different names; those of two starts differ as their entropy does.
    pub const fn begin(&mut self, number: u32) {
        self.session = self.base.wrapping_add(number);
        self.newest = None;
    }

    /// This session's name.
    pub const fn session(&self) -> u32 {
        self.session
    }

    /// Checks a command's stamp and records its count; the command is carried out only when this is `Ok`.
    pub fn take(&mut self, stamp: Option<Stamp>) -> Result<(), Refusal> {
        let stamp = stamp.ok_or(Refusal::Outdated)?;
        if stamp.session != self.session || self.newest.is_some_and(|newest| stamp.count <= newest) {
            return Err(Refusal::Outdated);
        }
        self.newest = Some(stamp.count);
        Ok(())
    }
}

/// SplitMix64's output function (Steele, Lea, Flood 2014), upper half: entropies that differ by little give bases that differ by much.
const fn mixed(entropy: u64) -> u32 {
    let mut z = entropy.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_count_is_taken_once_and_never_after_a_larger_one() {
        let mut freshness = Freshness::new(7);
        freshness.begin(1);
        let session = freshness.session();
        let stamp = |count| Some(Stamp { session, count });
        assert_eq!(freshness.take(stamp(0)), Ok(()), "any start");
        assert_eq!(freshness.take(stamp(0)), Err(Refusal::Outdated));
        assert_eq!(freshness.take(stamp(u32::MAX)), Ok(()));
        assert_eq!(freshness.take(stamp(5)), Err(Refusal::Outdated));
        freshness.begin(2);
        assert_eq!(
            freshness.take(stamp(6)),
            Err(Refusal::Outdated),
            "another session"
        );
        assert_eq!(freshness.take(None), Err(Refusal::Outdated));
    }

    #[test]
    fn sessions_of_a_start_and_of_the_next_differ() {
        let mut names = std::collections::BTreeSet::new();
        for entropy in 0..100 {
            let mut freshness = Freshness::new(entropy);
            for number in 1..=100 {
                freshness.begin(number);
                assert!(names.insert(freshness.session()), "{entropy}, {number}");
            }
        }
    }
}
