//! The record that a crash leaves in memory that a reset does not clear.

use mortise_protocol::message::ResetReason;

/// What left a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crash {
    /// No crash: the host asked for a restart.
    Requested,
    /// A Rust panic.
    Panic {
        /// Source line.
        line: u32,
    },
    /// A processor fault: bad access, stack overflow, uncorrectable memory error.
    HardFault {
        /// Address of the instruction, 0 when the stack could not be read.
        pc: u32,
        /// Configurable Fault Status Register.
        status: u32,
    },
}

impl Crash {
    /// What the host is reported. The status of a hard fault goes to the log ([`crate::start`]).
    pub const fn reason(self) -> ResetReason {
        match self {
            Self::Requested => ResetReason::Requested,
            Self::Panic { line } => ResetReason::Panic { line },
            Self::HardFault { pc, .. } => ResetReason::HardFault { pc },
        }
    }
}

/// Words of a [`CrashRecord`].
pub const RECORD_WORDS: usize = 4;
const REQUESTED: u32 = 0x5245_5354;
const PANIC: u32 = 0x5041_4e43;
const HARD_FAULT: u32 = 0x4641_554c;

/// A crash in a form that survives a reset: words with a check, because memory that lost power holds anything.
pub type CrashRecord = [u32; RECORD_WORDS];

/// Packs a crash.
pub const fn record(crash: Crash) -> CrashRecord {
    let (kind, a, b) = match crash {
        Crash::Requested => (REQUESTED, 0, 0),
        Crash::Panic { line } => (PANIC, line, 0),
        Crash::HardFault { pc, status } => (HARD_FAULT, pc, status),
    };
    [kind, a, b, check(kind, a, b)]
}

/// Unpacks a record; `None` when there is none.
pub const fn crash(record: CrashRecord) -> Option<Crash> {
    let [kind, a, b, sum] = record;
    if sum != check(kind, a, b) {
        return None;
    }
    match kind {
        REQUESTED => Some(Crash::Requested),
        PANIC => Some(Crash::Panic { line: a }),
        HARD_FAULT => Some(Crash::HardFault { pc: a, status: b }),
        _ => None,
    }
}

const fn check(kind: u32, a: u32, b: u32) -> u32 {
    !(kind ^ a.rotate_left(11) ^ b.rotate_left(22))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn empty_memory_is_no_record() {
        assert_eq!(crash([0; RECORD_WORDS]), None);
        assert_eq!(crash([u32::MAX; RECORD_WORDS]), None);
    }

    proptest! {
        #[test]
        fn a_record_comes_back_and_a_flipped_bit_does_not(line in any::<u32>(), pc in any::<u32>(), status in any::<u32>(), bit in 0usize..128) {
            for made in [Crash::Requested, Crash::Panic { line }, Crash::HardFault { pc, status }] {
                let mut words = record(made);
                prop_assert_eq!(crash(words), Some(made));
                words[bit / 32] ^= 1 << (bit % 32);
                prop_assert_eq!(crash(words), None);
            }
        }
    }
}
