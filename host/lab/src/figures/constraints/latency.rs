//! Time from a touch on the board to a target in force, over the emulated board's serial line.
//!
//! The time is a sum over two clocks. The board's own, in lockstep, counts from the touch to the sample that reports it and from the target's arrival
//! to the sample that reports it in force. This computer's counts from the end of that sample's run to the board's answer to the target: reading the
//! sample, recognition, both directions of the line. An emulated board is slower than a real one, so a single clock would measure the emulator.

use std::time::Instant;

use glam::{DQuat, DVec3};
use mortise_bake::Grabbable;
use mortise_guide::{Guide, GuideSettings};
use mortise_protocol::message::{HandScript, Keyframe, Telemetry, ToDevice, WirePose};
use mortise_rig::{Client, Event};
use mortise_scenario::{PreparedScene, ScenarioError};

use crate::LabError;
use crate::figures::{Plan, Row};
use crate::fit::Fit;
use crate::guided::{emulated, insertion};
use crate::variant::Variant;

const MEDIAN_MS: f64 = 30.0;
const P99_MS: f64 = 100.0;
/// Number of touches, in the full and in the shorter form.
const TOUCHES: u32 = 100;
const TOUCHES_QUICK: u32 = 20;
/// Ticks between samples.
const EVERY_TICKS: u16 = 5;
/// Ticks of the hand's motion down.
const DOWN_TICKS: u32 = 150;
/// Ticks within which an expected sample must arrive.
const PATIENCE_TICKS: u32 = 4000;

/// Sets the peg down 1 mm off on its hole's rim, repeatedly.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let touches = if plan.quick { TOUCHES_QUICK } else { TOUCHES };
    let fit = Fit::thesis(0.2).engaged(-4.0);
    let file = fit.file()?;
    let scenario = insertion(&fit, file.path())?;
    let options = Variant::field(1.0).options(Grabbable::Named(vec!["peg".into()]));
    let scene = PreparedScene::with(&scenario, &options)?;
    let client = Client::connect(&emulated())?;
    let grip = DVec3::from_array(scenario.hand.grip_mm);
    let mut bench = Bench {
        client: &client,
        guide: scene.guide(GuideSettings::default()),
        grip,
        sent_ms: f64::NAN,
    };
    client.upload(&scene.image, &mut |_| {})?;
    bench.move_hand(-grip, DVec3::ZERO, 2 * DOWN_TICKS)?;
    client.run(4 * DOWN_TICKS)?;
    client.request(ToDevice::Arm)?;
    client.request(ToDevice::Grab { part: scene.part })?;
    let every_ticks = EVERY_TICKS;
    client.request(ToDevice::SetTelemetry { every_ticks })?;
    let mut delays = Vec::new();
    for number in 0..touches {
        delays.push(bench.touch(number)?);
    }
    client.stop()?;
    delays.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| delays[((delays.len() - 1) as f64 * share).round() as usize];
    let what = |what: &str| {
        format!(
            "from touch to target in force, {touches} touches, telemetry each {EVERY_TICKS} ms, emulated board's serial line, \
             the board's virtual time and this computer's wall time for its part added: {what}"
        )
    };
    out(Row::at_most(what("median"), at(0.5), "ms", MEDIAN_MS).varies());
    out(Row::at_most(what("99th percentile"), at(0.99), "ms", P99_MS).varies());
    Ok(())
}

struct Bench<'c, 's> {
    client: &'c Client,
    guide: Guide<'s>,
    /// Where the hand holds the handle, mm.
    grip: DVec3,
    /// This computer's share of the delay of the last target sent, ms.
    sent_ms: f64,
}

impl Bench<'_, '_> {
    /// Moves down onto the rim until a target is in force, then up until none is; returns the delay, ms.
    fn touch(&mut self, number: u32) -> Result<f64, LabError> {
        let (up, down) = (DVec3::ZERO, DVec3::new(1.0, 0.0, -5.0));
        // Varies the tick of the touch between two samples.
        self.move_hand(up, down, DOWN_TICKS + number % u32::from(EVERY_TICKS))?;
        self.sent_ms = f64::NAN;
        let (mut untouched, mut touched) = (None, false);
        let active = self.until(|sample| {
            touched |= !sample.pairs.is_empty();
            if !touched {
                untouched = Some(sample.tick);
            }
            sample.guidance.active > 0
        })?;
        self.move_hand(down, up, DOWN_TICKS)?;
        self.until(|sample| sample.guidance.active == 0 && sample.pairs.is_empty())?;
        // The earliest tick of the touch is the one after the last sample without contact.
        let ticks = untouched.map_or(f64::NAN, |untouched| f64::from(active - (untouched + 1)));
        Ok(ticks + self.sent_ms)
    }

    /// Moves the hand from one offset to another, mm from the grip.
    fn move_hand(&self, from: DVec3, to: DVec3, ticks: u32) -> Result<(), LabError> {
        let keyframe = |tick, offset: DVec3| Keyframe {
            tick,
            pose: WirePose {
                position: (1e-3 * (self.grip + offset)).as_vec3().to_array(),
                orientation: DQuat::IDENTITY.as_quat().to_array(),
            },
            push: [0.0; 3],
        };
        self.client.request(ToDevice::SimulatedHand(HandScript {
            stiffness: 400.0,
            damping: 4.0,
            angular_stiffness: 2.0,
            angular_damping: 0.02,
            tremor: 0.0,
            tremor_hz: 10.0,
            keyframes: [keyframe(0, from), keyframe(ticks, to)].into_iter().collect(),
        }))?;
        Ok(())
    }

    /// Guides from sample to sample until one is as `wanted`; returns its tick.
    fn until(&mut self, mut wanted: impl FnMut(&Telemetry) -> bool) -> Result<u32, LabError> {
        let mut left = PATIENCE_TICKS;
        while left > 0 {
            let batch = left.min(u32::from(EVERY_TICKS));
            left -= batch;
            self.client.run(batch)?;
            let begun = Instant::now();
            // The sample may arrive after the answer to the run, but not after this answer.
            self.client.run(0)?;
            for event in self.client.events().try_iter() {
                match event {
                    Event::Telemetry(sample) => {
                        for message in self.guide.hear(&sample) {
                            let sets = matches!(message, ToDevice::SetTarget(_));
                            self.client.request(message)?;
                            if sets && self.sent_ms.is_nan() {
                                self.sent_ms = 1e3 * begun.elapsed().as_secs_f64();
                            }
                        }
                        if wanted(&sample) {
                            return Ok(sample.tick);
                        }
                    }
                    Event::Fault { tick, fault } => {
                        let what = mortise_rig::describe(fault);
                        return Err(ScenarioError::Fault { tick, what }.into());
                    }
                    _ => {}
                }
            }
        }
        Err(LabError::Input {
            name: "touches on the emulated board".into(),
            what: format!("what should have happened did not within {PATIENCE_TICKS} ticks"),
        })
    }
}
