//! Work of a held force on a motion that is told in counts.
//!
//! An encoder of count u tells the position within ±u/2. Its difference from tick to tick is no motion: a handle that moves by less than a count a
//! tick stands, then jumps. What the force does while it stands, not least its answer to the last jump, is lost from a sum of force times difference,
//! and what is lost is dissipation: g₀·u²/(12·h) of power on each axis, with g₀ the force's first answer to a step of position, 32 µW on three axes
//! of 5 µm. Of a hand that presses and trembles for half a minute such a sum makes a motor.
//!
//! So the position is taken to have moved only as far as it must have to be told as it is, by a play of one count: it is known exactly when a count
//! changes, and the same count there and back again moves nothing. Each such motion is the work of the mean force since the last one, as if it had
//! gone on evenly. A motion of more than a count in a tick is that of the tick's own force. Of sums over a path the error does not grow: no more than
//! force times count at each turn of the way.

use glam::Vec3;

/// After so many ticks at rest the oldest force counts half.
const LONG_TICKS: f32 = 64.0;
/// A motion below this share of a count is a rounding of the arithmetic.
const SLIGHT: f32 = 0.01;

/// Three axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QuantisedWork([Axis; 3]);

#[derive(Clone, Copy, Debug)]
struct Axis {
    /// How far the reading is ahead of the motion, at most half a count.
    ahead: f32,
    /// Sum of the force since the last motion, and its ticks.
    held: f32,
    ticks: f32,
}

impl QuantisedWork {
    /// Zero bits.
    pub const fn new() -> Self {
        Self(
            [Axis {
                ahead: 0.0,
                held: 0.0,
                ticks: 0.0,
            }; 3],
        )
    }

    /// Work of `force`, held over a tick in which the reading changed by `moved`, and of what was held before it, that is known by now, J. `count` is
    /// u; with 0 it is force times difference. About 15 instructions an axis.
    pub fn work(&mut self, force: Vec3, moved: Vec3, count: f32) -> f32 {
        if count == 0.0 {
            return force.dot(moved);
        }
        let slight = SLIGHT * count;
        let (half, one) = (0.5 * count, count + slight);
        let [x, y, z] = &mut self.0;
        x.work(force.x, moved.x, half, one, slight)
            + y.work(force.y, moved.y, half, one, slight)
            + z.work(force.z, moved.z, half, one, slight)
    }
}

impl Axis {
    #[inline]
    fn work(&mut self, force: f32, moved: f32, half: f32, one: f32, slight: f32) -> f32 {
        let ahead = self.ahead + moved;
        let distance = ahead.abs() - half;
        if distance <= slight {
            self.ahead = ahead;
            self.held += force;
            self.ticks += 1.0;
            if self.ticks >= LONG_TICKS {
                self.held *= 0.5;
                self.ticks *= 0.5;
            }
            return 0.0;
        }
        // A count changes half-way through a tick as well as anywhere in it: half of the tick is before that, half behind.
        let (held, ticks) = (0.5 * force, 0.5);
        let mean = if distance > one {
            force
        } else {
            (self.held + held) / (self.ticks + ticks)
        };
        let by = distance.copysign(ahead);
        *self = Self {
            ahead: ahead - by,
            held,
            ticks,
        };
        mean * by
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Work as `QuantisedWork` has it, force times difference of readings, and the true one, of a force on x along a path given in 100 steps a tick.
    fn along(
        count: f32,
        ticks: usize,
        x: impl Fn(f64) -> f64,
        mut force: impl FnMut(f32) -> f32,
    ) -> (f64, f64, f64) {
        let mut counted = QuantisedWork::new();
        let told = |k: usize| (libm::round(x(k as f64) / f64::from(count)) * f64::from(count)) as f32;
        let (mut seen, mut plain, mut truth) = (0.0, 0.0, 0.0);
        for k in 0..ticks {
            let f = force(told(k));
            let moved = told(k + 1) - told(k);
            seen += f64::from(counted.work(Vec3::new(0.0, f, 0.0), Vec3::new(0.0, moved, 0.0), count));
            plain += f64::from(f) * f64::from(moved);
            truth += f64::from(f) * (x(k as f64 + 1.0) - x(k as f64));
        }
        (seen, plain, truth)
    }

    /// A damper whose speed is the filtered difference, as the boards have it: at a third of a count a tick it dissipates, and a sum of differences
    /// sees less.
    #[test]
    fn a_damper_dissipates_below_a_count_a_tick() {
        const COUNT: f32 = 5e-6;
        for rate in [0.1237, 0.2137, 0.4137, 0.7213, 1.377, 5.217] {
            let (mut last, mut speed) = (0.0, 0.0);
            let damper = |told: f32| {
                speed += 0.25 * ((told - last) * 1e3 - speed);
                last = told;
                -20.0 * speed
            };
            let (seen, plain, truth) = along(COUNT, 20_000, |t| rate * t * f64::from(COUNT), damper);
            assert!((seen / truth - 1.0).abs() < 0.03, "{rate}: {seen} {truth}");
            assert!(
                rate > 0.3 || plain.abs() < 0.6 * truth.abs(),
                "{rate}: {plain} {truth}"
            );
        }
    }

    /// A sampled spring in a trembling hand makes K·v²·h/2, a sum of differences twice that: K·u for each amplitude of each period.
    #[test]
    fn a_spring_makes_what_sampling_makes() {
        const COUNT: f32 = 5e-6;
        let tremor = |t: f64| 50e-6 * (libm::sin(t * core::f64::consts::TAU / 103.7) - 1.0);
        let (seen, plain, truth) = along(COUNT, 10_370, tremor, |told| -1000.0 * told);
        assert!(plain > 2.0 * truth, "{plain} {truth}");
        assert!(
            (seen - truth).abs() < 0.2 * (plain - truth),
            "{seen} {truth} {plain}"
        );
    }

    /// Far above a count a tick, and with readings told exactly, it is the sum of differences.
    #[test]
    fn fast_motion_is_what_it_was() {
        let fast = |t: f64| 1e-3 * libm::sin(t * 0.7);
        let spring = |told: f32| -1000.0 * told;
        let (seen, plain, _) = along(5e-6, 1000, fast, spring);
        assert!((seen / plain - 1.0).abs() < 0.02, "{seen} {plain}");
        let mut exact = QuantisedWork::new();
        for k in 0..100 {
            let (f, moved) = (k as f32, if k % 3 == 0 { 0.0 } else { 1e-9 * k as f32 });
            let seen = exact.work(Vec3::new(f, 0.0, 0.0), Vec3::new(moved, 0.0, 0.0), 0.0);
            assert_eq!(seen, f * moved);
        }
    }
}
