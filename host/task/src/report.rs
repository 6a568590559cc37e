//! Results as plain values for JSON: names instead of indices, micrometres, poses as waypoints.
//!
//! A pose is p' = R(q)·p + t in the file's frame, mm, q = [w, x, y, z]; between two waypoints t runs linearly and q on the shortest great arc.

use glam::{DAffine3, DQuat, DVec3};
use serde::Serialize;

use crate::assembly::{Assembly, Moved};
use crate::fits::Fit;
use crate::graph::{Edge, graph};
use crate::mobility::{Freedoms, Reach, freedoms};
use crate::removal::{Blocked, Path};
use crate::sequence::{Sequence, Step};
use crate::taxonomy::Connection;

/// Largest turn between two waypoints, radians: a point 50 mm from the axis then leaves its arc by 2 µm.
const WAYPOINT_RAD: f64 = 0.0175;

/// A pose of a way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Waypoint {
    /// Translation, mm.
    pub t: [f64; 3],
    /// Rotation, w first.
    pub q: [f64; 4],
}

impl Waypoint {
    /// As a transform.
    pub fn pose(&self) -> DAffine3 {
        let [w, x, y, z] = self.q;
        DAffine3::from_rotation_translation(DQuat::from_xyzw(x, y, z, w), DVec3::from_array(self.t))
    }
}

/// Waypoints of a path from its start at `from`.
pub fn waypoints(path: &Path, from: DAffine3) -> Vec<Waypoint> {
    let mut by = from;
    let mut points = vec![waypoint(&by)];
    for leg in &path.legs {
        let steps = (leg.angle.abs() / WAYPOINT_RAD).ceil().max(1.0) as usize;
        for i in 1..=steps {
            points.push(waypoint(&(leg.at(i as f64 / steps as f64) * by)));
        }
        by = leg.at(1.0) * by;
    }
    points
}

fn waypoint(by: &DAffine3) -> Waypoint {
    let q = DQuat::from_mat3(&by.matrix3).normalize();
    let q = if q.w < 0.0 { -q } else { q };
    Waypoint {
        t: by.translation.to_array(),
        q: [q.w, q.x, q.y, q.z],
    }
}

/// One step of a sequence.
#[derive(Clone, Debug, Serialize)]
pub struct StepReport<'a> {
    /// Place in the order, from 1.
    pub step: usize,
    /// Parts that move together.
    #[serde(rename = "move")]
    pub moving: Vec<&'a str>,
    /// Parts that stay.
    pub onto: Vec<&'a str>,
    /// Number of legs of the way: slides and turns.
    pub legs: usize,
    /// Direction of the first leg of the way out, which is the side the group comes from; `None` when that is a turn.
    pub direction: Option<[f64; 3]>,
    /// The way, in the sense of the report.
    pub waypoints: Vec<Waypoint>,
    /// Least clearance on the way, µm, 0 in contact; `None`: not measured for lack of time, or farther than a metre.
    pub clearance_um: Option<f64>,
    /// Largest overlap on the way, µm.
    pub overlap_um: Option<f64>,
    /// The pair that is nearest.
    pub nearest: Option<[&'a str; 2]>,
    /// Parts that stay and would fall without those that move: they are held meanwhile.
    pub falls: Vec<&'a str>,
}

impl StepReport<'_> {
    /// How it moves first, in words.
    pub fn way(&self) -> String {
        match self.direction {
            Some(d) => format!("along {}", direction(d)),
            None => "by a turn".into(),
        }
    }

    /// The step in words: what moves, along which direction, and how near it passes.
    pub fn words(&self) -> String {
        let gap = match (self.overlap_um, self.clearance_um) {
            (Some(overlap), _) if overlap > 0.05 => format!("overlap {overlap:.1} µm"),
            (Some(_), Some(clearance)) => format!("clearance {clearance:.1} µm"),
            (Some(_), None) => "clear".into(),
            (None, _) => "not measured in the time".into(),
        };
        let legs = if self.legs > 1 {
            format!(", {} legs", self.legs)
        } else {
            String::new()
        };
        let falls = if self.falls.is_empty() {
            String::new()
        } else {
            format!("; hold {} meanwhile", self.falls.join(", "))
        };
        format!("{} {}{legs}: {gap}{falls}", self.moving.join(", "), self.way())
    }
}

/// A direction in words: an axis, or its components.
pub fn direction([x, y, z]: [f64; 3]) -> String {
    let names = [
        ([1.0, 0.0, 0.0], "+x"),
        ([-1.0, 0.0, 0.0], "-x"),
        ([0.0, 1.0, 0.0], "+y"),
        ([0.0, -1.0, 0.0], "-y"),
        ([0.0, 0.0, 1.0], "+z"),
        ([0.0, 0.0, -1.0], "-z"),
    ];
    let near = |d: &[f64; 3]| (d[0] - x).abs().max((d[1] - y).abs()).max((d[2] - z).abs()) < 1e-6;
    names
        .iter()
        .find(|(d, _)| near(d))
        .map_or_else(|| format!("({x:.4}, {y:.4}, {z:.4})"), |(_, name)| (*name).into())
}

/// What stays together.
#[derive(Clone, Debug, Serialize)]
pub struct StuckReport<'a> {
    /// Its parts.
    pub parts: Vec<&'a str>,
    /// The pair that blocks.
    pub pair: [&'a str; 2],
    /// Least overlap with which the search could have gone on, µm, or that any way would need where there is a proof; `None` where no opening was near.
    pub overlap_um: Option<f64>,
    /// Proof that they cannot come apart; `None`: no way was found.
    pub proof: Option<String>,
}

impl StuckReport<'_> {
    /// What stays together, in words, what holds it, and why that is certain, or that it is not.
    pub fn words(&self) -> String {
        let ([a, b], parts) = (self.pair, self.parts.join(", "));
        match (&self.proof, self.overlap_um) {
            (Some(proof), um) => {
                let least = um.map_or(String::new(), |um| format!(" by {um:.1} µm at the least"));
                format!("{parts} stay together: {a} meets {b}{least}; {proof}")
            }
            (None, Some(um)) => format!(
                "{parts} stay together, as far as was searched: {a} meets {b}, by {um:.1} µm at the widest place found"
            ),
            (None, None) => format!("{parts} stay together, as far as was searched: {a} meets {b}"),
        }
    }
}

/// Result of `assemble` and `disassemble`.
#[derive(Clone, Debug, Serialize)]
pub struct SequenceReport<'a> {
    /// "assembles" (or "comes_out"), "blocked", or "timed_out".
    pub verdict: &'static str,
    /// Parts in the order of the file.
    pub parts: Vec<&'a str>,
    /// The order, with ways.
    pub steps: Vec<StepReport<'a>>,
    /// What stays together.
    pub stuck: Vec<StuckReport<'a>>,
    /// Parts that are one, by permanent connections of the catalogue.
    pub joined: Vec<Vec<&'a str>>,
    /// Pairs that overlap as placed in the file, µm.
    pub pressed: Vec<PressedReport<'a>>,
    /// Time taken, s.
    pub time_s: f64,
}

/// Two parts that overlap as placed.
#[derive(Clone, Debug, Serialize)]
pub struct PressedReport<'a> {
    /// The parts.
    pub parts: [&'a str; 2],
    /// Depth, µm.
    pub overlap_um: f64,
}

/// Sense of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// From outside into place, first part first.
    Assembly,
    /// From place to outside.
    Disassembly,
}

/// The report of a sequence.
pub fn sequence<'a>(assembly: &'a Assembly, found: &Sequence, sense: Sense) -> SequenceReport<'a> {
    let mut order: Vec<&Step> = found.steps.iter().collect();
    if sense == Sense::Assembly {
        order.reverse();
    }
    let verdict = match (found.stuck.is_empty(), found.timed_out, sense) {
        (true, false, Sense::Assembly) => "assembles",
        (true, false, Sense::Disassembly) => "comes_out",
        (_, true, _) => "timed_out",
        (false, false, _) => "blocked",
    };
    SequenceReport {
        verdict,
        parts: (0..assembly.count()).map(|p| assembly.name(p)).collect(),
        steps: order
            .iter()
            .enumerate()
            .map(|(i, step)| step_report(assembly, step, i + 1, sense))
            .collect(),
        stuck: found
            .stuck
            .iter()
            .map(|(parts, blocked)| stuck(assembly, parts, blocked))
            .collect(),
        joined: joined(assembly),
        pressed: pressed(assembly),
        time_s: found.time.as_secs_f64(),
    }
}

fn joined(assembly: &Assembly) -> Vec<Vec<&str>> {
    let all: Vec<usize> = (0..assembly.count()).collect();
    let units = assembly.stated.units(&all).into_iter();
    (units.filter(|unit| unit.len() > 1))
        .map(|unit| names(assembly, &unit))
        .collect()
}

fn names<'a>(assembly: &'a Assembly, parts: &[usize]) -> Vec<&'a str> {
    parts.iter().map(|&p| assembly.name(p)).collect()
}

fn step_report<'a>(assembly: &'a Assembly, step: &Step, number: usize, sense: Sense) -> StepReport<'a> {
    let waypoints = match sense {
        Sense::Disassembly => waypoints(&step.path, DAffine3::IDENTITY),
        Sense::Assembly => {
            let (from, path) = step.path.reversed();
            waypoints(&path, from)
        }
    };
    let distance = step.least.map(|l| l.gap.distance_mm * 1e3);
    StepReport {
        step: number,
        moving: names(assembly, &step.group),
        onto: names(assembly, &step.onto),
        legs: step.path.legs.len(),
        direction: step
            .path
            .legs
            .first()
            .filter(|leg| leg.angle == 0.0)
            .map(|leg| leg.slide.normalize_or_zero().to_array()),
        waypoints,
        clearance_um: distance.map(|d| d.max(0.0)),
        overlap_um: step.measured.then_some(distance.map_or(0.0, |d| (-d).max(0.0))),
        nearest: step.least.map(|l| l.pair.map(|p| assembly.name(p))),
        falls: names(assembly, &step.falls),
    }
}

fn stuck<'a>(assembly: &'a Assembly, parts: &[usize], blocked: &Blocked) -> StuckReport<'a> {
    StuckReport {
        parts: names(assembly, parts),
        pair: blocked.pair.map(|p| assembly.name(p)),
        overlap_um: blocked.overlap_mm.map(|mm| mm * 1e3),
        proof: blocked.proof.map(|proof| proof.to_string()),
    }
}

/// Overlaps below this are rounding, µm.
const PRESSED_UM: f64 = 0.1;

fn pressed(assembly: &Assembly) -> Vec<PressedReport<'_>> {
    let pairs = (0..assembly.count()).flat_map(|a| (a + 1..assembly.count()).map(move |b| (a, b)));
    pairs
        .map(|(a, b)| PressedReport {
            parts: [assembly.name(a), assembly.name(b)],
            overlap_um: assembly.pressed_mm(a, b) * 1e3,
        })
        .filter(|p| p.overlap_um > PRESSED_UM)
        .collect()
}

/// Freedoms of one part or group.
#[derive(Clone, Debug, Serialize)]
pub struct PartMobility<'a> {
    /// Its name, or those of a group.
    pub part: String,
    /// Dimensions of translation that its contacts leave both ways, to first order.
    pub two_sided: usize,
    /// Extreme rays that they leave one way, to first order.
    pub one_sided: usize,
    /// Directions in which it moves over a finite step.
    pub translations: Vec<TranslationReport<'a>>,
    /// Axes about which it turns over a finite step.
    pub rotations: Vec<RotationReport>,
}

/// A direction.
#[derive(Clone, Debug, Serialize)]
pub struct TranslationReport<'a> {
    /// Unit direction.
    pub direction: [f64; 3],
    /// Whether the opposite is free, too.
    pub two_sided: bool,
    /// out, limited, or play.
    pub reach: Reach,
    /// Travel until it meets a part, mm.
    pub range_mm: Option<f64>,
    /// That part.
    pub meets: Option<&'a str>,
}

/// An axis.
#[derive(Clone, Debug, Serialize)]
pub struct RotationReport {
    /// Point on it, mm.
    pub point_mm: [f64; 3],
    /// Unit direction.
    pub direction: [f64; 3],
    /// full, limited, or play.
    pub reach: Reach,
    /// Angles backwards and forwards, degrees.
    pub range_deg: [f64; 2],
}

/// Freedoms of some groups, each with the parts that it is permanently connected to, against all others in place.
pub fn mobility<'a>(assembly: &'a Assembly, groups: &[Vec<usize>]) -> Vec<PartMobility<'a>> {
    groups
        .iter()
        .map(|group| {
            let (unit, others) = assembly.with_joined(group);
            part_mobility(assembly, group, &freedoms_of(assembly, &unit, &others))
        })
        .collect()
}

fn freedoms_of(assembly: &Assembly, parts: &[usize], others: &[usize]) -> Freedoms {
    let by = DAffine3::IDENTITY;
    freedoms(assembly, &Moved { parts, by }, others, &[])
}

fn part_mobility<'a>(assembly: &'a Assembly, group: &[usize], found: &Freedoms) -> PartMobility<'a> {
    let tidy = |d: [f64; 3]| (DVec3::from_array(d) + 0.0).to_array();
    PartMobility {
        part: names(assembly, group).join(", "),
        two_sided: found.lines,
        one_sided: found.rays,
        translations: (found.translations.iter())
            .map(|t| TranslationReport {
                direction: tidy(t.direction),
                two_sided: t.two_sided,
                reach: t.reach,
                range_mm: t.range_mm,
                meets: t.meets.map(|p| assembly.name(p)),
            })
            .collect(),
        rotations: (found.rotations.iter())
            .map(|r| RotationReport {
                point_mm: r.point,
                direction: tidy(r.direction),
                reach: r.reach,
                range_deg: r.range_deg,
            })
            .collect(),
    }
}

/// A connection of two parts.
#[derive(Clone, Debug, Serialize)]
pub struct ConnectionReport<'a> {
    /// First part.
    pub a: &'a str,
    /// Second part.
    pub b: &'a str,
    /// Kinds, strongest first.
    pub kinds: Vec<Connection>,
    /// Kinds of the contacts: planar, cylindrical, conical, spherical, annular.
    pub contacts: Vec<&'static str>,
    /// Shafts in bores.
    pub fits: Vec<FitReport<'a>>,
}

/// A connection, and what it leaves free.
#[derive(Clone, Debug, Serialize)]
pub struct FreeConnection<'a> {
    /// The connection.
    #[serde(flatten)]
    pub connection: ConnectionReport<'a>,
    /// Freedoms of the first part with the second alone in its way.
    pub freedoms: PartMobility<'a>,
}

/// The connection graph with what each connection leaves free. Cost: the freedoms of one part against the other, for each.
pub fn free_connections(assembly: &Assembly) -> Vec<FreeConnection<'_>> {
    (graph(assembly).edge_weights())
        .map(|edge| {
            let [first, second] = edge.parts;
            FreeConnection {
                connection: connection(assembly, edge),
                freedoms: part_mobility(assembly, &[first], &freedoms_of(assembly, &[first], &[second])),
            }
        })
        .collect()
}

/// A shaft in a bore, or a profile in a hole.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport<'a> {
    /// Whether it is round; else diameters are those of circles about the profile, and the clearance is twice that of the outlines.
    pub round: bool,
    /// Part with the shaft.
    pub shaft: &'a str,
    /// Part with the bore.
    pub bore: &'a str,
    /// Middle of the common length, mm.
    pub center_mm: [f64; 3],
    /// Unit direction.
    pub axis: [f64; 3],
    /// Diameter of the shaft, mm.
    pub diameter_mm: f64,
    /// Diameter of the bore less that of the shaft, µm; negative: overlap.
    pub clearance_um: f64,
    /// Common length: the capacity of both ports that the connection consumes, mm.
    pub length_mm: f64,
}

/// The connection graph.
pub fn connections(assembly: &Assembly) -> Vec<ConnectionReport<'_>> {
    (graph(assembly).edge_weights())
        .map(|edge| connection(assembly, edge))
        .collect()
}

fn connection<'a>(assembly: &'a Assembly, edge: &Edge) -> ConnectionReport<'a> {
    let fit = |fit: &Fit| FitReport {
        shaft: assembly.name(fit.parts[0]),
        bore: assembly.name(fit.parts[1]),
        center_mm: fit.center.to_array(),
        axis: fit.axis.to_array(),
        diameter_mm: 2.0 * fit.radius_mm,
        clearance_um: 2e3 * fit.clearance_mm,
        length_mm: fit.length_mm,
        round: fit.is_round,
    };
    let kind = |contact: &usize| assembly.contacts[*contact].kind.name();
    ConnectionReport {
        a: assembly.name(edge.parts[0]),
        b: assembly.name(edge.parts[1]),
        kinds: edge.kinds.clone(),
        contacts: edge.contacts.iter().map(kind).collect(),
        fits: edge.fits.iter().map(fit).collect(),
    }
}
