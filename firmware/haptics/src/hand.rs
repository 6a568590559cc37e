//! State of one hand: the part it holds, and what carries over from tick to tick while it holds it.

use mortise_protocol::image::Field;

use crate::collision::coherence::Coherence;
use crate::collision::contact::Contacts;
use crate::collision::decimation::Decimation;
use crate::collision::node_cursor::NodeCursor;
use crate::constraints::geometric_energy::GeometricEnergy;
use crate::constraints::targets::TargetSet;
use crate::dynamics::body::Grabbed;
use crate::dynamics::limits::limit;
use crate::io::{FacePairs, Flags, GuidanceState, Input, Output, Work};
use crate::math::pose::{Pose, Twist, Wrench};
use crate::passivity::tank::EnergyTank;
use crate::settings::Settings;

/// Speed at which shrunk points return outward when shrinking falls, m/s.
const EXPANSION_M_PER_S: f32 = 0.01;

/// State of one hand.
#[derive(Clone, Debug)]
pub(crate) struct Hand {
    pub grabbed: Option<Grabbed>,
    /// Whether the coupling slips permanently where it saturates ([`crate::State::set_slipping`]).
    pub slipping: bool,
    /// Placement of the part last held.
    pub last_object: Option<Pose>,
    /// Handle wrench of the last tick, for the slew limit.
    pub previous_wrench: Wrench,
    /// Energy account of the coupling.
    pub tank: EnergyTank,
    /// Constraint targets.
    pub targets: TargetSet,
    /// Geometric energies.
    pub energy: GeometricEnergy,
    pub contact: ContactMemory,
}

/// Memory of the contact search and the step for the next tick.
#[derive(Clone, Debug)]
pub(crate) struct ContactMemory {
    /// Number of touching points, which divides the total contact stiffness; rises at once and falls by a twentieth a tick.
    pub sharing: f32,
    /// Where the search resumes after a tick whose budget ran out, else the beginning.
    pub resume: NodeCursor,
    /// The last tick needed half of the work budget or more.
    pub busy: bool,
    /// Decimation of points while the work exceeds the budget.
    pub decimation: Decimation,
    /// Number of contacts that pushed in the last tick.
    pub pushing: u16,
    /// How far points of the held part are moved inward before voxmaps are queried, m.
    pub shrunk_m: f32,
    /// Advancement bounds of tree nodes.
    pub coherence: Coherence,
    /// Contacts of this tick and the last; kept here because a board's stack is small.
    pub contacts: Contacts,
}

impl Hand {
    /// Holds nothing.
    pub const fn new() -> Self {
        Self {
            grabbed: None,
            slipping: false,
            last_object: None,
            previous_wrench: Wrench::ZERO,
            tank: EnergyTank::new(),
            targets: TargetSet::new(),
            energy: GeometricEnergy::new(),
            contact: ContactMemory::new(),
        }
    }

    /// Resets everything that belongs to the part held so far.
    pub fn invalidate(&mut self) {
        self.tank.forget();
        self.targets.clear_all();
        self.energy.clear();
        self.contact.invalidate();
    }

    /// `wanted` within all limits; stored for the slew limit.
    pub fn limited(
        &mut self,
        wanted: Wrench,
        input: &Input,
        settings: &Settings,
        flags: &mut Flags,
    ) -> Wrench {
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

    /// Output of a tick without motion and forces.
    pub fn at_rest(&mut self, work: Work) -> Output {
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

    /// As [`Self::at_rest`], for a tick that cannot be computed for the reason in `flag`: the object stops where it is.
    pub fn stopped(&mut self, mut work: Work, flag: Flags) -> Output {
        work.flags.insert(flag);
        if let Some(g) = &mut self.grabbed {
            g.twist = Twist::ZERO;
        }
        self.at_rest(work)
    }
}

impl ContactMemory {
    const fn new() -> Self {
        Self {
            sharing: 0.0,
            resume: NodeCursor::FIRST,
            busy: false,
            decimation: Decimation::NEW,
            pushing: 0,
            shrunk_m: 0.0,
            coherence: Coherence::new(),
            contacts: Contacts::new(),
        }
    }

    fn invalidate(&mut self) {
        self.sharing = 0.0;
        self.resume = NodeCursor::FIRST;
        self.busy = false;
        self.decimation = Decimation::NEW;
        self.pushing = 0;
        self.contacts.clear();
        self.coherence.invalidate();
    }

    /// Distance by which points of the held part, of this field, are moved inward in this tick, m.
    pub fn shrink(&mut self, settings: &Settings, field: &Field<'_>) -> f32 {
        let wanted = settings.contact.shrunk_m(field);
        let lowest = self.shrunk_m - EXPANSION_M_PER_S * settings.period_s;
        let now = if wanted > lowest { wanted } else { lowest };
        let moved = now - self.shrunk_m;
        if moved != 0.0 {
            // Advancement bounds assume points at rest in their part. Each call counts as a round.
            self.coherence.travelled(if moved < 0.0 { -moved } else { moved });
        }
        self.shrunk_m = now;
        now
    }
}
