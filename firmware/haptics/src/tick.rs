//! One tick of the force law.

use heapless::Vec;
use mortise_protocol::image::SceneImage;

use crate::baseline::explicit;
use crate::collision::contact::Phase;
use crate::collision::face_pairs::{Scenery, touching_faces};
use crate::constraints::geometric_energy::{EnergyForce, EnergySituation, GeometricEnergy};
use crate::constraints::saturating_spring::{SaturatingSpring, TargetForce};
use crate::constraints::targets::{Situation, TargetRules};
use crate::contact_step::{Constraints, Given, Reach, contact_step};
use crate::dynamics::body::Grabbed;
use crate::dynamics::coupling::{Coupling, CouplingForce, slipping, take_hold};
use crate::dynamics::force::ForceTerm;
use crate::dynamics::friction::Friction;
use crate::dynamics::step::{Solution, Step};
use crate::hand::Hand;
use crate::io::{Flags, GuidanceState, Input, Output, Work};
use crate::math::pose::{Pose, Wrench, usable_pose, usable_twist};
use crate::math::scalar::{larger, smaller};
use crate::motion::{point_speed, slow_down};
use crate::passivity::energy_bound::Hold;
use crate::settings::{Integrator, Settings};
use crate::state::State;

/// Initial speed of an object whose obstacle vanishes from one tick to the next, m/s: the search allows for it and for growth by [`FASTER`] a tick, until
/// it reaches the free motion: 3 ticks to 0.1 m/s, which 10 N give 0.1 kg in one.
const START_M_PER_S: f32 = 0.02;
/// See [`START_M_PER_S`].
const FASTER: f32 = 2.0;

/// Moves the held object by one period and returns the wrench that the handle must render.
///
/// Order: input check; coupling and energy balance; force terms; step without contacts, which bounds how far anything can move; contact search within
/// that bound; step with contacts; motion; reaction; limits.
///
/// **Contract.** Called every [`Settings::period_s`]. Work is bounded: [`crate::ContactSettings::point_budget`] field queries, 256 contacts, 8
/// solves with contacts. Beyond a bound the tick degrades in the order stated in the flag's documentation and reports it in [`Work::flags`]; it never
/// panics and never returns a wrench above [`crate::LimitSettings`] or one that is not finite. A bad input or a failed step gives a zero wrench and
/// leaves the object where it was. `scene` must be the one given to [`State::load_scene`]; with another one the result is safe but meaningless.
///
/// **Cost**, counted on an emulated Cortex-M7 (QEMU `mps2-an500`, `-icount`) on 2026-11-29, thesis pair with 20 µm clearance baked at 0.5 mm cells
/// with a pointshell of 25 µm: at most 65,480 instructions pressed to the wall with 5 N and slid at 10 mm/s, 15,440 in free motion; with a
/// pointshell of 5 µm 65,780 and 15,440. A peg of 0.7 m with 0.2 mm clearance and a shell of 50 µm, pressed in the same way and slid at 20 mm/s,
/// takes 113,200 (`mortise-lab figures contact --quick`). Into a fit of 0.02 mm: 93,140 guided and by collision alone; 79,940 with four
/// different targets (`mortise-lab figures constraints --quick`).
pub fn tick(state: &mut State, scene: &SceneImage<'_>, settings: &Settings, input: &Input) -> Output {
    let mut work = Work::default();
    let hand = &mut state.hand;
    let Some(handle) = usable_pose(&input.handle).filter(|_| usable_twist(&input.handle_twist)) else {
        return hand.stopped(work, Flags::BAD_INPUT);
    };
    let held = hand.grabbed.filter(|g| usize::from(g.part) < scene.parts().len());
    let Some(grabbed) = held else {
        let mut out = hand.at_rest(work);
        out.handle = hand.limited(Wrench::ZERO, input, settings, &mut out.work.flags);
        return out;
    };
    let given = Given {
        scene,
        parts: &state.parts,
        resolution: state.resolution,
        settings,
    };
    let coupled = couple(hand, grabbed, handle, input, settings);
    work.flags.insert_if(coupled.open < 1.0, Flags::SOFTENED);
    let Some(moved) = move_object(hand, &given, &coupled, &mut work) else {
        return hand.stopped(work, Flags::NON_FINITE);
    };
    let out = react(hand, &given, &coupled, moved, input, work);
    state.settle();
    out
}

/// The object and its coupling to the handle.
struct Coupled {
    grabbed: Grabbed,
    coupling: Coupling,
    /// What the valve lets through, 0 to 1.
    open: f32,
    /// Energy of the object's translation, J.
    moving_j: f32,
}

/// Measures the coupling and balances the energy at the handle.
fn couple(hand: &mut Hand, grabbed: Grabbed, handle: Pose, input: &Input, settings: &Settings) -> Coupled {
    let limits = hand.slipping.then_some(&settings.coupling);
    let (grabbed, mut coupling) = take_hold(grabbed, handle, input.handle_twist, limits);
    let moving_j = grabbed.moving_energy(settings.object.mass_kg);
    let tank = &mut hand.tank;
    let open = if input.enabled {
        tank.measure(&mut coupling, handle.orientation);
        let last = hand.previous_wrench;
        let open = tank.balance(handle, input.handle_twist, &coupling, last, moving_j, settings);
        let unguided = hand.targets.is_empty() && hand.energy.engagement() == 0.0;
        let hold = match (unguided, hand.contact.pushing) {
            (false, _) => Hold::Targets,
            (true, 0) => Hold::Nothing,
            (true, _) => Hold::Contacts,
        };
        tank.slip_to_bound(&mut coupling, handle.orientation, hold, settings);
        open
    } else {
        tank.forget();
        1.0
    };
    Coupled {
        grabbed,
        coupling,
        open,
        moving_j,
    }
}

/// The object after the step.
struct Moved {
    grabbed: Grabbed,
    /// Of all contacts on the object, at its centre of mass.
    contact: Wrench,
    guidance: GuidanceState,
}

/// The implicit step of the held part from where it is.
fn step_of(grabbed: &Grabbed, settings: &Settings) -> Step {
    let (gyration2, length) = (grabbed.body).gyration2_in_world(grabbed.orientation, &settings.object);
    Step {
        period_s: settings.period_s,
        mass_kg: settings.object.mass_kg,
        gyration2,
        length,
        twist: grabbed.twist,
    }
}

/// Moves the object by one step under coupling, constraints and contact. `None` when the step is not finite.
fn move_object(hand: &mut Hand, given: &Given<'_, '_>, coupled: &Coupled, work: &mut Work) -> Option<Moved> {
    let settings = given.settings;
    let (mut grabbed, coupling) = (coupled.grabbed, &coupled.coupling);
    let step = step_of(&grabbed, settings);
    let (period_s, length) = (step.period_s, step.length);

    hand.targets.step(&settings.guidance);
    let situation = situation(given, &grabbed, length);
    let mut springs = Vec::new();
    hand.targets.add_springs(&situation, &mut springs);
    let turning_j = grabbed.turning_energy(step.mass_kg, step.gyration2);
    hand.tank
        .keep(coupled.moving_j + turning_j, settings.passivity.initial_budget_j);
    let energy = energy_force(&mut hand.energy, given, &grabbed, &step, hand.contact.busy);
    let guided = (TargetForce::new(&springs, period_s, length), energy);
    let coupled_force = CouplingForce::new(coupling, &settings.coupling, period_s, length);
    let constrained = (coupled_force, guided);
    let terms = &mut (constrained, Friction::new(&settings.friction, period_s, length));

    let (free, reach) = free_motion(given, &grabbed, &step, terms);
    if (hand.targets).exclude(&situation, &springs, &reach.motions, given.slack()) {
        hand.contact.coherence.end_exclusions();
    }
    let rules = TargetRules {
        targets: &hand.targets,
        settings: &settings.guidance,
    };
    let constraints = Constraints {
        rules: &rules,
        guided_share: hand.targets.share(&situation),
        springs: springs.len(),
        energies: hand.energy.cost(),
    };
    let motion = (&step, terms, &free);
    let solution = contact_step(
        given,
        &mut hand.contact,
        &grabbed,
        motion,
        &reach,
        &constraints,
        work,
    );

    let mut twist = solution.twist;
    // Nothing beyond the margin was evaluated, so nothing may move farther.
    let fastest = smaller(reach.margin / period_s, given.fastest());
    let slowed = slow_down(&mut twist, grabbed.body.reach, fastest);
    work.flags.insert_if(reach.slowed || slowed, Flags::SPEED_LIMIT);
    grabbed.advance(twist, period_s);
    let finite = grabbed.twist.is_finite() && grabbed.pose().is_finite() && solution.contact.is_finite();
    finite.then(|| Moved {
        grabbed,
        contact: solution.contact,
        guidance: guidance(hand, &springs, energy, &step.scale(twist), &step),
    })
}

/// Force of the scene's geometric energies in this tick.
fn energy_force(
    energy: &mut GeometricEnergy,
    given: &Given<'_, '_>,
    grabbed: &Grabbed,
    step: &Step,
    busy: bool,
) -> Option<EnergyForce> {
    let situation = EnergySituation {
        scene: given.scene,
        parts: given.parts,
        grabbed,
        period_s: step.period_s,
        length: step.length,
        busy,
    };
    energy.step(&situation, &given.settings.guidance)
}

/// What guides, for telemetry: targets and geometric energies together, once the twist `x` has acted.
fn guidance(
    hand: &Hand,
    springs: &[SaturatingSpring],
    energy: Option<EnergyForce>,
    x: &[f32; 6],
    step: &Step,
) -> GuidanceState {
    let mut state = hand.targets.state(springs, x, step.length);
    if let Some(energy) = energy {
        state.wrench = state.wrench + energy.wrench(x, step.period_s);
        state.engagement = larger(state.engagement, hand.energy.engagement());
    }
    state
}

/// Situation of the constraints at the tick's start.
fn situation<'a, 'i>(given: &Given<'a, 'i>, grabbed: &Grabbed, length: f32) -> Situation<'a, 'i> {
    Situation {
        scene: given.scene,
        parts: given.parts,
        held: grabbed.part,
        object: grabbed.pose(),
        center: grabbed.center,
        length,
        period_s: given.settings.period_s,
        settings: &given.settings.guidance,
        coupling_stiffness: given.settings.coupling.k_t_n_per_m,
    }
}

/// The step without contacts, and how far anything can move in this tick.
fn free_motion(
    given: &Given<'_, '_>,
    grabbed: &Grabbed,
    step: &Step,
    terms: &mut impl ForceTerm,
) -> (Solution, Reach) {
    let settings = given.settings;
    let mut free = match settings.integrator {
        Integrator::Implicit => step.free(terms),
        Integrator::Explicit => explicit::free(step, terms),
    };
    let reach = grabbed.body.reach;
    let slowed = slow_down(&mut free.twist, reach, given.fastest());
    // The free motion, or less: a part that leans on something stays there, so its search need not reach as far as if it were let go.
    let likely = FASTER * point_speed(grabbed.twist, reach) + START_M_PER_S;
    let margin = settings.contact.margin_m
        + given.braking_margin()
        + settings.period_s * smaller(likely, point_speed(free.twist, reach));
    let motions = [grabbed.twist, free.twist].map(|t| step.scale(t).map(|x| x * settings.period_s));
    (
        free,
        Reach {
            margin,
            motions,
            slowed,
        },
    )
}

/// The wrench on the handle, and what is reported of the tick.
fn react(
    hand: &mut Hand,
    given: &Given<'_, '_>,
    coupled: &Coupled,
    moved: Moved,
    input: &Input,
    mut work: Work,
) -> Output {
    let settings = given.settings;
    let period_s = settings.period_s;
    let grabbed = moved.grabbed;
    let pull = (coupled.coupling).pull(&settings.coupling, period_s, grabbed.twist);
    let pull = slipping(pull, &settings.coupling, &mut work.flags);
    hand.tank.pulled(pull, grabbed.twist, period_s);
    let felt = Wrench {
        force: pull.force * coupled.open,
        torque: pull.torque * coupled.open,
    };
    let wanted = coupled.coupling.reaction(felt);
    let contacts = hand.contact.contacts.as_slice();
    let guided = (contacts.iter())
        .filter(|c| c.guided && c.phase != Phase::Free)
        .map(|c| c.arm);
    hand.targets.observe(guided, given.parts);
    let scenery = Scenery {
        scene: given.scene,
        parts: given.parts,
        held: grabbed.part,
        object: grabbed.pose(),
        center: grabbed.center,
        period_s,
    };
    // Filled in place: what it holds is large.
    let mut out = Output {
        handle: Wrench::ZERO,
        contact: moved.contact,
        object: grabbed.pose(),
        object_twist: grabbed.twist,
        pairs: Vec::new(),
        guidance: moved.guidance,
        work: Work::default(),
    };
    touching_faces(contacts, &scenery, &mut out.pairs);
    (hand.contact.coherence).travelled(period_s * point_speed(grabbed.twist, grabbed.body.reach));
    hand.grabbed = Some(grabbed);
    out.handle = hand.limited(wanted, input, settings, &mut work.flags);
    out.work = work;
    out
}
