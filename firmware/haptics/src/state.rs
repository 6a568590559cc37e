//! State of the force law, kept from tick to tick.

use core::fmt;

use glam::Vec3;
use heapless::Vec;
use mortise_protocol::image::{PART_GRABBABLE, SceneImage, Shape};
use mortise_protocol::limits::MAX_PARTS;
use mortise_protocol::message::ConstraintTarget;

use crate::collision::placement::Placed;
use crate::constraints::targets::TargetError;
use crate::dynamics::body::{Body, Grabbed};
use crate::hand::Hand;
use crate::math::pose::{Pose, Twist, Wrench, usable_pose};
use crate::passivity::tank::Passivity;

/// Placements, the grabbed object, and everything that carries over. About 162 KiB; lives in a static on a board.
#[derive(Clone, Debug)]
pub struct State {
    /// Every part's placement.
    pub(crate) parts: Vec<Placed, MAX_PARTS>,
    pub(crate) resolution: Resolution,
    pub(crate) hand: Hand,
}

/// Finest cells in a scene: the textbook's methods move at most half a cell in a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Resolution {
    /// Smallest cell of any field, m; 0 without parts.
    pub cell_m: f32,
    /// Smallest voxel of any voxmap, m; 0 when there is none.
    pub voxel_m: f32,
}

impl Resolution {
    const NONE: Self = Self {
        cell_m: 0.0,
        voxel_m: 0.0,
    };
}

/// Why a part could not be grabbed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GrabError {
    /// The scene has no part of this index.
    NoSuchPart {
        /// The part requested.
        part: u16,
        /// Number of parts in the scene.
        parts: u16,
    },
    /// The part is fixed.
    Fixed {
        /// The part requested.
        part: u16,
    },
    /// Another part is held: release it first.
    Busy {
        /// The held part.
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

/// Why a part could not be placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaceError {
    /// The scene has no part of this index.
    NoSuchPart {
        /// Number of parts in the scene.
        parts: u16,
    },
    /// It is in hand.
    Held,
    /// The pose is not finite, farther than 100 m from the origin along an axis, or no rotation.
    BadPose,
}

impl Default for State {
    fn default() -> Self {
        Self::new()
    }
}

impl State {
    /// No scene, nothing grabbed. All bits zero, so that a static lies in `.bss` and takes no flash. Construct it in place: it is too large for a
    /// board's stack.
    pub const fn new() -> Self {
        Self {
            parts: Vec::new(),
            resolution: Resolution::NONE,
            hand: Hand::new(),
        }
    }

    /// Loads a scene's placements; a grabbed part is released. Parts beyond [`MAX_PARTS`] are ignored.
    ///
    /// Cost grows with the number of parts; not for the tick.
    pub fn load_scene(&mut self, scene: &SceneImage<'_>) {
        self.release();
        self.hand.last_object = None;
        self.parts.clear();
        self.resolution = Resolution::NONE;
        self.hand.contact.shrunk_m = 0.0;
        for (index, record) in scene.parts().iter().enumerate().take(MAX_PARTS) {
            let Shape {
                record: shape, field, ..
            } = scene.shape_of_part(index);
            let cell = field.record().cell;
            self.resolution.cell_m = finer(self.resolution.cell_m, cell);
            if field.is_occupancy() {
                self.resolution.voxel_m = finer(self.resolution.voxel_m, cell);
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

    /// Puts part `part`, which nobody holds, at a pose. A part placed into others is pushed out once it is grabbed, like any that overlaps.
    ///
    /// # Errors
    /// [`PlaceError`]; nothing changed.
    pub fn place(&mut self, part: u16, pose: &Pose) -> Result<(), PlaceError> {
        if self.grabbed() == Some(part) {
            return Err(PlaceError::Held);
        }
        let parts = self.parts.len() as u16;
        let placed = (self.parts.get_mut(usize::from(part))).ok_or(PlaceError::NoSuchPart { parts })?;
        let pose = usable_pose(pose).ok_or(PlaceError::BadPose)?;
        placed.pose = pose;
        placed.center = pose.transform_point(placed.local_center);
        self.invalidate_coherence();
        Ok(())
    }

    /// Grabs part `part` at its placement: the offset between handle and part is kept, so no force arises.
    pub fn grab(&mut self, scene: &SceneImage<'_>, part: u16, handle: &Pose) -> Result<(), GrabError> {
        if let Some(grabbed) = &self.hand.grabbed {
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
        self.hand.grabbed = Some(Grabbed {
            part,
            offset: handle.inverse().compose(placed.pose),
            center: placed.pose.transform_point(body.center_of_mass),
            orientation: placed.pose.orientation,
            twist: Twist::ZERO,
            angle: Vec3::ZERO,
            age: 0,
            body,
        });
        self.hand.last_object = Some(placed.pose);
        self.hand.invalidate();
        Ok(())
    }

    /// Releases the part, which stays at its placement. The handle's force falls to zero within the slew limit.
    pub fn release(&mut self) {
        self.hand.grabbed = None;
        self.hand.invalidate();
    }

    /// Index of the held part.
    pub fn grabbed(&self) -> Option<u16> {
        self.hand.grabbed.as_ref().map(|g| g.part)
    }

    /// Guides the held part towards `target` from the next tick on. A target with the same id is refreshed or replaced; an older one is ignored.
    /// Grabbing and releasing end all guidance.
    ///
    /// # Errors
    /// [`TargetError`]; nothing changed.
    pub fn set_target(&mut self, target: &ConstraintTarget) -> Result<(), TargetError> {
        self.hand.targets.set(target, self.parts.len(), self.grabbed())
    }

    /// Lets the target with this id fade. Unknown ids are ignored.
    pub fn clear_target(&mut self, id: u16) {
        self.hand.targets.clear(id);
    }

    /// Number of placed parts.
    pub fn part_count(&self) -> usize {
        self.parts.len()
    }

    /// Placement of part `part` (shape frame in the world).
    pub fn placement(&self, part: u16) -> Option<Pose> {
        self.parts.get(usize::from(part)).map(|p| p.pose)
    }

    /// The held part: placement, and twist at its centre of mass.
    pub fn object(&self) -> Option<(Pose, Twist)> {
        self.hand.grabbed.as_ref().map(|g| (g.pose(), g.twist))
    }

    /// World position of the held part's centre of mass, m.
    pub fn object_center(&self) -> Option<Vec3> {
        self.hand.grabbed.as_ref().map(|g| g.center)
    }

    /// Energy state of the coupling.
    pub fn passivity(&self) -> Passivity {
        self.hand.tank.status
    }

    /// Slip of the coupling, by which guidance is kept from delivering net energy to the operator: stretch (m) and angle (rad) of the coupling,
    /// handle's axes. Zero without targets.
    pub fn slip(&self) -> Twist {
        self.hand.tank.slip()
    }

    /// Sets whether the coupling slips permanently where it saturates, instead of pulling the part back with its largest force.
    ///
    /// For the time after a grab in which the coupling's limit rises from tick to tick ([`crate::CouplingSettings::force_max_n`]): a coupling
    /// stretched farther than it can hold would gain d·ΔF with each step of its limit, energy unaccounted for; one that has slipped stores no more
    /// than it can return.
    pub fn set_slipping(&mut self, slipping: bool) {
        self.hand.slipping = slipping;
    }

    /// Resets the last handle wrench, so that the next one builds up from zero under the slew limit.
    pub fn restart_slew(&mut self) {
        self.hand.previous_wrench = Wrench::ZERO;
    }

    /// Voids all advancement bounds, so that the next tick queries everything, as after a jump. Coherence changes the work, never the result; tests
    /// use this to show it.
    pub fn invalidate_coherence(&mut self) {
        self.hand.contact.coherence.invalidate();
    }

    /// Writes the held part's placement back to the list of parts.
    pub(crate) fn settle(&mut self) {
        if let Some(g) = &self.hand.grabbed {
            let pose = g.pose();
            self.hand.last_object = Some(pose);
            if let Some(placed) = self.parts.get_mut(usize::from(g.part)) {
                placed.pose = pose;
                placed.center = pose.transform_point(placed.local_center);
            }
        }
    }
}

/// The smaller of the size found so far (0: none) and another.
fn finer(known: f32, cell: f32) -> f32 {
    if known > 0.0 && known < cell { known } else { cell }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The smallest board has 512 KiB of RAM.
    #[test]
    fn fits_a_board() {
        assert!(size_of::<State>() <= 162 * 1024, "{}", size_of::<State>());
    }
}
