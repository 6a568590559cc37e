//! The true motion of the simulated handle, before its encoders round it.
//!
//! Work of the device on the handle is Σ F_k·(x_{k+1} − x_k), with F_k held over the tick and x the handle's true position. With readings q = x + e
//! in its place the error is Σ F_k·(e_{k+1} − e_k), whose mean is not zero: a count of size u changes the force at once by −g₀·u, which over the
//! ticks until the next count resists a motion that the readings do not show. While the handle moves by about a count a tick e is nearly white,
//! uniform within ±u/2, and
//!
//! P = g₀·u²/(12·h) on each axis, g₀ = m/(m + h·B)·(k + B·a/h), B = b + h·k, a = h/(τ + h) of the speed's filter
//!
//! is the apparent power generated: 10.8 µW for 5 µm, 5.2 N/mm and 1 ms, 32 µW on three axes that tremble. Therefore the mechanism is simulated again
//! with the script and the wrenches of the recording. It computes the same bits on every rig, which is checked to the last reading.

use mortise_firmware::board::{Drive, Mechanism, Simulation};
use mortise_firmware::wire::{pose_to_wire, wrench_to_wire};
use mortise_haptics::{Vec3, Wrench};
use mortise_protocol::message::{HandScript, Telemetry};
use mortise_simulation::simulated::Simulated;

use crate::measure::Felt;

/// Motor commands and true poses of the handle, tick by tick.
///
/// The mechanism starts from its initial state, undriven while the script of `before` moves it for `before.1` ticks; then `script` does, under the
/// wrenches of `samples`. `None` unless every reading equals the recorded one: otherwise a tick is missing, inputs were made to fail, or the rig has
/// another mechanism.
pub fn replay(before: (&HandScript, u32), script: &HandScript, samples: &[Telemetry]) -> Option<Vec<Felt>> {
    let mut mechanism = Simulated::new();
    mechanism.set_hand(Some(before.0));
    for _ in 0..before.1 {
        mechanism.advance();
        mechanism.sense();
    }
    mechanism.set_hand(Some(script));
    let first = samples.first()?.tick;
    let felt = samples.iter().zip(0..).map(|(sample, age)| {
        mechanism.advance();
        let sensed = mechanism.sense();
        let reading = pose_to_wire(&sensed.handle);
        let handle = pose_to_wire(&mechanism.true_pose());
        // Encoders are watched while a part is in hand.
        mechanism.watch_encoders(sample.object.is_some());
        mechanism.drive(Drive::Wrench(Wrench {
            force: Vec3::from_array(sample.wrench.force),
            torque: Vec3::from_array(sample.wrench.torque),
        }));
        let known = reading == sample.handle && sample.tick == first.wrapping_add(age);
        known.then(|| Felt {
            tick: sample.tick,
            handle,
            wrench: wrench_to_wire(&mechanism.motors()),
            twist: Some(sensed.twist),
        })
    });
    felt.collect()
}
