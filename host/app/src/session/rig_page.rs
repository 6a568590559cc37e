//! State of the page on the rig: its description as edited, the steps of commissioning, and the last seconds of its encoders. Pure.

use std::collections::VecDeque;

use mortise_protocol::message::{InputFaultKind, Readings};
use mortise_protocol::rig::Rig;
use mortise_rig::commissioning::{Commissioning, operator};
use mortise_rig::{Abilities, abilities, parse_rig, write_rig};

use super::mechanism::Mechanism;
use super::mechanism::links::Angles;
use super::readings::ReadingsWatch;

/// Time that the traces of the encoders keep, s.
pub const TRACE_S: f64 = 10.0;

/// An action of the operator on the page on the rig.
#[derive(Clone, Debug, PartialEq)]
pub enum RigIntent {
    /// Replace the text by the description that the board keeps.
    Read,
    /// Replace the text by an example.
    Example(usize),
    /// Ask for the file of a description.
    Browse,
    /// Replace the text by a file.
    Load(std::path::PathBuf),
    /// Ask where to write the description.
    Save,
    /// Write the description.
    Write {
        /// File to write.
        path: std::path::PathBuf,
        /// Whether an existing file may be replaced.
        replace: bool,
    },
    /// Ask where to write a report of commissioning.
    SaveReport,
    /// Write the report.
    WriteReport {
        /// File to write.
        path: std::path::PathBuf,
        /// Whether an existing file may be replaced.
        replace: bool,
    },
    /// Change the text.
    Edit(String),
    /// Change the drawn posture of the described mechanism; nothing is driven.
    Draw(DrawIntent),
    /// Send the description to the board, which restarts.
    Send,
    /// Begin commissioning with the description that the board uses.
    Begin,
    /// The present step was done by hand: judge it.
    Done,
    /// Test the motor of the present step.
    TestMotor,
    /// The mechanism is in its reference pose.
    SetReference,
    /// Send the corrections.
    SendCorrections,
    /// Begin the present step again, from the present pose.
    Again,
    /// Go back one step and take its correction back.
    Back,
    /// End commissioning.
    End,
    /// A simulated operator does by hand what the present step asks for.
    Simulate,
    /// Wire the simulated mechanism in this way from now on.
    Wire(Wiring),
}

/// A change of the drawn posture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DrawIntent {
    /// Turn a joint (from 0) to an angle, rad.
    Joint(usize, f64),
    /// Go to the home pose.
    Home,
    /// Draw the joints where the connected mechanism has them, or no longer.
    Follow(bool),
}

/// How a simulated mechanism is wired, to try commissioning with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wiring {
    /// As described.
    #[default]
    Sound,
    /// The encoder of a joint counts the other way.
    EncoderReversed(u8),
    /// The encoder of a joint does not count.
    EncoderDead(u8),
    /// The motor of a joint pushes the other way.
    MotorReversed(u8),
    /// The motor of a joint does not push.
    MotorDead(u8),
    /// The wire of the stop button is broken.
    StopOpen,
}

impl Wiring {
    /// All ways for a mechanism with so many joints.
    pub fn all(joints: u8) -> impl Iterator<Item = Self> {
        let each = move |of: fn(u8) -> Self| (0..joints).map(of);
        [Self::Sound]
            .into_iter()
            .chain(each(Self::EncoderReversed))
            .chain(each(Self::EncoderDead))
            .chain(each(Self::MotorReversed))
            .chain(each(Self::MotorDead))
            .chain([Self::StopOpen])
    }

    /// Its name.
    pub fn name(self) -> String {
        match self {
            Self::Sound => "as described".into(),
            Self::EncoderReversed(joint) => format!("encoder {} reversed", joint + 1),
            Self::EncoderDead(joint) => format!("encoder {} unplugged", joint + 1),
            Self::MotorReversed(joint) => format!("motor {} reversed", joint + 1),
            Self::MotorDead(joint) => format!("motor {} unplugged", joint + 1),
            Self::StopOpen => "wire of the stop button broken".into(),
        }
    }

    /// The fault at the inputs of the mechanism that `rig` describes.
    pub fn fault(self, rig: &Rig) -> Option<InputFaultKind> {
        let joint = |axis: u8| rig.joints.get(usize::from(axis));
        match self {
            Self::Sound => None,
            Self::EncoderReversed(axis) => joint(axis).map(|joint| InputFaultKind::EncoderSense {
                axis,
                reversed: !joint.encoder_reversed,
            }),
            Self::EncoderDead(axis) => Some(InputFaultKind::EncoderStuck { axis }),
            Self::MotorReversed(axis) => joint(axis).map(|joint| InputFaultKind::MotorSense {
                axis,
                reversed: !joint.motor_reversed,
            }),
            Self::MotorDead(axis) => Some(InputFaultKind::MotorDead { axis }),
            Self::StopOpen => Some(InputFaultKind::StopOpen),
        }
    }
}

/// A description without errors.
#[derive(Clone, Debug)]
pub struct Checked {
    /// The description.
    pub rig: Rig,
    /// What the rig will be able to do.
    pub abilities: Abilities,
    /// Its mechanism, to be drawn.
    pub mechanism: Mechanism,
}

/// See the module.
#[derive(Default)]
pub struct RigPage {
    text: String,
    checked: Option<Result<Box<Checked>, String>>,
    /// Drawn angles, and the number of joints that they belong to.
    drawn: (Angles, usize),
    follows: bool,
    /// The description that the board keeps, and whether it uses it; `None`: not read yet.
    pub on_board: Option<(Option<Rig>, bool)>,
    /// Commissioning under way.
    pub steps: Option<Commissioning>,
    /// What the board is busy with, for this page.
    pub busy: Option<&'static str>,
    /// The wiring of a simulated mechanism, and the fault that it stands for.
    pub wiring: (Wiring, Option<InputFaultKind>),
    /// Reads encoders and inputs while the page shows them.
    pub(super) watch: Option<ReadingsWatch>,
    newest: Option<Readings>,
    /// Tick at which the simulated operator began to bring the mechanism to the pose from which it turns a joint.
    pub(super) hand_since: Option<u32>,
    /// Time and joint angles in the description's sense, rad.
    trace: VecDeque<(f64, [f32; 3])>,
}

impl RigPage {
    /// The text of the description.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Changes the text.
    pub fn edit(&mut self, text: String) {
        self.checked = match text.trim() {
            "" => None,
            _ => Some(check(&text)),
        };
        self.text = text;
        if let Some(Ok(checked)) = &self.checked {
            let mechanism = &checked.mechanism.links;
            let joints = mechanism.ranges().len();
            let (angles, of) = self.drawn;
            let angles = if of == joints {
                mechanism.clamp(angles)
            } else {
                mechanism.home()
            };
            self.drawn = (angles, joints);
        }
    }

    /// Changes the drawn posture.
    pub fn draw(&mut self, intent: DrawIntent) {
        let Some(Ok(checked)) = &self.checked else { return };
        let mechanism = &checked.mechanism.links;
        match intent {
            DrawIntent::Joint(joint, angle) => {
                if let Some(known) = self.drawn.0.get_mut(joint) {
                    *known = angle;
                }
                self.drawn.0 = mechanism.clamp(self.drawn.0);
            }
            DrawIntent::Home => self.drawn.0 = mechanism.home(),
            DrawIntent::Follow(follows) => self.follows = follows,
        }
    }

    /// Angles to draw, and whether they are those of the connected mechanism.
    pub fn drawn(&self) -> (Angles, bool) {
        let live = self.live().filter(|_| self.follows);
        (live.unwrap_or(self.drawn.0), live.is_some())
    }

    /// Whether the connected mechanism's angles are to be drawn, where there is one.
    pub fn follows(&self) -> bool {
        self.follows
    }

    /// Angles of the connected mechanism, if it is the described one.
    pub fn live(&self) -> Option<Angles> {
        let (_, angles) = self.trace.back().filter(|_| self.is_in_use())?;
        Some(angles.map(f64::from))
    }

    /// The text as a description, or what is wrong with it; `None` without text.
    pub fn checked(&self) -> Option<Result<&Checked, &str>> {
        match self.checked.as_ref()? {
            Ok(checked) => Some(Ok(checked)),
            Err(why) => Some(Err(why)),
        }
    }

    /// Whether the text describes what the board uses.
    pub fn is_in_use(&self) -> bool {
        match (&self.checked, &self.on_board) {
            // The board has a description in single precision, the text six digits of it.
            (Some(Ok(checked)), Some((Some(kept), true))) => write_rig(&checked.rig) == write_rig(kept),
            _ => false,
        }
    }

    /// Takes readings in.
    pub fn see(&mut self, readings: &Readings, tick_hz: u16) {
        let time = f64::from(readings.tick) / f64::from(tick_hz.max(1));
        // A board that has started again counts from 0.
        if self.trace.back().is_some_and(|&(last, _)| last >= time) {
            self.trace.clear();
        }
        let rig = match (&self.steps, &self.on_board) {
            (Some(steps), _) => Some(steps.rig()),
            (None, Some((rig, true))) => rig.as_ref(),
            _ => None,
        };
        if let Some(rig) = rig {
            let angles = std::array::from_fn(|joint| {
                let described = rig.joints.get(joint);
                described.map_or(0.0, |described| {
                    described.home + readings.counts[joint] as f32 * described.radians_per_count()
                })
            });
            self.trace.push_back((time, angles));
        }
        while self
            .trace
            .front()
            .is_some_and(|&(first, _)| first < time - TRACE_S)
        {
            self.trace.pop_front();
        }
        self.newest = Some(*readings);
        let Some(steps) = &mut self.steps else { return };
        steps.see(readings);
        if self
            .hand_since
            .is_some_and(|since| readings.tick.wrapping_sub(since) >= operator::READY)
        {
            self.hand_since = None;
            steps.again();
        }
    }

    /// Commissioning so far as a text in Markdown, for the board and its firmware `board`; `None`: it has not begun.
    pub fn report(&self, board: &str) -> Option<String> {
        let steps = self.steps.as_ref()?;
        let mut text = format!(
            "# Commissioning of {}\n\n{board}\n\n| step | result | what was seen |\n|---|---|---|\n",
            steps.rig().name
        );
        for (number, (step, outcome)) in steps.steps().enumerate() {
            let result = outcome.name();
            let words = outcome.words().replace('|', "/");
            text += &format!("| {}. {} | {result} | {words} |\n", number + 1, step.name());
        }
        text += &format!(
            "\nDescription that the board uses:\n\n```toml\n{}```\n",
            write_rig(steps.in_use())
        );
        Some(text)
    }

    /// The newest readings.
    pub fn newest(&self) -> Option<&Readings> {
        self.newest.as_ref()
    }

    /// The board keeps this description, and whether it uses it. Commissioning goes on with its own alone, with or without the corrections not yet sent.
    pub fn found(&mut self, rig: Option<Rig>, in_use: bool) {
        if let Some(steps) = &mut self.steps {
            match rig.as_ref().filter(|_| in_use) {
                Some(rig) if rig == steps.rig() || rig == steps.in_use() => steps.sent(Ok(rig.clone())),
                _ => self.steps = None,
            }
        }
        self.on_board = Some((rig, in_use));
    }

    /// Begins commissioning, if the board uses a description.
    pub fn begin(&mut self) {
        let Some((Some(rig), true)) = &self.on_board else {
            return;
        };
        let mut steps = Commissioning::new(rig.clone());
        if let Some(readings) = &self.newest {
            steps.see(readings);
        }
        self.steps = Some(steps);
    }

    /// Times, s, and angles of the joints, rad, oldest first.
    pub fn trace(&self) -> impl DoubleEndedIterator<Item = &(f64, [f32; 3])> + ExactSizeIterator {
        self.trace.iter()
    }

    /// Forgets what belongs to a board that is no longer connected; the text stays.
    pub fn disconnected(&mut self) {
        self.link_lost();
        self.steps = None;
    }

    /// As [`Self::disconnected`], but commissioning goes on when the board is connected again: one on a USB port of its own leaves it as it restarts.
    pub fn link_lost(&mut self) {
        self.on_board = None;
        self.busy = None;
        self.watch = None;
        self.newest = None;
        self.hand_since = None;
        self.wiring = Default::default();
        self.trace.clear();
    }
}

fn check(text: &str) -> Result<Box<Checked>, String> {
    let rig = parse_rig(text, "description").map_err(|error| {
        let words = error.to_string();
        let words = words.strip_prefix("description: ").map(str::to_owned);
        words.unwrap_or_else(|| error.to_string())
    })?;
    let abilities = abilities(&rig).map_err(mortise_rig::describe)?;
    let mechanism = Mechanism::new(&rig).map_err(mortise_rig::describe)?;
    Ok(Box::new(Checked {
        rig,
        abilities,
        mechanism,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mortise_rig::EXAMPLES;

    #[test]
    fn an_example_is_sound_and_a_damaged_one_says_where() {
        let mut page = RigPage::default();
        assert!(page.checked().is_none());
        for (name, text) in EXAMPLES {
            page.edit(text.to_owned());
            assert!(matches!(page.checked(), Some(Ok(_))), "{name}");
            page.edit(text.replace("counts_per_turn", "counts_per_turns"));
            match page.checked() {
                Some(Err(why)) => assert!(why.contains("line") && !why.starts_with("description"), "{why}"),
                _ => panic!("{name} was damaged"),
            }
        }
    }

    #[test]
    fn the_drawn_posture_stays_within_the_described_ranges() {
        let mut page = RigPage::default();
        page.draw(DrawIntent::Joint(0, 1.0));
        assert_eq!(page.drawn(), ([0.0; 3], false), "nothing is described");
        page.edit(EXAMPLES[0].1.to_owned());
        let degrees = |page: &RigPage| page.drawn().0[0].to_degrees();
        assert!((degrees(&page) - 90.0).abs() < 1e-4, "home");
        page.draw(DrawIntent::Joint(0, 5.0));
        assert!((degrees(&page) - 130.0).abs() < 1e-4);
        page.edit(EXAMPLES[0].1.replace("130]", "120]"));
        assert!((degrees(&page) - 120.0).abs() < 1e-4);
        page.draw(DrawIntent::Home);
        assert!((degrees(&page) - 90.0).abs() < 1e-4);
        page.draw(DrawIntent::Joint(7, 5.0));
        page.draw(DrawIntent::Follow(true));
        assert!(!page.drawn().1, "no mechanism is connected");
        page.edit(EXAMPLES[1].1.to_owned());
        assert!(
            (page.drawn().0[1].to_degrees() - 82.77).abs() < 1e-3,
            "another mechanism is at home"
        );
    }

    #[test]
    fn commissioning_goes_on_when_the_board_comes_back_and_not_on_another_one() {
        let rigs = EXAMPLES.map(|(name, text)| parse_rig(text, name).expect(name));
        let mut page = RigPage::default();
        page.found(Some(rigs[2].clone()), true);
        page.begin();
        page.link_lost();
        assert!(page.steps.is_some() && page.on_board.is_none());
        page.found(Some(rigs[2].clone()), true);
        assert!(page.steps.is_some());
        page.link_lost();
        let mut other = rigs[2].clone();
        other.joints[0].gear += 1.0;
        page.found(Some(other), true);
        assert!(page.steps.is_none(), "another description of as many joints");
        page.found(Some(rigs[2].clone()), true);
        page.begin();
        page.found(Some(rigs[1].clone()), true);
        assert!(page.steps.is_none(), "another mechanism");
        page.begin();
        page.found(Some(rigs[1].clone()), false);
        assert!(page.steps.is_none(), "not in use");
    }

    #[test]
    fn a_text_is_in_use_when_the_board_has_the_same_numbers() {
        let mut page = RigPage::default();
        let (_, text) = EXAMPLES[2];
        page.edit(text.to_owned());
        let Some(Ok(checked)) = page.checked() else {
            panic!()
        };
        let rig = checked.rig.clone();
        assert!(!page.is_in_use());
        page.on_board = Some((Some(rig.clone()), false));
        assert!(!page.is_in_use());
        page.on_board = Some((Some(rig), true));
        assert!(page.is_in_use());
        page.edit(text.replace("upper_mm = 205", "upper_mm = 206"));
        assert!(!page.is_in_use());
    }
}
