//! Why the board started: reset flags of the chip, and the record of a crash.

use mortise_board::record::Crash;
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

/// What the host is reported.
pub const fn reset_reason(flags: ResetFlags, crash: Option<Crash>) -> ResetReason {
    // After power-on or brown-out memory is undefined: no record counts.
    if flags.power_on {
        return ResetReason::PowerOn;
    }
    if flags.brown_out {
        return ResetReason::BrownOut;
    }
    if let Some(crash) = crash {
        return crash.reason();
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
}
