//! The in-process rig: the board's own planes and simulated mechanism on threads of this program.

use crate::error::RigError;
use crate::transport::Transport;

/// Flash of a simulated board; survives its restarts.
#[derive(Clone, Debug, Default)]
pub struct Flash;

pub(crate) fn start(_flash: Flash, _realtime: bool) -> Result<Transport, RigError> {
    Err(RigError::NoAnswer {
        rig: "sim".into(),
        waited_s: 0.0,
        hint: "the in-process rig is not wired up in this build; use `emulated`".into(),
    })
}
