//! The list of targets as the operator reads it.

use mortise_mating::recognise::{AlignmentError, Freedom, Target, TargetId};

/// Status of a target.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// Its faces touch or are near, but its alignment error is too large for it to engage.
    Candidate,
    /// Contradicts these targets, which came first.
    Conflict(Vec<TargetId>),
    /// The operator switched it off.
    Off,
    /// Active, and held by contact alone: planes meet, a bore slides over a ball.
    ByContact,
    /// Active, but not sent: guidance is off, or the largest number of targets is on the board.
    Waiting,
    /// Active on the board.
    Sent,
    /// The board refused it, for this reason.
    Refused(String),
}

/// An entry of the list.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The constraint.
    pub target: Target,
    /// Its status.
    pub standing: Standing,
    /// Its alignment error.
    pub alignment_error: AlignmentError,
    /// Largest depth at which its faces touch, mm; 0 without contact.
    pub depth_mm: f64,
    /// Overlap of the surfaces along the axis, mm; negative: gap. `None` where there is no axis.
    pub inside_mm: Option<f64>,
    /// Whether the operator pinned it.
    pub pinned: bool,
}

/// The whole list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct List {
    /// Tick of the sample on which the list is based.
    pub tick: u32,
    /// Held part, an index into [`mortise_brep::CadModel::parts`].
    pub held: Option<usize>,
    /// Targets that could be sent come first, then those held by contact, then candidates; each group ordered by surfaces.
    pub rows: Vec<Row>,
    /// Motion that the active targets leave to the held part.
    pub freedom: Freedom,
}
