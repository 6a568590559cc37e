//! Energy account of the handle while targets pull at the part: the hand is given no more than it brought and E₀.
//!
//! A target that takes hold is a source: engaging at an error e it has the energy of its pull on e out of nothing, 3 mJ at 1 mm and 3 N. It may move
//! the part with it, which is virtual, but not the hand. So each tick balances the handle's port on the motion that truly followed,
//!
//! B ← min(B − W, U + ½·m·v² + ½·ω·I·ω),   W = F·Δp + τ·Δφ of the wrench that acted,
//!
//! with U as in `passivity`: what the hand credit_j, as far as it is still stored in the coupling or in the object's motion. What is stored there no
//! more is dissipated, and is not there to be spent by a target; what a target stores was brought by nobody and does not count. −B never exceeds E₀
//! ([`crate::PassivitySettings::initial_budget_j`]), because of two measures that act while there are targets:
//!
//! * **Slip.** The coupling stores no more than E₀ + B. Where a pull would have it store more, the part gives way in the hand by as much: d and θ count
//!   from where it has slipped to, as if the hand had taken hold of it there. What gave way comes back with a time of 0.25 s as far as E₀ + B allows.
//! * **Bound.** The coupling's force has terms that no spring stores: its damper and the step's look-ahead, h·k, pull at the hand with the speed of a
//!   part that a target drives. So the wrench is scaled by the largest s up to 1 whose work until the next tick is paid for, whatever the hand does:
//!
//!   s·(h·(F·v + τ·ω) + |F|·(A·h² + u) + |τ|·(A_ω·h² + u_ω)) + s²·h·t·(|F|²/m + |τ|²/I) ≤ max(0, E₀ + B)
//!
//!   v and ω are the handle's speed as it is told, A and A_ω accelerations that a hand does not exceed, u and u_ω the encoders' counts, and the square
//!   is what the wrench itself changes of the handle's motion while its speed is told late by t, for the lightest handle m, I. A wrench that takes more
//!   from the hand than it may give in a tick passes whole: a hand that presses or moves off feels contact and target as without the account.
//!
//! Readings and wrench are those that acted, so the account is the observer's own ([`crate::observer`]), one tick late. Encoders that count are off by
//! e, no more than half a count u, and force times difference of readings by Σ F·Δe = F·e − Σ e·ΔF. What U is off by at the start takes away the first
//! term there; at the end it is in the bound's |F|·u; and for the rest each tick takes u/2·|ΔF| from B. So B never exceeds the true one by more than
//! F·u/2, however long it sums. The work of `counted`, right on the mean for a hand that trembles, has no such bound: it misses 100 of the 128 µJ given
//! to a handle of 67 g that swings at 60 Hz.
//!
//! Without targets the account is only kept, and the tick's bits are what they are without it. Then the coupling is passive by itself and the valve's to
//! mind; B falls no lower than −E₀. What gave way comes back at once where neither target nor contact holds the part, which then has nothing to push
//! the hand from. What was lent is owed for good: a grab or a fault does not forgive it, only work of the hand does.
//!
//! The account is that of Ferraguti, Secchi and Fantuzzi, ICRA 2013 (see `passivity`); slip in place of a softer spring is ours. Cost: 20 instructions
//! without targets, about 350 with.

use glam::{Quat, Vec3};

use crate::dynamics::coupling::{Coupling, potential};
use crate::math::pose::{Twist, Wrench};
use crate::math::vector::cut;
use crate::settings::{CouplingSettings, PassivitySettings, Settings};

/// Time in which 1/e is left of what gave way, s.
const COMING_BACK_S: f32 = 0.25;
/// A and A_ω, m/s² and rad/s²: accelerations of a handle by the hand that holds it.
const ACCELERATION: f32 = 25.0;
const ANGULAR_ACCELERATION: f32 = 500.0;
/// Time of the filter through which counting encoders tell the handle's speed, s; without counts it is told within the tick.
const FILTER_S: f32 = 3e-3;
/// m and I, kg and kg m²: no handle is lighter.
const LIGHTEST: f32 = 0.05;
const LIGHTEST_TURNING: f32 = 5e-5;
/// Less than this did not give way, m and rad.
const NOTHING: Twist = Twist {
    linear: Vec3::splat(1e-8),
    angular: Vec3::splat(1e-7),
};

/// What holds the part besides the hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    Nothing,
    Contacts,
    /// And contacts, perhaps.
    Targets,
}

/// What the hand credit_j, and how far the part gave way in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnergyBound {
    /// B, J.
    credit_j: f32,
    /// As stretch and angle of the coupling, handle's axes.
    slip: Twist,
    /// What acted on the handle last.
    acted: Wrench,
    /// There are targets, or the part has not come back from where they had it slip.
    active: bool,
}

impl EnergyBound {
    /// Zero bits, as [`crate::State::new`] asks.
    pub const fn new() -> Self {
        Self {
            credit_j: 0.0,
            slip: Twist::ZERO,
            acted: Wrench::ZERO,
            active: false,
        }
    }

    /// Nothing is in hand any more; what was lent is owed.
    pub fn forget(&mut self) {
        let credit_j = if self.credit_j < 0.0 { self.credit_j } else { 0.0 };
        *self = Self {
            credit_j,
            ..Self::new()
        };
    }

    /// How far the part gave way.
    pub fn slip(&self) -> Twist {
        self.slip
    }

    /// The wrench `acted` while the reading moved by `moved` and `turned`.
    pub fn account(&mut self, acted: Wrench, moved: Vec3, turned: Vec3, told: &PassivitySettings) {
        self.credit_j -= acted.force.dot(moved) + acted.torque.dot(turned);
        if self.active {
            let changed = acted + -self.acted;
            self.credit_j -= 0.5
                * (told.position_count_m * sum(changed.force.abs())
                    + told.angle_count_rad * sum(changed.torque.abs()));
        }
        self.acted = acted;
    }

    /// `coupling` from where the part has slipped to.
    pub fn measure(&self, coupling: &mut Coupling, handle: Quat) {
        if self.slip != Twist::ZERO {
            coupling.stretch -= handle * self.slip.linear;
            coupling.angle -= handle * self.slip.angular;
        }
    }

    /// Gives way in `coupling`, which stores `stored` (J), or comes back, `open` being what the valve lets through.
    pub fn slip_to_bound(
        &mut self,
        coupling: &mut Coupling,
        stored: &mut f32,
        handle: Quat,
        hold: Hold,
        open: f32,
        settings: &Settings,
    ) {
        let lent = settings.passivity.initial_budget_j;
        let firm = self.slip == Twist::ZERO;
        self.active = hold == Hold::Targets || !firm;
        if !self.active {
            // What the coupling makes by itself is the valve's to mind.
            self.credit_j = if self.credit_j > -lent {
                self.credit_j
            } else {
                -lent
            };
            return;
        }
        let paid = lent + self.credit_j;
        let before = *coupling;
        if hold == Hold::Nothing {
            come_back(coupling, handle, &self.slip, settings.period_s);
        } else if open * *stored > paid {
            shorten(coupling, paid / open, &settings.coupling);
        } else if !firm {
            come_back(coupling, handle, &self.slip, settings.period_s);
            if open * potential(coupling, &settings.coupling) > paid {
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
            let given = &mut self.slip;
            given.linear += handle * slipped.linear;
            given.angular += handle * slipped.angular;
            if given.linear.abs().cmple(NOTHING.linear).all()
                && given.angular.abs().cmple(NOTHING.angular).all()
            {
                *given = Twist::ZERO;
            }
        }
    }

    /// What the hand brought and is `stored` no more (J) is dissipated.
    pub fn keep(&mut self, stored: f32) {
        self.credit_j = if self.credit_j < stored {
            self.credit_j
        } else {
            stored
        };
    }

    /// `wrench`, or as much of it as is paid for whatever the hand does until the next tick, `motion` being the handle's as it is told; late motors give
    /// the wrenches `pending` before it.
    pub fn bound(&self, wrench: Wrench, pending: &[Wrench], motion: Twist, settings: &Settings) -> Wrench {
        if !self.active {
            return wrench;
        }
        let told = &settings.passivity;
        let ticks = (1 + pending.len()) as f32;
        let h = settings.period_s;
        let slack = Twist {
            linear: Vec3::splat(ACCELERATION * (h * ticks) * (h * ticks) + told.position_count_m),
            angular: Vec3::splat(ANGULAR_ACCELERATION * (h * ticks) * (h * ticks) + told.angle_count_rad),
        };
        let late = if told.position_count_m > 0.0 {
            h * ticks + FILTER_S
        } else {
            h * ticks
        };
        // s·straight + s²·squared: work of s times a wrench until the next tick, at worst.
        let straight = |w: &Wrench| {
            h * (w.force.dot(motion.linear) + w.torque.dot(motion.angular))
                + w.force.abs().dot(slack.linear)
                + w.torque.abs().dot(slack.angular)
        };
        let squared = |w: &Wrench| {
            h * late * (w.force.length_squared() / LIGHTEST + w.torque.length_squared() / LIGHTEST_TURNING)
        };
        let mut paid = told.initial_budget_j + self.credit_j;
        for w in pending {
            let worst = straight(w) + squared(w);
            paid -= if worst > 0.0 { worst } else { 0.0 };
        }
        let (b, c) = (straight(&wrench), squared(&wrench));
        let share = share_paid(b, c, if paid > 0.0 { paid } else { 0.0 });
        if share >= 1.0 {
            return wrench;
        }
        Wrench {
            force: wrench.force * share,
            torque: wrench.torque * share,
        }
    }
}

/// Largest s up to 1 with b·s + c·s² ≤ p, for c and p that are not negative.
fn share_paid(b: f32, c: f32, p: f32) -> f32 {
    if b + c <= p {
        return 1.0;
    }
    let root = libm::sqrtf(b * b + 4.0 * c * p);
    // No difference of what is nearly the same.
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

/// Some of what gave way comes back.
fn come_back(coupling: &mut Coupling, handle: Quat, slip: &Twist, period_s: f32) {
    let back = period_s / COMING_BACK_S;
    coupling.stretch += handle * (slip.linear * back);
    coupling.angle += handle * (slip.angular * back);
}

/// Has `coupling` store no more than `most`, J.
fn shorten(coupling: &mut Coupling, most: f32, settings: &CouplingSettings) {
    // Beyond its limits the potential is no square of the stretch.
    coupling.stretch = cut(coupling.stretch, settings.force_max_n / settings.k_t_n_per_m).0;
    coupling.angle = cut(coupling.angle, settings.torque_max_nm / settings.k_r).0;
    let stored = potential(coupling, settings);
    if stored > most {
        let share = if most > 0.0 {
            libm::sqrtf(most / stored)
        } else {
            0.0
        };
        coupling.stretch *= share;
        coupling.angle *= share;
    }
}
