//! Quantised-work integrator: work of a held force on a motion measured in encoder counts.
//!
//! An encoder of count u gives the position within ±u/2. The difference of its readings from tick to tick is not the motion: a handle that moves by
//! less than a count a tick appears to stand, then to jump. The work of the force while the reading stands, not least of its response to the last
//! jump, is missing from a sum of force times difference, and what is missing is dissipation: a power of g₀·u²/(12·h) on each axis, with g₀ the
//! force's first response to a step of position; 32 µW on three axes of 5 µm. For a hand that presses with tremor for half a minute such a sum shows
//! a source of energy.
//!
//! So the position is assumed to have moved only as far as the reading proves, with a backlash of one count: it is known exactly when a count
//! changes, and the same count there and back again is no motion. The work of each such motion uses the mean force since the last one, as if the
//! motion had been even. A motion of more than a count in a tick uses that tick's own force. The error of a sum along a path does not grow: no more
//! than force times count at each reversal.

use glam::Vec3;

/// After this many ticks at rest the weight of the oldest force is halved.
const MEMORY_TICKS: f32 = 64.0;
/// A motion below this share of a count is rounding error.
const ROUNDING_SHARE: f32 = 0.01;

/// Integrator for three axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QuantisedWork([Axis; 3]);

#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Lead of the reading over the assumed motion, at most half a count.
    lead: f32,
    /// Sum of the force since the last motion, and its number of ticks.
    held: f32,
    ticks: f32,
}

impl QuantisedWork {
    /// At rest, all bits zero.
    pub const fn new() -> Self {
        Self(
            [Axis {
                lead: 0.0,
                held: 0.0,
                ticks: 0.0,
            }; 3],
        )
    }

    /// Work of `force`, held over a tick in which the reading changed by `moved`, and of the forces held before it, as far as it is determined by
    /// now, J. `count` is u; with 0 the result is force times difference. About 15 instructions an axis.
    pub fn work(&mut self, force: Vec3, moved: Vec3, count: f32) -> f32 {
        if count == 0.0 {
            return force.dot(moved);
        }
        let rounding = ROUNDING_SHARE * count;
        let (half, one) = (0.5 * count, count + rounding);
        let [x, y, z] = &mut self.0;
        x.work(force.x, moved.x, half, one, rounding)
            + y.work(force.y, moved.y, half, one, rounding)
            + z.work(force.z, moved.z, half, one, rounding)
    }
}

impl Axis {
    #[inline]
    fn work(&mut self, force: f32, moved: f32, half: f32, one: f32, rounding: f32) -> f32 {
        let lead = self.lead + moved;
        let distance = lead.abs() - half;
        if distance <= rounding {
            self.lead = lead;
            self.held += force;
            self.ticks += 1.0;
            if self.ticks >= MEMORY_TICKS {
                self.held *= 0.5;
                self.ticks *= 0.5;
            }
            return 0.0;
        }
        // A count changes on average half-way through a tick: half of the tick lies before the change, half after.
        let (held, ticks) = (0.5 * force, 0.5);
        let mean = if distance > one {
            force
        } else {
            (self.held + held) / (self.ticks + ticks)
        };
        let by = distance.copysign(lead);
        *self = Self {
            lead: lead - by,
            held,
            ticks,
        };
        mean * by
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Work by `QuantisedWork`, by force times difference of readings, and the exact work, of a force on x along a path given in 100 steps a tick.
    fn along(
        count: f32,
        ticks: usize,
        x: impl Fn(f64) -> f64,
        mut force: impl FnMut(f32) -> f32,
    ) -> (f64, f64, f64) {
        let mut integrator = QuantisedWork::new();
        let reading = |k: usize| (libm::round(x(k as f64) / f64::from(count)) * f64::from(count)) as f32;
        let (mut measured, mut plain, mut exact_work) = (0.0, 0.0, 0.0);
        for k in 0..ticks {
            let f = force(reading(k));
            let moved = reading(k + 1) - reading(k);
            measured += f64::from(integrator.work(Vec3::new(0.0, f, 0.0), Vec3::new(0.0, moved, 0.0), count));
            plain += f64::from(f) * f64::from(moved);
            exact_work += f64::from(f) * (x(k as f64 + 1.0) - x(k as f64));
        }
        (measured, plain, exact_work)
    }

    /// A damper whose speed is the filtered difference, as on the boards: at a third of a count a tick it dissipates, and a sum of differences shows
    /// less.
    #[test]
    fn a_damper_dissipates_below_a_count_a_tick() {
        const COUNT: f32 = 5e-6;
        for rate in [0.1237, 0.2137, 0.4137, 0.7213, 1.377, 5.217] {
            let (mut last, mut speed) = (0.0, 0.0);
            let damper = |reading: f32| {
                speed += 0.25 * ((reading - last) * 1e3 - speed);
                last = reading;
                -20.0 * speed
            };
            let (measured, plain, exact_work) = along(COUNT, 20_000, |t| rate * t * f64::from(COUNT), damper);
            assert!(
                (measured / exact_work - 1.0).abs() < 0.03,
                "{rate}: {measured} {exact_work}"
            );
            assert!(
                rate > 0.3 || plain.abs() < 0.6 * exact_work.abs(),
                "{rate}: {plain} {exact_work}"
            );
        }
    }

    /// A sampled spring held with tremor generates K·v²·h/2, a sum of differences twice that: K·u for each amplitude of each period.
    #[test]
    fn a_sampled_spring_generates_the_known_energy() {
        const COUNT: f32 = 5e-6;
        let tremor = |t: f64| 50e-6 * (libm::sin(t * core::f64::consts::TAU / 103.7) - 1.0);
        let (measured, plain, exact_work) = along(COUNT, 10_370, tremor, |reading| -1000.0 * reading);
        assert!(plain > 2.0 * exact_work, "{plain} {exact_work}");
        assert!(
            (measured - exact_work).abs() < 0.2 * (plain - exact_work),
            "{measured} {exact_work} {plain}"
        );
    }

    /// Far above a count a tick, and with exact readings, the result equals the sum of differences.
    #[test]
    fn fast_motion_gives_the_sum_of_differences() {
        let fast = |t: f64| 1e-3 * libm::sin(t * 0.7);
        let spring = |reading: f32| -1000.0 * reading;
        let (measured, plain, _) = along(5e-6, 1000, fast, spring);
        assert!((measured / plain - 1.0).abs() < 0.02, "{measured} {plain}");
        let mut exact = QuantisedWork::new();
        for k in 0..100 {
            let (f, moved) = (k as f32, if k % 3 == 0 { 0.0 } else { 1e-9 * k as f32 });
            let measured = exact.work(Vec3::new(f, 0.0, 0.0), Vec3::new(moved, 0.0, 0.0), 0.0);
            assert_eq!(measured, f * moved);
        }
    }
}
