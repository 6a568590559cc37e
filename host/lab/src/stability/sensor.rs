//! How the bench measures its handle: position from an encoder, and a speed from that.

use mortise_mechanism::velocity::{AdaptiveWindow, Estimator, LowPass};

/// Measurement of the handle.
#[derive(Clone, Copy, Debug)]
pub struct Sensor {
    /// Δ, the encoder's resolution, m; 0: exact.
    pub resolution_m: f64,
    /// How the speed is found.
    pub speed: Speed,
    /// Share of the measured speed that the tick receives: 1, unless it sets a wall's damping.
    pub share: f64,
}

impl Sensor {
    /// Exact positions and their difference quotient.
    pub const EXACT: Self = Self {
        resolution_m: 0.0,
        speed: Speed::Filtered { filter_s: 0.0 },
        share: 1.0,
    };
}

/// Speed from successive readings.
#[derive(Clone, Copy, Debug)]
pub enum Speed {
    /// The difference quotient through a low-pass of time constant `filter_s` (s; 0: the quotient itself), at any period and resolution.
    Filtered {
        /// τ, s.
        filter_s: f64,
    },
    /// An estimator of the mechanism's, for the product's tick of 1 ms and a resolution above 0.
    Counted(Counted),
}

/// Estimators of [`mortise_mechanism::velocity`], with their state.
#[derive(Clone, Copy, Debug)]
pub enum Counted {
    /// Low-pass of 3 ms.
    LowPass(LowPass),
    /// Adaptive window of 16 ticks.
    Window16(AdaptiveWindow<16>),
    /// Adaptive window of 6 ticks.
    Window6(AdaptiveWindow<6>),
}

impl Counted {
    /// All, at rest.
    pub const ALL: [Self; 3] = [
        Self::LowPass(LowPass::AT_REST),
        Self::Window16(AdaptiveWindow::AT_REST),
        Self::Window6(AdaptiveWindow::AT_REST),
    ];

    /// Its name in tables and charts.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::LowPass(_) => "low-pass of 3 ms",
            Self::Window16(_) => "window of 16 ticks",
            Self::Window6(_) => "window of 6 ticks",
        }
    }

    fn update(&mut self, moved: i32, per_count: f32) -> f32 {
        match self {
            Self::LowPass(estimator) => estimator.update(moved, per_count),
            Self::Window16(estimator) => estimator.update(moved, per_count),
            Self::Window6(estimator) => estimator.update(moved, per_count),
        }
    }
}

/// A sensor at work; it starts at 0 and at rest.
#[derive(Clone, Copy, Debug)]
pub struct Readout {
    speed: Speed,
    last_m: f64,
    estimate_m_per_s: f64,
}

impl Readout {
    /// Starts.
    pub const fn new(sensor: &Sensor) -> Self {
        Self {
            speed: sensor.speed,
            last_m: 0.0,
            estimate_m_per_s: 0.0,
        }
    }

    /// Reads the handle at `position` (m), a period after the last reading: position, m, and speed, m/s, as the tick receives them.
    pub fn read(&mut self, sensor: &Sensor, position: f64, period_s: f64) -> (f64, f64) {
        let step = sensor.resolution_m;
        let read = if step > 0.0 {
            (position / step).round() * step
        } else {
            position
        };
        let moved = read - self.last_m;
        self.last_m = read;
        match &mut self.speed {
            Speed::Filtered { filter_s } => {
                let gain = period_s / (*filter_s + period_s);
                self.estimate_m_per_s += gain * (moved / period_s - self.estimate_m_per_s);
            }
            Speed::Counted(counted) => {
                self.estimate_m_per_s = f64::from(counted.update((moved / step).round() as i32, step as f32));
            }
        }
        (read, self.estimate_m_per_s * sensor.share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mechanism's low-pass and the same filter computed here agree on a moving handle.
    #[test]
    fn the_mechanisms_low_pass_is_the_filter() {
        let filtered = Sensor {
            resolution_m: 5e-6,
            speed: Speed::Filtered { filter_s: 3e-3 },
            share: 1.0,
        };
        let counted = Sensor {
            speed: Speed::Counted(Counted::ALL[0]),
            ..filtered
        };
        let (mut one, mut other) = (Readout::new(&filtered), Readout::new(&counted));
        for tick in 0..500 {
            let position = 2e-4 * (f64::from(tick) * 0.05).sin();
            let (a, b) = (
                one.read(&filtered, position, 1e-3),
                other.read(&counted, position, 1e-3),
            );
            assert_eq!(a.0, b.0);
            assert!((a.1 - b.1).abs() < 1e-7, "{} and {}", a.1, b.1);
        }
    }
}
