//! Limits of stiffness over damping on one axis, and how far a setting is from them.
//!
//! Three limits are known: [`Axis::is_stable`] ends where the sampled loop oscillates; beyond 2·f_c/Δ dry friction f_c no longer holds the handle
//! between two counts Δ, so that it trembles (Abbott and Okamura, IEEE T-RO 21(5), 2005; Diolaiti, Niemeyer, Barbagli and Salisbury, IEEE T-RO 22(2),
//! 2006); and the board takes a parameter no further than its range.
//!
//! **Reserve.** Readings are rounded to counts. To an oscillation of amplitude A a rounding of step Δ acts as a gain that depends on A, of at most 4/π
//! (the describing function of a quantiser; A. Gelb and W. Vander Velde, *Multiple-input describing functions*, 1968). All gains are therefore taken
//! [`RESERVE`] times as large as they are. The measured boundaries of `docs/stability.md` then all lie beyond the drawn ones (test below).
//!
//! Holds for one axis of a handle that nobody holds, or that is in a hand which damps as those of the maps do (a hundredth of a second of its stiffness);
//! a held part near whose centre of mass the handle is; forces below every limit.

use super::sampled_loop::{Axis, Gains};

/// Factor by which gains are taken larger than they are; see the module.
pub const RESERVE: f64 = 4.0 / core::f64::consts::PI;
/// Rows of a map.
const ROWS: u32 = 80;
/// Steps of a constant ratio in which a limit is searched, and the ratio at which bisection ends.
const STEPS: i32 = 32;
const RATIO: f64 = 1.002;
/// Least stiffness that is searched, as a share of the largest that is searched.
const LEAST: f64 = 1e-4;
/// See [`bears`].
const SMALL: f64 = 0.05;
/// The search goes this far beyond what the board takes.
const BEYOND: f64 = 20.0;

/// Limits of stiffness at one damping, N/m or N·m/rad; 0: none is within the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// b_T or b_R.
    pub damping: f64,
    /// Where the loop begins to oscillate.
    pub stable: f64,
    /// Up to where it is passive.
    pub passive: f64,
}

/// The limits over the whole range of damping.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The axis.
    pub axis: Axis,
    /// The largest gains that the board takes.
    pub most: Gains,
    /// From no damping to the most.
    pub rows: Vec<Row>,
}

/// What ends a rise of the stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The loop oscillates.
    Oscillation,
    /// Dry friction no longer holds the handle between two counts.
    Trembling,
    /// The board takes no more.
    Board,
}

/// How far a setting is from the limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// The setting, as the board takes it.
    pub gains: Gains,
    /// Stiffness up to which the limits are kept at this damping.
    pub stiffness: f64,
    /// The limit that comes first.
    pub by: Limit,
    /// Stiffness where the loop oscillates at this damping.
    pub stable: f64,
    /// Dampings between which this stiffness is stable; `None`: at none.
    pub damping: Option<[f64; 2]>,
    /// Viscous friction of the handle that passivity takes.
    pub viscous_for_passivity: f64,
}

impl Margin {
    /// By how many times the stiffness may rise; below 1 it is beyond a limit. Infinite for no stiffness.
    pub fn times(&self) -> f64 {
        self.stiffness / self.gains.stiffness
    }
}

impl Map {
    /// Computes the map. Cost: about 3,000 polynomials of degree 3 and more.
    pub fn new(axis: Axis, most: Gains) -> Self {
        let rows = (0..=ROWS).map(|row| row_at(&axis, most, most.damping * f64::from(row) / f64::from(ROWS)));
        Self {
            axis,
            most,
            rows: rows.collect(),
        }
    }

    /// Where dry friction no longer holds the handle between two counts.
    pub fn resting(&self) -> f64 {
        self.axis.resting / RESERVE
    }

    /// How far these gains are from the limits. What the board does not take is cut to what it takes.
    pub fn margin(&self, gains: Gains) -> Margin {
        let gains = Gains {
            stiffness: gains.stiffness.clamp(0.0, self.most.stiffness),
            damping: gains.damping.clamp(0.0, self.most.damping),
        };
        let stable = row_at(&self.axis, self.most, gains.damping).stable;
        let limits = [
            (stable, Limit::Oscillation),
            (self.resting(), Limit::Trembling),
            (self.most.stiffness, Limit::Board),
        ];
        // The lowest, the first of equal ones.
        let (stiffness, by) = limits
            .into_iter()
            .fold((f64::INFINITY, Limit::Board), |least, limit| {
                if limit.0 < least.0 { limit } else { least }
            });
        let stable_rows = || self.rows.iter().filter(|row| row.stable >= gains.stiffness);
        let ends = stable_rows().next().zip(stable_rows().next_back());
        Margin {
            gains,
            stiffness,
            by,
            stable,
            damping: ends.map(|(low, high)| [low.damping, high.damping]),
            viscous_for_passivity: RESERVE * self.axis.viscous_for_passivity(gains),
        }
    }
}

/// Whether an axis of this inertia or any larger one bears gains. A heavier axis bears more, within x/6 for small x = b·T/m; where x is large it may bear
/// less, so that it is doubled until x is small.
fn bears(axis: &Axis, gains: Gains) -> bool {
    let mut axis = *axis;
    while axis.is_stable(gains, RESERVE) {
        if axis.viscous * axis.period_s < SMALL * axis.inertia {
            return true;
        }
        axis.inertia *= 2.0;
    }
    false
}

fn row_at(axis: &Axis, most: Gains, damping: f64) -> Row {
    let highest = BEYOND * most.stiffness;
    let at = |stiffness| Gains { stiffness, damping };
    Row {
        damping,
        stable: largest(highest, |stiffness| bears(axis, at(stiffness))),
        passive: axis.passive_stiffness(damping, axis.viscous / RESERVE),
    }
}

/// The largest stiffness up to `most` below which `holds` is true; 0 if it is not even for the least.
fn largest(most: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let at = |step: i32| most * LEAST.powf(1.0 - f64::from(step) / f64::from(STEPS));
    let Some(first) = (0..=STEPS).find(|&step| !holds(at(step))) else {
        return most;
    };
    if first == 0 {
        return 0.0;
    }
    let (mut low, mut high) = (at(first - 1), at(first));
    while high / low > RATIO {
        let middle = (low * high).sqrt();
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Resolution of the measured boundaries: their search ends at this ratio, with the middle of the two.
    const MEASURED: f64 = 1.005;
    const MOST: Gains = Gains {
        stiffness: 5000.0,
        damping: 60.0,
    };

    fn axis(inertia: f64, viscous: f64) -> Axis {
        Axis {
            inertia,
            viscous,
            resting: f64::INFINITY,
            period_s: 1e-3,
            filter_s: 3e-3,
            delay: 0,
        }
    }

    /// Rows of a measured map: its columns after the name.
    fn measured(text: &str) -> Vec<(String, Vec<f64>)> {
        let rows = text.lines().skip(1).map(|line| {
            // A quoted column names what varies.
            let line = line.replace(['"'], "");
            let columns: Vec<&str> = line.split(',').collect();
            let numbers = columns.iter().filter_map(|column| column.parse().ok()).collect();
            (line.clone(), numbers)
        });
        rows.collect()
    }

    /// The drawn limit of an undamped or damped wall K·x + B·v̂, which is the coupling with b_T = B − T·K.
    fn wall_limit(axis: &Axis, rendered: f64, times: f64) -> f64 {
        largest(1e5, |stiffness| {
            let damping = rendered - axis.period_s * stiffness;
            axis.is_stable(Gains { stiffness, damping }, times)
        })
    }

    /// The drawn limit of the coupling at b_T = 20 N·s/m.
    fn coupling_limit(axis: &Axis) -> f64 {
        let gains = |stiffness| Gains {
            stiffness,
            damping: 20.0,
        };
        largest(1e5, |stiffness| axis.is_stable(gains(stiffness), RESERVE))
    }

    /// No measured wall is unstable where the drawn limit has it stable, whatever its damping and delay; without the reserve the limit is the measured one.
    #[test]
    fn the_drawn_limit_is_on_the_safe_side_of_every_measured_wall() {
        let z_width = include_str!("../../../../../docs/figures/stability-z-width.csv");
        for (line, numbers) in measured(z_width) {
            let [damping, found, ..] = numbers[..] else {
                panic!("{line}")
            };
            let late = ["0 ticks", "1 ticks", "2 ticks"];
            let delay = late.iter().position(|late| line.contains(late)).expect("a delay");
            let axis = Axis {
                filter_s: 0.0,
                delay,
                ..axis(0.1, 0.5)
            };
            let limit = wall_limit(&axis, damping, RESERVE);
            assert!(
                limit <= MEASURED * found && limit >= 0.29 * found,
                "{line}: {limit}"
            );
            let exact = wall_limit(&axis, damping, 1.0);
            assert!(
                found == 0.0 || (exact / found - 1.0).abs() < 0.01,
                "{line}: {exact}"
            );
        }
    }

    /// The same at any rate, mass and hand of the maps. What a hand adds is not counted on, so that a tight one bears far more than is drawn.
    #[test]
    fn the_drawn_limit_is_on_the_safe_side_at_every_measured_rate_mass_and_hand() {
        for (text, least) in [
            (
                include_str!("../../../../../docs/figures/stability-rate.csv"),
                0.69,
            ),
            (
                include_str!("../../../../../docs/figures/stability-mass.csv"),
                0.69,
            ),
            (
                include_str!("../../../../../docs/figures/stability-hand.csv"),
                0.02,
            ),
        ] {
            for (line, numbers) in measured(text) {
                let [value, found, ..] = numbers[..] else {
                    panic!("{line}")
                };
                let mut axis = axis(0.15, 1.0);
                match line.split(',').next() {
                    Some("stability-rate") => axis.period_s = 1.0 / value,
                    Some("stability-mass") => axis.inertia = value,
                    _ => {}
                }
                let limit = if line.contains("wall K") {
                    axis.filter_s = 0.0;
                    wall_limit(&axis, 0.0, RESERVE)
                } else {
                    coupling_limit(&axis)
                };
                // At 100 Hz the search began at 221 N/m, where the loop was unstable.
                let found = if found == 0.0 { 221.0 } else { found };
                assert!(
                    limit <= MEASURED * found && limit >= least * found,
                    "{line}: {limit}"
                );
            }
        }
    }

    /// The same with rounded readings, without dry friction: the handle comes to rest within two counts wherever the drawn limit has it stable.
    #[test]
    fn the_drawn_limit_is_on_the_safe_side_of_every_measured_encoder() {
        let estimators = include_str!("../../../../../docs/figures/stability-estimator.csv");
        let low_pass = (measured(estimators).into_iter()).filter(|(line, _)| line.starts_with("low-pass"));
        let mut rows = 0;
        for (line, numbers) in low_pass {
            let [delay, _, found] = numbers[..] else {
                panic!("{line}")
            };
            let limit = coupling_limit(&Axis {
                delay: delay as usize,
                ..axis(0.15, 1.0)
            });
            assert!(limit <= found && limit >= 0.74 * found, "{line}: {limit}");
            rows += 1;
        }
        assert_eq!(rows, 18);
    }

    /// Where a measured handle rests, the drawn limits have it rest no farther, whichever comes first.
    #[test]
    fn a_handle_rests_wherever_the_drawn_limit_has_it_rest() {
        let text = include_str!("../../../../../docs/figures/stability-encoder.csv");
        for (line, numbers) in measured(text) {
            let [coulomb, count_um, found, _] = numbers[..] else {
                panic!("{line}")
            };
            let axis = Axis {
                resting: 2.0 * coulomb / (1e-6 * count_um),
                filter_s: 0.0,
                ..axis(0.15, 1.0)
            };
            let map = Map {
                axis,
                most: MOST,
                rows: Vec::new(),
            };
            let limit = map.resting().min(wall_limit(&axis, 0.0, RESERVE));
            assert!(limit <= found, "{line}: {limit}");
            assert!(limit > 0.19 * found, "{line}: {limit}");
        }
    }

    #[test]
    fn a_margin_names_what_comes_first() {
        let simulated = Axis {
            resting: 4000.0,
            ..axis(0.15, 1.0)
        };
        let setting = Gains {
            stiffness: 1000.0,
            damping: 20.0,
        };
        let map = Map::new(simulated, MOST);
        let margin = map.margin(setting);
        assert_eq!(margin.by, Limit::Trembling);
        assert!((margin.times() - 4.0 / RESERVE).abs() < 1e-9);
        // 0.5 + 21/7 N·s/m with the reserve.
        assert!((margin.viscous_for_passivity - 3.5 * RESERVE).abs() < 1e-9);
        let exact = Map::new(axis(0.15, 1.0), MOST).margin(setting);
        assert_eq!((exact.by, exact.times()), (Limit::Board, 5.0));
        let late = Axis {
            delay: 1,
            ..axis(0.05, 0.05)
        };
        let map = Map::new(late, MOST);
        let margin = map.margin(setting);
        assert_eq!(margin.by, Limit::Oscillation);
        assert!((0.8..0.9).contains(&margin.times()), "{margin:?}");
        let [low, high] = margin.damping.expect("a damping that is stable");
        assert!(low > 1.0 && high < 20.0 && low < high, "{margin:?}");
        let beyond = Gains {
            stiffness: 9e9,
            damping: -1.0,
        };
        assert_eq!(
            map.margin(beyond).gains,
            Gains {
                stiffness: 5000.0,
                damping: 0.0
            }
        );
        assert_eq!(map.margin(beyond).damping, None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        /// A longer period or delay and less friction never raise the limit. A lighter handle raises it by 1 % for what is left of x/6, and by 2 %
        /// because inertias are doubled in steps.
        #[test]
        fn limits_are_monotone(
            mass in -2.0..0.3f64, viscous in -2.0..1.0f64, damping in 0.0..50.0f64, delay in 0usize..2, more in 1.05..3.0f64,
        ) {
            let axis = Axis { delay, ..axis(10f64.powf(mass), 10f64.powf(viscous)) };
            let limit = |axis: &Axis| row_at(axis, MOST, damping);
            let now = limit(&axis);
            let fine = 1.0 + 2.0 * (RATIO - 1.0);
            for worse in [
                Axis { period_s: more * axis.period_s, ..axis },
                Axis { delay: delay + 1, ..axis },
                Axis { viscous: axis.viscous / more, ..axis },
            ] {
                let then = limit(&worse);
                prop_assert!(then.stable <= fine * now.stable && then.passive <= fine * now.passive, "{worse:?}: {then:?}, {now:?}");
            }
            let lighter = limit(&Axis { inertia: axis.inertia / more, ..axis });
            prop_assert!(lighter.stable <= 1.03 * fine * now.stable, "{lighter:?}, {now:?}");
            prop_assert_eq!(lighter.passive, now.passive);
            prop_assert!(now.passive <= fine * now.stable, "{now:?}");
        }
    }
}
