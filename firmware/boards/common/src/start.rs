//! What a board logs when it starts.

use mortise_firmware::board::Flash;
use mortise_firmware::link::LinkPlane;
use mortise_protocol::message::ResetReason;

use crate::record::Crash;

/// Logs why the board started, and which scene it has.
pub fn announce<'s, F: Flash<'s>>(reset: ResetReason, crash: Option<Crash>, link: &LinkPlane<'_, 's, F>) {
    match crash {
        Some(Crash::Requested) => defmt::info!("started: as requested"),
        Some(Crash::Panic { line }) => defmt::error!("started after a panic in line {=u32}", line),
        Some(Crash::HardFault { pc, status }) => {
            defmt::error!(
                "started after a processor fault at {=u32:#010x}, CFSR {=u32:#010x}",
                pc,
                status
            );
        }
        None => match reset {
            ResetReason::PowerOn => defmt::info!("started: power on"),
            ResetReason::BrownOut => defmt::warn!("started after a brown-out"),
            ResetReason::Watchdog => defmt::error!("started by the watchdog"),
            ResetReason::Requested => defmt::info!("started: software reset"),
            _ => defmt::warn!("started: reason unknown"),
        },
    }
    match link.store().current() {
        Some(scene) => defmt::info!(
            "scene {=u32:08x}: {=usize} parts, {=u32} bytes",
            scene.crc,
            scene.image.parts().len(),
            scene.image.header().length
        ),
        None => defmt::info!("no scene"),
    }
}
