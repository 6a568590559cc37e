//! Insertion of a part of any shape along a way that the fit finder found, by a hand that is off and trembles, with no recognised surface.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::{Grabbable, Request};
use mortise_brep::{CadModel, LoadOptions, load_step_with};
use mortise_energy::{BakedEnergy, Placed, attach, of_fit};
use mortise_fit::{Fit, FitOptions, find, part_named};
use mortise_guide::{GuideSettings, along};
use mortise_mating::recognise::Target;
use mortise_protocol::message::Telemetry;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::RigSpec;
use mortise_scenario::wire::pose_mm;
use mortise_scenario::{
    Key, PreparedScene, Recording, Scenario, connect, connect_with_scene, overlap, record,
};

use crate::LabError;
use crate::guided::{key, script};

/// Room between the parts at the start, beyond where they are apart, mm.
const ROOM_MM: f64 = 4.0;
/// Distance before the mouth from which the hand is off, mm.
const BEFORE_MOUTH_MM: f64 = 3.0;
/// How far beyond the fit the hand pulls, mm.
const BEYOND_MM: f64 = 2.0;
/// Speed of the hand along the way, mm/s.
const SPEED_MM_S: f64 = 25.0;
/// Ticks after full engagement until a part is on its way: 1 mm decays below 1 µm with τ = 20 ms.
const SETTLING_TICKS: u32 = 150;
/// A part that comes so near to the end of its way is in, mm, where it is on the way and turned as there: no farther off than this, mm and rad, more than
/// walls allow in any fit that is inserted, and far less than a part that slips from the hand and lies across the mouth.
const IN_MM: f64 = 0.1;
const IN_ASIDE_MM: f64 = 0.5;
const IN_TURNED_RAD: f64 = 0.02;
/// Time of a hover, s, and its last ticks, in which the part is at rest.
const HOVER_S: f64 = 1.5;
const RESTING_TICKS: usize = 200;
/// Time of a careless hand from one place to the next, s, and how far it goes aside and out, mm, and turns, rad.
const WANDER_S: f64 = 0.25;
const WANDER_MM: f64 = 5.0;
const WANDER_RAD: f64 = 0.1;
/// Straight legs of the hand's motion along the way.
const LEGS: u32 = 8;

/// How far the hand is off at the mouth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Off {
    /// Sideways, mm, in a direction across the way at this angle, rad.
    pub aside_mm: f64,
    pub direction_rad: f64,
    /// Rotation vector, rad.
    pub turn: DVec3,
}

/// Where the moving part is when it is grabbed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Begin {
    /// On the way, before the mouth.
    Outside,
    /// In the fit.
    Seated,
}

/// Where a hand wants the part.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wanted {
    /// Travel along the way, mm: 0 in the fit, negative before it.
    pub travel_mm: f64,
    /// Beside the way, mm, and rotation vector, rad; world.
    pub aside: DVec3,
    pub turn: DVec3,
}

/// How an insertion is helped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Help {
    /// Contact alone.
    Nothing,
    /// The way in, held.
    Way,
    /// The scene's geometric energy alone.
    Energy,
}

/// Value of [`ParameterId::Guidance`] for the geometric energy.
const BY_ENERGY: f32 = 3.0;

/// A pair, its fit, and the scene in which the moving part begins outside.
pub(crate) struct Followed {
    scenario: Scenario,
    scene: PreparedScene,
    target: Target,
    /// The fit, and the parts of the model that it is of.
    fit: Fit,
    parts: [usize; 2],
    /// Placements of the moving part at the start and in the fit, and of the other part, mm.
    start: DAffine3,
    other: DAffine3,
    way: Way,
    /// Travel from the mouth to the fit, mm.
    depth_mm: f64,
}

/// A way in, in the world, mm.
struct Way {
    seat: DAffine3,
    into: DVec3,
    /// Point on a screw's axis, and its pitch.
    screw: Option<(DVec3, f64)>,
}

impl Way {
    /// Placement of the part after a travel along the way: 0 in the fit, negative before it.
    fn at(&self, travel_mm: f64) -> DAffine3 {
        let slide = DAffine3::from_translation(travel_mm * self.into);
        let turn = self.screw.map_or(DAffine3::IDENTITY, |(point, pitch_mm)| {
            let angle = std::f64::consts::TAU * travel_mm / pitch_mm;
            let turn = DAffine3::from_quat(DQuat::from_axis_angle(self.into, angle));
            DAffine3::from_translation(point) * turn * DAffine3::from_translation(-point)
        });
        slide * turn * self.seat
    }
}

/// What an insertion showed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// Whether the part arrived at the end of its way.
    pub is_in: bool,
    /// Time from the start until it did, s; NaN: never.
    pub after_s: f64,
    /// Largest distance from the way, mm, and largest angle, rad, once held; NaN: never held.
    pub off_mm: f64,
    pub off_rad: f64,
    /// Largest force at the handle, N.
    pub peak_n: f64,
    /// Deepest overlap by the exact surfaces, mm.
    pub overlap_mm: f64,
    /// Time of the run, s.
    pub run_s: f64,
    /// Ticks missed.
    pub missed: u32,
    /// Instructions of the longest tick; NaN where they are not counted.
    pub instructions: f64,
}

impl Followed {
    /// The best fit of parts `moving` and `fixed` of a STEP file that has a way in, the moving part before its mouth.
    pub fn new(step: &Path, parts: [&str; 2]) -> Result<Self, LabError> {
        Self::beginning(step, parts, Begin::Outside)
    }

    /// As [`Self::new`], the moving part elsewhere.
    pub fn beginning(step: &Path, [moving, fixed]: [&str; 2], begin: Begin) -> Result<Self, LabError> {
        let bad = |what: String| LabError::Input {
            name: step.display().to_string(),
            what,
        };
        let reading = LoadOptions::default();
        let mut model = load_step_with(step, &reading).map_err(|error| bad(error.to_string()))?;
        let part = |name: &str| part_named(&model, name).map_err(|error| bad(error.to_string()));
        let (a, b) = (part(moving)?, part(fixed)?);
        let found = find(&model, a, b, &FitOptions::default()).map_err(|error| bad(error.to_string()))?;
        let fit = found
            .fits
            .iter()
            .find_map(|fit| Some((fit, along(&model, a, b, fit)?)));
        let (fit, target) = fit.ok_or_else(|| bad("no fit with a way in was found".to_owned()))?;
        let (into, length_mm) = way(fit).ok_or_else(|| bad("the way in has no direction".to_owned()))?;
        let other = model.parts[b].placement;
        let screw = fit.path.as_ref().and_then(|path| path.screw);
        let way = Way {
            seat: fit.placement,
            into,
            screw,
        };
        let start = match begin {
            Begin::Outside => way.at(-(length_mm + ROOM_MM)),
            Begin::Seated => way.at(0.0),
        };
        let depth_mm = mating_depth(&model, [a, b], fit, into);
        model.parts[a].placement = start;
        let middle = start.transform_point3(model.shapes[model.parts[a].shape].center_of_mass);
        let mut scenario = script(step)?;
        scenario.scene.part = moving.to_owned();
        scenario.depth = None;
        scenario.hand.grip_mm = middle.to_array();
        // As the program plans a scene by default.
        let request = Request {
            grabbable: Grabbable::Named(vec![moving.to_owned()]),
            ..Request::default()
        };
        let scene = PreparedScene::plan(step, model, moving, &request)?;
        Ok(Self {
            scenario,
            scene,
            target,
            fit: fit.clone(),
            parts: [a, b],
            start,
            other,
            way,
            depth_mm,
        })
    }

    /// The pair with its geometric energy in the scene, and that energy.
    pub fn with_energy(mut self) -> Result<(Self, BakedEnergy), LabError> {
        let bad = |what: &str| LabError::Input {
            name: self.scenario.name.clone(),
            what: what.to_owned(),
        };
        let [moving, fixed] = self.parts;
        let energy = of_fit(&self.scene.model, moving, fixed, &self.fit)
            .ok_or_else(|| bad("the fit has no energy"))?;
        let baked = self
            .scene
            .report
            .parts
            .iter()
            .position(|part| part.model_part == fixed);
        let fixed = (baked.and_then(|index| u16::try_from(index).ok()))
            .ok_or_else(|| bad("the part is not in the scene"))?;
        let placed = Placed {
            moving: self.scene.part,
            fixed,
            energy,
        };
        self.scene.image = attach(&self.scene.image, std::slice::from_ref(&placed))
            .map_err(|error| bad(&error.to_string()))?;
        Ok((self, placed.energy))
    }

    /// Inserts the part.
    pub fn insert(&self, off: &Off, help: Help, rig: &RigSpec) -> Result<Seen, LabError> {
        let scenario = self.helped(help, self.scenario(off));
        let settings = GuideSettings {
            recognising: false,
            ..GuideSettings::default()
        };
        let mut guide = self.scene.guide(settings);
        if help == Help::Way {
            guide.follow(vec![self.target.clone()]);
        }
        let mut listener = |sample: &Telemetry| guide.hear(sample);
        let client = connect(&scenario, rig)?;
        let recording = record(&client, &scenario, &self.scene, Some(&mut listener))?;
        Ok(self.seen(&recording))
    }

    /// The hand's motion: to before the mouth, off there, and on along the way.
    fn scenario(&self, off: &Off) -> Scenario {
        let mut scenario = self.scenario.clone();
        let total = self.travel_mm(&self.start).abs();
        let before = total - self.depth_mm - BEFORE_MOUTH_MM;
        let [x, y] = self.across();
        let (sin, cos) = off.direction_rad.sin_cos();
        // The hand after a travel from the start, and off.
        let off_at = |t_s: f64, travel: f64| {
            let wanted = Wanted {
                travel_mm: travel - total,
                aside: off.aside_mm * (cos * x + sin * y),
                turn: off.turn,
            };
            self.key(t_s, &wanted)
        };
        let down = total + BEYOND_MM - before;
        let down_s = down / SPEED_MM_S;
        scenario.hand.keyframes = vec![key(0.0, [0.0; 3], [0.0; 3])];
        scenario.hand.keyframes.extend((0..=LEGS).map(|leg| {
            let share = f64::from(leg) / f64::from(LEGS);
            off_at(0.5 + share * down_s, before + share * down)
        }));
        scenario.run.duration_s = 1.0 + down_s;
        scenario
    }

    /// The hand at a time at which it wants the part somewhere.
    pub fn key(&self, t_s: f64, wanted: &Wanted) -> Key {
        let grip = DVec3::from_array(self.scenario.hand.grip_mm);
        let held = self.start.inverse().transform_point3(grip);
        let at = self.way.at(wanted.travel_mm);
        let rotation = DQuat::from_mat3(&(at.matrix3 * self.start.matrix3.inverse()));
        let turn = (DQuat::from_scaled_axis(wanted.turn) * rotation).to_scaled_axis();
        let offset = at.transform_point3(held) - grip + wanted.aside;
        key(t_s, offset.to_array(), turn.to_array().map(f64::to_degrees))
    }

    /// Plays hands helped by the geometric energy, one after another on one rig that has the scene from its start; each ends with its last key. Telemetry of every
    /// `every_ticks`-th tick.
    pub fn play(
        &self,
        hands: &[Vec<Key>],
        every_ticks: u16,
        rig: &RigSpec,
    ) -> Result<Vec<Recording>, LabError> {
        let mut scenario = self.helped(Help::Energy, self.scenario.clone());
        scenario.run.telemetry_every_ticks = every_ticks;
        let client = connect_with_scene(&scenario, rig, &self.scene)?;
        let played = hands.iter().map(|keys| {
            scenario.run.duration_s = keys.last().map_or(0.0, |key| key.t_s);
            scenario.hand.keyframes.clone_from(keys);
            Ok(record(&client, &scenario, &self.scene, None)?)
        });
        played.collect()
    }

    /// Placement of the moving part in the fit, mm.
    pub fn seat(&self) -> &DAffine3 {
        &self.way.seat
    }

    /// Two directions across the way and across each other, world.
    pub fn across(&self) -> [DVec3; 2] {
        let (x, y) = self.way.into.any_orthonormal_pair();
        [x, y]
    }

    /// Placement of the moving part in the other part's frame after a travel outward from the fit, mm.
    pub fn place(&self, travel_mm: f64) -> DAffine3 {
        self.other.inverse() * self.way.at(-travel_mm)
    }

    /// Direction of the way outward, other part's frame.
    pub fn outward(&self) -> DVec3 {
        self.other.inverse().transform_vector3(-self.way.into)
    }

    /// Centre of mass of the moving part, its frame, mm.
    pub fn center_of_mass(&self) -> DVec3 {
        let model = &self.scene.model;
        model.shapes[model.parts[self.parts[0]].shape].center_of_mass
    }

    /// Length of the part of the way on which the mating faces overlap, mm.
    pub fn depth_mm(&self) -> f64 {
        self.depth_mm
    }

    /// A careless hand for `duration_s`, helped by the geometric energy: about the mouth, in and out of the fit, aside and turned at random, four times a second.
    pub fn wander(
        &self,
        random: &mut fastrand::Rng,
        duration_s: f64,
        rig: &RigSpec,
    ) -> Result<Recording, LabError> {
        let mut scenario = self.helped(Help::Energy, self.scenario.clone());
        let total = self.travel_mm(&self.start).abs();
        let [x, y] = self.across();
        let count = (duration_s / WANDER_S).round() as usize;
        scenario.hand.keyframes = vec![key(0.0, [0.0; 3], [0.0; 3])];
        scenario.hand.keyframes.extend((1..=count).map(|i| {
            let mut signed = || 2.0 * random.f64() - 1.0;
            let travel = -0.5 * (1.0 + signed()) * total.min(self.depth_mm + WANDER_MM);
            let aside = WANDER_MM * (signed() * x + signed() * y);
            let turn = WANDER_RAD * DVec3::new(signed(), signed(), signed());
            let wanted = Wanted {
                travel_mm: travel,
                aside,
                turn,
            };
            self.key(WANDER_S * i as f64, &wanted)
        }));
        scenario.run.duration_s = WANDER_S * count as f64;
        // Energies are summed over every tick.
        scenario.run.telemetry_every_ticks = 1;
        let client = connect(&scenario, rig)?;
        Ok(record(&client, &scenario, &self.scene, None)?)
    }

    /// Median of the instructions of a tick with the part at rest on the way, at a height above the mouth; less than 0 is within.
    pub fn hover(&self, height_mm: f64, help: Help, rig: &RigSpec) -> Result<f64, LabError> {
        let mut scenario = self.helped(help, self.scenario.clone());
        let total = self.travel_mm(&self.start).abs();
        let at = self.way.at(-(self.depth_mm + height_mm));
        let offset = at.translation - self.way.at(-total).translation;
        scenario.hand.keyframes = vec![
            key(0.0, [0.0; 3], [0.0; 3]),
            key(0.5, offset.to_array(), [0.0; 3]),
        ];
        scenario.run.duration_s = HOVER_S;
        scenario.run.telemetry_every_ticks = 1;
        let client = connect(&scenario, rig)?;
        let samples = record(&client, &scenario, &self.scene, None)?.samples;
        let rest = samples.iter().rev().take(RESTING_TICKS);
        let mut costs: Vec<u32> = rest.map(|sample| sample.cost).collect();
        costs.sort_unstable();
        Ok(costs.get(costs.len() / 2).copied().map_or(f64::NAN, f64::from))
    }

    /// Largest rise over any interval of the work of the geometric energy on the part and its potential together, mJ, while it is fully engaged: energy
    /// that it made. Every tick's sample is needed.
    pub fn made_by_energy_mj(&self, energy: &BakedEnergy, samples: &[Telemetry]) -> f64 {
        let center = self.center_of_mass();
        let depth_mj =
            1e3 * f64::from(ParameterId::GeometricForce.row().default / energy.record.largest_force);
        let (mut last, mut work, mut least, mut made): (Option<DAffine3>, f64, f64, f64) =
            (None, 0.0, f64::NAN, 0.0);
        for sample in samples {
            let Some((_, pose)) = (sample.object.as_ref()).filter(|_| sample.guidance.engagement >= 1.0)
            else {
                (last, work, least) = (None, 0.0, f64::NAN);
                continue;
            };
            let at = pose_mm(pose);
            if let Some(before) = last {
                let moved = at.transform_point3(center) - before.transform_point3(center);
                let turned = DQuat::from_mat3(&(at.matrix3 * before.matrix3.inverse())).to_scaled_axis();
                let of = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
                let wrench = &sample.guidance.wrench;
                // N mm are mJ.
                work += of(wrench.force).dot(moved) + 1e3 * of(wrench.torque).dot(turned);
            }
            last = Some(at);
            let potential = energy.at(&(self.other.inverse() * at), DVec3::ZERO).energy;
            let total = work + depth_mj * potential;
            least = least.min(total);
            made = made.max(total - least);
        }
        made
    }

    /// The scenario with what this help needs.
    fn helped(&self, help: Help, mut scenario: Scenario) -> Scenario {
        if help == Help::Energy {
            let name = ParameterId::Guidance.row().name;
            scenario.parameters.insert(name.to_owned(), BY_ENERGY);
        }
        scenario
    }

    /// Distance of the part's centre of mass from its way (a straight one) at a placement, mm.
    pub fn aside_mm(&self, at: &DAffine3) -> f64 {
        let center = self.center_of_mass();
        let off = at.transform_point3(center) - self.way.seat.transform_point3(center);
        off.reject_from_normalized(self.way.into).length()
    }

    /// Travel of the part at a placement, mm: 0 in the fit, negative before it.
    pub fn travel_mm(&self, at: &DAffine3) -> f64 {
        let origin = at.transform_point3(self.target.moving.origin);
        let end = self.other.transform_point3(self.target.fixed.origin);
        (origin - end).dot(self.way.into)
    }

    /// Whether a part with this placement is in its fit.
    pub fn is_in(&self, at: &DAffine3) -> bool {
        let off = self.target.alignment_error(at, &self.other);
        let on_way = off.distance_mm < IN_ASIDE_MM && off.angle_rad < IN_TURNED_RAD;
        on_way && self.travel_mm(at) > -IN_MM
    }

    fn seen(&self, recording: &Recording) -> Seen {
        let mut seen = Seen {
            is_in: false,
            after_s: f64::NAN,
            off_mm: f64::NAN,
            off_rad: f64::NAN,
            peak_n: recording.outcome.peak_force_n,
            overlap_mm: overlap::penetration_mm(&self.scene, &recording.samples),
            run_s: 1e-3 * f64::from(recording.outcome.ticks),
            missed: recording.outcome.missed_ticks,
            instructions: (recording.outcome.instructions_per_tick_max).map_or(f64::NAN, f64::from),
        };
        let first = recording.samples.first().map_or(0, |sample| sample.tick);
        let mut held_since = None;
        for sample in &recording.samples {
            let Some((_, pose)) = &sample.object else { continue };
            let at = pose_mm(pose);
            if !seen.is_in && self.is_in(&at) {
                seen.is_in = true;
                seen.after_s = 1e-3 * f64::from(sample.tick - first);
            }
            if sample.guidance.engagement < 1.0 {
                held_since = None;
            } else if sample.tick - *held_since.get_or_insert(sample.tick) > SETTLING_TICKS {
                let error = self.target.alignment_error(&at, &self.other);
                seen.off_mm = seen.off_mm.max(error.distance_mm);
                seen.off_rad = seen.off_rad.max(error.angle_rad);
            }
        }
        seen
    }
}

/// Direction and length of the last straight line of a fit's way in, mm.
fn way(fit: &Fit) -> Option<(DVec3, f64)> {
    let path = fit.path.as_ref()?;
    let length = match path.corners_mm.as_slice() {
        [.., from, to] => from.distance(*to),
        _ => path.length_mm,
    };
    Some((path.direction.try_normalize()?, length))
}

/// Extent along the way over which the mating faces of both parts overlap in the fit, mm.
fn mating_depth(model: &CadModel, parts: [usize; 2], fit: &Fit, into: DVec3) -> f64 {
    let places = [fit.placement, model.parts[parts[1]].placement];
    let extent = |side: usize| {
        let mesh = &model.shapes[model.parts[parts[side]].shape].mesh;
        let of = |face: &u32| fit.faces.iter().any(|faces| faces[side] == *face);
        (mesh.triangles.iter().zip(&mesh.triangle_face))
            .filter(|(_, face)| of(face))
            .flat_map(|(triangle, _)| triangle)
            .map(|&vertex| {
                places[side]
                    .transform_point3(mesh.vertices[vertex as usize])
                    .dot(into)
            })
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            })
    };
    let (a, b) = (extent(0), extent(1));
    (a.1.min(b.1) - a.0.max(b.0)).max(0.0)
}

/// A hand that is this far off, in random directions.
pub(crate) fn off(random: &mut fastrand::Rng, aside_mm: f64, turn_deg: f64) -> Off {
    let mut signed = || 2.0 * random.f64() - 1.0;
    let axis = DQuat::from_xyzw(signed(), signed(), signed(), 0.01).normalize() * DVec3::Z;
    Off {
        aside_mm,
        direction_rad: std::f64::consts::PI * signed(),
        turn: turn_deg.to_radians() * axis,
    }
}
