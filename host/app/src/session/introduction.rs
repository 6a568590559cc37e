//! What a connection begins with, and begins with again when the board starts with another description of its rig.

use mortise_protocol::message::{Capabilities, ToDevice};
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_protocol::rig::Rig;
use mortise_rig::{Client, RigError};

/// Ticks between telemetry messages: some 60 messages a second, half of what an emulated UART carries.
const TELEMETRY_TICKS: u16 = 16;

/// A board that has started again with another description.
pub struct RigSent {
    /// The description that it uses.
    pub rig: Rig,
    /// What it can do.
    pub capabilities: Capabilities,
    /// Its parameters, which are the default ones again.
    pub parameters: Vec<(ParameterId, f32)>,
}

/// Requests telemetry and reads every parameter.
pub(super) fn introduce(client: &Client) -> Result<Vec<(ParameterId, f32)>, RigError> {
    client.request(ToDevice::SetTelemetry {
        every_ticks: TELEMETRY_TICKS,
    })?;
    (PARAMETERS.iter())
        .map(|row| Ok((row.id, client.parameter(row.id)?)))
        .collect()
}

/// Sends a description and has the board start again with it.
pub(super) fn send_rig(client: &Client, rig: Rig) -> Result<RigSent, String> {
    let send = || {
        client.request(ToDevice::SetRig(rig))?;
        let capabilities = client.restart_board()?;
        let parameters = introduce(client)?;
        Ok((capabilities, parameters, client.rig()?))
    };
    let (capabilities, parameters, kept) = send().map_err(|error: RigError| error.to_string())?;
    match kept {
        (Some(rig), true) => Ok(RigSent {
            rig,
            capabilities,
            parameters,
        }),
        _ => Err("the board does not use the description that was sent: send it again".to_owned()),
    }
}
