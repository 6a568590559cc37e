//! Rigs by their description: every example is sent, kept over a restart, driven, and gives the same bits on every simulation.

use mortise_protocol::message::{HandScript, Keyframe, Refusal, ToDevice, WirePose};
use mortise_protocol::rig::Rig;
use mortise_rig::{Client, EXAMPLES, Event, RigError, RigSpec, parse_rig};

use crate::verdict::Verdict;

/// Ticks of the hand's motion, and of its rest.
const TICKS: u32 = 400;

/// See the module. A board with a built-in mechanism must report so.
pub fn descriptions_are_kept_and_driven(client: Client) -> Verdict {
    let mut client = client;
    let mut said = Vec::new();
    for (name, text) in EXAMPLES {
        let rig = parse_rig(text, name).map_err(|error| error.to_string())?;
        match client.request(ToDevice::SetRig(rig.clone())) {
            Err(RigError::Refused {
                reason: Refusal::RigFixed,
                ..
            }) => return Ok("its mechanism is compiled in, and it says so".into()),
            other => other.map_err(words)?,
        }
        client = client.restart().map_err(words)?;
        let (kept, in_use) = client.rig().map_err(words)?;
        if kept.as_ref() != Some(&rig) || !in_use {
            return Err(format!("{name}: sent, but {kept:?} is kept"));
        }
        let axes = client.capabilities().force_axes;
        if usize::from(axes) != rig.joints.len() {
            return Err(format!("{name}: {axes} axes instead of {}", rig.joints.len()));
        }
        if !client.capabilities().simulated {
            continue;
        }
        let here = drive(&client, &rig)?;
        let there = in_process(&rig)?;
        if here != there {
            return Err(format!(
                "{name}: state hash {here:016x} here, {there:016x} in-process"
            ));
        }
        said.push(format!("{name} {here:016x}"));
    }
    Ok(said.join(", "))
}

fn words(error: RigError) -> String {
    error.to_string()
}

fn in_process(rig: &Rig) -> Result<u64, String> {
    let client = Client::connect(&RigSpec::Simulated { realtime: false }).map_err(words)?;
    client.request(ToDevice::SetRig(rig.clone())).map_err(words)?;
    drive(&client.restart().map_err(words)?, rig)
}

/// Moves the handle 10 mm along each axis by the hand; returns the state hash if the handle went where the joints allow.
fn drive(client: &Client, rig: &Rig) -> Result<u64, String> {
    client.request(ToDevice::ResetScene).map_err(words)?;
    client
        .request(ToDevice::SetTelemetry { every_ticks: 1 })
        .map_err(words)?;
    client.run(1).map_err(words)?;
    let home = position(client)?;
    let key = |tick, by: f32| Keyframe {
        tick,
        pose: WirePose {
            position: home.map(|x| x + by),
            orientation: [0.0, 0.0, 0.0, 1.0],
        },
        push: [0.0; 3],
    };
    let script = HandScript {
        stiffness: 500.0,
        damping: 5.0,
        angular_stiffness: 0.5,
        angular_damping: 0.005,
        tremor: 1e-4,
        tremor_hz: 9.0,
        keyframes: [key(0, 0.0), key(TICKS / 2, 0.01)].into_iter().collect(),
    };
    client.request(ToDevice::SimulatedHand(script)).map_err(words)?;
    let ran = client.run(TICKS).map_err(words)?;
    let end = position(client)?;
    client
        .request(ToDevice::SetTelemetry { every_ticks: 0 })
        .map_err(words)?;
    let moved = home
        .iter()
        .zip(&end)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f32>()
        .sqrt();
    // Of the 17 mm, the part along the directions of the joints: all with three, at least a third with one, minus what friction holds.
    if !(0.002..0.02).contains(&moved) {
        return Err(format!(
            "{}: the handle moved {moved} m, from {home:?} to {end:?}",
            rig.name
        ));
    }
    Ok(ran.state_hash)
}

/// Position of the handle in the last sample.
fn position(client: &Client) -> Result<[f32; 3], String> {
    // The sample may arrive after the answer to the run, but not after this answer.
    client.run(0).map_err(words)?;
    let samples = client.events().try_iter().filter_map(|event| match event {
        Event::Telemetry(sample) => Some(sample.handle.position),
        _ => None,
    });
    samples.last().ok_or_else(|| "no telemetry came".into())
}
