//! The list of targets as the operator reads it.

use mortise_mating::recognise::{Freedom, Misfit, Target, TargetId};

/// How a target stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// Its faces touch or are near, but it is too far off to be taken up.
    Candidate,
    /// Contradicts these, which came first.
    Conflict(Vec<TargetId>),
    /// The operator switched it off.
    Off,
    /// Taken up, and kept by contact alone: planes meet, a bore slides over a ball.
    ByContact,
    /// Taken up, but not sent: guidance is off, or the board holds as many as it can.
    Waiting,
    /// On the board.
    Sent,
    /// The board does not take it, and why.
    Refused(String),
}

/// One line of the list.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The constraint.
    pub target: Target,
    /// How it stands.
    pub standing: Standing,
    /// How far it is from being kept.
    pub misfit: Misfit,
    /// Largest depth at which its faces touch, mm; 0 when they do not.
    pub depth_mm: f64,
    /// How far the surfaces are in each other along the axis, mm; negative: how far they still are apart. `None` where there is no axis.
    pub inside_mm: Option<f64>,
    /// The operator wants it to stay.
    pub pinned: bool,
}

/// The whole list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct List {
    /// Tick of the sample it was made from.
    pub tick: u32,
    /// Part in hand, an index into [`mortise_brep::CadModel::parts`].
    pub held: Option<usize>,
    /// What could be sent first, then what contact keeps, then candidates; each in order of their surfaces.
    pub rows: Vec<Row>,
    /// Motion that the targets taken up leave to the part in hand.
    pub freedom: Freedom,
}
