//! How an instruction in plain words begins and ends.

use std::sync::Arc;
use std::sync::mpsc::{TryRecvError, sync_channel};

use mortise_words::Outcome;
use mortise_words::grammar::parse;
use mortise_words::phrase::Command;
use mortise_words::token::{LONGEST, Names, read};

use super::instructions::{Answer, Running, Said, answer, carry_out};
use super::state::Session;
use super::threads::spawn;

impl Session {
    /// Starts an instruction, which must be possible.
    pub(super) fn instruct(&mut self, text: &str) {
        if let Some(back) = self.instructs_to_rewind(text) {
            self.instructions.remember(text);
            self.instructions.answer = Some(self.rewound(text, back));
            return;
        }
        let Some(document) = &self.document else { return };
        let (outbox, said) = sync_channel(1);
        let (model, generation) = (Arc::clone(&document.model), document.generation);
        let poses = document.poses.clone();
        let wake = self.outbox.waker();
        let instructions = &mut self.instructions;
        instructions.remember(text);
        instructions.answer = None;
        instructions.running = Some(Running {
            text: text.to_owned(),
            generation,
            poses: poses.clone(),
            said,
        });
        let talk = (instructions.talk.take()).filter(|talk| talk.generation == generation);
        let text = text.to_owned();
        spawn("mortise-instruction", move || {
            let turn = carry_out(talk, &model, generation, &poses, &text);
            // The window may have been closed, or the instruction cancelled.
            _ = outbox.send(Said { turn });
            wake();
        });
    }

    /// Whether an instruction undoes (`true`) or redoes (`false`) the last move of whatever kind: there is one history of all moves.
    fn instructs_to_rewind(&self, text: &str) -> Option<bool> {
        let parts = &self.document.as_ref()?.model.parts;
        if text.len() > LONGEST {
            return None;
        }
        let names = Names::new(parts.iter().map(|part| part.name.as_str()));
        match parse(&read(text, &names)).ok()?[..] {
            [Command::Undo] => Some(true),
            [Command::Redo] => Some(false),
            _ => None,
        }
    }

    fn rewound(&mut self, text: &str, back: bool) -> Answer {
        let done = if back { "undone" } else { "redone" };
        let (outcome, words) = match self.no_rewinding(back) {
            Some(why) => (Outcome::Refuse, why),
            None => match self.rewind(back) {
                Some(name) => (Outcome::Done, format!("{done}: {name}")),
                None => (Outcome::Refuse, "nothing was moved".to_owned()),
            },
        };
        Answer {
            text: text.to_owned(),
            outcome,
            words,
            parts: Vec::new(),
        }
    }

    /// Forgets the instruction under way: its thread ends by itself, and moves nothing.
    pub(super) fn cancel_instruction(&mut self) {
        self.instructions.running = None;
    }

    /// Takes in the end of an instruction.
    pub(super) fn poll_instruction(&mut self) {
        let Some(running) = &self.instructions.running else {
            return;
        };
        let said = match running.said.try_recv() {
            Ok(said) => said,
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => Said {
                turn: Err("its computation ended without a result".to_owned()),
            },
        };
        let Some(running) = self.instructions.running.take() else {
            return;
        };
        let answer = self.answered(&running, said);
        self.instructions.answer = Some(answer);
    }

    fn answered(&mut self, running: &Running, said: Said) -> Answer {
        let refused = |words: &str| Answer {
            text: running.text.clone(),
            outcome: Outcome::Refuse,
            words: words.to_owned(),
            parts: Vec::new(),
        };
        let (talk, turn, poses) = match said.turn {
            Ok(said) => said,
            Err(why) => return refused(&why),
        };
        let Some(document) = &self.document else {
            return refused("no file is open");
        };
        if !turn.moved.is_empty() {
            if document.generation != running.generation || document.poses != running.poses {
                return refused(
                    "the parts were moved meanwhile, so nothing was done; give the instruction again",
                );
            }
            if let Some(why) = self.no_move() {
                return refused(&format!(
                    "nothing was done. {why}, and give the instruction again"
                ));
            }
            if let Some(group) = document.groups().broken(&poses) {
                return refused(&format!(
                    "nothing was done: the parts of {} are a group and move as one; ungroup them, and give the instruction again",
                    group.name
                ));
            }
            // A board gets the scene with the parts here.
            self.place(poses);
            self.note_step(&format!("\"{}\"", running.text));
        }
        let Some(document) = &self.document else {
            return refused("no file is open");
        };
        let answer = answer(document, &running.text, &turn);
        self.instructions.talk = Some(talk);
        answer
    }
}
