//! Joints of a part where it is: what it touches, with which faces, and how it can move; and the motion that shows one of its freedoms. Pure.

use std::f64::consts::TAU;
use std::time::Instant;

use glam::{DAffine3, DQuat, DVec3};
use mortise_mating::{Contact, ContactKind};
use mortise_task::mobility::{Freedoms, Reach};
use mortise_task::{Assembly, report};

use super::document::Document;
use super::sequence::are_same;

/// Time in which a freedom is shown once, s.
const SHOWN_S: f64 = 2.4;
/// Longest slide that is shown, over the radius of the assembly, and largest turn, rad.
const MOST: (f64, f64) = (0.6, 0.8);

/// An action of the operator.
#[derive(Clone, Debug, PartialEq)]
pub enum JointIntent {
    /// Find the joints of a part.
    Find(usize),
    /// Mark the faces of a joint, or of none.
    Mark(Option<usize>),
    /// Show a freedom by moving the part in the picture.
    Show(usize),
}

/// Two parts that touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// The joint in words.
    pub words: String,
    /// The part that touches: the one that was asked about, or another of its group.
    part: usize,
    /// The other part.
    pub other: usize,
    /// Faces of the part, and of the other.
    faces: [Vec<u32>; 2],
}

/// How a part can move.
#[derive(Clone, Debug, PartialEq)]
pub struct Freedom {
    /// The motion in words.
    pub words: String,
    motion: Motion,
}

#[derive(Clone, Debug, PartialEq)]
enum Motion {
    /// By at most this vector, mm.
    Slide(DVec3),
    /// About an axis, by at most these angles backwards and forwards, rad.
    Turn {
        point: DVec3,
        direction: DVec3,
        range: [f64; 2],
    },
}

impl Motion {
    /// Displacement at a time between 0 and 1: there and back, a turn both ways.
    fn at(&self, time: f64) -> DAffine3 {
        match self {
            Self::Slide(whole) => {
                let share = 0.5 * (1.0 - (TAU * time).cos());
                DAffine3::from_translation(*whole * share)
            }
            Self::Turn {
                point,
                direction,
                range: [back, forth],
            } => {
                let swing = (TAU * time).sin();
                let angle = swing * if swing < 0.0 { *back } else { *forth };
                let turn = DAffine3::from_quat(DQuat::from_axis_angle(*direction, angle));
                DAffine3::from_translation(*point) * turn * DAffine3::from_translation(-*point)
            }
        }
    }
}

/// What was found of a part, or of a group.
#[derive(Clone, Debug, PartialEq)]
pub struct PartJoints {
    /// The parts that move as one, ascending.
    pub parts: Vec<usize>,
    /// Its joints, those of the largest area first.
    pub joints: Vec<Joint>,
    /// Its freedoms, those by which it leaves first.
    pub freedoms: Vec<Freedom>,
    /// Where the parts were.
    poses: Vec<DAffine3>,
}

impl PartJoints {
    /// The joints and freedoms of parts of `assembly` that move as one; all parts are placed where they are.
    pub fn new(assembly: &Assembly, parts: Vec<usize>, found: &Freedoms) -> Self {
        // Those of the parts with one another cannot move.
        let mut contacts: Vec<&Contact> = (assembly.contacts.iter())
            .filter(|contact| {
                let [a, b] = contact.parts.map(|part| parts.contains(&part));
                a != b
            })
            .collect();
        contacts.sort_by(|a, b| b.area_mm2.total_cmp(&a.area_mm2));
        let all: Vec<usize> = (0..assembly.count()).collect();
        let (low, high) = assembly.bounds_of(&all, DAffine3::IDENTITY);
        Self {
            joints: (contacts.into_iter())
                .map(|contact| joint(assembly, &parts, contact))
                .collect(),
            parts,
            freedoms: freedoms(assembly, found, 0.5 * low.distance(high)),
            poses: (assembly.model.parts.iter()).map(|part| part.placement).collect(),
        }
    }
}

fn joint(assembly: &Assembly, parts: &[usize], contact: &Contact) -> Joint {
    let own = usize::from(parts.contains(&contact.parts[1]));
    let part = contact.parts[own];
    let other = contact.parts[1 - own];
    let (name, round) = (assembly.name(other), contact.radius_mm);
    let round = round.map_or_else(String::new, |radius| format!(", Ø {:.3} mm", 2.0 * radius));
    let words = match contact.kind {
        ContactKind::Planar => format!("Plane on {name}"),
        ContactKind::Cylindrical => format!("Cylinder on {name}{round}"),
        ContactKind::Conical => format!("Cone on {name}{round}"),
        ContactKind::Spherical => format!("Ball on {name}{round}"),
        ContactKind::Annular => format!("Ball in bore of {name}{round}"),
    };
    let faces = [own, 1 - own].map(|side| {
        let mut faces: Vec<u32> = contact.faces.iter().map(|pair| pair[side]).collect();
        faces.sort_unstable();
        faces.dedup();
        faces
    });
    Joint {
        words,
        part,
        other,
        faces,
    }
}

fn freedoms(assembly: &Assembly, found: &Freedoms, radius: f64) -> Vec<Freedom> {
    let farthest = MOST.0 * radius;
    let slides = found.translations.iter().map(|slide| {
        let way = match (slide.range_mm, slide.meets) {
            (Some(range), Some(meets)) => format!("{range:.3} mm to {}", assembly.name(meets)),
            _ => "out".to_owned(),
        };
        let length = slide.range_mm.unwrap_or(farthest).min(farthest);
        Freedom {
            words: format!("Slides along {}: {way}", report::direction(slide.direction)),
            motion: Motion::Slide(DVec3::from_array(slide.direction) * length),
        }
    });
    let turns = found.rotations.iter().map(|turn| {
        let [back, forth] = turn.range_deg;
        let way = match turn.reach {
            Reach::Full | Reach::Out => "all around".to_owned(),
            _ => format!("{back:.2}° back, {forth:.2}° on"),
        };
        Freedom {
            words: format!("Turns about {}: {way}", report::direction(turn.direction)),
            motion: Motion::Turn {
                point: DVec3::from_array(turn.point),
                direction: DVec3::from_array(turn.direction),
                range: turn.range_deg.map(|degrees| degrees.to_radians().min(MOST.1)),
            },
        }
    });
    slides.chain(turns).collect()
}

/// What a search found.
pub struct JointsFound {
    /// Number of the search.
    pub id: u64,
    /// The joints, or one line with the reason why there are none.
    pub result: Result<PartJoints, String>,
}

/// The joints shown.
#[derive(Default)]
pub struct Joints {
    searches: u64,
    /// Part of the search under way, and its start.
    search: Option<(usize, Instant)>,
    generation: Option<u64>,
    found: Option<Result<PartJoints, String>>,
    marked: Option<usize>,
    /// Freedom that is shown, and the time for which it has been, s.
    shown: Option<(usize, f64)>,
}

impl Joints {
    /// Part of the search under way, and its start.
    pub fn search(&self) -> Option<(usize, Instant)> {
        self.search
    }

    /// What was found of a part of the open document, or of its group, unless parts have moved or were grouped since.
    pub fn of(&self, document: &Document, part: usize) -> Option<&PartJoints> {
        let found = self.found.as_ref()?.as_ref().ok()?;
        let is_its =
            self.generation == Some(document.generation) && found.parts == document.groups().together(part);
        (is_its && are_same(&found.poses, &document.poses)).then_some(found)
    }

    /// Why the search failed, in a line.
    pub fn failure(&self, document: &Document) -> Option<&str> {
        let is_its = self.generation == Some(document.generation);
        let failure = self.found.as_ref().filter(|_| is_its)?.as_ref().err();
        failure.map(String::as_str)
    }

    /// The joint whose faces are marked.
    pub fn marked(&self) -> Option<usize> {
        self.marked
    }

    /// The freedom that is shown.
    pub fn shown(&self) -> Option<usize> {
        self.shown.map(|(freedom, _)| freedom)
    }

    /// Faces of a part that are marked.
    pub fn marked_faces(&self, document: &Document, part: usize) -> &[u32] {
        let faces = || {
            let marked = self.marked?;
            let found = self.found.as_ref()?.as_ref().ok()?;
            let first = *found.parts.first()?;
            let joint = self.of(document, first)?.joints.get(marked)?;
            match part {
                _ if part == joint.part => Some(&joint.faces[0]),
                _ if part == joint.other => Some(&joint.faces[1]),
                _ => None,
            }
        };
        faces().map_or(&[], Vec::as_slice)
    }

    /// Parts that are looked at: what moves, with the other one of the joint that is marked; `None`: all.
    pub fn in_focus(&self, document: &Document) -> Option<Vec<usize>> {
        if self.marked.is_none() && self.shown.is_none() {
            return None;
        }
        let found = self.found.as_ref()?.as_ref().ok()?;
        let found = self.of(document, *found.parts.first()?)?;
        let with = |other: usize| [found.parts.as_slice(), &[other]].concat();
        match (self.marked.and_then(|joint| found.joints.get(joint)), self.shown) {
            (Some(joint), _) => Some(with(joint.other)),
            (None, Some(_)) => Some(found.parts.clone()),
            (None, None) => None,
        }
    }

    /// By how much the picture shows a part elsewhere.
    pub fn displacement(&self, document: &Document, part: usize) -> Option<DAffine3> {
        let (freedom, seconds) = self.shown?;
        let freedom = self.of(document, part)?.freedoms.get(freedom)?;
        Some(freedom.motion.at(seconds / SHOWN_S))
    }

    /// Begins a search in the document of this number; returns the number of the search.
    pub(super) fn begin(&mut self, generation: u64, part: usize) -> u64 {
        *self = Self {
            searches: self.searches + 1,
            search: Some((part, Instant::now())),
            generation: Some(generation),
            ..Self::default()
        };
        self.searches
    }

    /// Takes in what a search found, unless another one began since.
    pub(super) fn take_in(&mut self, found: JointsFound) {
        if self.search.is_some() && found.id == self.searches {
            self.search = None;
            self.found = Some(found.result);
        }
    }

    pub(super) fn mark(&mut self, joint: Option<usize>) {
        self.marked = joint;
    }

    /// Shows a freedom once, from its beginning.
    pub(super) fn show(&mut self, freedom: Option<usize>) {
        self.shown = freedom.map(|freedom| (freedom, 0.0));
    }

    /// Lets time pass. Returns whether something is shown that moves.
    pub(super) fn pass(&mut self, seconds: f64) -> bool {
        if let Some((_, shown)) = &mut self.shown {
            *shown += seconds;
            if *shown >= SHOWN_S {
                self.shown = None;
            }
            return true;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_begins_and_ends_in_place_and_stays_within_its_range() {
        let slide = Motion::Slide(DVec3::new(0.0, 0.0, 5.0));
        let turn = Motion::Turn {
            point: DVec3::new(3.0, 0.0, 0.0),
            direction: DVec3::Z,
            range: [0.2, 0.6],
        };
        let place = |motion: &Motion, time| motion.at(time).transform_point3(DVec3::X);
        for motion in [&slide, &turn] {
            for time in [0.0, 1.0] {
                assert!(place(motion, time).distance(DVec3::X) < 1e-12, "{motion:?}");
            }
        }
        let mut extremes = [0f64; 2];
        for step in 0..=1000 {
            let time = f64::from(step) / 1000.0;
            let z = place(&slide, time).z;
            assert!((0.0..=5.0 + 1e-12).contains(&z));
            let arm = place(&turn, time) - DVec3::new(3.0, 0.0, 0.0);
            assert!((arm.length() - 2.0).abs() < 1e-12);
            let angle = DVec3::NEG_X.cross(arm).z.atan2(DVec3::NEG_X.dot(arm));
            extremes = [extremes[0].min(angle), extremes[1].max(angle)];
        }
        assert!((place(&slide, 0.5).z - 5.0).abs() < 1e-12);
        assert!(
            (extremes[0] + 0.2).abs() < 1e-5 && (extremes[1] - 0.6).abs() < 1e-5,
            "{extremes:?}"
        );
    }
}
