//! Commissioning of simulated boards, sound ones and ones with a fault each, driven as an operator would drive it.

use mortise_mechanism::kinematics::Model;
use mortise_protocol::message::{InputFault, InputFaultKind, ToDevice};
use mortise_protocol::rig::Rig;

use super::*;
use crate::{Client, EXAMPLES, Patience, describe, parse_rig};

/// A simulated board in lockstep with a description in use, and the wiring of its mechanism.
struct Bench {
    client: Client,
    wiring: Vec<InputFaultKind>,
    commissioning: Commissioning,
}

impl Bench {
    fn new(rig: &Rig, wiring: &[InputFaultKind]) -> Self {
        let transport = crate::simulate(&crate::Flash::default(), false).expect("a simulated board");
        let client = Client::over(transport, "bench", Patience::long(), None).expect("it answers");
        client.request(ToDevice::SetRig(rig.clone())).expect("accepted");
        let client = client.restart().expect("it starts again");
        let bench = Self {
            client,
            wiring: wiring.to_vec(),
            commissioning: Commissioning::new(rig.clone()),
        };
        bench.wire();
        bench
    }

    /// The mechanism is wired as given from now on.
    fn wire(&self) {
        let faults = self.wiring.iter().map(|&kind| InputFault {
            tick: 0,
            ticks: u32::MAX,
            kind,
        });
        self.client
            .request(ToDevice::SimulatedInputs(faults.collect()))
            .expect("a simulated mechanism");
    }

    fn see(&mut self) {
        let readings = self.client.readings().expect("readings");
        self.commissioning.see(&readings);
    }

    /// Moves the joints to these angles by hand. The hand knows the true mechanism.
    fn turn_to(&mut self, angles: [f32; 3]) {
        let script = operator::lead(self.commissioning.in_use(), &[angles]).expect("a posture");
        self.client
            .request(ToDevice::SimulatedHand(script))
            .expect("a hand");
        self.wait(900);
    }

    /// Lets the handle go.
    fn let_go(&mut self) {
        let script = operator::loose();
        self.client
            .request(ToDevice::SimulatedHand(script))
            .expect("a hand");
        self.wait(300);
    }

    /// Time passes: the board is not in lockstep, and as fast as it can be.
    fn wait(&mut self, ms: u32) {
        let start = self.client.readings().expect("readings").tick;
        while self.client.readings().expect("readings").tick.wrapping_sub(start) < ms {}
    }

    /// Takes the present step as an operator would, with a sound stop button; returns its outcome.
    fn take(&mut self) -> Outcome {
        let at = self.commissioning.at();
        let rig = self.commissioning.in_use().clone();
        let homes = operator::homes(&rig);
        match self.commissioning.step().expect("a step") {
            Step::Encoder(joint) => {
                // On the side of home on which the links stay away from a singular posture.
                let model = Model::new(&rig).expect("a sound description");
                let wide = |by: f32| {
                    let mut angles = homes;
                    angles[usize::from(joint)] += by;
                    let posture = model.posture(angles, [0.0; 3]);
                    posture.map_or(0.0, |posture| posture.isotropy)
                };
                let (mut from, mut to) = (homes, homes);
                if wide(0.3) >= wide(-0.3) {
                    to[usize::from(joint)] += 0.3;
                } else {
                    from[usize::from(joint)] -= 0.3;
                }
                self.turn_to(from);
                self.see();
                self.commissioning.again();
                self.turn_to(to);
                self.see();
                self.commissioning.done();
                self.turn_to(homes);
            }
            Step::Send => {
                self.see();
                if self.commissioning.at() == at {
                    let wanted = self.commissioning.rig().clone();
                    self.client.request(ToDevice::SetRig(wanted)).expect("accepted");
                    self.client.restart_board().expect("it starts again");
                    self.wire();
                    let (rig, in_use) = self.client.rig().expect("a description");
                    assert!(in_use);
                    self.commissioning.sent(rig.ok_or_else(|| "lost".to_owned()));
                }
            }
            Step::Reference => {
                let result = self.client.request(ToDevice::Home);
                self.commissioning
                    .referenced(result.map_err(|error| error.to_string()));
            }
            Step::StopInput => {
                self.see();
                self.wiring.push(InputFaultKind::StopOpen);
                self.wire();
                self.wait(20);
                self.see();
                self.wiring.pop();
                self.wire();
                self.wait(20);
                self.see();
                self.client
                    .request(ToDevice::ClearFault)
                    .expect("nothing is wrong any more");
            }
            Step::Motor(joint) => {
                self.let_go();
                let result = both_ways(&self.client, joint, 1.0);
                let result = result.map_err(|error| error.to_string());
                self.commissioning
                    .tested(result.and_then(|tests| tests.ok_or_else(|| "no rest".to_owned())));
            }
            Step::Workspace => {
                for (number, joint) in rig.joints.iter().enumerate() {
                    for end in joint.range {
                        let mut angles = homes;
                        angles[number] += 0.8 * (end - joint.home);
                        self.turn_to(angles);
                        self.see();
                    }
                }
                self.commissioning.done();
            }
        }
        let steps: Vec<Outcome> = self
            .commissioning
            .steps()
            .map(|(_, outcome)| outcome.clone())
            .collect();
        steps[at].clone()
    }

    /// Takes steps until one fails or all are done; the outcomes.
    fn take_all(&mut self) -> Vec<(Step, Outcome)> {
        let mut found = Vec::new();
        while let Some(step) = self.commissioning.step() {
            let outcome = self.take();
            let done = outcome.is_done();
            found.push((step, outcome));
            if !done {
                break;
            }
        }
        found
    }
}

fn example(name: &str) -> Rig {
    let (_, text) = EXAMPLES.iter().find(|(known, _)| *known == name).expect(name);
    parse_rig(text, name).expect("an example")
}

fn failed(found: &[(Step, Outcome)]) -> (Step, &str) {
    match found.last() {
        Some((step, Outcome::Failed(words))) => (*step, words),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_rig_that_is_as_described_passes_every_step_and_nothing_is_corrected() {
    for (name, text) in EXAMPLES {
        let rig = parse_rig(text, name).expect(name);
        let mut bench = Bench::new(&rig, &[]);
        let found = bench.take_all();
        assert_eq!(bench.commissioning.step(), None, "{name}: {found:#?}");
        for (step, outcome) in &found {
            assert!(
                matches!(outcome, Outcome::Passed(_)),
                "{name}, {step:?}: {outcome:?}"
            );
        }
        assert_eq!(bench.commissioning.rig(), &rig);
        assert!(bench.commissioning.changes().is_empty());
    }
}

/// Every joint of every example with its encoder, its motor, or both the wrong way round: reported, corrected, sent, and right from then on.
#[test]
fn a_wrong_sense_is_corrected_and_the_corrected_description_passes() {
    for (name, text) in EXAMPLES {
        let rig = parse_rig(text, name).expect(name);
        for axis in 0..rig.joints.len() as u8 {
            let described = rig.joints[usize::from(axis)];
            let encoder = InputFaultKind::EncoderSense {
                axis,
                reversed: !described.encoder_reversed,
            };
            let motor = InputFaultKind::MotorSense {
                axis,
                reversed: !described.motor_reversed,
            };
            for wiring in [vec![encoder], vec![motor], vec![encoder, motor]] {
                let mut bench = Bench::new(&rig, &wiring);
                let found = bench.take_all();
                assert_eq!(bench.commissioning.step(), None, "{name}, {wiring:?}: {found:#?}");
                let corrected: Vec<Step> = found
                    .iter()
                    .filter(|(_, outcome)| matches!(outcome, Outcome::Corrected(_)))
                    .map(|(step, _)| *step)
                    .collect();
                let mut expected = Vec::new();
                if wiring.contains(&encoder) {
                    expected.push(Step::Encoder(axis));
                }
                if wiring.contains(&motor) {
                    expected.push(Step::Motor(axis));
                }
                assert_eq!(corrected, expected, "{name}, {wiring:?}");
                let mut right = rig.clone();
                let joint = &mut right.joints[usize::from(axis)];
                joint.encoder_reversed ^= wiring.contains(&encoder);
                joint.motor_reversed ^= wiring.contains(&motor);
                let (kept, in_use) = bench.client.rig().expect("a description");
                assert_eq!(
                    (kept.as_ref(), in_use),
                    (Some(&right), true),
                    "{name}, {wiring:?}"
                );
            }
        }
    }
}

#[test]
fn a_dead_encoder_ends_the_steps_before_anything_is_driven() {
    let rig = example("woodenhaptics");
    for axis in 0..3 {
        let mut bench = Bench::new(&rig, &[InputFaultKind::EncoderStuck { axis }]);
        let found = bench.take_all();
        let (step, words) = failed(&found);
        assert_eq!(step, Step::Encoder(axis));
        assert!(
            words.contains("does not count") && words.contains("plug"),
            "{words}"
        );
        let statistics = bench.client.statistics(false).expect("counters");
        assert_eq!(statistics.peak_force, 0.0);
    }
}

#[test]
fn swapped_encoders_are_named() {
    for (name, axis, with) in [
        ("woodenhaptics", 0, 2),
        ("woodenhaptics", 1, 2),
        ("haply_2diy", 0, 1),
    ] {
        let mut bench = Bench::new(&example(name), &[InputFaultKind::EncodersSwapped { axis, with }]);
        let found = bench.take_all();
        let (step, words) = failed(&found);
        assert_eq!(step, Step::Encoder(axis), "{name}");
        assert!(
            words.contains(&format!("encoder {} counts", with + 1)) && words.contains("swapped"),
            "{words}"
        );
    }
}

#[test]
fn a_dead_motor_is_reported_and_the_next_is_not_driven() {
    let mut bench = Bench::new(
        &example("woodenhaptics"),
        &[InputFaultKind::MotorDead { axis: 1 }],
    );
    let found = bench.take_all();
    let (step, words) = failed(&found);
    assert_eq!(step, Step::Motor(1));
    assert!(words.contains("motor 2 moves nothing"), "{words}");
    // Mended, it goes on from there.
    bench.wiring.clear();
    bench.wire();
    bench.commissioning.again();
    assert!(bench.take().is_done());
    assert_eq!(bench.commissioning.step(), Some(Step::Motor(2)));
}

#[test]
fn a_stop_button_without_effect_or_with_a_broken_wire_is_reported() {
    let rig = example("hapkit");
    let mut bench = Bench::new(&rig, &[]);
    while bench.commissioning.step() != Some(Step::StopInput) {
        assert!(bench.take().is_done());
    }
    bench.see();
    bench.commissioning.done();
    let words = bench.commissioning.outcome().words().to_owned();
    assert!(
        words.contains("did not open") && words.contains("do not arm"),
        "{words}"
    );
    assert_eq!(bench.commissioning.step(), Some(Step::StopInput));

    // The wire is broken: open before anybody presses.
    bench.wiring = vec![InputFaultKind::StopOpen];
    bench.wire();
    bench.wait(20);
    bench.commissioning.again();
    bench.see();
    let words = bench.commissioning.outcome().words().to_owned();
    assert!(words.contains("wire is broken"), "{words}");
    // And the board drives nothing then.
    let refused = both_ways(&bench.client, 0, 1.0).expect_err("stop is open");
    assert!(refused.to_string().contains("stop input"), "{refused}");

    // Mended: pressed and released, the step passes.
    bench.wiring.clear();
    bench.wire();
    bench.wait(20);
    bench.see();
    assert_eq!(bench.commissioning.outcome(), &Outcome::Open);
    assert!(bench.take().is_done());
}

#[test]
fn a_step_taken_back_takes_its_correction_back() {
    let rig = example("haply_2diy");
    let mut bench = Bench::new(
        &rig,
        &[InputFaultKind::EncoderSense {
            axis: 1,
            reversed: true,
        }],
    );
    assert!(bench.take().is_done());
    assert!(matches!(bench.take(), Outcome::Corrected(_)));
    assert_eq!(
        bench.commissioning.changes(),
        ["joint 2: encoder_reversed = true"]
    );
    bench.commissioning.back();
    assert_eq!(bench.commissioning.step(), Some(Step::Encoder(1)));
    assert_eq!(bench.commissioning.rig(), &rig);
    assert!(bench.commissioning.changes().is_empty());
    // Over a step that had nothing to send.
    let mut bench = Bench::new(&rig, &[]);
    for _ in 0..3 {
        bench.take();
    }
    assert_eq!(bench.commissioning.step(), Some(Step::Reference));
    bench.commissioning.back();
    assert_eq!(bench.commissioning.step(), Some(Step::Encoder(1)));
}

#[test]
fn a_joint_that_is_hardly_turned_or_falls_by_itself_is_not_judged() {
    let rig = example("woodenhaptics");
    let counts = |joint: usize, count: i32| {
        let mut counts = [0; 6];
        counts[joint] = count;
        counts
    };
    let per_degree = 2000.0 * 12.0 / 360.0;
    let far = (12.0 * per_degree) as i32;
    assert_eq!(encoder_sense(&rig, 1, &counts(1, far)), Sense::Forward);
    assert_eq!(encoder_sense(&rig, 1, &counts(1, -far)), Sense::Backward);
    assert_eq!(encoder_sense(&rig, 1, &counts(1, far / 2)), Sense::Unclear);
    assert_eq!(encoder_sense(&rig, 1, &counts(1, 2)), Sense::Still);
    assert_eq!(encoder_sense(&rig, 1, &counts(2, far)), Sense::Other(2));
    let test = |moved| MotorTest { moved, far: false };
    let pair = |forth, back| [test(counts(0, forth)), test(counts(0, back))];
    assert_eq!(motor_sense(&rig, 0, &pair(40, -35)), Sense::Forward);
    assert_eq!(motor_sense(&rig, 0, &pair(-40, 35)), Sense::Backward);
    assert_eq!(motor_sense(&rig, 0, &pair(90, 60)), Sense::Unclear);
    assert_eq!(motor_sense(&rig, 0, &pair(3, -3)), Sense::Still);
    assert_eq!(motor_sense(&rig, 1, &pair(60, -60)), Sense::Other(0));
}

/// Ranges in degrees: one that was reached, one reached in part, and ones exceeded at either end or both.
#[test]
fn a_range_is_widened_only_at_the_end_that_was_exceeded() {
    use super::verdict::{Reached, range};
    let of = |described: [f32; 2], reached: [f32; 2]| {
        let (found, note) = range(described.map(f32::to_radians), reached.map(f32::to_radians));
        (found.map(|end| (10.0 * end.to_degrees()).round() / 10.0), note)
    };
    let described = [-60.0, 80.0];
    assert_eq!(of(described, [-59.0, 80.9]), (described, Reached::Whole));
    let (found, note) = of(described, [-20.0, 50.0]);
    assert_eq!(found, described);
    assert!(
        matches!(note, Reached::Part(share) if (share - 0.5).abs() < 1e-5),
        "{note:?}"
    );
    assert_eq!(of(described, [-65.0, 30.0]), ([-66.0, 80.0], Reached::Beyond));
    assert_eq!(of(described, [0.0, 84.0]), ([-60.0, 85.0], Reached::Beyond));
    assert_eq!(of(described, [-70.0, 90.0]), ([-71.0, 91.0], Reached::Beyond));
}

#[test]
fn every_instruction_and_verdict_says_something_to_do() {
    for (name, text) in EXAMPLES {
        let mut bench = Bench::new(&parse_rig(text, name).expect(name), &[]);
        while bench.commissioning.step().is_some() {
            let words = bench.commissioning.instruction();
            assert!(words.len() > 30 && words.ends_with('.'), "{words}");
            let outcome = bench.take();
            assert!(outcome.is_done(), "{name}: {outcome:?}");
        }
        assert!(bench.commissioning.instruction().contains("done"));
    }
    assert!(describe(mortise_protocol::message::DeviceState::Testing).contains("motor"));
}
