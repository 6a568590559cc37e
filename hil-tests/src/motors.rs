//! Motors tested one by one: each pushes its own joint, in the sense of its wiring, with the same bits on every simulation.

use std::sync::{Arc, Mutex, PoisonError};

use mortise_protocol::message::{
    DeviceState, FromDevice, InputFault, InputFaultKind, MotorTest, Refusal, ToDevice,
};
use mortise_protocol::rig::Rig;
use mortise_rig::commissioning::{Sense, motor_sense};
use mortise_rig::{Client, EXAMPLES, Observer, RigError, RigSpec, parse_rig};

use crate::verdict::Verdict;

/// More ticks than a test takes.
const TEST: u32 = 150;
/// Ticks in which the mechanism comes to rest.
const REST: u32 = 500;
/// Force at the handle, N.
const FORCE: f32 = 1.0;

/// See the module.
pub fn motors_are_tested_one_by_one(client: Client) -> Verdict {
    if !client.capabilities().simulated {
        return Ok("real motors are tested from the window, by the person beside them".into());
    }
    let (name, text) = EXAMPLES[2];
    let rig = parse_rig(text, name).map_err(|error| error.to_string())?;
    let client = described(client, &rig)?;
    let other = Client::connect(&RigSpec::Simulated { realtime: false }).map_err(words)?;
    let other = described(other, &rig)?;
    let joints = rig.joints.len() as u8;
    for axis in 0..joints {
        for (wiring, expected) in [
            (None, Sense::Forward),
            (
                Some(InputFaultKind::MotorSense { axis, reversed: true }),
                Sense::Backward,
            ),
            (Some(InputFaultKind::MotorDead { axis }), Sense::Still),
        ] {
            let here = both_ways(&client, axis, wiring)?;
            let there = both_ways(&other, axis, wiring)?;
            let found = motor_sense(&rig, axis, &here);
            if found != expected || here != there {
                return Err(format!(
                    "joint {axis}, {wiring:?}: {found:?}; {here:?} here, {there:?} in-process"
                ));
            }
        }
    }
    match client
        .send(ToDevice::TestMotor {
            joint: joints,
            force: FORCE,
        })
        .and(client.run(1))
    {
        Ok(_) if client.state() == DeviceState::Idle => {}
        other => return Err(format!("a motor that is not there: {other:?}")),
    }
    match client.request(ToDevice::TestMotor { joint: 0, force: 9.0 }) {
        Err(RigError::Refused {
            reason: Refusal::BadNumber,
            ..
        }) => {}
        other => return Err(format!("a force beyond the limit: {other:?}")),
    }
    Ok(format!("{joints} motors, as wired, reversed and dead"))
}

fn words(error: RigError) -> String {
    error.to_string()
}

/// The board with this description in use.
fn described(client: Client, rig: &Rig) -> Result<Client, String> {
    client.request(ToDevice::SetRig(rig.clone())).map_err(words)?;
    client.restart().map_err(words)
}

/// Tests a motor forward and backward, from rest and with this wiring.
fn both_ways(client: &Client, joint: u8, wiring: Option<InputFaultKind>) -> Result<[MotorTest; 2], String> {
    client.request(ToDevice::ResetScene).map_err(words)?;
    let faults = wiring.map(|kind| InputFault {
        tick: 0,
        ticks: u32::MAX,
        kind,
    });
    let faults = faults.into_iter().collect();
    client.request(ToDevice::SimulatedInputs(faults)).map_err(words)?;
    client.run(REST).map_err(words)?;
    let forth = test(client, joint, FORCE)?;
    client.run(REST).map_err(words)?;
    Ok([forth, test(client, joint, -FORCE)?])
}

/// In lockstep the answer comes with the ticks.
fn test(client: &Client, joint: u8, force: f32) -> Result<MotorTest, String> {
    let seen = Arc::new(Seen::default());
    client.observe(Some(seen.clone()));
    let ran = client
        .send(ToDevice::TestMotor { joint, force })
        .and_then(|_| client.run(TEST))
        // The answer is on the wire before this one.
        .and_then(|_| client.run(0));
    client.observe(None);
    ran.map_err(words)?;
    let found = seen.0.lock().unwrap_or_else(PoisonError::into_inner).take();
    found.ok_or_else(|| format!("no answer to the test of joint {joint}"))
}

#[derive(Default)]
struct Seen(Mutex<Option<MotorTest>>);

impl Observer for Seen {
    fn sent(&self, _sequence: u16, _message: &ToDevice) {}

    fn received(&self, _sequence: u16, message: &FromDevice) {
        if let FromDevice::MotorTested(test) = message {
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(*test);
        }
    }
}
