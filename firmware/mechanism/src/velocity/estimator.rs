//! Interface of velocity estimators.

/// Estimator of the speed of one axis, called once per tick.
pub trait Estimator {
    /// Initial state, at rest.
    const AT_REST: Self;

    /// Takes the counts moved in this tick and the size of a count (m, rad); returns the speed (m/s, rad/s). Finite for any counts while `per_count`
    /// is.
    fn update(&mut self, moved: i32, per_count: f32) -> f32;
}
