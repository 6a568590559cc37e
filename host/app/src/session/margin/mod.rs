//! Stability margin of the virtual coupling on the rig in use: which stiffness and damping its loop bears by theory, and how far the setting is from
//! there. Pure.
//!
//! [`handle`] finds the worst axis of the rig's handle, [`sampled_loop`] has the theory, [`limits`] the limits over the range that the board takes,
//! [`words`] says them.

pub mod handle;
pub mod limits;
pub mod sampled_loop;
pub mod words;

use std::cell::RefCell;
use std::sync::Arc;

use mortise_protocol::parameter::ParameterId;
use mortise_protocol::rig::Rig;

use self::handle::{Handle, HandleAxis, described, simulated};
use self::limits::{Map, Margin};
use self::sampled_loop::Gains;

/// Stiffness and damping in translation and rotation: parameters of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Force along an axis.
    Translation,
    /// Torque about one.
    Rotation,
}

impl Motion {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Translation, Self::Rotation];

    /// Its parameters: stiffness and damping.
    pub const fn parameters(self) -> [ParameterId; 2] {
        match self {
            Self::Translation => [ParameterId::CouplingStiffness, ParameterId::CouplingDamping],
            Self::Rotation => [
                ParameterId::CouplingAngularStiffness,
                ParameterId::CouplingAngularDamping,
            ],
        }
    }

    /// The largest gains that the board takes.
    pub fn most(self) -> Gains {
        let [stiffness, damping] = self.parameters().map(|id| f64::from(id.row().max));
        Gains { stiffness, damping }
    }

    /// The gains among the values of all parameters.
    pub fn gains(self, parameters: &[f32]) -> Gains {
        let [stiffness, damping] = self.parameters().map(|id| f64::from(parameters[id as usize]));
        Gains { stiffness, damping }
    }
}

/// The rig whose limits are shown.
#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    /// The free handle that simulated rigs have without a description.
    Simulated,
    /// A described mechanism, moved by a board with motors or by a simulation.
    Described {
        /// The description.
        rig: Box<Rig>,
        /// Whether a board with motors moves it.
        real: bool,
    },
}

/// One motion of a rig's handle with its limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The motion.
    pub motion: Motion,
    /// The handle.
    pub handle: HandleAxis,
    /// The limits.
    pub map: Map,
}

impl Plane {
    /// How far a setting is from the limits.
    pub fn margin(&self, parameters: &[f32]) -> Margin {
        self.map.margin(self.motion.gains(parameters))
    }
}

/// Limits of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Which rig's, as part of a sentence.
    pub name: String,
    /// Position scale through which the force law has the handle.
    pub scale: f64,
    /// The motions that its motors drive.
    pub planes: Vec<Plane>,
}

impl Limits {
    /// Computes the limits with a position scale; `None` if no posture of a description can be driven.
    pub fn new(subject: &Subject, scale: f64) -> Option<Self> {
        let handle = match subject {
            Subject::Simulated => simulated(),
            Subject::Described { rig, real } => described(rig, *real)?,
        };
        let Handle {
            name,
            translation,
            rotation,
        } = handle.scaled(scale);
        let plane = |(motion, handle): (Motion, HandleAxis)| Plane {
            motion,
            handle,
            map: Map::new(handle.axis, motion.most()),
        };
        let moved = [Some(translation), rotation];
        let driven = Motion::ALL.into_iter().zip(moved);
        Some(Self {
            name,
            scale,
            planes: driven
                .filter_map(|(motion, handle)| Some(plane((motion, handle?))))
                .collect(),
        })
    }
}

/// The limits computed last, kept while rig and position scale are the same: they are drawn many times a second.
#[derive(Default)]
pub struct Kept(RefCell<Option<Known>>);

/// Limits, and what they are the limits of.
struct Known {
    subject: Subject,
    scale: f64,
    limits: Option<Arc<Limits>>,
}

impl Kept {
    /// The limits of a rig with a position scale.
    pub fn of(&self, subject: &Subject, scale: f64) -> Option<Arc<Limits>> {
        let mut kept = self.0.borrow_mut();
        if let Some(known) = kept
            .as_ref()
            .filter(|known| (&known.subject, known.scale) == (subject, scale))
        {
            return known.limits.clone();
        }
        let limits = Limits::new(subject, scale).map(Arc::new);
        *kept = Some(Known {
            subject: subject.clone(),
            scale,
            limits: limits.clone(),
        });
        limits
    }
}
