//! Why the board started: reset flags of the chip, and the record a crash leaves in memory that a reset does not clear.

use mortise_protocol::message::ResetReason;

/// Flags of RCC_RSR. Several are set at once: every reset also pulls the reset pin, power-on also counts as brown-out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetFlags {
    /// Power came up.
    pub power_on: bool,
    /// Supply fell under the brown-out level.
    pub brown_out: bool,
    /// Independent or window watchdog.
    pub watchdog: bool,
    /// SYSRESETREQ.
    pub software: bool,
    /// Reset pin.
    pub pin: bool,
}

/// What kind of crash left a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crash {
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

/// Words of a [`CrashRecord`].
pub const RECORD_WORDS: usize = 4;
const PANIC: u32 = 0x5041_4e43;
const HARD_FAULT: u32 = 0x4641_554c;

/// A crash in a form that survives a reset: words with a check, because memory that lost power holds anything.
pub type CrashRecord = [u32; RECORD_WORDS];

/// Packs a crash.
pub const fn record(crash: Crash) -> CrashRecord {
    let (kind, a, b) = match crash {
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
        PANIC => Some(Crash::Panic { line: a }),
        HARD_FAULT => Some(Crash::HardFault { pc: a, status: b }),
        _ => None,
    }
}

const fn check(kind: u32, a: u32, b: u32) -> u32 {
    !(kind ^ a.rotate_left(11) ^ b.rotate_left(22))
}

/// What the host is told. The status of a hard fault goes to the log.
pub const fn reset_reason(flags: ResetFlags, crash: Option<Crash>) -> ResetReason {
    // After power-on or brown-out memory is undefined: no record counts.
    if flags.power_on {
        return ResetReason::PowerOn;
    }
    if flags.brown_out {
        return ResetReason::BrownOut;
    }
    match crash {
        Some(Crash::Panic { line }) => return ResetReason::Panic { line },
        Some(Crash::HardFault { pc, .. }) => return ResetReason::HardFault { pc },
        None => {}
    }
    if flags.watchdog {
        ResetReason::Watchdog
    } else if flags.software {
        ResetReason::Requested
    } else if flags.pin {
        ResetReason::PowerOn
    } else {
        ResetReason::Unknown
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NONE: ResetFlags = ResetFlags {
        power_on: false,
        brown_out: false,
        watchdog: false,
        software: false,
        pin: true,
    };

    #[test]
    fn each_cause_has_its_name() {
        let reason = |flags| reset_reason(flags, None);
        assert_eq!(
            reason(ResetFlags {
                power_on: true,
                brown_out: true,
                ..NONE
            }),
            ResetReason::PowerOn
        );
        assert_eq!(
            reason(ResetFlags {
                brown_out: true,
                ..NONE
            }),
            ResetReason::BrownOut
        );
        assert_eq!(
            reason(ResetFlags {
                watchdog: true,
                ..NONE
            }),
            ResetReason::Watchdog
        );
        assert_eq!(
            reason(ResetFlags {
                software: true,
                ..NONE
            }),
            ResetReason::Requested
        );
        assert_eq!(reason(NONE), ResetReason::PowerOn);
        assert_eq!(reason(ResetFlags { pin: false, ..NONE }), ResetReason::Unknown);
    }

    #[test]
    fn a_crash_goes_before_the_reset_it_made_but_not_before_power_on() {
        let crash = Some(Crash::Panic { line: 42 });
        let software = ResetFlags {
            software: true,
            ..NONE
        };
        assert_eq!(reset_reason(software, crash), ResetReason::Panic { line: 42 });
        let fault = Some(Crash::HardFault {
            pc: 0x0800_1234,
            status: 2,
        });
        assert_eq!(
            reset_reason(software, fault),
            ResetReason::HardFault { pc: 0x0800_1234 }
        );
        // The watchdog may bite while the record is being written; a whole record still tells more.
        let watchdog = ResetFlags {
            watchdog: true,
            ..NONE
        };
        assert_eq!(reset_reason(watchdog, crash), ResetReason::Panic { line: 42 });
        let power = ResetFlags {
            power_on: true,
            ..NONE
        };
        assert_eq!(reset_reason(power, crash), ResetReason::PowerOn);
    }

    #[test]
    fn empty_memory_is_no_record() {
        assert_eq!(crash([0; RECORD_WORDS]), None);
        assert_eq!(crash([u32::MAX; RECORD_WORDS]), None);
    }

    proptest! {
        #[test]
        fn a_record_comes_back_and_a_flipped_bit_does_not(line in any::<u32>(), pc in any::<u32>(), status in any::<u32>(), bit in 0usize..128) {
            for made in [Crash::Panic { line }, Crash::HardFault { pc, status }] {
                let mut words = record(made);
                prop_assert_eq!(crash(words), Some(made));
                words[bit / 32] ^= 1 << (bit % 32);
                prop_assert_eq!(crash(words), None);
            }
        }
    }
}
