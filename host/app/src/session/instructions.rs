//! Instructions in plain words: carried out beside the window's thread, on the parts where they are.

use std::sync::mpsc::Receiver;

use glam::DAffine3;
use mortise_brep::CadModel;
use mortise_words::{Act, Outcome, Session as Words, Turn, Verb};

use super::document::Document;

/// Number of instructions kept for repetition.
const KEPT: usize = 100;

/// What became of an instruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The instruction.
    pub text: String,
    /// Whether it was carried out.
    pub outcome: Outcome,
    /// What was done, the question, or the reason why not.
    pub words: String,
    /// Parts that have moved, may be meant, or are in the way.
    pub parts: Vec<usize>,
}

/// Instructions on one document, with what was spoken of and what can be undone.
pub(super) struct Talk {
    pub generation: u64,
    words: Words,
}

impl Talk {
    /// Whether the talk has the parts at `poses`, mm.
    fn is_at(&self, poses: &[DAffine3]) -> bool {
        let parts = self.words.parts().iter();
        parts.map(|part| part.placement).eq(poses.iter().copied())
    }

    /// Undoes or redoes its own last instruction where that brings the parts to `poses`.
    fn follow(&mut self, poses: &[DAffine3], back: bool) {
        if self.is_at(poses) {
            return;
        }
        let (there, here) = if back { ("undo", "redo") } else { ("redo", "undo") };
        if self.words.say(there).outcome == Outcome::Done && !self.is_at(poses) {
            self.words.say(here);
        }
    }
}

/// The end of an instruction.
pub(super) struct Said {
    /// The talk, what became of the instruction, and where the parts then are; or why the assembly takes no instructions.
    pub turn: Result<(Box<Talk>, Turn, Vec<DAffine3>), String>,
}

/// An instruction under way.
pub(super) struct Running {
    pub text: String,
    pub generation: u64,
    /// Where the parts were.
    pub poses: Vec<DAffine3>,
    pub said: Receiver<Said>,
}

/// The state of the command line.
#[derive(Default)]
pub struct Instructions {
    /// Instructions given, oldest first.
    pub given: Vec<String>,
    /// What became of the last one, until the next.
    pub answer: Option<Answer>,
    pub(super) talk: Option<Box<Talk>>,
    pub(super) running: Option<Running>,
}

impl Instructions {
    /// The instruction under way.
    pub fn under_way(&self) -> Option<&str> {
        self.running.as_ref().map(|running| running.text.as_str())
    }

    /// Parts among which the last answer asks to choose.
    pub fn candidates(&self) -> &[usize] {
        match &self.answer {
            Some(answer) if answer.outcome == Outcome::Ask => &answer.parts,
            _ => &[],
        }
    }

    /// Ends what belongs to a document; the instructions given are kept.
    pub(super) fn end(&mut self) {
        *self = Self {
            given: std::mem::take(&mut self.given),
            ..Self::default()
        };
    }

    /// Lets the talk go with parts that undo or redo has put to `poses`, mm, so that what it knows of them stays.
    pub(super) fn follow(&mut self, poses: &[DAffine3], back: bool) {
        if let Some(talk) = &mut self.talk {
            talk.follow(poses, back);
        }
    }

    pub(super) fn remember(&mut self, text: &str) {
        if self.given.last().is_none_or(|last| last != text) {
            self.given.push(text.to_owned());
        }
        let surplus = self.given.len().saturating_sub(KEPT);
        self.given.drain(..surplus);
    }
}

/// Carries out an instruction in the talk so far, or, where parts are no longer where it left them, in a new one that begins with the parts as they are.
pub(super) fn carry_out(
    talk: Option<Box<Talk>>,
    model: &CadModel,
    generation: u64,
    poses: &[DAffine3],
    text: &str,
) -> Result<(Box<Talk>, Turn, Vec<DAffine3>), String> {
    let mut talk = match talk.filter(|talk| talk.is_at(poses)) {
        Some(talk) => talk,
        None => {
            let mut model = model.clone();
            for (part, pose) in model.parts.iter_mut().zip(poses) {
                part.placement = *pose;
            }
            let words = Words::new(model).map_err(|error| error.to_string())?;
            Box::new(Talk { generation, words })
        }
    };
    let turn = talk.words.say(text);
    let poses = talk.words.parts().iter().map(|p| p.placement).collect();
    Ok((talk, turn, poses))
}

pub(super) fn answer(document: &Document, text: &str, turn: &Turn) -> Answer {
    let moved: Vec<String> = turn.moved.iter().map(|moved| moved.part.clone()).collect();
    let (words, names) = match turn.outcome {
        Outcome::Done => (done(turn), &moved),
        Outcome::Ask => {
            let question = turn.question.clone();
            (
                question.unwrap_or_else(|| "which one?".to_owned()),
                &turn.candidates,
            )
        }
        Outcome::Refuse => match &turn.reason {
            Some(reason) => (reason.words.clone(), &reason.parts),
            None => ("no reason is known".to_owned(), &moved),
        },
    };
    Answer {
        text: text.to_owned(),
        outcome: turn.outcome,
        words,
        parts: (0..document.model.parts.len())
            .filter(|&part| names.iter().any(|name| name == document.part_name(part)))
            .collect(),
    }
}

/// What was done, in words.
fn done(turn: &Turn) -> String {
    if turn.acts.is_empty() {
        return "nothing to connect or move".to_owned();
    }
    let acts: Vec<String> = turn.acts.iter().map(act).collect();
    acts.join("; ")
}

fn act(act: &Act) -> String {
    let by = |unit: &str| {
        act.amount
            .map_or(String::new(), |by| format!(", by {by:.3}{unit}"))
    };
    let a = &act.a;
    match (act.verb, &act.b) {
        (Verb::Connect, Some(b)) => format!("{a} connected with {b}{}", by(" mm")),
        (Verb::Connect, None) => format!("{a} connected{}", by(" mm")),
        (Verb::Disconnect, Some(b)) => format!("{a} taken out of {b}{}", by(" mm")),
        (Verb::Disconnect, None) => format!("{a} taken out{}", by(" mm")),
        (Verb::Adjust, _) => format!("{a} moved{}", by(" mm")),
        (Verb::Turn, _) => format!("{a} turned{}", by("°")),
    }
}

/// What `text` may become when its end is completed to a part's name: for the longest end that begins a name, one text for each name, in the order of the parts.
pub fn completions<'a>(text: &str, names: impl Iterator<Item = &'a str> + Clone) -> Vec<String> {
    let begins = text.char_indices().filter(|&(at, first)| {
        let before = text[..at].chars().next_back();
        !first.is_whitespace() && before.is_none_or(char::is_whitespace)
    });
    for (at, _) in begins {
        let (kept, end) = text.split_at(at);
        let begun = end.to_lowercase();
        let fitting = |name: &&str| {
            let name = name.to_lowercase();
            name.len() > begun.len() && name.starts_with(&begun)
        };
        let found: Vec<String> = (names.clone().filter(fitting))
            .map(|name| format!("{kept}{name}"))
            .collect();
        if !found.is_empty() {
            return found;
        }
    }
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_begun_name_is_completed() {
        let names = ["base plate", "base", "Bolt (2)", "late arm"];
        let of = |text: &str| completions(text, names.into_iter());
        assert_eq!(of("remove the bo"), ["remove the Bolt (2)"]);
        assert_eq!(of("remove the base pl"), ["remove the base plate"]);
        assert_eq!(of("remove ba"), ["remove base plate", "remove base"]);
        assert_eq!(of("remove the plate"), [""; 0], "begins no name");
        assert_eq!(of("remove the base plate"), [""; 0], "complete");
        assert_eq!(of("remove "), [""; 0]);
        assert_eq!(of(""), [""; 0]);
    }

    #[test]
    fn instructions_are_kept_once_and_not_for_ever() {
        let mut instructions = Instructions::default();
        for text in ["undo", "undo", "redo"] {
            instructions.remember(text);
        }
        assert_eq!(instructions.given, ["undo", "redo"]);
        for number in 0..2 * KEPT {
            instructions.remember(&number.to_string());
        }
        assert_eq!(instructions.given.len(), KEPT);
        assert_eq!(instructions.given.last().map(String::as_str), Some("199"));
    }
}
