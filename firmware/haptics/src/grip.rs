//! The hand's grip on a part that targets pull: it gives way before the hand is given what it never brought.
//!
//! A target that takes hold is a source: engaging at an error e it has the energy of its pull on e out of nothing, 3 mJ at 1 mm and 3 N. Most of it
//! goes into the target's own damper on the way to the axis, but the coupling that is stretched by it pushes the hand back. Waiting with engagement
//! until the hand has paid would keep guidance from a hand that rests. So the pull is free, and what it may hand on is not: the coupling stores no
//! more than the hand has brought through the handle and not taken back,
//!
//! U ≤ B = E₀ − Σ W_handle, U as in `passivity`, W counted as there (`counted`),
//!
//! and where a pull would have it store more, the part gives way in the hand by as much: d and θ count from where it has slipped to, as if the hand
//! had taken hold of it there. Since U is never negative, Σ W_handle never exceeds E₀ ([`crate::PassivitySettings::endowment_j`]), whatever pulls at
//! the part, the thesis' blend included. As B falls from 4·E₀ to nothing the coupling's damper goes with it, or it would drag the hand after a part
//! that is driven; what the step's look-ahead, h·k, still drags is below a tenth of E₀. What gave way comes back with a time of 0.25 s, as far as B
//! allows.
//!
//! Of what the hand brought and the system dissipated no more is kept than a purse ([`crate::PassivitySettings::purse_j`]), so that an hour of
//! friction is not there to be spent: B ≤ U + behind + purse, with the object's energy of motion and what the targets store, F·(√(s² + |e|²) − s),
//! behind the coupling.
//!
//! Without targets none of this acts, and the tick's bits are what they are without it: the coupling is passive then, and what it stores was
//! brought. What gave way still comes back then, also where all is spent and the hand rests: a 64th of E₀ is let off once, and again in every tick in
//! which nothing holds the part, which then has nothing to push the hand from.
//!
//! The account is that of Ferraguti, Secchi and Fantuzzi, ICRA 2013 (see `passivity`); giving way in place of a softer spring is ours. Cost: 40
//! instructions without targets, about 250 with one.

use glam::{Quat, Vec3};

use crate::coupling::Coupling;
use crate::passivity::potential;
use crate::pose::Twist;
use crate::settings::{PassivitySettings, Settings};

/// Time in which 1/e is left of what gave way, s.
const COMING_BACK_S: f32 = 0.25;
/// Share of E₀ that is let off each time the last target has gone, and while nothing holds the part.
const LET_OFF: f32 = 1.0 / 64.0;
/// The coupling's damper is whole from so many E₀ on.
const DAMPED: f32 = 4.0;
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

/// What the hand brought, and how far the part gave way in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grip {
    /// −Σ W_handle, J.
    brought: f32,
    /// As stretch and angle of the coupling, handle's axes.
    given_way: Twist,
    /// There were targets in the last tick.
    guided: bool,
}

impl Grip {
    /// Zero bits, as [`crate::State::new`] asks.
    pub const fn new() -> Self {
        Self {
            brought: 0.0,
            given_way: Twist::ZERO,
            guided: false,
        }
    }

    /// The wrench did this work on the handle, J.
    pub fn gave(&mut self, to_handle: f32) {
        self.brought -= to_handle;
    }

    /// `coupling` from where the part has slipped to.
    pub fn measure(&self, coupling: &mut Coupling, handle: Quat) {
        if self.given_way != Twist::ZERO {
            coupling.stretch -= handle * self.given_way.linear;
            coupling.angle -= handle * self.given_way.angular;
        }
    }

    /// Gives way in `coupling`, which stores `stored` (J), or comes back, `open` being what the valve lets through; the share of its damping that the
    /// coupling keeps.
    pub fn give_way(
        &mut self,
        coupling: &mut Coupling,
        stored: &mut f32,
        handle: Quat,
        hold: Hold,
        open: f32,
        settings: &Settings,
    ) -> f32 {
        let lent = settings.passivity.endowment_j;
        let firm = self.given_way == Twist::ZERO;
        let guided = hold == Hold::Targets;
        let ended = self.guided && !guided;
        self.guided = guided;
        let let_off = ended || hold == Hold::Nothing && !firm;
        if !guided && (firm || let_off) {
            let owed = if let_off { LET_OFF - 1.0 } else { -1.0 };
            let least = *stored + owed * lent;
            self.brought = if self.brought > least { self.brought } else { least };
            if firm {
                return 1.0;
            }
        }
        let paid = lent + self.brought;
        let before = *coupling;
        if open * *stored > paid {
            let share = if paid > 0.0 {
                libm::sqrtf(paid / (open * *stored))
            } else {
                0.0
            };
            coupling.stretch *= share;
            coupling.angle *= share;
        } else if !firm {
            let back = settings.period_s / COMING_BACK_S;
            coupling.stretch += handle * (self.given_way.linear * back);
            coupling.angle += handle * (self.given_way.angular * back);
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
            let given = &mut self.given_way;
            given.linear += handle * slipped.linear;
            given.angular += handle * slipped.angular;
            if given.linear.abs().cmple(NOTHING.linear).all()
                && given.angular.abs().cmple(NOTHING.angular).all()
            {
                *given = Twist::ZERO;
            }
        }
        let whole = DAMPED * lent;
        if paid >= whole {
            1.0
        } else if paid > 0.0 {
            paid / whole
        } else {
            0.0
        }
    }

    /// No more is kept than the purse of what is stored nowhere: `stored` in the coupling, `behind` it in the object's motion and in targets, J.
    pub fn keep(&mut self, stored: f32, behind: f32, settings: &PassivitySettings) {
        let (least, most) = (-settings.purse_j, stored + behind + settings.purse_j);
        let brought = if self.brought < most { self.brought } else { most };
        self.brought = if brought > least { brought } else { least };
    }
}
