//! Random bits of the chip, for the names of sessions.

use embassy_stm32::{pac, uid};

/// Looks for a word before the generator is given up; it has one every 40 cycles of its 48 MHz (RM0433, 34.3).
const PATIENCE: u32 = 100_000;

/// 64 bits that differ at every start. A generator that fails, which its clock and seed checks tell, leaves what differs between boards and a cycle
/// count of this start; bounded time either way. Call once, after the clocks are set up: the generator runs from HSI48, as USB does.
pub fn entropy() -> u64 {
    // The processor's cycle counter runs by now, and how long the clocks took to lock differs from start to start.
    let cycles = cortex_m::peripheral::DWT::cycle_count();
    let identity = uid::uid().chunks(4).fold(cycles, |sum, word| {
        word.iter().fold(sum, |s, &b| s.rotate_left(5) ^ u32::from(b))
    });
    pac::RCC.ahb2enr().modify(|w| w.set_rngen(true));
    // A read back lets the clock arrive before the first access.
    let _ = pac::RCC.ahb2enr().read();
    pac::RNG.cr().write(|w| w.set_rngen(true));
    let bits = u64::from(word().unwrap_or(identity)) << 32 | u64::from(word().unwrap_or(0) ^ identity);
    pac::RNG.cr().write(|w| w.set_rngen(false));
    bits
}

fn word() -> Option<u32> {
    for _ in 0..PATIENCE {
        let status = pac::RNG.sr().read();
        if status.secs() || status.cecs() {
            return None;
        }
        if status.drdy() {
            // 0 is what the register reads as when the generator failed between the two looks.
            return Some(pac::RNG.dr().read()).filter(|&word| word != 0);
        }
    }
    None
}
