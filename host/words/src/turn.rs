//! Result of one instruction, as it is written in JSON.

use serde::Serialize;

/// Outcome of a turn; only `done` moves parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Carried out.
    Done,
    /// Ambiguous: the candidates are listed.
    Ask,
    /// Not possible, with the reason.
    Refuse,
}

/// Operation of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verb {
    /// Put together.
    Connect,
    /// Take apart.
    Disconnect,
    /// Move along a remaining freedom.
    Adjust,
    /// Turn about an axis.
    Turn,
}

impl Verb {
    /// Its word, in lower case.
    pub fn word(self) -> &'static str {
        match self {
            Self::Connect => "connect",
            Self::Disconnect => "disconnect",
            Self::Adjust => "adjust",
            Self::Turn => "turn",
        }
    }
}

/// Why a turn is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// Another part is in the way.
    Blocked,
    /// No surfaces of the two parts fit.
    NoFit,
    /// No part has this name.
    NoSuchPart,
    /// Fewer parts than asked for.
    NotEnough,
    /// Beyond the remaining freedom.
    OutOfRange,
    /// A pronoun, undo or redo without anything before it.
    NoReferent,
    /// No assembly operation.
    NotAnAction,
    /// Not understood.
    NotUnderstood,
}

/// One operation of a turn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Act {
    /// The operation.
    pub verb: Verb,
    /// Moving part.
    pub a: String,
    /// Part it is connected to or leaves, if one is stated or found.
    pub b: Option<String>,
    /// Direction of the motion, or axis of a turn: unit vector in the assembly's frame.
    pub axis: Option<[f64; 3]>,
    /// Travel in mm, or angle in degrees of a turn.
    pub amount: Option<f64>,
}

/// Placement: x = R·x_shape + t.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pose {
    /// Quaternion x, y, z, w.
    pub rotation: [f64; 4],
    /// Translation, mm.
    pub translation_mm: [f64; 3],
}

/// A part that has moved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moved {
    /// Name.
    pub part: String,
    /// Placement before.
    pub from: Pose,
    /// Placement after.
    pub to: Pose,
}

/// Reason of a refusal or question.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reason {
    /// Its kind.
    pub code: Code,
    /// One line.
    pub words: String,
    /// Parts concerned: those in the way, for example.
    pub parts: Vec<String>,
}

/// Result of one instruction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Turn {
    /// Whether it was carried out.
    pub outcome: Outcome,
    /// What was done, in order.
    pub acts: Vec<Act>,
    /// Parts whose placement has changed.
    pub moved: Vec<Moved>,
    /// Parts that may be meant, for a question.
    pub candidates: Vec<String>,
    /// Why not; `None` when done. A question has none either: its words are in `question`.
    pub reason: Option<Reason>,
    /// The question, when one is asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub question: Option<String>,
}

/// Why an instruction is not carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Ambiguous: words and candidates.
    Ask(String, Vec<usize>),
    /// Not possible: code, words, parts concerned.
    Refuse(Code, String, Vec<usize>),
}
