//! The constituents of a clause, and the command that they make with the class of its verb.

use crate::lexicon::{Place, Relation, VerbClass};
use crate::phrase::{Amount, Command, Phrase, Pronoun, Puzzle};

/// A constituent of a clause.
#[derive(Clone, Debug)]
pub(crate) enum Piece {
    Thing(Phrase),
    Into(Relation, Phrase),
    From(Phrase, bool),
    Side(Place),
    Way(Place),
    Amount(Amount),
    Clockwise(bool),
    Out,
    In,
    Filler,
}

/// The constituents of a clause, sorted.
pub(crate) struct Clause {
    what: Option<Phrase>,
    extra: bool,
    into: Option<(Relation, Phrase)>,
    from: Option<Phrase>,
    side: Option<Place>,
    way: Option<Place>,
    amount: Amount,
    clockwise: bool,
    out: bool,
    inwards: bool,
}

impl Clause {
    pub fn new(pieces: Vec<Piece>) -> Self {
        let mut clause = Self {
            what: None,
            extra: false,
            into: None,
            from: None,
            side: None,
            way: None,
            amount: Amount::Open,
            clockwise: false,
            out: false,
            inwards: false,
        };
        for piece in pieces {
            match piece {
                Piece::Thing(phrase) if clause.what.is_none() => clause.what = Some(phrase),
                Piece::Thing(_) => clause.extra = true,
                Piece::Into(relation, phrase) if clause.into.is_none() => {
                    clause.into = Some((relation, phrase))
                }
                Piece::Into(..) => clause.extra = true,
                Piece::From(phrase, bare) => {
                    clause.out = true;
                    if bare && clause.what.is_none() {
                        clause.what = Some(phrase);
                    } else if clause.from.is_none() {
                        clause.from = Some(phrase);
                    } else {
                        clause.extra = true;
                    }
                }
                Piece::Side(place) => clause.side = Some(place),
                Piece::Way(place) => clause.way = Some(place),
                Piece::Amount(amount) => clause.amount = amount,
                Piece::Clockwise(clockwise) => clause.clockwise = clockwise,
                Piece::Out => clause.out = true,
                Piece::In => clause.inwards = true,
                Piece::Filler => {}
            }
        }
        clause
    }

    pub fn command(
        mut self,
        class: VerbClass,
        verb: &str,
        text: &str,
        before: Option<&Command>,
    ) -> Result<Command, Puzzle> {
        let puzzle = |what: &str| Err(Puzzle::NotUnderstood(format!("\"{text}\": {what}")));
        if self.extra {
            return puzzle("more objects than the verb takes; give one instruction after another");
        }
        if self.what.is_none()
            && matches!(class, VerbClass::Connect | VerbClass::Push)
            && let Some((Relation::Inside | Relation::Around, phrase)) = self.into.take()
        {
            // "put in the screw".
            self.what = Some(phrase);
            self.inwards = true;
        }
        let Some(what) = self.what.clone().or_else(|| before.map(|_| pronoun())) else {
            return puzzle("say which part");
        };
        self.what = Some(what.clone());
        let measured = matches!(self.amount, Amount::Length(_) | Amount::Half | Amount::Vague);
        let open = |amount| {
            if amount == Amount::Open {
                Amount::Full
            } else {
                amount
            }
        };
        let disconnect = |clause: Self| Command::Disconnect {
            what: what.clone(),
            way: clause.way.or(clause.side),
            from: clause.from,
        };
        let connect = |clause: Self| {
            let (relation, into) = clause
                .into
                .map_or((Relation::Any, None), |(relation, into)| (relation, Some(into)));
            Command::Connect {
                what: what.clone(),
                into,
                relation,
                from: clause.side,
                extent: open(clause.amount),
            }
        };
        let adjust = |clause: &Self, out: bool| Command::Adjust {
            what: what.clone(),
            out,
            way: clause.way,
            amount: clause.amount,
        };
        Ok(match class {
            _ if matches!(self.amount, Amount::Angle(_)) && class != VerbClass::Turn => {
                if self.into.is_some() || self.from.is_some() {
                    return puzzle("an angle needs a verb such as \"turn\"");
                }
                return puzzle("an angle goes with \"turn\", a length with \"pull\" or \"push\"");
            }
            VerbClass::Turn if verb == "give" && !matches!(self.amount, Amount::Angle(_)) => {
                return puzzle("say what to give it: an angle");
            }
            VerbClass::Turn if self.into.is_some() || self.from.is_some() => {
                return puzzle("turn a part about its axis, without a place");
            }
            VerbClass::Turn => Command::Turn {
                what,
                amount: match self.amount {
                    Amount::Angle(angle) if self.clockwise => Amount::Angle(-angle),
                    Amount::Half => Amount::Angle(std::f64::consts::PI),
                    amount => amount,
                },
            },
            VerbClass::Remove | VerbClass::Undo if measured => adjust(&self, true),
            VerbClass::Remove | VerbClass::Undo => disconnect(self),
            VerbClass::Connect
                if matches!(self.amount, Amount::Length(_) | Amount::Vague) && self.into.is_none() =>
            {
                adjust(&self, self.out)
            }
            VerbClass::Connect if self.out && self.into.is_none() => disconnect(self),
            VerbClass::Connect => connect(self),
            VerbClass::Take if self.into.is_some() => connect(self),
            VerbClass::Take if measured => adjust(&self, true),
            VerbClass::Take if self.out || self.from.is_some() => disconnect(self),
            VerbClass::Take => Command::Pick { what },
            VerbClass::Pull if self.into.is_some() => connect(self),
            VerbClass::Pull if measured => adjust(&self, !self.inwards),
            VerbClass::Pull if verb == "loosen" => return puzzle("say by how many millimetres to loosen it"),
            VerbClass::Pull if verb == "back" && !self.out => return puzzle("say how far to back it out"),
            VerbClass::Pull if self.inwards && !self.out => connect(self),
            VerbClass::Pull => disconnect(self),
            VerbClass::Push if self.into.is_some() => connect(self),
            VerbClass::Push if measured || verb == "tighten" => {
                self.amount = open(self.amount);
                adjust(&self, self.out)
            }
            VerbClass::Push if self.out => disconnect(self),
            VerbClass::Push => connect(self),
            VerbClass::Move if self.into.is_some() => connect(self),
            VerbClass::Move if measured && (self.out || self.inwards || self.way.is_some()) => {
                adjust(&self, self.out || !self.inwards)
            }
            VerbClass::Move if self.out || self.from.is_some() => disconnect(self),
            VerbClass::Move if self.inwards => connect(self),
            VerbClass::Move => return puzzle("say which way, and how far or to which part"),
            VerbClass::Redo | VerbClass::Other => return puzzle("not an operation on a part"),
        })
    }
}

fn pronoun() -> Phrase {
    Phrase {
        pronoun: Some(Pronoun::Them),
        ..Phrase::new("it".into())
    }
}
