//! Prober: gap of two parts at one pose, and the contact forces there, by the distances that the tick uses but without a motion.
//!
//! For measurement, on a PC as on a board. It traverses the trees and fields of the tick's own search, in both directions, without its budget and
//! without the memory of earlier poses. Forces are those of the contact law at rest, λ = k·depth, k shared as in the tick. With a voxmap the results
//! are its own: depth to its tangent planes, gaps only as bounds, nothing from the analytic faces.

use core::fmt;

use glam::Vec3;
use mortise_protocol::image::{NO_FACE, SceneImage, Shape};

use crate::collision::coherence::Coherence;
use crate::collision::contact::{Contacts, Phase};
use crate::collision::decimation::Decimation;
use crate::collision::directed_pair::DirectedPair;
use crate::collision::node_cursor::NodeCursor;
use crate::collision::rules::NoRules;
use crate::collision::search::{Search, Traversal};
use crate::dynamics::body::Body;
use crate::dynamics::contact_force::{Stiffness, total_force};
use crate::io::{Flags, Work};
use crate::math::pose::{Pose, Wrench, usable_pose};
use crate::math::scalar::smaller;
use crate::probe::clearance::{BUDGET, clearance};
use crate::probe::convex::{Separation, separation};
use crate::probe::epa::Epa;
use crate::probe::nearest::{Nearest, NearestSearch, Progress};
use crate::probe::nearest_voxel::nearest_voxel;
use crate::probe::on_surface::is_inside;
use crate::probe::support::Support;
use crate::probe::sweep::{Course, Motion, Sweep, Sweeping};
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

/// A first guess of the gap is enlarged by this, m.
const GUESS_M: f64 = 2e-6;

/// Memory for one query. About 60 KiB; create it once.
#[derive(Clone, Debug)]
pub struct Prober {
    contacts: Contacts,
    coherence: Coherence,
    epa: Epa,
}

/// Refuses parts that are not there, or are the same.
fn check_parts(scene: &SceneImage<'_>, moving: u16, fixed: u16) -> Result<(), ProbeError> {
    for part in [moving, fixed] {
        if usize::from(part) >= scene.parts().len() {
            return Err(ProbeError::NoSuchPart { part });
        }
    }
    if moving == fixed {
        return Err(ProbeError::SamePart);
    }
    Ok(())
}

/// Searches each part's tree against the other's field, for the nearest point and for what touches.
fn search_both_ways(
    pairs: &[DirectedPair<'_>; 2],
    against: [&Shape<'_>; 2],
    shrunk_m: f32,
    progress: &mut Progress,
    touching: &mut Traversal<'_, '_, '_, NoRules>,
) {
    let mut searches = [0, 1].map(|way| NearestSearch::new(&pairs[way], against[way]));
    for (search, pair) in searches.iter_mut().zip(pairs) {
        if !pair.field.is_occupancy() {
            search.traverse(progress, touching);
        } else if !pair.unused() {
            nearest_voxel(pair, shrunk_m, progress);
        }
    }
    for search in &mut searches {
        search.finish(progress, touching);
    }
}

/// A search of everything that touches at a pose, with its centre of mass, at rest.
fn resting_search<'s, 'i>(
    scene: &'s SceneImage<'i>,
    moving: u16,
    (pose, center): (Pose, Vec3),
    shrunk_m: f32,
) -> Search<'s, 'i, NoRules> {
    Search {
        scene,
        parts: &[],
        held: moving,
        held_shape: scene.shape_of_part(usize::from(moving)),
        shrunk_m,
        pose,
        center,
        middle: center,
        margin: 0.0,
        way: 0.0,
        slack: 0.0,
        motions: [[0.0; 6]; 2],
        swing: 0.0,
        inverse_length: 1.0,
        busy: false,
        decimation: Decimation::NEW,
        budget: u32::MAX,
        reserved: 0,
        carried: 0,
        braking_m: 0.0,
        rules: &NoRules,
    }
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
    /// Cost: a field query for every tree node and point that could be nearest or overlaps, in both directions, and the search of the surfaces' gap. Not
    /// for the tick.
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
        check_parts(scene, moving, fixed)?;
        let pose = usable_pose(pose).ok_or(ProbeError::BadPose)?;
        let held = scene.shape_of_part(usize::from(moving));
        let other = scene.shape_of_part(usize::from(fixed));
        let body = Body::of(&held);
        let center = pose.transform_point(body.center_of_mass);
        let pairs = [0, 1].map(|way| DirectedPair::new(way, (&held, pose), (&other, Pose::IDENTITY), center));

        let mut progress = Progress::new();
        let mut touched = Work::default();
        let shrunk_m = settings.shrunk_m(&held.field);
        let search = resting_search(scene, moving, (pose, center), shrunk_m);
        let voxmaps = pairs.iter().any(|pair| pair.field.is_occupancy());
        if voxmaps {
            self.coherence.invalidate();
        }
        // A pose is measured by itself, whatever touched in the last one.
        self.contacts.clear();
        let mut touching = search.traverse(false, &mut self.coherence, &mut self.contacts, &mut touched);
        search_both_ways(&pairs, [&other, &held], shrunk_m, &mut progress, &mut touching);
        let Progress {
            best: mut nearest,
            settled,
            mut work,
        } = progress;
        let shapes = [(&held, &pose), (&other, &Pose::IDENTITY)];
        let proven = (!voxmaps).then(|| Self::proven(&mut self.epa, center, shapes, &mut nearest, settled));
        let proven = proven.flatten();
        if let Some(found) = &proven {
            nearest = found.nearest(&nearest, shapes, center);
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
        work.contacts = self.contacts.as_slice().len() as u16;
        Ok(Probe {
            nearest,
            wrench: self.wrench_at_rest(settings),
            contacts: work.contacts,
            work,
        })
    }

    /// Wrench of all contacts found, without a rate, so that neither period nor damping has an effect.
    fn wrench_at_rest(&mut self, settings: &ContactSettings) -> Wrench {
        let pushing = self.contacts.as_slice().len();
        let k = settings.shared_stiffness(if pushing == 0 { 1.0 } else { pushing as f32 });
        for contact in self.contacts.as_mut_slice() {
            contact.phase = Phase::Parting;
        }
        total_force(self.contacts.as_slice(), &Stiffness::new(k, 1.0), 0.0, 0.0, 1.0)
    }

    /// First touch of part `moving` with part `fixed` along `motion` from `start`, in the frame of part `fixed`.
    ///
    /// # Errors
    /// [`ProbeError`]; `BadPose` also for a motion that does not end at a usable pose.
    pub fn sweep(
        &mut self,
        scene: &SceneImage<'_>,
        [moving, fixed]: [u16; 2],
        start: &Pose,
        motion: &Motion,
        settings: &ContactSettings,
    ) -> Result<Sweep, ProbeError> {
        let found = self.probe(scene, moving, fixed, start, settings)?;
        let start = usable_pose(start).ok_or(ProbeError::BadPose)?;
        if !motion.turn.is_finite() || usable_pose(&motion.at(&start, 1.0)).is_none() {
            return Err(ProbeError::BadPose);
        }
        let [held, other] = [moving, fixed].map(|part| scene.shape_of_part(usize::from(part)));
        if found.nearest.distance_m < 0.0 || held.field.is_occupancy() || other.field.is_occupancy() {
            let center = start.transform_point(Body::of(&held).center_of_mass);
            let overlap = found.nearest.distance_m < 0.0;
            return Ok(Sweep {
                course: if overlap { Course::Touch } else { Course::Unknown },
                share: 0.0,
                error: if overlap { 0.0 } else { f64::INFINITY },
                pose: start,
                gap_m: f64::from(found.nearest.distance_m),
                nearest: center + found.nearest.arm,
                steps: 0,
            });
        }
        let mut sweeping = Sweeping {
            held: &held,
            other: &other,
            epa: &mut self.epa,
        };
        Ok(sweeping.sweep(&start, motion, f64::from(found.nearest.distance_m)))
    }

    /// Separation of two shapes with proven bounds, where they are both convex or shown to be apart; else `nearest` is not called exact, and negative
    /// where they were found to overlap. `settled`: the gap is no larger than that of `nearest`, whatever the search of the surfaces finds in its budget.
    fn proven(
        epa: &mut Epa,
        center: Vec3,
        shapes: [(&Shape<'_>, &Pose); 2],
        nearest: &mut Nearest,
        settled: bool,
    ) -> Option<Separation> {
        if let [Some(a), Some(b)] = shapes.map(|(shape, pose)| Support::new(shape, pose)) {
            return Some(separation(&a, &b, epa));
        }
        nearest.exact = false;
        let [(held, pose), (other, _)] = shapes;
        let point = center + nearest.arm;
        let back = pose.inverse().transform_point(point);
        if nearest.distance_m < 0.0
            && (is_inside(other, point.as_dvec3()) || is_inside(held, back.as_dvec3()))
        {
            return None;
        }
        let guess = if nearest.distance_m > 0.0 {
            1.001 * f64::from(nearest.distance_m) + GUESS_M
        } else {
            f64::INFINITY
        };
        let mut found = clearance(held, other, pose, guess, BUDGET)?;
        if found.upper == guess && !found.overlap {
            found = clearance(held, other, pose, f64::INFINITY, BUDGET)?;
        }
        if found.overlap {
            if f64::from(nearest.distance_m) > found.deepest {
                nearest.distance_m = found.deepest as f32;
                nearest.in_band = false;
            }
        } else if found.upper.is_finite() {
            // No point was found inside: what interpolation tells to be a depth is a gap.
            nearest.distance_m = if nearest.distance_m < 0.0 {
                smaller(found.upper as f32, -nearest.distance_m)
            } else if settled {
                smaller(found.upper as f32, nearest.distance_m)
            } else {
                found.upper as f32
            };
        }
        found.separation(pose, held, other)
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
            contact.single = false;
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
