//! Faults at the inputs of the simulated mechanism, injected by a test or by a host's script.
//!
//! A script ([`InputFault`]s with their times) works with every simulated mechanism, in-process and on the emulated board, identically tick for tick.

use heapless::Vec;
pub use mortise_firmware::scripts::AXES;
use mortise_mechanism::interface::{DriverFault, DriverFaultKind, Sensed};
use mortise_protocol::limits::{MAX_INPUT_FAULTS, MAX_JOINTS};
use mortise_protocol::message::{InputFault, InputFaultKind};

/// State of the simulated wiring in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wiring {
    /// The stop input is open.
    pub stop_open: bool,
    /// The supply is too low.
    pub supply_low: bool,
    /// A motor driver reports a fault.
    pub driver_fault: Option<DriverFault>,
    /// Counts by which an axis's counter is offset from the next reading on; applied once. For a rotation the following reading corrects it.
    pub glitch: [i32; AXES],
    /// Axes whose counters are frozen.
    pub stuck: [bool; AXES],
    /// The position reads as not a number.
    pub not_a_number: bool,
    /// Encoder that is wired to each input.
    pub encoders: [u8; AXES],
    /// Whether each encoder counts down when its axis turns forward; `None`: as described.
    pub encoders_reversed: [Option<bool>; AXES],
    /// Whether each joint's motor pushes backward under a positive current; `None`: as described.
    pub motors_reversed: [Option<bool>; MAX_JOINTS],
    /// Joints whose motors give no torque.
    pub motors_dead: [bool; MAX_JOINTS],
}

impl Wiring {
    /// No fault.
    pub const SOUND: Self = Self {
        stop_open: false,
        supply_low: false,
        driver_fault: None,
        glitch: [0; AXES],
        stuck: [false; AXES],
        not_a_number: false,
        encoders: [0, 1, 2, 3, 4, 5],
        encoders_reversed: [None; AXES],
        motors_reversed: [None; MAX_JOINTS],
        motors_dead: [false; MAX_JOINTS],
    };

    /// The readings that result when the true readings `sensed` pass through this wiring.
    pub fn through(&self, mut sensed: Sensed) -> Sensed {
        if self.not_a_number {
            sensed.handle.position.x = f32::NAN;
        }
        Sensed {
            stop_open: self.stop_open,
            supply_low: self.supply_low,
            driver_fault: self.driver_fault,
            ..sensed
        }
    }

    fn apply(&mut self, kind: InputFaultKind, first: bool) {
        let driver = |axis, kind| Some(DriverFault { axis, kind });
        match kind {
            InputFaultKind::EncoderGlitch { axis, counts } => {
                if let (true, Some(glitch)) = (first, self.glitch.get_mut(usize::from(axis))) {
                    *glitch = glitch.saturating_add(counts);
                }
            }
            InputFaultKind::EncoderStuck { axis } => {
                if let Some(stuck) = self.stuck.get_mut(usize::from(axis)) {
                    *stuck = true;
                }
            }
            InputFaultKind::NotANumber => self.not_a_number = true,
            InputFaultKind::Driver { axis } => self.driver_fault = driver(axis, DriverFaultKind::Any),
            InputFaultKind::OverCurrent { axis } => {
                self.driver_fault = driver(axis, DriverFaultKind::OverCurrent);
            }
            InputFaultKind::OverTemperature { axis } => {
                self.driver_fault = driver(axis, DriverFaultKind::OverTemperature);
            }
            InputFaultKind::StopOpen => self.stop_open = true,
            InputFaultKind::SupplyLow => self.supply_low = true,
            InputFaultKind::EncoderSense { axis, reversed } => {
                if let Some(sense) = self.encoders_reversed.get_mut(usize::from(axis)) {
                    *sense = Some(reversed);
                }
            }
            InputFaultKind::MotorSense { axis, reversed } => {
                if let Some(sense) = self.motors_reversed.get_mut(usize::from(axis)) {
                    *sense = Some(reversed);
                }
            }
            InputFaultKind::MotorDead { axis } => {
                if let Some(dead) = self.motors_dead.get_mut(usize::from(axis)) {
                    *dead = true;
                }
            }
            InputFaultKind::EncodersSwapped { axis, with } => {
                let (one, other) = (usize::from(axis), usize::from(with));
                if one < AXES && other < AXES {
                    self.encoders.swap(one, other);
                }
            }
        }
    }
}

/// A script of faults whose time advances with each reading.
#[derive(Clone, Debug, Default)]
pub struct InputScript {
    faults: Vec<InputFault, MAX_INPUT_FAULTS>,
    tick: u32,
}

impl InputScript {
    /// An empty script.
    pub const fn new() -> Self {
        Self {
            faults: Vec::new(),
            tick: 0,
        }
    }

    /// Starts a script whose time begins now; faults beyond the capacity are dropped, which the protocol's bound rules out.
    pub fn start(&mut self, faults: &[InputFault]) {
        self.tick = 0;
        self.faults.clear();
        self.faults.extend(faults.iter().copied().take(MAX_INPUT_FAULTS));
    }

    /// The wiring of the next tick: `wiring` plus the script's faults.
    pub fn advance(&mut self, mut wiring: Wiring) -> Wiring {
        for fault in &self.faults {
            if self.tick >= fault.tick && self.tick - fault.tick < fault.ticks.max(1) {
                wiring.apply(fault.kind, self.tick == fault.tick);
            }
        }
        self.tick = self.tick.saturating_add(1);
        wiring
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_lasts_as_scripted_and_a_glitch_occurs_once() {
        let mut script = InputScript::new();
        script.start(&[
            InputFault {
                tick: 2,
                ticks: 3,
                kind: InputFaultKind::StopOpen,
            },
            InputFault {
                tick: 3,
                ticks: 9,
                kind: InputFaultKind::EncoderGlitch { axis: 4, counts: -7 },
            },
        ]);
        for tick in 0..20 {
            let wiring = script.advance(Wiring::SOUND);
            assert_eq!(wiring.stop_open, (2..5).contains(&tick), "{tick}");
            assert_eq!(wiring.glitch[4], if tick == 3 { -7 } else { 0 }, "{tick}");
        }
    }
}
