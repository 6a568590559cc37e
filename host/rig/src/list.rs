//! List of the available rigs: simulated ones first, then the serial ports.

use crate::spec::{EmulatedMode, RigSpec};
use crate::{emulator, serial};

/// An entry of the rig chooser.
#[derive(Clone, Debug, PartialEq)]
pub struct RigEntry {
    /// Specification to connect with.
    pub spec: RigSpec,
    /// Short name.
    pub label: String,
    /// Description; USB ids of a port.
    pub detail: String,
    /// Whether the rig can be used now; the error says what to do. A port is tested only when it is opened.
    pub available: Result<(), String>,
}

/// All rigs. Runs `qemu-system-arm --version` once to check for QEMU (some 20 ms).
pub fn list() -> Vec<RigEntry> {
    let emulated = RigSpec::Emulated {
        mode: EmulatedMode::Interactive,
        firmware: None,
    };
    let mut entries = vec![
        RigEntry {
            spec: RigSpec::Simulated { realtime: true },
            label: "Simulation in this program".into(),
            detail: "simulated mechanism and hand, 1 kHz, no hardware needed".into(),
            available: Ok(()),
        },
        RigEntry {
            spec: emulated,
            label: "Emulated board".into(),
            detail: "the board's firmware on a Cortex-M7 in QEMU (mps2-an500), simulated mechanism".into(),
            available: emulator::emulator_available(None),
        },
    ];
    entries.extend(serial::ports().into_iter().map(|port| RigEntry {
        detail: serial::detail(&port),
        label: port.port_name.clone(),
        spec: RigSpec::Serial { port: port.port_name },
        available: Ok(()),
    }));
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_rigs_come_first_and_ports_after_them() {
        let entries = list();
        assert_eq!(entries[0].spec, RigSpec::Simulated { realtime: true });
        assert!(entries[0].available.is_ok());
        assert!(matches!(entries[1].spec, RigSpec::Emulated { .. }));
        if let Err(what_to_do) = &entries[1].available {
            assert!(what_to_do.contains("cargo xtask"), "{what_to_do}");
        }
        assert!(
            entries[2..]
                .iter()
                .all(|e| matches!(e.spec, RigSpec::Serial { .. }))
        );
    }
}
