//! What the tests of simulated mechanisms share.

use mortise_firmware::board::{Mechanism, Sensed, Simulation};

/// The readings after the next tick of the simulated world.
pub fn next<M: Mechanism + Simulation>(mechanism: &mut M) -> Sensed {
    mechanism.advance();
    mechanism.sense()
}
