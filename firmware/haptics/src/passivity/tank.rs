//! Passivity of the coupling: an observer of the energy it makes, and a valve that turns the handle's wrench down before that can be felt.
//!
//! The handle is sampled and its wrench held from tick to tick, so a virtual spring can give back more than was put in; speed that is told late makes
//! of a damper a motor. Neither can happen unseen, because the work of a held wrench is known exactly once the next pose is: W = F·Δp + τ·Δφ. The
//! coupling is a two-port between handle and object; what it makes in a tick is what left by both ports and what is stored more than before,
//!
//! G = W_handle + s·(W_object + ΔU), U = the potential of a spring that slips at F_max.
//!
//! An energy tank pays for G and is filled by what coupling and handle ([`crate::PassivitySettings::damping`]) dissipate, to
//! [`crate::PassivitySettings::tank_j`] and no further: energy that an hour of friction took out is not there to be spent by an instability (the late
//! action of a plain passivity observer), and since U is part of the account a spring that was pressed may give back all of it. Below half of the
//! tank the valve s falls, by up to a quarter a tick. It scales the wrench as a whole: no speed is divided by or fed back, so nothing buzzes at rest,
//! and it works where an added damper would not because speed itself is late. Turning it down frees s·U, which goes to the tank; turning it up again
//! costs as much, is paid by the tank, and takes 20 s in contact and half a second out of it.
//!
//! What is behind the coupling is the object's port: targets that take hold there make energy of nothing, and `grip` keeps it from the hand, with an
//! account of its own.
//!
//! A wrench that reaches the motors late works on another motion than it was made for: rigs whose drivers take ticks to answer say so in
//! [`crate::PassivitySettings::delay_ticks`]. So do those whose encoders count ([`crate::PassivitySettings::position_count_m`]): a sum over
//! differences of counts takes for made what is dissipated between them, and shut the valve on a hand that leaned and trembled for half a minute (see
//! the source of `counted`). What is not seen: energy below one count, and a wrench that the application takes down (a ceiling, the fade of a soft
//! stop), which is taken for whole. Both make W too small or too large by no more than one count, or one fade, of force. A ramp from nothing
//! therefore raises the coupling's own limits, with a part that slips in the hand meanwhile ([`crate::State::set_slipping`]): scaling the wrench
//! behind the coupling makes up to the object's kinetic energy.
//!
//! After the energy tank of Franken, Stramigioli, Misra, Secchi and Macchelli, *Bilateral telemanipulation with time delays: a two-layer approach
//! combining passivity and transparency*, IEEE T-RO 27(4), 2011, with the reference energy of Ryu, Preusche, Hannaford and Hirzinger, *Time domain
//! passivity control with reference energy following*, IEEE T-CST 13(5), 2005, and stiffness paid for as in Ferraguti, Secchi and Fantuzzi, *A
//! tank-based approach to impedance control with variable stiffness*, ICRA 2013. Cost: about 450 instructions.

use glam::{Quat, Vec3};

use crate::dynamics::coupling::{Coupling, potential};
use crate::math::pose::{Pose, Twist, Wrench};
use crate::passivity::energy_bound::{EnergyBound, Hold};
use crate::passivity::quantised_work::QuantisedWork;
use crate::settings::{MAX_DELAY_TICKS, Settings};

/// The most the valve closes in a tick, once the tank is empty.
const CLOSING: f32 = 0.25;
/// Time in which it would open from shut: in contact, and where nothing is stored, s.
const OPENING_S: f32 = 20.0;
const OPENING_FREE_S: f32 = 0.5;
/// Time in which the tank fills where nothing is stored, s.
const FILLING_FREE_S: f32 = 1.0;
/// A spring that stores less than this share of the tank is not in contact.
const FREE: f32 = 0.02;
/// The tank's debt is not counted beyond this multiple of it: the valve is shut by then.
const MOST_DRAWN: f32 = 1.5;

/// What is observed and how far the valve is shut; all zero when nothing was drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passivity {
    /// Drawn from the tank and not yet paid back, J.
    pub drawn_j: f32,
    /// 1 − s: 0 open, 1 shut.
    pub softened: f32,
    /// Made by the coupling so far, net of what it dissipated, J: negative when it is passive.
    pub made_j: f32,
}

/// The observer's memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnergyTank {
    pub seen: Passivity,
    /// Whether the last tick was observed, so that what follows is known.
    known: bool,
    handle: Pose,
    /// What the wrench did on the handle, which is told in counts.
    linear: QuantisedWork,
    angular: QuantisedWork,
    /// U, J.
    stored: f32,
    energy_bound: EnergyBound,
    /// Work on the object since, J.
    to_object: f32,
    /// Wrenches of the last ticks, newest first, where the motors are late.
    given: [Wrench; MAX_DELAY_TICKS + 1],
}

impl EnergyTank {
    /// Full, open, nothing known. Zero bits, as [`crate::State::new`] asks.
    pub const fn new() -> Self {
        Self {
            seen: Passivity {
                drawn_j: 0.0,
                softened: 0.0,
                made_j: 0.0,
            },
            known: false,
            handle: Pose {
                position: Vec3::ZERO,
                orientation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
            },
            linear: QuantisedWork::new(),
            angular: QuantisedWork::new(),
            stored: 0.0,
            energy_bound: EnergyBound::new(),
            to_object: 0.0,
            given: [Wrench::ZERO; MAX_DELAY_TICKS + 1],
        }
    }

    /// At the tick's start: takes the account of the last period, behind the tick that gave `given`; what the wrench is to be multiplied by.
    pub fn balance(
        &mut self,
        handle: Pose,
        handle_twist: Twist,
        coupling: &Coupling,
        given: Wrench,
        object_energy: f32,
        settings: &Settings,
    ) -> f32 {
        let acting = self.acting(given, settings.passivity.delay_ticks as usize);
        let stored = potential(coupling, &settings.coupling);
        let open = 1.0 - self.seen.softened;
        let size = settings.passivity.tank_j;
        if self.known {
            let moved = handle.position - self.handle.position;
            let turned = small_turn(self.handle.orientation, handle.orientation);
            let told = &settings.passivity;
            let to_handle = self.linear.work(acting.force, moved, told.position_count_m)
                + (self.angular).work(acting.torque, turned, told.angle_count_rad);
            self.energy_bound.account(acting, moved, turned, told);
            let made = to_handle + open * (self.to_object + stored - self.stored);
            let rubbed = settings.passivity.damping * handle_twist.linear.dot(moved)
                + settings.passivity.angular_damping * handle_twist.angular.dot(turned);
            if size > 0.0 {
                self.seen.made_j += made;
                let drawn = made - if rubbed > 0.0 { rubbed } else { 0.0 };
                self.account(drawn, stored, object_energy, settings.period_s, size);
            }
        }
        self.known = true;
        self.handle = handle;
        self.stored = stored;
        1.0 - self.seen.softened
    }

    /// Takes in the last tick's wrench; the one that acted since.
    fn acting(&mut self, given: Wrench, delay_ticks: usize) -> Wrench {
        if delay_ticks == 0 {
            return given;
        }
        self.given.rotate_right(1);
        self.given[0] = given;
        self.given[delay_ticks.min(MAX_DELAY_TICKS)]
    }

    /// See [`crate::State::slip`].
    pub fn slip(&self) -> Twist {
        self.energy_bound.slip()
    }

    /// See [`EnergyBound::measure`]; before [`Self::balance`].
    pub fn measure(&self, coupling: &mut Coupling, handle: Quat) {
        self.energy_bound.measure(coupling, handle);
    }

    /// See [`EnergyBound::slip_to_bound`]; after [`Self::balance`].
    pub fn slip_to_bound(&mut self, coupling: &mut Coupling, handle: Quat, hold: Hold, settings: &Settings) {
        let open = 1.0 - self.seen.softened;
        (self.energy_bound).slip_to_bound(coupling, &mut self.stored, handle, hold, open, settings);
    }

    /// See [`EnergyBound::keep`]; `moving`: energy of the object's motion, J.
    pub fn keep(&mut self, moving: f32) {
        self.energy_bound
            .keep((1.0 - self.seen.softened) * self.stored + moving);
    }

    /// See [`EnergyBound::bound`].
    pub fn bound(&self, wrench: Wrench, motion: Twist, settings: &Settings) -> Wrench {
        let pending = (settings.passivity.delay_ticks as usize).min(MAX_DELAY_TICKS);
        self.energy_bound
            .bound(wrench, &self.given[..pending], motion, settings)
    }

    /// After the step: the object moved with `twist` under `pull`.
    pub fn pulled(&mut self, pull: Wrench, twist: Twist, period_s: f32) {
        self.to_object = (pull.force.dot(twist.linear) + pull.torque.dot(twist.angular)) * period_s;
    }

    /// Nothing acts on the handle, or something else did: the account begins anew.
    pub fn forget(&mut self) {
        let mut energy_bound = self.energy_bound;
        energy_bound.forget();
        *self = Self {
            energy_bound,
            ..Self::new()
        };
    }

    fn account(&mut self, drawn: f32, stored: f32, object_energy: f32, period_s: f32, size: f32) {
        let seen = &mut self.seen;
        let mut drawn = seen.drawn_j + drawn;
        let free = stored + object_energy < FREE * size;
        if free {
            drawn -= size * period_s / FILLING_FREE_S;
        }
        let half = 0.5 * size;
        if drawn > half {
            let short = (drawn - half) / half;
            let share = CLOSING * if short < 1.0 { short } else { 1.0 };
            let closed = share * (1.0 - seen.softened);
            seen.softened += closed;
            drawn -= closed * stored;
        } else if seen.softened > 0.0 {
            let time = if free { OPENING_FREE_S } else { OPENING_S };
            let opened = period_s / time;
            let opened = if opened < seen.softened {
                opened
            } else {
                seen.softened
            };
            let cost = opened * (stored + object_energy);
            if drawn + cost <= half {
                seen.softened -= opened;
                drawn += cost;
            }
        }
        seen.drawn_j = drawn.clamp(0.0, MOST_DRAWN * size);
    }
}

/// Rotation vector from `from` to `to`, world axes, rad: 2·sin(φ/2) in place of φ.
fn small_turn(from: Quat, to: Quat) -> Vec3 {
    let q = to * from.conjugate();
    let v = Vec3::new(q.x, q.y, q.z) * 2.0;
    if q.w < 0.0 { -v } else { v }
}
