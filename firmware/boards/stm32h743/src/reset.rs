//! Reads and clears the chip's reset flags.

use crate::boot::ResetFlags;
use embassy_stm32::pac;

/// Why the chip was reset. Once: the flags are cleared, so that the next reset shows its own.
pub fn take_flags() -> ResetFlags {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    ResetFlags {
        power_on: flags.porrstf(),
        brown_out: flags.borrstf(),
        watchdog: flags.iwdg1rstf() || flags.wwdg1rstf(),
        software: flags.sftrstf(),
        pin: flags.pinrstf(),
    }
}
