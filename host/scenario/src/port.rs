//! Energy generated behind a port: the largest work that leaves it over any interval, beyond what was stored at the interval's start.
//!
//! With W_k the work that leaves in tick k and S_k the energy stored behind the port at the tick's start, part of which may leave again,
//!
//! E = max over all a ≤ b of Σ_{a ≤ k ≤ b} W_k − S_a, and 0.
//!
//! E is not the largest value of the running sum: that would credit earlier dissipation and miss energy generated after it. Without storage E is the
//! maximum of the running sum minus its smallest earlier value. Uncounted storage makes E too large, never too small. At the first tick nothing
//! counts as stored. The recurrence that finds E in one pass is that of [`Rise`].

use mortise_haptics::observer::Rise;

/// Account of the work through a port, in one unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Port {
    rise: Rise,
    passed: f64,
}

impl Port {
    /// Adds one tick's work, positive out of the port, with nothing stored behind it.
    pub fn add(&mut self, work: f64) {
        self.add_beyond(0.0, work);
    }

    /// Adds one tick's work; `stored` is the energy behind the port when the tick began.
    pub fn add_beyond(&mut self, stored: f64, work: f64) {
        self.rise.stored(stored);
        self.rise.gave(work);
        self.passed += work.abs();
    }

    /// E, at least 0.
    pub fn made(&self) -> f64 {
        self.rise.most()
    }

    /// All work that passed, in either direction.
    pub fn passed(&self) -> f64 {
        self.passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums every interval separately: O(n²) intervals.
    fn by_force(ticks: &[(f64, f64)]) -> f64 {
        let mut most = 0.0f64;
        for (a, &(stored, _)) in ticks.iter().enumerate() {
            let mut sum = if a == 0 { 0.0 } else { -stored };
            for &(_, work) in &ticks[a..] {
                sum += work;
                most = most.max(sum);
            }
        }
        most
    }

    #[test]
    fn one_pass_finds_the_largest_rise_over_any_interval() {
        let mut random = fastrand::Rng::with_seed(16);
        let (mut beyond_the_sum, mut credited) = (0, 0);
        for _ in 0..2000 {
            let stores = random.bool();
            let ticks: Vec<(f64, f64)> = (0..random.usize(0..60))
                .map(|_| {
                    let stored = if stores { random.f64() } else { 0.0 };
                    (stored, 2.0 * random.f64() - 1.2)
                })
                .collect();
            let mut port = Port::default();
            let (mut sum, mut largest, mut passed) = (0.0f64, 0.0f64, 0.0);
            for &(stored, work) in &ticks {
                if stores {
                    port.add_beyond(stored, work);
                } else {
                    port.add(work);
                }
                sum += work;
                largest = largest.max(sum);
                passed += work.abs();
            }
            let expected = by_force(&ticks);
            assert!((port.made() - expected).abs() < 1e-12, "{ticks:?}");
            assert_eq!(port.passed(), passed);
            // The running sum's maximum is smaller on some of these sequences, and storage is a credit: both cases must occur.
            beyond_the_sum += u32::from(!stores && expected > largest + 0.1);
            credited += u32::from(stores && by_force(&ticks) + 0.1 < by_force(&forgotten(&ticks)));
        }
        assert!(
            beyond_the_sum > 100 && credited > 100,
            "{beyond_the_sum} {credited}"
        );
    }

    fn forgotten(ticks: &[(f64, f64)]) -> Vec<(f64, f64)> {
        ticks.iter().map(|&(_, work)| (0.0, work)).collect()
    }

    #[test]
    fn what_is_made_after_dissipation_is_seen() {
        let mut port = Port::default();
        for work in [-5.0, 1.0, 0.5, -0.25, 1.0] {
            port.add(work);
        }
        assert_eq!(port.made(), 2.25);
    }
}
