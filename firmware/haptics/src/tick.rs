//! One tick of the force law.

use glam::{Mat3, Vec3};
use heapless::Vec;
use mortise_protocol::image::SceneImage;

use crate::body::Grabbed;
use crate::contact::Phase;
use crate::coupling::Coupling;
use crate::explicit;
use crate::grip::Hold;
use crate::guidance::{At, GuidanceState};
use crate::io::{FacePairs, Flags, Input, Output, Work};
use crate::limits::limit;
use crate::linear::inverse_sqrt;
use crate::overload::Searched;
use crate::pose::{Pose, Twist, Wrench, renormalize};
use crate::proximity::{Leaf, Search};
use crate::rotation;
use crate::settings::{CouplingSettings, Integrator, Settings};
use crate::state::State;
use crate::step::{MAX_SOLVES, Solution, Step, Stiffness};
use crate::touching::{Scenery, touching_faces};

/// Positions beyond this are an encoder's fault, not a place, m.
const FARTHEST_M: f32 = 100.0;
/// Speeds beyond this likewise, m/s.
const FASTEST_M_PER_S: f32 = 100.0;
/// Angular speeds beyond this likewise, rad/s.
const FASTEST_RAD_PER_S: f32 = 1000.0;
/// How fast the number of points that share the total stiffness may fall, a tick: stiffness of points still touching then rises
/// slowly, and little energy is made of it.
const SHARING_DECAY: f32 = 0.95;

/// What held the object back may be gone from one tick to the next. Then it starts with this speed, m/s, and grows faster by [`FASTER`] a tick, until
/// it has caught up with the motion that nothing holds back: 3 ticks to 0.1 m/s, which 10 N give 0.1 kg in one.
const START_M_PER_S: f32 = 0.02;
/// See [`START_M_PER_S`].
const FASTER: f32 = 2.0;

/// So many solves with contacts every step may take, whatever the search took; most do with fewer.
const LEAST_SOLVES: u8 = 4;
/// To find what a target pulls with, and what follows from it, look-ups. What it takes in a solve: [`solve_cost`].
const PULL: u32 = 6;
/// The diagonal of a cell, cells.
const DIAGONAL_CELLS: f32 = 1.733;

/// Moves the held object by one period and gives the wrench the handle must feel.
///
/// Order: input check; coupling; step without contacts, which tells how far anything can move; search within that; step with contacts;
/// motion; reaction; limits.
///
/// **Contract.** Called every [`Settings::period_s`]. Work is bounded: [`crate::ContactSettings::point_budget`] look-ups, 256 contacts, 8
/// solves with contacts. Past a bound the tick degrades in the order the flag's documentation states and says so in [`Work::flags`]; it never panics
/// and never returns a wrench above [`crate::LimitSettings`] or one that is not finite. A bad input or a failed step gives a zero wrench and
/// leaves the object where it was. `scene` must be the one given to [`State::load_scene`]; another one is safe but meaningless.
///
/// **Cost**, counted on an emulated Cortex-M7 (QEMU `mps2-an500`, `-icount`) on 2026-11-22, thesis pair with 20 µm clearance baked at 0.5 mm cells
/// with a pointshell of 25 µm: 72,540 instructions at worst pressed to the wall with 5 N and slid at 10 mm/s, 18,480 in free motion; with a
/// pointshell of 5 µm 112,320, points left out in 96 % of the ticks, and 19,100. A peg of 0.7 m
/// with 0.2 mm clearance and a shell of 50 µm, pressed likewise and slid at 20 mm/s, needs more than the default budget, is thinned, and stays below
/// 120,000. Into a fit of 0.02 mm: 123,900 guided, 115,700 by collision alone; 121,580 with four different targets
/// (`mortise-lab figures constraints --quick`).
pub fn tick(state: &mut State, scene: &SceneImage<'_>, settings: &Settings, input: &Input) -> Output {
    let mut work = Work::default();
    let Some(handle) = usable_pose(&input.handle).filter(|_| usable_twist(&input.handle_twist)) else {
        work.flags.insert(Flags::BAD_INPUT);
        if let Some(g) = &mut state.grabbed {
            g.twist = Twist::ZERO;
        }
        return state.still(work);
    };
    let Some(grabbed) = state
        .grabbed
        .filter(|g| usize::from(g.part) < scene.parts().len())
    else {
        let mut out = state.still(work);
        out.handle = state.hand_over(Wrench::ZERO, input, settings, &mut out.work.flags);
        return out;
    };
    let limits = state.slipping.then_some(&settings.coupling);
    let (mut grabbed, mut coupling) = take_hold(grabbed, handle, input.handle_twist, limits);
    let object_energy = grabbed.moving_energy(settings.object.mass_kg);
    let open = if input.enabled {
        (state.tank).measure(&mut coupling, handle.orientation);
        let open = (state.tank).balance(
            handle,
            input.handle_twist,
            &coupling,
            state.previous_wrench,
            object_energy,
            settings,
        );
        let hold = match (state.guidance.is_empty(), state.pushing) {
            (false, _) => Hold::Targets,
            (true, 0) => Hold::Nothing,
            (true, _) => Hold::Contacts,
        };
        (state.tank).give_way(&mut coupling, handle.orientation, hold, settings);
        open
    } else {
        state.tank.forget();
        1.0
    };
    work.flags.insert_if(open < 1.0, Flags::SOFTENED);
    let (gyration2, scale) = grabbed
        .body
        .gyration2_in_world(grabbed.orientation, &settings.object);
    state.guidance.step(&settings.guidance);
    let at = At {
        scene,
        parts: &state.parts,
        held: grabbed.part,
        object: grabbed.pose(),
        center: grabbed.center,
        length: scale,
        period_s: settings.period_s,
        settings: &settings.guidance,
        coupling_stiffness: settings.coupling.k_t_n_per_m,
    };
    let mut pulls = Vec::new();
    state.guidance.add_pulls(&at, &mut pulls);
    let turning = grabbed.turning_energy(settings.object.mass_kg, gyration2);
    state.tank.keep(object_energy + turning);
    let guided_share = state.guidance.share(&at);
    let step = Step {
        coupling: &coupling,
        settings: &settings.coupling,
        period_s: settings.period_s,
        mass_kg: settings.object.mass_kg,
        gyration2,
        length: scale,
        twist: grabbed.twist,
        pulls: &pulls,
    };
    let mut free = match settings.integrator {
        Integrator::Implicit => step.free(),
        Integrator::Explicit => explicit::free(&step),
    };
    let reach = grabbed.body.reach;
    let fastest = state.fastest(settings);
    let capped = slow_down(&mut free.twist, reach, fastest);
    // As far as it would go with nothing in the way; but what leans on something stays there, and need not look as far as if it let go.
    let likely = FASTER * point_speed(grabbed.twist, reach) + START_M_PER_S;
    let margin = settings.contact.margin_m
        + state.braking_margin(settings)
        + settings.period_s * smaller(likely, point_speed(free.twist, reach));
    let motions = [grabbed.twist, free.twist].map(|t| step.scale(t).map(|x| x * settings.period_s));
    if (state.guidance).join(&at, &pulls, &motions, state.slack(settings)) {
        state.coherence.end_joints();
    }
    let solution = state.meet(
        scene,
        settings,
        &grabbed,
        &step,
        &free,
        &motions,
        margin,
        guided_share,
        &mut work,
    );

    let mut twist = solution.twist;
    // Nothing beyond the margin was looked at, so nothing may move farther.
    let slowed = slow_down(&mut twist, reach, smaller(margin / settings.period_s, fastest));
    work.flags.insert_if(capped || slowed, Flags::SPEED_LIMITED);
    grabbed.advance(twist, settings.period_s);
    if !(grabbed.twist.is_finite() && grabbed.pose().is_finite() && solution.contact.is_finite()) {
        work.flags.insert(Flags::NON_FINITE);
        if let Some(g) = &mut state.grabbed {
            g.twist = Twist::ZERO;
        }
        return state.still(work);
    }
    let pull = slipping(
        coupling.pull(&settings.coupling, settings.period_s, twist),
        settings,
        &mut work.flags,
    );
    state.tank.pulled(pull, twist, settings.period_s);
    let felt = Wrench {
        force: pull.force * open,
        torque: pull.torque * open,
    };
    let wanted = coupling.reaction(felt);
    let guided = (state.contacts.as_slice().iter())
        .filter(|c| c.guided && c.phase != Phase::Free)
        .map(|c| c.arm);
    state.guidance.observe(guided, &state.parts);
    let guidance = state.guidance.state(&pulls, &step.scale(twist), scale);
    let scenery = Scenery {
        scene,
        parts: &state.parts,
        held: grabbed.part,
        object: grabbed.pose(),
        center: grabbed.center,
        period_s: settings.period_s,
    };
    // Filled in place: what it holds is large.
    let mut out = Output {
        handle: Wrench::ZERO,
        contact: solution.contact,
        object: grabbed.pose(),
        object_twist: twist,
        pairs: Vec::new(),
        guidance,
        work: Work::default(),
    };
    touching_faces(state.contacts.as_slice(), &scenery, &mut out.pairs);
    state
        .coherence
        .travelled(settings.period_s * point_speed(twist, reach));
    state.grabbed = Some(grabbed);
    state.settle();
    out.handle = state.hand_over(wanted, input, settings, &mut work.flags);
    out.work = work;
    out
}

/// A solve with so many pulls, in the look-ups of the budget.
fn solve_cost(pulls: usize) -> u32 {
    8 + 5 * pulls as u32 / 2
}

/// How many solves there may be with contacts, when so many look-ups are `left`: past the third, a solve takes three eighths of one for each
/// candidate too.
fn most_solves(left: u32, candidates: u16, pulls: usize) -> u8 {
    let more = left / (solve_cost(pulls) + 3 * u32::from(candidates) / 8);
    u32::from(LEAST_SOLVES)
        .saturating_add(more)
        .min(u32::from(MAX_SOLVES)) as u8
}

impl State {
    /// The step with whatever is within `margin`.
    #[expect(clippy::too_many_arguments, reason = "one call; the parts of a tick")]
    fn meet(
        &mut self,
        scene: &SceneImage<'_>,
        settings: &Settings,
        grabbed: &Grabbed,
        step: &Step<'_>,
        free: &Solution,
        motions: &[[f32; 6]; 2],
        margin: f32,
        guided_share: f32,
        work: &mut Work,
    ) -> Solution {
        let explicit = settings.integrator == Integrator::Explicit;
        let braking_m = if explicit { self.finest_cell_m } else { 0.0 };
        let pulls = step.pulls.len();
        let budget = settings.contact.point_budget;
        let reserved = solve_cost(pulls) * u32::from(free.solves + LEAST_SOLVES) + PULL * pulls as u32;
        // Whatever pulls, contact is looked for.
        let reserved = reserved.min(budget / 2);
        let held_shape = scene.shape_of_part(usize::from(grabbed.part));
        let shrunk_m = self.shrink(settings, &held_shape.field);
        let search = Search {
            scene,
            parts: &self.parts,
            held: grabbed.part,
            held_shape,
            shrunk_m,
            pose: grabbed.pose(),
            center: grabbed.center,
            margin,
            way: settings.period_s * point_speed(grabbed.twist, grabbed.body.reach),
            slack: self.slack(settings),
            motions: *motions,
            swing: margin / (grabbed.body.reach * grabbed.body.reach),
            inverse_length: 1.0 / step.length,
            busy: self.busy,
            thinning: self.overload.thinning(),
            budget,
            reserved,
            carried: if self.busy { u32::from(self.pushing) } else { 0 },
            braking_m,
            guidance: &self.guidance,
            guidance_settings: &settings.guidance,
        };
        let start = self.resume;
        let (stopped, used) = search.run(start, &mut self.coherence, &mut self.contacts, work);
        self.resume = stopped.unwrap_or(Leaf::FIRST);
        self.busy = used.all > budget / 2;
        work.flags.insert_if(search.thinning > 0, Flags::BUDGET_EXCEEDED);
        let touching = self.contacts.as_slice().iter().filter(|c| c.gap < 0.0).count() as u32;
        self.overload.learn(&Searched {
            start,
            stopped,
            used,
            budget,
            touching,
            lost: self.contacts.lost(),
        });
        work.flags
            .insert_if(self.contacts.dropped(), Flags::CONTACTS_DROPPED);
        let contact = &settings.contact;
        self.sharing = larger(larger(touching as f32, 1.0), self.sharing * SHARING_DECAY);
        let fastest = self.fastest(settings);
        let farthest = self.contacts.farthest();
        let contacts = self.contacts.as_mut_slice();
        let solution = if explicit {
            let k = explicit::shared_stiffness(contact, self.sharing);
            let reach = grabbed.body.reach;
            explicit::with_contacts(step, contacts, k, braking_m, |mut twist| {
                slow_down(&mut twist, reach, fastest);
                twist
            })
        } else {
            let k = contact.shared_stiffness(self.sharing);
            let k = Stiffness {
                point: k,
                guided: k * guided_share,
            };
            let left = budget.saturating_sub(used.all);
            let solves = most_solves(left, work.candidates, pulls);
            step.with_contacts(free, contacts, &k, contact.damping_s, farthest, solves)
        };
        self.pushing = self.contacts.pushing() as u16;
        work.contacts = self.pushing;
        work.solves = solution.solves;
        work.flags.insert_if(!solution.settled, Flags::UNSETTLED);
        solution
    }

    /// No point of the object may be faster, m/s. The textbook methods see no farther than the next voxel, so half a cell a tick (eq. 5 of Faas
    /// 2010) bounds the explicit step, and half a voxel any step where there are voxmaps.
    fn fastest(&self, settings: &Settings) -> f32 {
        let cell = match settings.integrator {
            Integrator::Implicit => self.finest_voxel_m,
            Integrator::Explicit => self.finest_cell_m,
        };
        if cell > 0.0 {
            smaller(0.5 * cell / settings.period_s, settings.object.speed_max_m_per_s)
        } else {
            settings.object.speed_max_m_per_s
        }
    }

    /// Points that come this near are wanted, m: for the step, or for braking.
    fn slack(&self, settings: &Settings) -> f32 {
        match settings.integrator {
            Integrator::Implicit => settings.contact.margin_m,
            Integrator::Explicit => larger(settings.contact.margin_m, self.finest_cell_m),
        }
    }

    /// How far from contact braking begins, m: within a cell of the surface, or in the layer of voxels round it, at most a diagonal away.
    fn braking_margin(&self, settings: &Settings) -> f32 {
        match settings.integrator {
            Integrator::Implicit => 0.0,
            Integrator::Explicit => DIAGONAL_CELLS * self.finest_cell_m,
        }
    }

    /// The wrench for the mechanism; remembered for the slew limit.
    fn hand_over(&mut self, wanted: Wrench, input: &Input, settings: &Settings, flags: &mut Flags) -> Wrench {
        let out = if input.enabled {
            let out = limit(
                wanted,
                self.previous_wrench,
                &settings.limits,
                settings.period_s,
                flags,
            );
            self.tank.bound(out, input.handle_twist, settings)
        } else {
            Wrench::ZERO
        };
        self.previous_wrench = out;
        out
    }

    /// Output of a tick in which nothing moves and nothing pushes.
    fn still(&mut self, work: Work) -> Output {
        if work.flags != Flags::empty() {
            self.previous_wrench = Wrench::ZERO;
        }
        Output {
            handle: Wrench::ZERO,
            contact: Wrench::ZERO,
            object: self.last_object.unwrap_or_default(),
            object_twist: Twist::ZERO,
            pairs: FacePairs::new(),
            guidance: GuidanceState::default(),
            work,
        }
    }
}

/// The coupling at the tick's start, slipping in the hand where it is stretched beyond `limits`. A firm grip that closes on a part at once
/// gives it the hand's motion, or the damper would be felt; one that slips takes it along from rest, since ½·m·v² is the hand's to give.
fn take_hold(
    mut grabbed: Grabbed,
    handle: Pose,
    handle_twist: Twist,
    limits: Option<&CouplingSettings>,
) -> (Grabbed, Coupling) {
    let mut coupling = Coupling::measure(handle, handle_twist, &grabbed);
    if let Some(limits) = limits
        && let Some(offset) = coupling.slipped(handle, &grabbed, limits)
    {
        grabbed.offset = offset;
        coupling = Coupling::measure(handle, handle_twist, &grabbed);
    }
    grabbed.angle = coupling.angle;
    if grabbed.age == 0 && limits.is_none() {
        grabbed.twist = coupling.target;
    }
    grabbed.age = grabbed.age.saturating_add(1);
    (grabbed, coupling)
}

/// `pull` cut to what the coupling can transmit.
fn slipping(pull: Wrench, settings: &Settings, flags: &mut Flags) -> Wrench {
    let slip = Coupling::slip(pull, &settings.coupling);
    flags.insert_if(slip.translation < 1.0, Flags::SATURATED_FORCE);
    flags.insert_if(slip.rotation < 1.0, Flags::SATURATED_TORQUE);
    Wrench {
        force: pull.force * slip.translation,
        torque: pull.torque * slip.rotation,
    }
}

impl Grabbed {
    /// Energy of its motion, J, without that of its turning.
    fn moving_energy(&self, mass_kg: f32) -> f32 {
        0.5 * mass_kg * self.twist.linear.length_squared()
    }

    /// Energy of its turning, J.
    fn turning_energy(&self, mass_kg: f32, gyration2: Mat3) -> f32 {
        0.5 * mass_kg * self.twist.angular.dot(gyration2 * self.twist.angular)
    }

    /// Moves with `twist` for `period_s`.
    fn advance(&mut self, twist: Twist, period_s: f32) {
        self.twist = twist;
        self.center += twist.linear * period_s;
        let turn = twist.angular * period_s;
        let turn = crate::limits::cut(turn, rotation::EXP_MAX).0;
        self.orientation = renormalize(rotation::exp(turn) * self.orientation);
    }
}

/// Upper bound of the speed of any point within `reach` of the centre of mass, m/s.
fn point_speed(twist: Twist, reach: f32) -> f32 {
    // No less than the lengths, by more than rounding can make the roots too small.
    let length = |v: Vec3| {
        let squared = v.length_squared();
        1.000_001 * squared * inverse_sqrt(squared)
    };
    length(twist.linear) + length(twist.angular) * reach
}

/// Scales `twist` so that no point within `reach` is faster than `most`; whether it had to.
///
/// A scaled motion keeps every linearised gap that the full one keeps: it stops part of the way.
fn slow_down(twist: &mut Twist, reach: f32, most: f32) -> bool {
    let speed = point_speed(*twist, reach);
    if speed > most {
        let scale = most / speed;
        twist.linear *= scale;
        twist.angular *= scale;
        true
    } else {
        false
    }
}

/// The pose with its quaternion at unit length, unless it is not finite, too far off, or not a rotation.
pub(crate) fn usable_pose(pose: &Pose) -> Option<Pose> {
    let near = pose.position.abs().max_element() <= FARTHEST_M;
    let norm2 = pose.orientation.length_squared();
    let rotation = norm2 > 0.81 && norm2 < 1.21;
    if !(pose.is_finite() && near && rotation) {
        return None;
    }
    Some(Pose {
        position: pose.position,
        orientation: pose.orientation * (1.0 / libm::sqrtf(norm2)),
    })
}

fn usable_twist(twist: &Twist) -> bool {
    twist.is_finite()
        && twist.linear.abs().max_element() <= FASTEST_M_PER_S
        && twist.angular.abs().max_element() <= FASTEST_RAD_PER_S
}

/// The smaller of two numbers; unlike `f32::min` it does not depend on the platform's choice between zeros.
fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// The larger of two numbers.
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
