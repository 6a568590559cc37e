//! A session: instructions one after another on one assembly, with what was spoken of, undo and redo.
//!
//! A turn is carried out whole or not at all: when any of its parts is refused or is a question, every placement is as before.

use glam::{DAffine3, DQuat};
use mortise_brep::{CadModel, Part};
use mortise_task::TaskError;

use crate::adjust::{adjust, turn};
use crate::connect::connect;
use crate::disconnect::disconnect;
use crate::grammar::{only_phrase, parse};
use crate::manner::Manner;
use crate::phrase::{Command, Phrase, Puzzle};
use crate::port::Port;
use crate::reference::{Memory, Purpose, Scene, Seen, direction, longest_axis};
use crate::token::{LONGEST, Names, read};
use crate::turn::{Act, Code, Moved, Outcome, Pose, Reason, Trouble, Turn};
use crate::world::World;

/// State to go back to.
#[derive(Clone, Debug)]
struct Snapshot {
    placements: Vec<DAffine3>,
    memory: Memory,
}

/// Phrase of a command that a question is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slot {
    What,
    Into,
}

/// Instructions on one assembly.
pub struct Session {
    world: World,
    names: Names,
    memory: Memory,
    /// The phrase that is being resolved.
    slot: Option<Slot>,
    /// The instruction that was answered by a question, and what the question is about.
    asked: Option<(Command, Slot)>,
    done: Vec<Snapshot>,
    undone: Vec<Snapshot>,
}

impl Session {
    /// Begins with the assembly as the file places it.
    ///
    /// # Errors
    /// [`TaskError`]: fewer than two parts, or a part without a surface.
    pub fn new(model: CadModel) -> Result<Self, TaskError> {
        let names = Names::new(model.parts.iter().map(|p| p.name.as_str()));
        Ok(Self {
            world: World::new(model)?,
            names,
            memory: Memory::default(),
            slot: None,
            asked: None,
            done: Vec::new(),
            undone: Vec::new(),
        })
    }

    /// The assembly now.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The parts at their placements now.
    pub fn parts(&self) -> &[Part] {
        &self.world.assembly().model.parts
    }

    /// Places every part as in the file and forgets what was said.
    pub fn start_over(&mut self) {
        for part in 0..self.world.count() {
            let home = self.world.home(part);
            self.world.set_placement(part, home);
        }
        self.memory = Memory::default();
        self.asked = None;
        self.done.clear();
        self.undone.clear();
    }

    /// Carries out one instruction. After a question a noun phrase alone is its answer: "the left one".
    pub fn say(&mut self, text: &str) -> Turn {
        let before = self.snapshot();
        let result = self.carry_out(text);
        match result {
            Ok((acts, meant, rewound)) => {
                let moved = self.moved(&before.placements);
                if !rewound && !acts.is_empty() {
                    self.done.push(before);
                    self.undone.clear();
                }
                if let Some(meant) = meant {
                    self.memory = meant;
                }
                Turn {
                    outcome: Outcome::Done,
                    acts,
                    moved,
                    candidates: Vec::new(),
                    reason: None,
                    question: None,
                }
            }
            Err(trouble) => {
                self.restore(&before);
                self.troubled(trouble)
            }
        }
    }

    fn troubled(&mut self, trouble: Trouble) -> Turn {
        let names = |parts: &[usize]| -> Vec<String> {
            parts.iter().map(|&p| self.world.name(p).to_owned()).collect()
        };
        let mut turn = Turn {
            outcome: Outcome::Refuse,
            acts: Vec::new(),
            moved: Vec::new(),
            candidates: Vec::new(),
            reason: None,
            question: None,
        };
        match trouble {
            Trouble::Ask(words, candidates) => {
                turn.outcome = Outcome::Ask;
                turn.candidates = names(&candidates);
                turn.question = Some(words);
                // "the left one" chooses among them.
                self.memory.class = candidates;
                self.memory.last.clear();
            }
            Trouble::Refuse(code, words, parts) => {
                turn.reason = Some(Reason {
                    code,
                    words,
                    parts: names(&parts),
                });
            }
        }
        turn
    }

    fn snapshot(&self) -> Snapshot {
        Snapshot {
            placements: self.world.placements(),
            memory: self.memory.clone(),
        }
    }

    fn restore(&mut self, snapshot: &Snapshot) {
        for (part, placement) in snapshot.placements.iter().enumerate() {
            self.world.set_placement(part, *placement);
        }
        self.memory = snapshot.memory.clone();
    }

    fn moved(&self, before: &[DAffine3]) -> Vec<Moved> {
        (0..self.world.count())
            .filter(|&p| before[p] != self.world.placement(p))
            .map(|p| Moved {
                part: self.world.name(p).to_owned(),
                from: pose(&before[p]),
                to: pose(&self.world.placement(p)),
            })
            .collect()
    }

    /// Acts, what was spoken of (`None`: unchanged), and whether the history was used.
    fn carry_out(&mut self, text: &str) -> Result<(Vec<Act>, Option<Memory>, bool), Trouble> {
        if text.len() > LONGEST {
            let words = format!(
                "the instruction has {} bytes; at most {LONGEST} are read, so say less at once",
                text.len()
            );
            return Err(Trouble::Refuse(Code::NotUnderstood, words, vec![]));
        }
        let tokens = read(text, &self.names);
        let asked = self.asked.take();
        let commands = match (asked, only_phrase(&tokens)) {
            (Some((command, slot)), Some(answer)) => vec![answered(command, slot, answer)],
            _ => parse(&tokens).map_err(|puzzle| match puzzle {
                Puzzle::NotAnAction(words) => Trouble::Refuse(Code::NotAnAction, words, vec![]),
                Puzzle::NotUnderstood(words) => Trouble::Refuse(Code::NotUnderstood, words, vec![]),
            })?,
        };
        if let [only @ (Command::Undo | Command::Redo)] = &commands[..] {
            self.rewind(only == &Command::Undo)?;
            return Ok((Vec::new(), None, true));
        }
        let mut acts = Vec::new();
        let mut memory = None;
        for command in &commands {
            self.slot = None;
            let meant = self.one(command, &mut acts);
            if let (Err(Trouble::Ask(..)), Some(slot), [only]) = (&meant, self.slot, &commands[..]) {
                self.asked = Some((only.clone(), slot));
            }
            let meant = meant?;
            self.memory = meant.clone();
            memory = Some(meant);
        }
        Ok((acts, memory, false))
    }

    fn rewind(&mut self, back: bool) -> Result<(), Trouble> {
        let from = if back { &mut self.done } else { &mut self.undone };
        let Some(snapshot) = from.pop() else {
            let words = if back {
                "there is nothing to undo"
            } else {
                "there is nothing to redo"
            };
            return Err(Trouble::Refuse(Code::NoReferent, words.into(), vec![]));
        };
        let now = self.snapshot();
        if back { &mut self.undone } else { &mut self.done }.push(now);
        // What was spoken of stays.
        let memory = self.memory.clone();
        self.restore(&snapshot);
        self.memory = memory;
        Ok(())
    }

    fn one(&mut self, command: &Command, acts: &mut Vec<Act>) -> Result<Memory, Trouble> {
        let (what, purpose) = match command {
            Command::Connect { what, .. } => (what, Purpose::Connect),
            Command::Disconnect { what, .. } => (what, Purpose::Remove),
            Command::Adjust { what, .. } | Command::Turn { what, .. } | Command::Pick { what } => {
                (what, Purpose::Move)
            }
            Command::Undo | Command::Redo => {
                let words = "undo and redo stand alone; say them one after another".to_owned();
                return Err(Trouble::Refuse(Code::NotUnderstood, words, vec![]));
            }
        };
        let mut near = Vec::new();
        if let Command::Disconnect { from: Some(from), .. } = command
            && !from.hole
        {
            near = self.resolve(from, Purpose::Owner, &[])?.0;
        }
        self.slot = Some(Slot::What);
        let (parts, class) = self.resolve(what, purpose, &near)?;
        self.slot = None;
        for &part in &parts {
            match command {
                Command::Connect {
                    into,
                    relation,
                    from,
                    extent,
                    ..
                } => {
                    self.slot = into.as_ref().is_none_or(|i| !i.hole).then_some(Slot::Into);
                    let (into, hole) = self.destination(part, &parts, into.as_ref())?;
                    self.slot = None;
                    let manner = Manner {
                        relation: *relation,
                        from: *from,
                        extent: *extent,
                        hole,
                    };
                    acts.push(connect(&mut self.world, part, into, &manner)?);
                }
                Command::Disconnect { way, .. } => {
                    let from = near
                        .iter()
                        .copied()
                        .find(|&b| self.world.connected(part, b))
                        .or(near.first().copied());
                    acts.push(disconnect(&mut self.world, part, from, way.map(direction))?);
                }
                Command::Adjust { out, way, amount, .. } => {
                    acts.push(adjust(&mut self.world, part, *out, *way, *amount)?);
                }
                Command::Turn { amount, .. } => acts.push(turn(&mut self.world, part, *amount)?),
                Command::Pick { .. } | Command::Undo | Command::Redo => {}
            }
        }
        Ok(Memory { last: parts, class })
    }

    fn scene(&self) -> Scene<'_> {
        let model = &self.world.assembly().model;
        let parts = (0..self.world.count())
            .map(|p| {
                let (low, high) = self.world.bounds(p);
                Seen {
                    name: self.world.name(p).to_owned(),
                    path: model.parts[p].path.clone(),
                    center: (low + high) / 2.0,
                    size: high - low,
                    volume_mm3: model.shapes[model.parts[p].shape].volume_mm3,
                    shape: self.world.kind(p),
                    connected: self.world.connections(p),
                }
            })
            .collect();
        Scene {
            names: &self.names,
            parts,
        }
    }

    fn resolve(
        &self,
        phrase: &Phrase,
        purpose: Purpose,
        near: &[usize],
    ) -> Result<(Vec<usize>, Vec<usize>), Trouble> {
        let meant = self.scene().resolve(phrase, &self.memory, purpose, near)?;
        Ok((meant.parts, meant.class))
    }

    /// The part to connect to, and its bore when one is stated.
    fn destination(
        &self,
        part: usize,
        moving: &[usize],
        into: Option<&Phrase>,
    ) -> Result<(usize, Option<Port>), Trouble> {
        let Some(phrase) = into else {
            return Ok((self.obvious(part, moving)?, None));
        };
        if phrase.hole {
            let owner = match &phrase.of {
                Some(owner) => self.sole(owner)?,
                None => self.obvious(part, moving)?,
            };
            return Ok((owner, self.hole(part, owner, phrase)?));
        }
        Ok((self.sole(phrase)?, None))
    }

    fn sole(&self, phrase: &Phrase) -> Result<usize, Trouble> {
        let (parts, _) = self.resolve(phrase, Purpose::Owner, &[])?;
        match parts[..] {
            [one] => Ok(one),
            _ => Err(Trouble::Ask(
                format!("which of them is meant by \"{}\"?", phrase.text),
                parts,
            )),
        }
    }

    /// The part to which `part` belongs: that of the file, else the only one whose ports fit.
    fn obvious(&self, part: usize, moving: &[usize]) -> Result<usize, Trouble> {
        let others: Vec<usize> = (0..self.world.count())
            .filter(|p| !moving.contains(p) && *p != part)
            .collect();
        let joined: Vec<usize> = others
            .iter()
            .copied()
            .filter(|&b| self.world.joined_at_home(part, b))
            .collect();
        if let Some(&first) = joined.first() {
            // All of them agree on the place as long as they stand to each other as in the file; the one that has most of the part is named.
            let here = self.world.home(part);
            let center = here.translation;
            let nearest = joined.iter().copied().min_by(|&a, &b| {
                self.world
                    .home(a)
                    .translation
                    .distance(center)
                    .total_cmp(&self.world.home(b).translation.distance(center))
            });
            return Ok(nearest.unwrap_or(first));
        }
        let fitting: Vec<usize> = others
            .iter()
            .copied()
            .filter(|&b| {
                self.world
                    .ports(part)
                    .iter()
                    .any(|p| self.world.ports(b).iter().any(|q| p.takes(q)))
            })
            .collect();
        match (&fitting[..], &others[..]) {
            ([one], _) | ([], [one]) => Ok(*one),
            ([], _) => Err(Trouble::Refuse(
                Code::NoFit,
                format!("no part has a surface that fits {}", self.world.name(part)),
                vec![part],
            )),
            _ => Err(Trouble::Ask(
                format!("into which part does {} go?", self.world.name(part)),
                fitting,
            )),
        }
    }

    /// The bore of `owner` that the phrase states; `None` when any will do.
    fn hole(&self, part: usize, owner: usize, phrase: &Phrase) -> Result<Option<Port>, Trouble> {
        let place = self.world.placement(owner);
        let shafts: Vec<Port> = self
            .world
            .ports(part)
            .iter()
            .filter(|p| p.male)
            .copied()
            .collect();
        let bores = self
            .world
            .ports(owner)
            .iter()
            .filter(|q| shafts.iter().any(|p| p.takes(q)));
        let mut bores: Vec<Port> = bores.map(|q| q.placed(&place)).collect();
        let name = self.world.name(owner);
        let none = |words: String| Err(Trouble::Refuse(Code::NoSuchPart, words, vec![owner]));
        if bores.is_empty() {
            let words = format!("{name} has no hole that takes {}", self.world.name(part));
            return Err(Trouble::Refuse(Code::NoFit, words, vec![part, owner]));
        }
        let axis = longest_axis(&bores.iter().map(Port::middle).collect::<Vec<_>>());
        bores.sort_by(|p, q| {
            p.middle()
                .dot(axis)
                .total_cmp(&q.middle().dot(axis))
                .then(p.middle().y.total_cmp(&q.middle().y))
        });
        let counted = phrase
            .ordinals
            .first()
            .copied()
            .or(phrase.numbers.first().map(|&n| n as usize));
        if let Some(n) = counted {
            let index = if n == 0 && !phrase.ordinals.is_empty() {
                bores.len()
            } else {
                n
            };
            return match index.checked_sub(1).and_then(|i| bores.get(i)) {
                Some(bore) => Ok(Some(*bore)),
                None => none(format!(
                    "{name} has {} holes that take {}, no number {n}",
                    bores.len(),
                    self.world.name(part)
                )),
            };
        }
        if let Some(&place) = phrase.places.first() {
            if place == crate::lexicon::Place::Middle {
                let n = bores.len();
                if n % 2 == 1 {
                    return Ok(Some(bores[n / 2]));
                }
                return Err(Trouble::Ask(
                    format!("{name} has {n} holes in a row and none in the middle; which one?"),
                    vec![owner],
                ));
            }
            let heights: Vec<f64> = bores.iter().map(|b| b.middle().dot(direction(place))).collect();
            let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let top: Vec<usize> = (0..bores.len()).filter(|&i| heights[i] > high - 1e-3).collect();
            return match top[..] {
                [one] => Ok(Some(bores[one])),
                _ => Err(Trouble::Ask(
                    format!("{} holes of {name} are there; which one?", top.len()),
                    vec![owner],
                )),
            };
        }
        Ok(None)
    }
}

/// The command with the phrase that was asked about.
fn answered(mut command: Command, slot: Slot, answer: Phrase) -> Command {
    match &mut command {
        Command::Connect { into, .. } if slot == Slot::Into => *into = Some(answer),
        Command::Connect { what, .. }
        | Command::Disconnect { what, .. }
        | Command::Adjust { what, .. }
        | Command::Turn { what, .. }
        | Command::Pick { what } => *what = answer,
        Command::Undo | Command::Redo => {}
    }
    command
}

fn pose(placement: &DAffine3) -> Pose {
    Pose {
        rotation: DQuat::from_mat3(&placement.matrix3).normalize().to_array(),
        translation_mm: placement.translation.to_array(),
    }
}
