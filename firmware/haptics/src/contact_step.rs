//! The step with all contacts within reach: search for contacts, solution, and the results that the next tick needs from both.

use glam::Vec3;
use mortise_protocol::image::SceneImage;

use crate::baseline::explicit;
use crate::collision::cost::{LEAST_SOLVES, further_solve_cost, solve_cost, spring_cost};
use crate::collision::decimation::Searched;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::placement::Placed;
use crate::collision::rules::FacePairRules;
use crate::collision::search::Search;
use crate::dynamics::body::Grabbed;
use crate::dynamics::contact_force::{ContactForce, Stiffness};
use crate::dynamics::force::ForceTerm;
use crate::dynamics::step::{MAX_SOLVES, Solution, Step};
use crate::hand::ContactMemory;
use crate::io::{Flags, Work};
use crate::math::scalar::{larger, smaller};
use crate::motion::{point_speed, slow_down};
use crate::settings::{Integrator, Settings};
use crate::state::Resolution;
/// Largest decay per tick of the number of points that share the total stiffness: the stiffness of points still touching then rises slowly, and
/// generates little energy.
const SHARING_DECAY: f32 = 0.95;
/// Diagonal of a cell, in cells.
const DIAGONAL_CELLS: f32 = 1.733;

/// Inputs of a tick, which it does not change.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a, 'i> {
    pub scene: &'a SceneImage<'i>,
    pub parts: &'a [Placed],
    pub resolution: Resolution,
    pub settings: &'a Settings,
}

/// How far the object may move in a tick.
pub(crate) struct Reach {
    /// Distance up to which points are evaluated, and therefore the bound of any point's motion, m.
    pub margin: f32,
    /// The motion so far and the motion without contacts, over one period, scaled as the step's unknowns.
    pub motions: [[f32; 6]; 2],
    /// The free motion was limited to the speed limit.
    pub slowed: bool,
}

/// Effect of the active constraints on contact.
pub(crate) struct Constraints<'a, R> {
    pub rules: &'a R,
    /// Share of the contact stiffness left between guided faces.
    pub guided_share: f32,
    /// Number of saturating springs among the force terms.
    pub springs: usize,
    /// What geometric energies have taken of the tick's budget, field queries.
    pub energies: u32,
}

impl<R> Constraints<'_, R> {
    /// Field queries of the tick: half of the budget at least, however much energies take.
    fn budget(&self, settings: &Settings) -> u32 {
        let whole = settings.contact.point_budget;
        whole - self.energies.min(whole / 2)
    }
}

/// A step, its force terms, and the solution without contacts.
type Motion<'a, T> = (&'a Step, &'a mut T, &'a Solution);

impl Given<'_, '_> {
    /// Speed limit of any point of the object, m/s. The textbook methods look no farther than the next voxel, so half a cell a tick (eq. 5 of Faas
    /// 2010) bounds the explicit step, and half a voxel any step with voxmaps.
    pub fn fastest(&self) -> f32 {
        let cell = match self.settings.integrator {
            Integrator::Implicit => self.resolution.voxel_m,
            Integrator::Explicit => self.resolution.cell_m,
        };
        if cell > 0.0 {
            smaller(
                0.5 * cell / self.settings.period_s,
                self.settings.object.speed_max_m_per_s,
            )
        } else {
            self.settings.object.speed_max_m_per_s
        }
    }

    /// Distance within which points are searched for, m: for the step, or for braking.
    pub fn slack(&self) -> f32 {
        match self.settings.integrator {
            Integrator::Implicit => self.settings.contact.margin_m,
            Integrator::Explicit => larger(self.settings.contact.margin_m, self.resolution.cell_m),
        }
    }

    /// Distance within which points are braked, m; 0 for no braking.
    fn braking_m(&self) -> f32 {
        match self.settings.integrator {
            Integrator::Implicit => 0.0,
            Integrator::Explicit => self.resolution.cell_m,
        }
    }

    /// Distance from contact at which braking begins, m: within a cell of the surface, or in the layer of voxels round it, at most a diagonal away.
    pub fn braking_margin(&self) -> f32 {
        match self.settings.integrator {
            Integrator::Implicit => 0.0,
            Integrator::Explicit => DIAGONAL_CELLS * self.resolution.cell_m,
        }
    }
}

/// The step of the `grabbed` part with the contacts within `reach`.
pub(crate) fn contact_step<T: ForceTerm>(
    given: &Given<'_, '_>,
    memory: &mut ContactMemory,
    grabbed: &Grabbed,
    (step, terms, free): Motion<'_, T>,
    reach: &Reach,
    constraints: &Constraints<'_, impl FacePairRules>,
    work: &mut Work,
) -> Solution {
    let budget = constraints.budget(given.settings);
    let used = search(given, memory, grabbed, (step, free), reach, constraints, work);
    let left = budget.saturating_sub(used);
    // Those carried over are solved for, too.
    let contacts = work.candidates.max(memory.contacts.as_slice().len() as u16);
    let solves = most_solves(left, contacts, constraints.springs);
    let motion = (step, terms, free);
    let solution = solve(given, memory, grabbed, motion, constraints.guided_share, solves);
    memory.pushing = memory.contacts.pushing() as u16;
    work.contacts = memory.pushing;
    work.solves = solution.solves;
    work.flags.insert_if(!solution.settled, Flags::UNSETTLED);
    solution
}

/// Fills the contacts in `memory`; returns the field queries used.
fn search(
    given: &Given<'_, '_>,
    memory: &mut ContactMemory,
    grabbed: &Grabbed,
    (step, free): (&Step, &Solution),
    reach: &Reach,
    constraints: &Constraints<'_, impl FacePairRules>,
    work: &mut Work,
) -> u32 {
    let settings = given.settings;
    let (rules, springs) = (constraints.rules, constraints.springs);
    let budget = constraints.budget(settings);
    let reserved = solve_cost(springs) * u32::from(free.solves + LEAST_SOLVES) + spring_cost(springs);
    let held_shape = given.scene.shape_of_part(usize::from(grabbed.part));
    let shrunk_m = memory.shrink(settings, &held_shape.field);
    let search = Search {
        scene: given.scene,
        parts: given.parts,
        held: grabbed.part,
        held_shape,
        shrunk_m,
        pose: grabbed.pose(),
        center: grabbed.center,
        middle: grabbed
            .pose()
            .transform_point(Vec3::from_array(held_shape.record.center)),
        margin: reach.margin,
        way: settings.period_s * point_speed(grabbed.twist, grabbed.body.reach),
        slack: given.slack(),
        motions: reach.motions,
        swing: reach.margin / (grabbed.body.reach * grabbed.body.reach),
        inverse_length: 1.0 / step.length,
        busy: memory.busy,
        decimation: memory.decimation,
        budget,
        // Reserve at least half of the budget for contact search, however many targets are active.
        reserved: reserved.min(budget / 2),
        carried: if memory.busy { u32::from(memory.pushing) } else { 0 },
        braking_m: given.braking_m(),
        rules,
    };
    let start = memory.resume;
    let (stopped, used) = search.run(start, &mut memory.coherence, &mut memory.contacts, work);
    work.flags.insert_if(search.decimation.level() > 0, Flags::BUDGET);
    memory.resume = stopped.unwrap_or(NodeCursor::FIRST);
    memory.busy = used.all > budget / 2;
    let touching = memory.contacts.as_slice().iter().filter(|c| c.gap < 0.0).count() as u32;
    memory.decimation.update(&Searched {
        start,
        stopped,
        used,
        budget,
        touching,
        lost: memory.contacts.lost(),
    });
    memory.sharing = larger(larger(touching as f32, 1.0), memory.sharing * SHARING_DECAY);
    work.flags.insert_if(memory.contacts.dropped(), Flags::CONTACTS);
    used.all
}

/// The step with the contacts in `memory`, by the integrator in the settings.
fn solve<T: ForceTerm>(
    given: &Given<'_, '_>,
    memory: &mut ContactMemory,
    grabbed: &Grabbed,
    (step, terms, free): Motion<'_, T>,
    guided_share: f32,
    solves: u8,
) -> Solution {
    let contact = &given.settings.contact;
    let farthest = memory.contacts.farthest();
    let contacts = memory.contacts.as_mut_slice();
    match given.settings.integrator {
        Integrator::Explicit => {
            let k = explicit::shared_stiffness(contact, memory.sharing);
            let (reach, fastest) = (grabbed.body.reach, given.fastest());
            explicit::with_contacts(step, terms, contacts, k, given.braking_m(), |mut twist| {
                slow_down(&mut twist, reach, fastest);
                twist
            })
        }
        Integrator::Implicit => {
            let point = contact.shared_stiffness(memory.sharing);
            let k = Stiffness::new(point, guided_share);
            let scale = (farthest, step.length);
            let mut force = ContactForce::new(contacts, k, step.period_s, contact.damping_s, scale);
            step.with_contacts(free, terms, &mut force, solves)
        }
    }
}

/// Largest number of solves with contacts when `left` field queries remain.
fn most_solves(left: u32, contacts: u16, springs: usize) -> u8 {
    let more = left / further_solve_cost(springs, contacts);
    u32::from(LEAST_SOLVES)
        .saturating_add(more)
        .min(u32::from(MAX_SOLVES)) as u8
}
