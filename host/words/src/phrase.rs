//! Meaning of an instruction, before its nouns are looked up in an assembly.

use crate::lexicon::{Place, Relation, Size};

/// One thing to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Put `what` together with `into`.
    Connect {
        /// The moving part.
        what: Phrase,
        /// Its destination; `None`: as the assembly suggests.
        into: Option<Phrase>,
        /// Inside or around the destination.
        relation: Relation,
        /// Side from which the part comes.
        from: Option<Place>,
        /// How far.
        extent: Amount,
    },
    /// Take `what` apart from `from`.
    Disconnect {
        /// The moving part.
        what: Phrase,
        /// Part it leaves; `None`: everything.
        from: Option<Phrase>,
        /// Direction of the motion.
        way: Option<Place>,
    },
    /// Move `what` along its remaining freedom.
    Adjust {
        /// The moving part.
        what: Phrase,
        /// Outwards (or, false, inwards), unless `way` is given.
        out: bool,
        /// Direction of the motion.
        way: Option<Place>,
        /// How far.
        amount: Amount,
    },
    /// Turn `what` about its axis.
    Turn {
        /// The moving part.
        what: Phrase,
        /// How far; negative: clockwise as seen against the axis.
        amount: Amount,
    },
    /// Choose `what` for the next instruction, without moving it.
    Pick {
        /// The part.
        what: Phrase,
    },
    /// Take back the last turn.
    Undo,
    /// Do again what was taken back.
    Redo,
}

/// How far something moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// Millimetres.
    Length(f64),
    /// Radians.
    Angle(f64),
    /// Half of the way.
    Half,
    /// As far as it goes.
    Full,
    /// Too vague to act on: "a bit", or a number without a unit.
    Vague,
    /// Not stated.
    Open,
}

/// How many of the candidates are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// One: "the screw", "a screw".
    One,
    /// All: "all screws", "the screws".
    All,
    /// Two: "both screws".
    Both,
    /// A number: "four screws".
    Count(u32),
    /// All of a stated number: "all four screws".
    AllOf(u32),
    /// Whichever: "any screw".
    Any,
}

/// A pronoun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pronoun {
    /// "it".
    It,
    /// "them".
    Them,
    /// "the other one".
    Other,
    /// "the others", "the rest".
    Others,
}

/// A noun phrase.
#[derive(Clone, Debug, PartialEq)]
pub struct Phrase {
    /// Its words as given, for messages.
    pub text: String,
    /// The pronoun, when it is one.
    pub pronoun: Option<Pronoun>,
    /// How many.
    pub quantity: Quantity,
    /// Parts named in full: indices.
    pub names: Vec<usize>,
    /// Nouns, singular, the head last; empty for "the second one".
    pub nouns: Vec<String>,
    /// Numbers after the noun: "screws 1 and 3".
    pub numbers: Vec<u32>,
    /// Ordinals, 0 for the last: "the third screw".
    pub ordinals: Vec<usize>,
    /// Places: "the left front screw".
    pub places: Vec<Place>,
    /// Sizes: "the small gear".
    pub sizes: Vec<Size>,
    /// Whether it is a loose one: "the free pin".
    pub free: bool,
    /// Whether an opening is meant: "the second hole of the plate".
    pub hole: bool,
    /// Owner or carrier: "… of the plate".
    pub of: Option<Box<Phrase>>,
    /// Further phrases: "the screw and the seal".
    pub and: Vec<Phrase>,
}

impl Phrase {
    /// An empty phrase with its text.
    pub fn new(text: String) -> Self {
        Self {
            text,
            pronoun: None,
            quantity: Quantity::One,
            names: Vec::new(),
            nouns: Vec::new(),
            numbers: Vec::new(),
            ordinals: Vec::new(),
            places: Vec::new(),
            sizes: Vec::new(),
            free: false,
            hole: false,
            of: None,
            and: Vec::new(),
        }
    }
}

/// Why an instruction has no meaning here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Puzzle {
    /// A sentence, but no assembly operation.
    NotAnAction(String),
    /// Not understood, with the reason.
    NotUnderstood(String),
}
