//! Velocity of an axis from its encoder's counts.
//!
//! Two estimators behind one interface, [`Estimator`]; [`InUse`] is the one used to drive motors, on every board, real or simulated. With Δ the
//! encoder's step (a count) and h the tick:
//!
//! | | [`LowPass`] of τ = 3 ms | [`AdaptiveWindow`] of n = 16 ticks | n = 6 |
//! |---|---|---|---|
//! | noise at rest on the edge of a count, rms, counts a tick | 0.134 | 0.044 | 0.118 |
//! | error at steady speeds up to 2 counts a tick, rms | 0.077 | 0.026 | 0.068 |
//! | delay of slow, small motion (5 counts at 5 Hz) | τ + h/2 = 3.5 ms | n·h/2 = 8 ms | 3 ms |
//! | delay of fast, large motion (200 counts at 20 Hz) | 3.3 ms | 0.65 ms | 0.65 ms |
//! | step of speed | 58 % after 3 ticks, 92 % after 9 | whole at once from 3 counts a tick on | likewise |
//! | stiffest coupling on which a bare handle comes to rest, kN/m | 17.3 | 19.3 | 23.3 |
//! | likewise, force a tick late | 5.9 | 3.7 | 5.8 |
//!
//! `tests/velocity.rs` measures all of it (2026-11-23; handle of 0.15 kg and 1 N·s/m, 5 µm a count, coupling of 20 N·s/m, no dry friction). The
//! window of 16 ticks has the least noise, and is stable for large motions up to more than twice the stiffness of the low-pass; but it reports a
//! motion of few counts 8 ms late, so that with a delayed force the handle keeps trembling by several counts, and at a wall damped by 40 N·s/m it
//! never comes to rest. In the product's own tick, contact and implicit step included, the low-pass bears as stiff a coupling as either window or a
//! stiffer one, in time and late (`mortise-lab stability --map stability-estimator`): it is in use.

pub mod adaptive_window;
mod estimator;
pub mod low_pass;

pub use adaptive_window::AdaptiveWindow;
pub use estimator::Estimator;
pub use low_pass::LowPass;

/// The estimator used to drive motors.
pub type InUse = LowPass;
