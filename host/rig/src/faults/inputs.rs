//! Faults at the inputs of a simulated board: encoders, drivers, stop input, supply.
//!
//! They are not part of the line: the board gets them beforehand ([`ToDevice::SimulatedInputs`]) and applies them itself, tick for tick
//! identically in-process and emulated.

use mortise_protocol::limits::MAX_INPUT_FAULTS;
use mortise_protocol::message::{self, InputFaultKind, ToDevice};
use serde::Deserialize;

/// One input fault, as a scenario describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputFault {
    /// Kind.
    pub what: InputFaultName,
    /// Encoder or motor: 0 to 2 are the handle's position, 3 to 5 its rotation.
    pub axis: Option<u8>,
    /// The other encoder of a swapped pair.
    pub with: Option<u8>,
    /// Sense of an encoder or a motor.
    pub reversed: Option<bool>,
    /// Error of an encoder, counts.
    pub counts: Option<i32>,
    /// Start, ms after the hand's start.
    pub at_ms: u32,
    /// Duration, ms.
    #[serde(default = "once")]
    pub for_ms: u32,
}

fn once() -> u32 {
    1
}

/// Kinds of input faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InputFaultName {
    /// An encoder's counter is off by `counts` from the start on.
    EncoderGlitch,
    /// An encoder's counter stays constant.
    EncoderStuck,
    /// The position reads as NaN.
    NotANumber,
    /// A motor driver reports a fault without its cause.
    Driver,
    /// A motor driver reports overcurrent.
    OverCurrent,
    /// A motor driver reports overtemperature.
    OverTemperature,
    /// The stop input is open.
    StopOpen,
    /// The supply voltage is too low.
    SupplyLow,
    /// An encoder counts in a sense of its own.
    EncoderSense,
    /// A motor pushes in a sense of its own.
    MotorSense,
    /// A motor gives no torque.
    MotorDead,
    /// Two encoders are plugged into each other's place.
    EncodersSwapped,
}

impl InputFault {
    /// The wire form. Ticks are milliseconds.
    ///
    /// # Errors
    /// A missing or superfluous axis or count, as a sentence.
    fn wire(&self) -> Result<message::InputFault, String> {
        use InputFaultName as N;
        let name = self.what;
        let one = |key: &str, axis: Option<u8>| match axis {
            Some(axis) if axis < 6 => Ok(axis),
            other => Err(format!("{name:?} needs {key} from 0 to 5, not {other:?}")),
        };
        let axis = || one("an axis", self.axis);
        let kind = match name {
            N::EncoderGlitch => InputFaultKind::EncoderGlitch {
                axis: axis()?,
                counts: self.counts.ok_or("EncoderGlitch needs counts")?,
            },
            N::EncoderStuck => InputFaultKind::EncoderStuck { axis: axis()? },
            N::Driver => InputFaultKind::Driver { axis: axis()? },
            N::OverCurrent => InputFaultKind::OverCurrent { axis: axis()? },
            N::OverTemperature => InputFaultKind::OverTemperature { axis: axis()? },
            N::NotANumber | N::StopOpen | N::SupplyLow if self.axis.is_some() => {
                return Err(format!("{name:?} has no axis"));
            }
            N::NotANumber => InputFaultKind::NotANumber,
            N::StopOpen => InputFaultKind::StopOpen,
            N::SupplyLow => InputFaultKind::SupplyLow,
            N::EncoderSense => InputFaultKind::EncoderSense {
                axis: axis()?,
                reversed: self.reversed.ok_or("EncoderSense needs `reversed`")?,
            },
            N::MotorSense => InputFaultKind::MotorSense {
                axis: axis()?,
                reversed: self.reversed.ok_or("MotorSense needs `reversed`")?,
            },
            N::MotorDead => InputFaultKind::MotorDead { axis: axis()? },
            N::EncodersSwapped => InputFaultKind::EncodersSwapped {
                axis: axis()?,
                with: one("`with`", self.with)?,
            },
        };
        if self.reversed.is_some() && !matches!(name, N::EncoderSense | N::MotorSense) {
            return Err(format!("{name:?} has no `reversed`"));
        }
        if self.with.is_some() && name != N::EncodersSwapped {
            return Err(format!("{name:?} has no `with`"));
        }
        if self.counts.is_some() && name != N::EncoderGlitch {
            return Err(format!("{name:?} has no counts"));
        }
        Ok(message::InputFault {
            tick: self.at_ms,
            ticks: self.for_ms,
            kind,
        })
    }
}

/// The message with all faults; an empty list clears the earlier ones.
///
/// # Errors
/// Too many faults, or an invalid one, as a sentence.
pub(super) fn message(faults: &[InputFault]) -> Result<ToDevice, String> {
    let all: Result<Vec<_>, _> = faults.iter().map(InputFault::wire).collect();
    let all = all.map_err(|what| format!("inputs: {what}"))?;
    let fits = heapless::Vec::from_slice(&all)
        .map_err(|_| format!("inputs: {} faults, at most {MAX_INPUT_FAULTS} fit", all.len()))?;
    Ok(ToDevice::SimulatedInputs(fits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_or_too_much_is_said() {
        let sound = InputFault {
            what: InputFaultName::EncoderGlitch,
            axis: Some(2),
            with: None,
            reversed: None,
            counts: Some(-40),
            at_ms: 7,
            for_ms: 1,
        };
        assert!(message(&[sound]).is_ok());
        let said = |fault| message(&[sound, fault]).expect_err("not possible");
        assert!(said(InputFault { axis: None, ..sound }).contains("axis"));
        assert!(
            said(InputFault {
                axis: Some(6),
                ..sound
            })
            .contains("axis")
        );
        assert!(
            said(InputFault {
                counts: None,
                ..sound
            })
            .contains("counts")
        );
        let what = InputFaultName::StopOpen;
        assert!(said(InputFault { what, ..sound }).contains("no axis"));
        let axis = None;
        assert!(said(InputFault { what, axis, ..sound }).contains("no counts"));
        assert!(message(&[sound; 9]).expect_err("too many").contains("at most 8"));
    }
}
