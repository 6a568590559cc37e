//! Prober: gap of two parts at one pose, and the contact forces there, by the distances that the tick uses but without a motion.
//!
//! For measurement, on a PC as on a board. It traverses the trees and fields of the tick's own search, in both directions, without its budget and
//! without the memory of earlier poses. Forces are those of the contact law at rest, λ = k·depth, k shared as in the tick. With a voxmap the results
//! are its own: depth to its tangent planes, gaps only as bounds, nothing from the analytic faces.

use core::fmt;

use glam::Vec3;
use mortise_protocol::image::{NO_FACE, SceneImage};

use crate::collision::coherence::Coherence;
use crate::collision::contact::{Contacts, Phase};
use crate::collision::directed_pair::DirectedPair;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::rules::NoRules;
use crate::collision::search::Search;
use crate::dynamics::body::Body;
use crate::dynamics::contact_force::{Stiffness, total_force};
use crate::io::{Flags, Work};
use crate::math::pose::{Pose, Wrench, usable_pose};
use crate::probe::convex::{Separation, separation};
use crate::probe::epa::Epa;
use crate::probe::nearest::{Measure, Nearest, NearestSearch, Progress};
use crate::probe::nearest_voxel::nearest_voxel;
use crate::probe::support::Support;
use crate::settings::ContactSettings;

/// Result at one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Point of the smallest gap or largest depth.
    pub nearest: Nearest,
    /// Sum of all contact forces on the moving part, about its centre of mass, axes of the fixed part.
    pub wrench: Wrench,
    /// Number of points that push.
    pub contacts: u16,
    /// Work for gap and contacts together. [`Flags::DEEP`]: some point lies too deep to push; [`Flags::CONTACTS`]: more points touch than the
    /// store holds.
    pub work: Work,
}

/// A point that pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPoint {
    /// Lever arm from the moving part's centre of mass, axes of the fixed part, m.
    pub arm: Vec3,
    /// Unit direction in which the moving part is pushed.
    pub normal: Vec3,
    /// Depth by the field, m, positive.
    pub depth_m: f32,
    /// Face of the moving part.
    pub moving_face: u16,
    /// Face of the fixed part.
    pub fixed_face: u16,
}

/// Why a pose could not be probed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProbeError {
    /// The scene has no part of this index.
    NoSuchPart {
        /// The part requested.
        part: u16,
    },
    /// A part has no distance to itself.
    SamePart,
    /// The pose is not finite, farther than 100 m, or not a rotation.
    BadPose,
}

impl fmt::Display for ProbeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSuchPart { part } => write!(f, "the scene has no part {part}"),
            Self::SamePart => f.write_str("a part has no distance to itself: choose two parts"),
            Self::BadPose => {
                f.write_str("the pose is not finite, farther than 100 m, or not a rotation: correct it")
            }
        }
    }
}

impl core::error::Error for ProbeError {}

/// Memory for one query. About 60 KiB; create it once.
#[derive(Clone, Debug)]
pub struct Prober {
    contacts: Contacts,
    coherence: Coherence,
    epa: Epa,
}

impl Default for Prober {
    fn default() -> Self {
        Self::new()
    }
}

impl Prober {
    /// Empty memory.
    pub const fn new() -> Self {
        Self {
            contacts: Contacts::new(),
            coherence: Coherence::new(),
            epa: Epa::new(),
        }
    }

    /// Gap and contacts of part `moving`, placed at `pose` in the frame of part `fixed`.
    ///
    /// Cost: a field query for every tree node and point that could be nearest or overlaps, in both directions; one or two projections per face for
    /// every point next to an edge or beyond the band that could be nearest. Unbounded by a budget: not for the tick.
    ///
    /// # Errors
    /// [`ProbeError`].
    pub fn probe(
        &mut self,
        scene: &SceneImage<'_>,
        moving: u16,
        fixed: u16,
        pose: &Pose,
        settings: &ContactSettings,
    ) -> Result<Probe, ProbeError> {
        for part in [moving, fixed] {
            if usize::from(part) >= scene.parts().len() {
                return Err(ProbeError::NoSuchPart { part });
            }
        }
        if moving == fixed {
            return Err(ProbeError::SamePart);
        }
        let pose = usable_pose(pose).ok_or(ProbeError::BadPose)?;
        let held = scene.shape_of_part(usize::from(moving));
        let other = scene.shape_of_part(usize::from(fixed));
        let body = Body::of(&held);
        let center = pose.transform_point(body.center_of_mass);
        let pairs = [0, 1].map(|way| DirectedPair::new(way, (&held, pose), (&other, Pose::IDENTITY), center));

        let mut progress = Progress {
            best: Nearest {
                distance_m: f32::INFINITY,
                field_distance_m: f32::INFINITY,
                error_m: f32::INFINITY,
                exact: false,
                measure: Measure::DeepestPoint,
                in_band: false,
                arm: Vec3::ZERO,
                moving_face: NO_FACE,
                fixed_face: NO_FACE,
            },
            work: Work::default(),
        };
        let mut touched = Work::default();
        let shrunk_m = settings.shrunk_m(&held.field);
        let search = Search {
            scene,
            parts: &[],
            held: moving,
            held_shape: scene.shape_of_part(usize::from(moving)),
            shrunk_m,
            pose,
            center,
            margin: 0.0,
            way: 0.0,
            slack: 0.0,
            motions: [[0.0; 6]; 2],
            swing: 0.0,
            inverse_length: 1.0,
            busy: false,
            decimation: 0,
            budget: u32::MAX,
            reserved: 0,
            carried: 0,
            braking_m: 0.0,
            rules: &NoRules,
        };
        let voxmaps = pairs.iter().any(|pair| pair.field.is_occupancy());
        if voxmaps {
            self.coherence.invalidate();
        }
        let mut touching = search.traverse(false, &mut self.coherence, &mut self.contacts, &mut touched);
        let mut searches = [0, 1].map(|way| NearestSearch::new(&pairs[way], [&other, &held][way]));
        for (search, pair) in searches.iter_mut().zip(&pairs) {
            if !pair.field.is_occupancy() {
                search.traverse(&mut progress, &mut touching);
            } else if !pair.unused() {
                nearest_voxel(pair, shrunk_m, &mut progress);
            }
        }
        for search in &mut searches {
            search.finish(&mut progress, &mut touching);
        }
        let Progress {
            best: mut nearest,
            mut work,
        } = progress;
        let supports =
            [(&held, &pose), (&other, &Pose::IDENTITY)].map(|(shape, pose)| Support::new(shape, pose));
        let proven = match &supports {
            [Some(a), Some(b)] if !voxmaps => Some(separation(a, b, &mut self.epa)),
            _ => None,
        };
        if let Some(found) = &proven {
            nearest = found.nearest(&nearest, [(&held, &pose), (&other, &Pose::IDENTITY)], center);
        }
        if voxmaps && (nearest.distance_m < 0.0 || nearest.field_distance_m < 0.0) {
            for pair in pairs.iter().filter(|pair| pair.field.is_occupancy()) {
                touching.all(pair);
            }
        }
        work.nodes += touched.nodes;
        work.points += touched.points;
        work.candidates = touched.candidates;
        work.flags.insert(touched.flags);
        if let Some(found) = &proven {
            self.agree(found, &nearest);
        }
        work.flags.insert_if(self.contacts.dropped(), Flags::CONTACTS);
        let pushing = self.contacts.as_slice().len();
        let k = settings.shared_stiffness(if pushing == 0 { 1.0 } else { pushing as f32 });
        for contact in self.contacts.as_mut_slice() {
            // At rest: no rate, so neither period nor damping has an effect.
            contact.phase = Phase::Parting;
        }
        let k = Stiffness::new(k, 1.0);
        let wrench = total_force(self.contacts.as_slice(), &k, 0.0, 0.0, 1.0);
        work.contacts = pushing as u16;
        Ok(Probe {
            nearest,
            wrench,
            contacts: work.contacts,
            work,
        })
    }

    /// Makes the contacts agree with a proven distance: none where the parts are apart, at least the nearest point where they overlap.
    fn agree(&mut self, found: &Separation, nearest: &Nearest) {
        if found.distance - found.error >= 0.0 {
            self.contacts.begin(false);
        }
        if found.distance + found.error >= 0.0 || !self.contacts.as_slice().is_empty() {
            return;
        }
        let (arm, n) = (nearest.arm, found.normal.as_vec3());
        let turn = arm.cross(n);
        if let Some(contact) =
            (self.contacts).offer(nearest.distance_m, nearest.distance_m, arm.length_squared())
        {
            contact.row = [n.x, n.y, n.z, turn.x, turn.y, turn.z];
            contact.arm = arm;
            contact.rate = 0.0;
            contact.guided = false;
            (contact.moving_face, contact.static_face) = (nearest.moving_face, nearest.fixed_face);
            (contact.moving_edge_face, contact.static_edge_face) = (NO_FACE, NO_FACE);
            contact.edges = [NO_FACE; 2];
            contact.leaf = NodeCursor::FIRST;
        }
    }

    /// Points that pushed in the last query, in arbitrary order.
    pub fn contacts(&self) -> impl Iterator<Item = ContactPoint> {
        self.contacts.as_slice().iter().map(|c| ContactPoint {
            arm: c.arm,
            normal: Vec3::new(c.row[0], c.row[1], c.row[2]),
            depth_m: -c.gap,
            moving_face: c.moving_face,
            fixed_face: c.static_face,
        })
    }
}
