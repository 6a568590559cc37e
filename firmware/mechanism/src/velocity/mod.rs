//! Velocity of an axis from the counts its encoder moves.
//!
//! Two estimators behind one interface, [`Estimator`]; [`InUse`] is the one that drives motors, on every board, real or simulated. With Δ the
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
//! `tests/velocity.rs` measures all of it (2026-11-23; handle of 0.15 kg and 1 N·s/m, 5 µm a count, coupling of 20 N·s/m, no dry friction). The window
//! of 16 ticks is the quietest, and stable in the large up to more than twice the stiffness of the low-pass; but a motion of few counts it reports 8 ms
//! late, so that with a delayed force the handle goes on trembling by several counts, and a wall damped by 40 N·s/m never rests. The low-pass
//! is in use: it has no such trembling. A window of 6 ticks bears a third more without delay and as much with it.

pub mod adaptive_window;
pub mod low_pass;

pub use adaptive_window::AdaptiveWindow;
pub use low_pass::LowPass;

/// Estimates the speed of one axis, one call a tick.
pub trait Estimator {
    /// At rest.
    const AT_REST: Self;

    /// Takes the counts moved in this tick and what a count is (m, rad); gives the speed (m/s, rad/s). Finite for any counts while `per_count` is.
    fn update(&mut self, moved: i32, per_count: f32) -> f32;
}

/// The estimator that drives motors.
pub type InUse = LowPass;
