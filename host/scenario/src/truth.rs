//! Where the simulated handle truly was, which its encoders round.
//!
//! Work of the device on the handle is Σ F_k·(x_{k+1} − x_k), with F_k held over the tick and x the handle's true position. Taken with readings
//! q = x + e in its place it is wrong by Σ F_k·(e_{k+1} − e_k), and not on average right: a count of size u shows at once in the force by −g₀·u,
//! which over the ticks until the next count resists a motion that readings do not have. While the handle moves by about a count a tick e is nearly
//! white, uniform within ±u/2, and
//!
//! P = g₀·u²/(12·h) on each axis, g₀ = m/(m + h·B)·(k + B·a/h), B = b + h·k, a = h/(τ + h) of the speed's filter
//!
//! is made out of nothing: 10.8 µW for 5 µm, 5.2 N/mm and 1 ms, 32 µW on three axes that tremble. So the mechanism is played again instead, with the
//! script and the wrenches of the recording. It computes the same bits on every rig; that it does, to the last reading, is checked.

use mortise_firmware::board::{Drive, Mechanism, Simulation};
use mortise_firmware::wire::{pose_to_wire, wrench_to_wire};
use mortise_haptics::{Vec3, Wrench};
use mortise_protocol::message::{HandScript, Telemetry};
use mortise_simulation::simulated::Simulated;

use crate::measure::Felt;

/// What the motors did and where the handle truly was, tick by tick.
///
/// The mechanism starts as new, with nothing driven while `before` leads it for so many ticks; then `script` does, under the wrenches of `samples`.
/// `None` unless every reading is the one recorded there: a tick is missing, inputs were made to fail, or the rig has another mechanism.
pub fn replay(before: (&HandScript, u32), script: &HandScript, samples: &[Telemetry]) -> Option<Vec<Felt>> {
    let mut mechanism = Simulated::new();
    mechanism.set_hand(Some(before.0));
    for _ in 0..before.1 {
        mechanism.sense();
    }
    mechanism.set_hand(Some(script));
    let first = samples.first()?.tick;
    let felt = samples.iter().zip(0..).map(|(sample, age)| {
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
