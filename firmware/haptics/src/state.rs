//! What the force law remembers from tick to tick.

use core::fmt;

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{Field, PART_GRABBABLE, SceneImage, Shape};
use mortise_protocol::limits::MAX_PARTS;
use mortise_protocol::message::ConstraintTarget;

use crate::collision::coherence::Coherence;
use crate::collision::contact::Contacts;
use crate::collision::decimation::Decimation;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::placement::Placed;
use crate::constraints::targets::{TargetError, TargetSet};
use crate::dynamics::body::{Body, Grabbed};
use crate::math::pose::{Pose, Twist, Wrench, usable_pose};
use crate::passivity::tank::{EnergyTank, Passivity};
use crate::settings::Settings;

/// Speed at which points come out again when shrinking falls, m/s.
const COMES_OUT_M_PER_S: f32 = 0.01;

/// Placements, the grabbed object, and what carries over. About 112 KiB; lives in a static on a board.
#[derive(Clone, Debug)]
pub struct State {
    /// Every part's placement.
    pub(crate) parts: Vec<Placed, MAX_PARTS>,
    pub(crate) grabbed: Option<Grabbed>,
    /// What the coupling cannot hold slips in the hand for good.
    pub(crate) slipping: bool,
    /// Where the part last held stood.
    pub(crate) last_object: Option<Pose>,
    /// Handle wrench of the last tick, for the slew limit.
    pub(crate) previous_wrench: Wrench,
    /// Energy account of the coupling.
    pub(crate) tank: EnergyTank,
    /// Points touching, rising at once and falling by a twentieth a tick: divides the total contact stiffness.
    pub(crate) sharing: f32,
    /// Where to go on after a tick whose budget ran out, else the beginning.
    pub(crate) resume: NodeCursor,
    /// The last tick needed half the look-up budget or more.
    pub(crate) busy: bool,
    /// What is left out while there is too much to look at.
    pub(crate) decimation: Decimation,
    /// Contacts that pushed in the last tick.
    pub(crate) pushing: u16,
    /// Smallest cell of any field in the scene, m; 0 without parts.
    pub(crate) finest_cell_m: f32,
    /// Smallest voxel of any voxmap in the scene, m; 0 when there is none.
    pub(crate) finest_voxel_m: f32,
    /// How far points of the held part are moved inward before voxmaps are asked, m.
    pub(crate) shrunk_m: f32,
    /// Constraint targets.
    pub(crate) targets: TargetSet,
    /// Nodes that need not be looked at yet.
    pub(crate) coherence: Coherence,
    /// Scratch of one tick; kept here because a board's stack is small.
    pub(crate) contacts: Contacts,
}

/// Why a part could not be grabbed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GrabError {
    /// The scene has no part of this index.
    NoSuchPart {
        /// Asked for.
        part: u16,
        /// Parts there are.
        parts: u16,
    },
    /// The part is fixed.
    Fixed {
        /// Asked for.
        part: u16,
    },
    /// Another part is in hand: release it first.
    Busy {
        /// The one in hand.
        part: u16,
    },
    /// The handle's pose is not usable.
    BadHandle,
}

impl fmt::Display for GrabError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSuchPart { part, parts } => write!(f, "no part {part}: the scene has {parts}"),
            Self::Fixed { part } => write!(f, "part {part} is fixed: choose one that may be moved"),
            Self::Busy { part } => write!(f, "part {part} is in hand: release it first"),
            Self::BadHandle => write!(f, "the handle's pose is not known: check the encoders"),
        }
    }
}

impl core::error::Error for GrabError {}

impl Default for State {
    fn default() -> Self {
        Self::new()
    }
}

impl State {
    /// No scene, nothing grabbed. Every bit of it is zero, so that a static lies in `.bss` and takes no flash; make it there, it is too large for
    /// a board's stack.
    pub const fn new() -> Self {
        Self {
            parts: Vec::new(),
            grabbed: None,
            slipping: false,
            last_object: None,
            previous_wrench: Wrench::ZERO,
            tank: EnergyTank::new(),
            sharing: 0.0,
            resume: NodeCursor::FIRST,
            busy: false,
            decimation: Decimation::NEW,
            pushing: 0,
            finest_cell_m: 0.0,
            finest_voxel_m: 0.0,
            shrunk_m: 0.0,
            targets: TargetSet::new(),
            coherence: Coherence::new(),
            contacts: Contacts::new(),
        }
    }

    /// Takes over a scene's placements; whatever was grabbed is let go. Parts beyond [`MAX_PARTS`] are left out.
    ///
    /// Cost grows with the number of parts; not for the tick.
    pub fn load_scene(&mut self, scene: &SceneImage<'_>) {
        self.release();
        self.last_object = None;
        self.parts.clear();
        (self.finest_cell_m, self.finest_voxel_m, self.shrunk_m) = (0.0, 0.0, 0.0);
        for (index, record) in scene.parts().iter().enumerate().take(MAX_PARTS) {
            let Shape {
                record: shape, field, ..
            } = scene.shape_of_part(index);
            let cell = field.record().cell;
            self.finest_cell_m = finer(self.finest_cell_m, cell);
            if field.is_occupancy() {
                self.finest_voxel_m = finer(self.finest_voxel_m, cell);
            }
            let pose = Pose::from_arrays(record.position, record.orientation);
            let local_center = Vec3::from_array(shape.center);
            // The loop is no longer than the vector.
            let _ = self.parts.push(Placed {
                pose,
                center: pose.transform_point(local_center),
                radius: shape.radius,
                local_center,
            });
        }
    }

    /// Takes part `part` in hand where it stands: the offset between handle and part is kept, so no force arises.
    pub fn grab(&mut self, scene: &SceneImage<'_>, part: u16, handle: &Pose) -> Result<(), GrabError> {
        if let Some(grabbed) = &self.grabbed {
            return Err(GrabError::Busy { part: grabbed.part });
        }
        let parts = self.parts.len().min(scene.parts().len());
        let no_such_part = GrabError::NoSuchPart {
            part,
            parts: parts as u16,
        };
        let index = usize::from(part);
        if index >= parts {
            return Err(no_such_part);
        }
        let placed = *self.parts.get(index).ok_or(no_such_part)?;
        if scene.parts()[index].flags & PART_GRABBABLE == 0 {
            return Err(GrabError::Fixed { part });
        }
        let handle = usable_pose(handle).ok_or(GrabError::BadHandle)?;
        let body = Body::of(&scene.shape_of_part(index));
        self.grabbed = Some(Grabbed {
            part,
            offset: handle.inverse().compose(placed.pose),
            center: placed.pose.transform_point(body.center_of_mass),
            orientation: placed.pose.orientation,
            twist: Twist::ZERO,
            angle: Vec3::ZERO,
            age: 0,
            body,
        });
        self.last_object = Some(placed.pose);
        self.forget_contacts();
        Ok(())
    }

    /// Lets go: the part stays where it is. The handle's force falls to zero within the slew limit.
    pub fn release(&mut self) {
        self.grabbed = None;
        self.forget_contacts();
    }

    /// Index of the part in hand.
    pub fn grabbed(&self) -> Option<u16> {
        self.grabbed.as_ref().map(|g| g.part)
    }

    /// Guides the part in hand towards `target` from the next tick on; a target of the same id is refreshed or replaced, one older than that does
    /// nothing. Grabbing and releasing end all guidance.
    ///
    /// # Errors
    /// [`TargetError`]; nothing changed.
    pub fn set_target(&mut self, target: &ConstraintTarget) -> Result<(), TargetError> {
        self.targets.set(target, self.parts.len(), self.grabbed())
    }

    /// Lets the target of this id fade; none of it is no error.
    pub fn clear_target(&mut self, id: u16) {
        self.targets.clear(id);
    }

    /// Number of placed parts.
    pub fn part_count(&self) -> usize {
        self.parts.len()
    }

    /// Where part `part` stands (shape frame in the world).
    pub fn placement(&self, part: u16) -> Option<Pose> {
        self.parts.get(usize::from(part)).map(|p| p.pose)
    }

    /// The part in hand: placement, and twist at its centre of mass.
    pub fn object(&self) -> Option<(Pose, Twist)> {
        self.grabbed.as_ref().map(|g| (g.pose(), g.twist))
    }

    /// World position of the held part's centre of mass, m.
    pub fn object_center(&self) -> Option<Vec3> {
        self.grabbed.as_ref().map(|g| g.center)
    }

    /// How passive the coupling is.
    pub fn passivity(&self) -> Passivity {
        self.tank.seen
    }

    /// How far the part has slipped in the hand because guidance's pull was not paid for: stretch (m) and angle (rad) of the coupling, handle's axes.
    /// Zero without targets.
    pub fn slip(&self) -> Twist {
        self.tank.slip()
    }

    /// Whether the part slips in the hand for good where the coupling would have to pull harder than it may, instead of being pulled back with all it
    /// may.
    ///
    /// For as long as a grip is still being made firm ([`crate::CouplingSettings::force_max_n`] raised from tick to tick): a coupling that is
    /// stretched farther than it can hold would gain d·ΔF with each step of its limit, energy that nobody put in; one that has slipped stores no more
    /// than it can give back.
    pub fn set_slipping(&mut self, slipping: bool) {
        self.slipping = slipping;
    }

    /// Forgets the last handle wrench, so that the next one builds up from zero under the slew limit.
    pub fn restart_slew(&mut self) {
        self.previous_wrench = Wrench::ZERO;
    }

    /// Has the next tick look at everything, as after a jump. Coherence changes the work, never the result; this is for showing so.
    pub fn invalidate_coherence(&mut self) {
        self.coherence.invalidate();
    }

    fn forget_contacts(&mut self) {
        self.sharing = 0.0;
        self.resume = NodeCursor::FIRST;
        self.busy = false;
        self.decimation = Decimation::NEW;
        self.pushing = 0;
        self.tank.forget();
        self.targets.forget();
        self.contacts.clear();
        self.coherence.invalidate();
    }

    /// How far points of the held part, of this field, are moved inward in this tick, m.
    pub(crate) fn shrink(&mut self, settings: &Settings, field: &Field<'_>) -> f32 {
        let wanted = settings.contact.shrunk_m(field);
        let least = self.shrunk_m - COMES_OUT_M_PER_S * settings.period_s;
        let now = if wanted > least { wanted } else { least };
        let moved = now - self.shrunk_m;
        if moved != 0.0 {
            // What is known of distances counts on points staying where they are in their part. Each call is a round of its own.
            self.coherence.travelled(if moved < 0.0 { -moved } else { moved });
        }
        self.shrunk_m = now;
        now
    }

    /// Writes the held part's placement back to the list of parts.
    pub(crate) fn settle(&mut self) {
        if let Some(g) = &self.grabbed {
            let pose = g.pose();
            self.last_object = Some(pose);
            if let Some(placed) = self.parts.get_mut(usize::from(g.part)) {
                placed.pose = pose;
                placed.center = pose.transform_point(placed.local_center);
            }
        }
    }
}

/// The smaller of a size found so far (0: none) and another.
fn finer(known: f32, cell: f32) -> f32 {
    if known > 0.0 && known < cell { known } else { cell }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The smallest board has 512 KiB of RAM.
    #[test]
    fn fits_a_board() {
        assert!(size_of::<State>() <= 126 * 1024, "{}", size_of::<State>());
    }
}
