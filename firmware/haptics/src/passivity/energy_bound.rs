//! Energy-bounded coupling: an energy account of the handle while targets act, so that the operator receives no more energy than they supplied plus
//! the initial budget E₀.
//!
//! A target that engages is an energy source: at an error e it introduces the potential of its spring at e, 3 mJ at 1 mm and 3 N, unaccounted for.
//! That energy may move the part, which is virtual, but not the hand. So each tick balances the port at the handle on the motion that actually
//! followed,
//!
//! B ← min(B − W, U + ½·m·v² + ½·ω·I·ω),   W = F·Δp + τ·Δφ of the wrench that acted,
//!
//! with U as in [`super::tank`]. The credit B is the energy that the operator supplied, as far as it is still stored in the coupling or in the
//! object's motion. Energy no longer stored there is dissipated and cannot be spent by a target; energy stored in a target was supplied by nobody and
//! does not count. −B never exceeds E₀ ([`crate::PassivitySettings::initial_budget_j`]), because of two measures that act while there are targets:
//!
//! * **Slip.** The coupling stores no more than E₀ + B. Where a target's spring would make it store more, the coupling slips by the excess: d and θ
//!   are measured from the slipped pose, as if the part had been grabbed there. The slip recovers with a time constant of 0.25 s as far as E₀ + B
//!   allows.
//! * **Bound.** The coupling's force has terms that no spring stores: the damper and the look-ahead of the step, h·k, act on the handle with the
//!   speed of a part that a target drives. So the wrench is scaled by the largest s up to 1 whose work until the next tick is covered, whatever the
//!   operator does:
//!
//!   s·(h·(F·v + τ·ω) + |F|·(A·h² + u) + |τ|·(A_ω·h² + u_ω)) + s²·h·t·(|F|²/m + |τ|²/I) ≤ max(0, E₀ + B)
//!
//!   v and ω are the measured speeds of the handle, A and A_ω accelerations that a hand does not exceed, u and u_ω the encoders' counts. The square term
//!   is the change that the wrench itself makes to the handle's motion during the delay t of the measured speed, for the lightest handle m, I. A wrench
//!   that takes more energy from the hand than it can deliver in a tick passes whole: an operator who presses or moves away feels contact and target as
//!   without the account.
//!
//! Readings and wrench are those that acted, so the account equals the observer's own ([`crate::observer`]), one tick late. Readings of counting
//! encoders have an error e of at most half a count u, and the sum of force times difference of readings contains Σ F·Δe = F·e − Σ e·ΔF. The error of
//! U at the start cancels the first term there; at the end it is covered by the bound's |F|·u; for the rest each tick subtracts u/2·|ΔF| from B. So B
//! never exceeds the true credit by more than F·u/2, however long it sums. The `quantised_work` integrator, correct on average for a hand
//! with tremor, has no such bound: it misses 100 of the 128 µJ delivered to a handle of 67 g that swings at 60 Hz.
//!
//! The last part of the budget, E₀/64, is reserved for a handle that moves against the wrench, which supplies energy within the tick: slip and bound
//! use E₀ + B while it does so, and E₀/64 less otherwise. Without the reserve B = −E₀ would be final: the coupling would slip by all of the operator's motion, its
//! force would be zero, and a motion against no force supplies nothing. With it the force of a handle that moves at v grows from √(2·k·E₀/64) = 0.01 N
//! by the factor e in each (A·h² + u)/v, 4 ms at 6 mm/s without counts; what comes and goes with the sense of the motion is no more than 0.01 N (k is
//! 400 N/m here).
//!
//! A part that a target has set in motion still carries that energy when the target has ended. So both measures act on, until the credit and the budget
//! cover what is stored or a contact takes the part up. From then on the account is only kept, and the tick's output is the same to the bit as without it:
//! the coupling is passive by itself and the valve of the tank limits it; B falls no lower than to the reserve. The slip recovers at once where neither
//! target nor contact acts on the part, which then has nothing to push the hand from. A negative B remains owed: a grab or a fault does not cancel it, only
//! work by the operator does.
//!
//! The account is that of Ferraguti, Secchi and Fantuzzi, ICRA 2013 (see [`super::tank`]); slip in place of a softer spring is ours. Cost: 20
//! instructions without targets, about 350 with.

use glam::{Quat, Vec3};

use crate::dynamics::coupling::{Coupling, potential};
use crate::math::pose::{Twist, Wrench};
use crate::math::vector::cut;
use crate::settings::{CouplingSettings, PassivitySettings, Settings};

/// Time constant of the slip's recovery, s.
const SLIP_RECOVERY_S: f32 = 0.25;
/// A and A_ω, m/s² and rad/s²: largest accelerations of a handle by the hand that holds it.
const ACCELERATION: f32 = 25.0;
const ANGULAR_ACCELERATION: f32 = 500.0;
/// Time constant of the filter that estimates the handle's speed from counting encoders, s; without counts the speed is known within the tick.
const FILTER_S: f32 = 3e-3;
/// m and I, kg and kg m²: the lightest handle.
const LEAST_MASS_KG: f32 = 0.05;
const LEAST_INERTIA_KG_M2: f32 = 5e-5;
/// Share of the initial budget that is reserved for a handle that moves against the wrench.
const RESERVE: f32 = 1.0 / 64.0;
/// Slip below this counts as zero, m and rad.
const NEGLIGIBLE_SLIP: Twist = Twist {
    linear: Vec3::splat(1e-8),
    angular: Vec3::splat(1e-7),
};

/// What acts on the part besides the hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    Nothing,
    Contacts,
    /// Targets, and perhaps contacts.
    Targets,
}

/// The operator's energy credit, and the slip of the coupling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnergyBound {
    /// B, J.
    credit_j: f32,
    /// Slip as stretch and angle of the coupling, handle's axes, m and rad.
    slip: Twist,
    /// The wrench that last acted on the handle.
    acted: Wrench,
    /// There are targets, or what they brought about has not ended: a slip, or a motion that the credit does not cover.
    active: bool,
    /// More is stored than the credit and the budget.
    uncovered: bool,
}

impl EnergyBound {
    /// No credit, no slip. All bits zero, as [`crate::State::new`] requires.
    pub const fn new() -> Self {
        Self {
            credit_j: 0.0,
            slip: Twist::ZERO,
            acted: Wrench::ZERO,
            active: false,
            uncovered: false,
        }
    }

    /// Clears a positive credit; a negative one remains owed.
    pub fn reset(&mut self) {
        let credit_j = if self.credit_j < 0.0 { self.credit_j } else { 0.0 };
        *self = Self {
            credit_j,
            ..Self::new()
        };
    }

    /// Slip of the coupling.
    pub fn slip(&self) -> Twist {
        self.slip
    }

    /// Books the work of the wrench that `acted` while the reading changed by `moved` and `turned`.
    pub fn account(&mut self, acted: Wrench, moved: Vec3, turned: Vec3, passivity: &PassivitySettings) {
        let before = self.credit_j;
        self.credit_j -= acted.force.dot(moved) + acted.torque.dot(turned);
        if self.active {
            let changed = acted + -self.acted;
            self.credit_j -= 0.5
                * (passivity.position_count_m * sum(changed.force.abs())
                    + passivity.angle_count_rad * sum(changed.torque.abs()));
        } else {
            // Energy that the coupling generates by itself is limited by the tank's valve.
            let floor = (RESERVE - 1.0) * passivity.initial_budget_j;
            let least = if before < floor { before } else { floor };
            self.credit_j = if self.credit_j > least {
                self.credit_j
            } else {
                least
            };
        }
        self.acted = acted;
    }

    /// Measures `coupling` from the slipped pose.
    pub fn measure(&self, coupling: &mut Coupling, handle: Quat) {
        if self.slip != Twist::ZERO {
            coupling.stretch -= handle * self.slip.linear;
            coupling.angle -= handle * self.slip.angular;
        }
    }

    /// Energy that may be delivered, J; `given_w` is the power that the wrench delivers to the handle at its measured speed.
    fn available(&self, given_w: f32, initial: f32) -> f32 {
        let reserved = if given_w < 0.0 { 0.0 } else { RESERVE * initial };
        initial - reserved + self.credit_j
    }

    /// Slips `coupling`, which stores `stored` (J), to within the bound, or lets the slip recover; `handle` is the handle's orientation,
    /// `open` the opening of the tank's valve.
    pub fn slip_to_bound(
        &mut self,
        coupling: &mut Coupling,
        stored: &mut f32,
        handle: Quat,
        hold: Hold,
        open: f32,
        settings: &Settings,
    ) {
        let initial = settings.passivity.initial_budget_j;
        let held_firmly = self.slip == Twist::ZERO;
        self.active =
            hold == Hold::Targets || !held_firmly || (self.active && self.uncovered && hold == Hold::Nothing);
        if !self.active {
            return;
        }
        let before = *coupling;
        let pull_w = settings.coupling.k_t_n_per_m * before.stretch.dot(before.target.linear)
            + settings.coupling.k_r * before.angle.dot(before.target.angular);
        let available = self.available(-pull_w, initial);
        if hold == Hold::Nothing {
            recover_slip(coupling, handle, &self.slip, settings.period_s);
        } else if open * *stored > available {
            limit_energy(coupling, available / open, &settings.coupling);
        } else if !held_firmly {
            recover_slip(coupling, handle, &self.slip, settings.period_s);
            if open * potential(coupling, &settings.coupling) > available {
                *coupling = before;
            }
        }
        let slipped = Twist {
            linear: before.stretch - coupling.stretch,
            angular: before.angle - coupling.angle,
        };
        if slipped != Twist::ZERO {
            *stored = potential(coupling, &settings.coupling);
            let handle = handle.conjugate();
            let slip = &mut self.slip;
            slip.linear += handle * slipped.linear;
            slip.angular += handle * slipped.angular;
            if slip.linear.abs().cmple(NEGLIGIBLE_SLIP.linear).all()
                && slip.angular.abs().cmple(NEGLIGIBLE_SLIP.angular).all()
            {
                *slip = Twist::ZERO;
            }
        }
    }

    /// Limits the credit to the energy still `stored` (J): the rest is dissipated. `initial` is the budget E₀, J.
    pub fn keep(&mut self, stored: f32, initial: f32) {
        self.credit_j = if self.credit_j < stored {
            self.credit_j
        } else {
            stored
        };
        let covered = (1.0 - RESERVE) * initial + self.credit_j;
        let least = RESERVE * initial;
        self.uncovered = stored > if covered > least { covered } else { least };
    }

    /// `wrench`, scaled down so that its work until the next tick is covered, whatever the operator does. `motion` is the measured twist of the
    /// handle; `pending` are the wrenches that delayed motors apply before this one.
    pub fn bound(&self, wrench: Wrench, pending: &[Wrench], motion: Twist, settings: &Settings) -> Wrench {
        if !self.active {
            return wrench;
        }
        let passivity = &settings.passivity;
        let ticks = (1 + pending.len()) as f32;
        let h = settings.period_s;
        let scale = passivity.position_scale;
        let slack = Twist {
            linear: Vec3::splat(
                scale * ACCELERATION * (h * ticks) * (h * ticks) + passivity.position_count_m,
            ),
            angular: Vec3::splat(
                ANGULAR_ACCELERATION * (h * ticks) * (h * ticks) + passivity.angle_count_rad,
            ),
        };
        let delay = if passivity.position_count_m > 0.0 {
            h * ticks + FILTER_S
        } else {
            h * ticks
        };
        let power = |w: &Wrench| w.force.dot(motion.linear) + w.torque.dot(motion.angular);
        // s·straight + s²·squared: largest work of s times a wrench until the next tick.
        let straight =
            |w: &Wrench| h * power(w) + w.force.abs().dot(slack.linear) + w.torque.abs().dot(slack.angular);
        let squared = |w: &Wrench| {
            h * delay
                * (scale * scale * w.force.length_squared() / LEAST_MASS_KG
                    + w.torque.length_squared() / LEAST_INERTIA_KG_M2)
        };
        let mut available = self.available(power(&wrench), passivity.initial_budget_j);
        for w in pending {
            let worst_case = straight(w) + squared(w);
            available -= if worst_case > 0.0 { worst_case } else { 0.0 };
        }
        let (b, c) = (straight(&wrench), squared(&wrench));
        let share = affordable_share(b, c, if available > 0.0 { available } else { 0.0 });
        if share >= 1.0 {
            return wrench;
        }
        Wrench {
            force: wrench.force * share,
            torque: wrench.torque * share,
        }
    }
}

/// Largest s up to 1 with b·s + c·s² ≤ p, for non-negative c and p.
fn affordable_share(b: f32, c: f32, p: f32) -> f32 {
    if b + c <= p {
        return 1.0;
    }
    let root = libm::sqrtf(b * b + 4.0 * c * p);
    // Avoids the difference of two nearly equal numbers.
    let share = if b > 0.0 {
        2.0 * p / (b + root)
    } else {
        (root - b) / (2.0 * c)
    };
    if share < 1.0 { share } else { 1.0 }
}

fn sum(v: Vec3) -> f32 {
    v.x + v.y + v.z
}

/// Lets a part of the slip recover.
fn recover_slip(coupling: &mut Coupling, handle: Quat, slip: &Twist, period_s: f32) {
    let back = period_s / SLIP_RECOVERY_S;
    coupling.stretch += handle * (slip.linear * back);
    coupling.angle += handle * (slip.angular * back);
}

/// Shortens the stretch and angle of `coupling` until it stores at most `max_j`, J.
fn limit_energy(coupling: &mut Coupling, max_j: f32, settings: &CouplingSettings) {
    // Beyond the force limits the potential is not quadratic in the stretch.
    coupling.stretch = cut(coupling.stretch, settings.force_max_n / settings.k_t_n_per_m).0;
    coupling.angle = cut(coupling.angle, settings.torque_max_nm / settings.k_r).0;
    let stored = potential(coupling, settings);
    if stored > max_j {
        let share = if max_j > 0.0 {
            libm::sqrtf(max_j / stored)
        } else {
            0.0
        };
        coupling.stretch *= share;
        coupling.angle *= share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f32 = 1e-3;

    fn settings() -> Settings {
        let mut settings = Settings::default();
        settings.coupling.k_t_n_per_m = 400.0;
        settings.period_s = H;
        settings
    }

    /// A handle that moves along x at `speed`, m/s, coupled to a part that targets hold in place: the handle's force after `ticks`, N, and the largest
    /// energy delivered since the start, J.
    fn moved(
        bound: &mut EnergyBound,
        settings: &Settings,
        ticks: usize,
        speed: impl Fn(usize) -> f32,
    ) -> (f32, f64) {
        let (mut x, mut force) = (0.0, 0.0f32);
        let (mut given, mut most) = (0.0f64, 0.0f64);
        for t in 0..ticks {
            let v = speed(t);
            let step = v * H;
            x += step;
            given += f64::from(force) * f64::from(step);
            most = most.max(given);
            let acted = Wrench {
                force: Vec3::X * force,
                torque: Vec3::ZERO,
            };
            bound.account(acted, Vec3::X * step, Vec3::ZERO, &settings.passivity);
            let motion = Twist {
                linear: Vec3::X * v,
                angular: Vec3::ZERO,
            };
            let mut coupling = Coupling::stretched(Vec3::X * x, Vec3::ZERO);
            coupling.target = motion;
            bound.measure(&mut coupling, Quat::IDENTITY);
            let mut stored = potential(&coupling, &settings.coupling);
            bound.slip_to_bound(
                &mut coupling,
                &mut stored,
                Quat::IDENTITY,
                Hold::Targets,
                1.0,
                settings,
            );
            bound.keep(stored, settings.passivity.initial_budget_j);
            let wanted = Wrench {
                force: -settings.coupling.k_t_n_per_m * coupling.stretch,
                torque: Vec3::ZERO,
            };
            force = bound.bound(wanted, &[], motion, settings).force.x;
        }
        (force, most)
    }

    /// What is left of the budget where it is spent, J, with the rounding of sums.
    fn reserve(settings: &Settings) -> f64 {
        1.001 * f64::from(RESERVE * settings.passivity.initial_budget_j)
    }

    fn spent(settings: &Settings) -> EnergyBound {
        let mut bound = EnergyBound::new();
        // Without targets any energy delivered leaves the reserve.
        let acted = Wrench {
            force: Vec3::X,
            torque: Vec3::ZERO,
        };
        bound.account(acted, Vec3::X, Vec3::ZERO, &settings.passivity);
        bound
    }

    #[test]
    fn a_moving_hand_feels_a_target_although_its_budget_is_spent() {
        for count in [0.0, 10e-6] {
            let mut settings = settings();
            settings.passivity.position_count_m = count;
            for mm_per_s in [1.0f32, 3.0, 7.0, 50.0] {
                // 5 mm, where a coupling without slip pulls with 2 N.
                let ticks = (5.0 / mm_per_s / H) as usize;
                let (force, given) = moved(&mut spent(&settings), &settings, ticks, |_| 1e-3 * mm_per_s);
                assert!(force < -1.0, "{force} N at {mm_per_s} mm/s, counts of {count} m");
                assert!(given <= reserve(&settings), "{given} J");
            }
        }
    }

    #[test]
    fn a_hand_that_turns_about_receives_no_more_than_it_brought() {
        let settings = settings();
        let mut bound = spent(&settings);
        // To and fro by 4 mm.
        let speed = |t: usize| 0.04 * libm::cosf(0.01 * t as f32);
        let (_, given) = moved(&mut bound, &settings, 20_000, speed);
        assert!(given <= reserve(&settings), "{given} J");
        let mut bound = spent(&settings);
        assert_eq!(moved(&mut bound, &settings, 100, |_| 0.0), (0.0, 0.0), "at rest");
    }

    /// A target that ends leaves the part in motion, with energy that nobody supplied: once 82 µJ of it reached a moving hand.
    #[test]
    fn the_bound_holds_after_a_target_until_its_energy_is_spent() {
        let settings = settings();
        let initial = settings.passivity.initial_budget_j;
        let mut bound = spent(&settings);
        let along = Twist {
            linear: Vec3::X * 0.1,
            angular: Vec3::ZERO,
        };
        let push = Wrench {
            force: Vec3::X,
            torque: Vec3::ZERO,
        };
        let mut passes = |hold, moving_j| {
            let (mut coupling, mut stored) = (Coupling::stretched(Vec3::ZERO, Vec3::ZERO), 0.0);
            bound.slip_to_bound(&mut coupling, &mut stored, Quat::IDENTITY, hold, 1.0, &settings);
            bound.keep(stored + moving_j, initial);
            bound.bound(push, &[], along, &settings) == push
        };
        assert!(passes(Hold::Nothing, 1e-3), "no target yet");
        assert!(!passes(Hold::Targets, 1e-3));
        for _ in 0..3 {
            assert!(!passes(Hold::Nothing, 1e-3));
        }
        assert!(!passes(Hold::Nothing, 0.0), "spent within this tick");
        assert!(passes(Hold::Nothing, 1e-3));
        assert!(!passes(Hold::Targets, 1e-3));
        assert!(passes(Hold::Contacts, 1e-3), "a contact acts on the part");
    }
}
