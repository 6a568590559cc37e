//! The insertions of an assembly, played one after another on a rig by a simulated hand: what each is felt like, and where it caught.
//!
//! Every part is felt where the steps before have left the others. Parts that are not yet put on are placed far away; the next one is placed at the start of its
//! way ([`ToDevice::Place`]), and the hand takes it at its centre of mass. Of a group, which moves as one, a scene is baked in which it is one part. The hand comes slightly off its way, trembles, and pulls through a spring, so that
//! contact and guidance, and not the script, bring the part in. Constraints that the designed place satisfies are pinned as they are recognised.

use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::BakeReport;
use mortise_brep::CadModel;
use mortise_guide::{Guide, GuideSettings};
use mortise_mating::recognise::TargetId;
use mortise_protocol::image::CRC;
use mortise_protocol::message::{DeviceState, HandScript, Keyframe, Telemetry, ToDevice};
use mortise_rig::Client;
use mortise_task::insertion::Insertion;

use crate::error::ScenarioError;
use crate::group::GroupScene;
use crate::hand::{REACH_TICKS, REST_TICKS, TICK_HZ};
pub use crate::hand_way::Manner;
use crate::hand_way::{Way, between, rotation, scripts};
use crate::run::{FADE_TICKS, Play};
use crate::wire::{pose_mm, to_wire, vector};

/// Where parts are that take no part in a step, mm: beyond every other part, within what a board accepts.
const AWAY_MM: DVec3 = DVec3::new(5e4, 0.0, 0.0);
/// A part is in when every vertex of its tessellation is this near to its designed place, mm.
pub const IN_PLACE_MM: f64 = 0.05;
/// Constraints with a smaller alignment error at the designed place belong to the design, mm and radians.
const DESIGNED: (f64, f64) = (0.005, 0.001);
/// Ticks between answers to samples.
const HEED_TICKS: u16 = 10;
/// Ticks for which the hand waits in place at the end, and after each correction.
const SETTLE_TICKS: u32 = 300;
/// Attempts to bring a part in.
const ATTEMPTS: usize = 3;
/// Corrections of the hand at the end, and how far they move it in all, mm and radians.
const CORRECTIONS: usize = 3;
const CORRECTED: (f64, f64) = (0.5, 0.02);

/// A scene of all parts of an assembly.
#[derive(Clone, Copy, Debug)]
pub struct AssemblyScene<'a> {
    /// The parts, at their designed places.
    pub model: &'a CadModel,
    /// The scene image, with every part that is inserted grabbable.
    pub image: &'a [u8],
    /// The baker's report.
    pub report: &'a BakeReport,
}

/// A moment of an insertion.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Moment {
    /// Force on the handle, N.
    pub force_n: f64,
    /// Distance of the part's centre of mass from its designed place, mm.
    pub left_mm: f64,
    /// The part that it touched deepest; `None`: none.
    pub against: Option<String>,
}

/// How an insertion was felt.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Inserted {
    /// The part.
    pub part: String,
    /// Whether it is in place at the end: within [`IN_PLACE_MM`].
    pub in_place: bool,
    /// Farthest of a point of the part from where the design has it, µm.
    pub off_um: f64,
    /// When the force on the handle was largest.
    pub peak: Moment,
    /// Where it caught: the end of each attempt that did not bring it in. The hand then draws it back and comes again, half as far off.
    pub caught: Vec<Moment>,
    /// Largest torque on the handle, N·m.
    pub peak_torque_nm: f64,
    /// Time from the grab to the end, s.
    pub time_s: f64,
    /// Ticks that came too late.
    pub missed_ticks: u32,
    /// Largest cost of a tick, in the board's unit.
    pub cost_max: u32,
}

impl Inserted {
    /// The insertion in words.
    pub fn words(&self) -> String {
        let end = if self.in_place {
            format!("in, {:.1} µm from its place", self.off_um)
        } else {
            format!("NOT in, {:.3} mm from its place", self.off_um / 1e3)
        };
        let caught: String = (self.caught.iter())
            .map(|moment| format!("; caught {}", moment.place()))
            .collect();
        format!(
            "{}: {end}{caught}; at most {:.2} N, {}; {:.1} s",
            self.part,
            self.peak.force_n,
            self.peak.place(),
            self.time_s
        )
    }
}

impl Moment {
    fn place(&self) -> String {
        let at = (self.against.as_ref()).map_or(String::new(), |part| format!(" at {part}"));
        format!("{:.1} mm before its place{at}", self.left_mm)
    }
}

/// Plays `insertions` in their order on `client`, which is connected and in lockstep ([`crate::connect`]). Each result is reported once it is known; a part that does
/// not go in stays where it is, and the next step begins with it there.
///
/// # Errors
/// `NeedsSimulatedHand`, `Rig`, `Fault`, `Bake` of a group; `Input` when a part is not in the scene, for it has no surface.
pub fn play_insertions(
    client: &Client,
    scene: &AssemblyScene<'_>,
    insertions: &[Insertion],
    manner: &Manner,
    report: &mut dyn FnMut(Inserted),
) -> Result<(), ScenarioError> {
    if !client.capabilities().simulated {
        return Err(ScenarioError::NeedsSimulatedHand {
            rig: client.name().to_owned(),
            scenario: "the steps of an assembly".into(),
        });
    }
    let mut rests: Vec<DAffine3> = scene.model.parts.iter().map(|part| part.placement).collect();
    let mut bench: Option<Bench<'_>> = None;
    for insertion in insertions {
        if !insertion.with.is_empty() {
            // The board gets the group's scene instead.
            bench = None;
            report(play_group(client, scene, insertion, &rests, manner)?);
            continue;
        }
        let bench = match &mut bench {
            Some(bench) => bench,
            None => bench.insert(Bench::new(client, scene, rests.clone())?),
        };
        report(bench.insert(insertion, manner)?);
        rests.clone_from(&bench.rests);
    }
    Ok(())
}

/// Plays a step in which a group moves as one, in a scene of its own. Where it ends is not kept: the steps that follow find it where the design has it.
fn play_group(
    client: &Client,
    scene: &AssemblyScene<'_>,
    insertion: &Insertion,
    rests: &[DAffine3],
    manner: &Manner,
) -> Result<Inserted, ScenarioError> {
    let group = GroupScene::new(scene.model, insertion, rests)?;
    let scene = AssemblyScene {
        model: &group.model,
        image: &group.image,
        report: &group.report,
    };
    Bench::new(client, &scene, group.rests.clone())?.insert(&group.insertion, manner)
}

/// The rig, and where everything is on it.
struct Bench<'a> {
    play: Play<'a>,
    scene: AssemblyScene<'a>,
    guide: Guide<'a>,
    /// Where each part of the model rests when it takes part, mm.
    rests: Vec<DAffine3>,
    /// Where each part of the model is on the board, mm; `None`: not known.
    placed: Vec<Option<DAffine3>>,
    /// Last target of the hand, mm.
    hand: DAffine3,
}

impl<'a> Bench<'a> {
    fn new(
        client: &'a Client,
        scene: &AssemblyScene<'a>,
        rests: Vec<DAffine3>,
    ) -> Result<Self, ScenarioError> {
        if matches!(client.state(), DeviceState::Stopped | DeviceState::Fault(_)) {
            client.request(ToDevice::ClearFault)?;
        }
        if client.refresh_capabilities()?.scene != Some(CRC.checksum(scene.image)) {
            client.upload(scene.image, &mut |_| {})?;
        }
        client.request(ToDevice::ResetScene)?;
        client.request(ToDevice::SetTelemetry {
            every_ticks: HEED_TICKS,
        })?;
        let parts = (scene.report.parts.iter()).map(|part| part.model_part).collect();
        Ok(Self {
            play: Play::new(client),
            scene: *scene,
            guide: Guide::new(scene.model, parts, GuideSettings::default()),
            placed: vec![None; rests.len()],
            rests,
            hand: DAffine3::IDENTITY,
        })
    }

    fn insert(&mut self, insertion: &Insertion, manner: &Manner) -> Result<Inserted, ScenarioError> {
        let client = self.play.client;
        let part = insertion.part;
        let grabbed = self.index(part)?;
        self.arrange(insertion)?;
        let mut way = Way::new(self.scene.model, insertion, manner);
        self.follow(&[(0, self.hand), (REACH_TICKS, way.grip())], 0.0, manner)?;
        self.play.run(REACH_TICKS + REST_TICKS)?;
        client.request(ToDevice::Arm)?;
        client.request(ToDevice::Grab { part: grabbed })?;
        client.statistics(true)?;
        // Those of before the grab have all arrived with this answer.
        self.play.listen()?;
        self.play.samples.clear();
        let designed = self.designed(part, &insertion.onto);
        let mut caught = Vec::new();
        let mut manner = *manner;
        let in_place = loop {
            self.along(&way.keys, &manner, &designed)?;
            self.correct(part, &designed, &manner)?;
            let Some(at) = last_pose(&self.play.samples) else {
                break false;
            };
            if self.off_mm(part, &at) <= IN_PLACE_MM {
                break true;
            }
            caught.extend(self.play.samples.last().map(|sample| self.moment(part, sample)));
            if caught.len() == ATTEMPTS {
                break false;
            }
            self.along(&way.back(self.hand), &manner, &designed)?;
            (manner.off_mm, manner.off_rad) = (0.5 * manner.off_mm, 0.5 * manner.off_rad);
            way = Way::new(self.scene.model, insertion, &manner);
        };
        let statistics = client.statistics(false)?;
        self.play.listen()?;
        client.request(ToDevice::Release)?;
        client.request(ToDevice::Disarm)?;
        self.play.run(FADE_TICKS)?;
        let samples = std::mem::take(&mut self.play.samples);
        let end = last_pose(&samples).unwrap_or(insertion.way[0]);
        self.placed[part] = Some(end);
        let off_mm = self.off_mm(part, &end);
        // Connected: the parts that follow find it where the design has it.
        if !in_place {
            self.rests[part] = end;
        }
        Ok(Inserted {
            part: self.scene.model.parts[part].name.clone(),
            in_place,
            off_um: 1e3 * off_mm,
            peak: self.peak(part, &samples),
            caught,
            peak_torque_nm: f64::from(statistics.peak_torque),
            time_s: f64::from(statistics.ticks) / TICK_HZ,
            missed_ticks: statistics.missed_ticks,
            cost_max: statistics.cost_max,
        })
    }

    /// Moves the hand by what the part is off its place, as a person does who sees it; without tremor, which would stay with the part.
    fn correct(&mut self, part: usize, designed: &[TargetId], manner: &Manner) -> Result<(), ScenarioError> {
        let place = self.scene.model.parts[part].placement;
        let end = self.hand;
        self.follow(&[(0, end)], 0.0, manner)?;
        self.heed(SETTLE_TICKS, designed)?;
        for _ in 0..CORRECTIONS {
            let Some(at) = last_pose(&self.play.samples) else {
                break;
            };
            let wanted = place * at.inverse() * self.hand;
            let (slide, turn) = between(&end, &wanted);
            let wanted = DAffine3::from_rotation_translation(
                DQuat::from_scaled_axis(turn.clamp_length_max(CORRECTED.1)) * rotation(&end),
                end.translation + slide.clamp_length_max(CORRECTED.0),
            );
            self.follow(&[(0, self.hand), (SETTLE_TICKS / 2, wanted)], 0.0, manner)?;
            self.heed(SETTLE_TICKS, designed)?;
        }
        Ok(())
    }

    /// Places every part for a step: those that it is put onto where they rest, itself at the start, all others away.
    fn arrange(&mut self, insertion: &Insertion) -> Result<(), ScenarioError> {
        for (index, baked) in self.scene.report.parts.iter().enumerate() {
            let part = baked.model_part;
            let pose = if part == insertion.part {
                insertion.way[0]
            } else if insertion.onto.contains(&part) {
                self.rests[part]
            } else {
                DAffine3::from_translation(AWAY_MM)
            };
            self.guide.place(part, pose);
            if self.placed[part] == Some(pose) {
                continue;
            }
            self.play.client.request(ToDevice::Place {
                part: index as u16,
                pose: to_wire(&pose),
            })?;
            self.placed[part] = Some(pose);
        }
        Ok(())
    }

    /// Index in the scene of a part of the model.
    fn index(&self, part: usize) -> Result<u16, ScenarioError> {
        let found = (self.scene.report.parts.iter()).position(|baked| baked.model_part == part);
        (found.and_then(|index| u16::try_from(index).ok())).ok_or_else(|| ScenarioError::Input {
            name: self.scene.model.parts[part].name.clone(),
            what: "it has no surface, and cannot be held; leave it out of the file".into(),
        })
    }

    /// Sends the hand along these poses, mm, at these ticks from now.
    fn follow(
        &mut self,
        keys: &[(u32, DAffine3)],
        tremor_mm: f64,
        manner: &Manner,
    ) -> Result<(), ScenarioError> {
        let keyframes = keys.iter().map(|&(tick, pose)| Keyframe {
            tick,
            pose: to_wire(&pose),
            push: [0.0; 3],
        });
        // Springs and dampers of the hand in the scenarios.
        self.play.client.request(ToDevice::SimulatedHand(HandScript {
            stiffness: 400.0,
            damping: 4.0,
            angular_stiffness: 2.0,
            angular_damping: 0.02,
            tremor: (1e-3 * tremor_mm) as f32,
            tremor_hz: manner.tremor_hz,
            keyframes: keyframes.collect(),
        }))?;
        if let Some((_, last)) = keys.last() {
            self.hand = *last;
        }
        Ok(())
    }

    /// Runs with guidance, by targets of the design before others.
    fn heed(&mut self, ticks: u32, designed: &[TargetId]) -> Result<(), ScenarioError> {
        if ticks == 0 {
            return Ok(());
        }
        let guide = &mut self.guide;
        let mut listener = |sample: &Telemetry| {
            let messages = guide.hear(sample);
            for id in designed {
                guide.recogniser().pin(*id, true);
            }
            messages
        };
        self.play
            .heeding(&mut listener, ticks, u32::from(HEED_TICKS), false)
            .map(|_| ())
    }

    /// Constraints between the part and those it is put onto that hold where the design has both.
    fn designed(&mut self, part: usize, onto: &[usize]) -> Vec<TargetId> {
        let model = self.scene.model;
        let place = |part: usize| model.parts[part].placement;
        let possible = self.guide.recogniser().possible(part);
        (possible.into_iter())
            .filter(|target| onto.contains(&target.id.fixed_part))
            .filter(|target| {
                let error =
                    target.alignment_error(&place(target.id.moving_part), &place(target.id.fixed_part));
                error.distance_mm <= DESIGNED.0 && error.angle_rad <= DESIGNED.1
            })
            .map(|target| target.id)
            .collect()
    }

    /// Farthest of a vertex of the part from where the design has it, mm.
    fn off_mm(&self, part: usize, at: &DAffine3) -> f64 {
        let part = &self.scene.model.parts[part];
        let vertices = &self.scene.model.shapes[part.shape].mesh.vertices;
        let off = |p: &DVec3| {
            at.transform_point3(*p)
                .distance(part.placement.transform_point3(*p))
        };
        vertices.iter().map(off).fold(0.0, f64::max)
    }

    /// When the force was largest.
    fn peak(&self, part: usize, samples: &[Telemetry]) -> Moment {
        let force = |sample: &&Telemetry| vector(sample.wrench.force).length();
        let most = (samples.iter()).max_by(|a, b| force(a).total_cmp(&force(b)));
        most.map(|sample| self.moment(part, sample)).unwrap_or_default()
    }

    fn moment(&self, part: usize, sample: &Telemetry) -> Moment {
        let placed = &self.scene.model.parts[part];
        let center = self.scene.model.shapes[placed.shape].center_of_mass;
        let place = placed.placement.transform_point3(center);
        let at = sample
            .object
            .map(|(_, pose)| pose_mm(&pose).transform_point3(center));
        let against = sample.pairs.first().and_then(|pair| {
            let part = self.scene.report.parts.get(usize::from(pair.static_part))?;
            Some(part.name.clone())
        });
        Moment {
            force_n: vector(sample.wrench.force).length(),
            left_mm: at.map_or(0.0, |at| at.distance(place)),
            against,
        }
    }

    /// Moves the hand along timed targets.
    fn along(
        &mut self,
        keys: &[(u32, DAffine3)],
        manner: &Manner,
        designed: &[TargetId],
    ) -> Result<(), ScenarioError> {
        for script in scripts(keys) {
            self.follow(&script, manner.tremor_mm, manner)?;
            self.heed(script.last().map_or(0, |(tick, _)| *tick), designed)?;
        }
        Ok(())
    }
}

/// Last pose of the held part, mm.
fn last_pose(samples: &[Telemetry]) -> Option<DAffine3> {
    (samples.iter().rev()).find_map(|sample| sample.object.map(|(_, pose)| pose_mm(&pose)))
}
