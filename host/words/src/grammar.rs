//! Tokens to commands: verb, noun phrases, particles, destinations, directions and amounts, in any order that a person says them.
//!
//! A sentence is a chain of clauses, each with a verb. The constituents of a clause are parsed one by one, and the verb's class together with
//! them gives the command: "pull … out" takes apart, "pull … out by 12 mm" adjusts, "push … into" puts together.

use winnow::combinator::{alt, opt, preceded, repeat};
use winnow::prelude::*;
use winnow::token::any;

use crate::clause::{Clause, Piece};
use crate::lexicon::{self, Place, VerbClass};
use crate::noun::phrase;
use crate::phrase::{Amount, Command, Phrase, Puzzle};
use crate::token::Token;
use crate::word::{Input, number, of_table, one_of};

/// Parses an instruction: its commands in order.
///
/// # Errors
/// [`Puzzle`]: no verb of assembly, or words that no rule takes.
pub fn parse(tokens: &[Token]) -> Result<Vec<Command>, Puzzle> {
    let mut commands = Vec::new();
    for clause in clauses(tokens) {
        commands.push(command(clause, commands.last())?);
    }
    if commands.is_empty() {
        return Err(Puzzle::NotUnderstood(
            "there are no words in it; say what to do with which part".into(),
        ));
    }
    Ok(commands)
}

/// The noun phrase that is all of an instruction: the answer to a question.
pub fn only_phrase(mut tokens: &[Token]) -> Option<Phrase> {
    while let Some((Token::Stop | Token::Comma, rest)) = tokens.split_last() {
        tokens = rest;
    }
    let starts_with_verb = tokens
        .first()
        .and_then(Token::word)
        .is_some_and(|w| lexicon::verb(w).is_some())
        && verb_at(tokens);
    let found = phrase(&mut tokens, true).ok()?;
    (tokens.is_empty() && !starts_with_verb).then_some(found)
}

/// Splits at stops, commas, "then" and "and" before a verb.
fn clauses(tokens: &[Token]) -> Vec<&[Token]> {
    let mut out = Vec::new();
    let mut start = 0;
    let mut at = 0;
    while at < tokens.len() {
        let joint = match &tokens[at] {
            Token::Stop => true,
            Token::Comma => verb_at(&tokens[at + 1..]),
            Token::Word { text, .. } if text == "and" || text == "then" => verb_at(&tokens[at + 1..]),
            _ => false,
        };
        if joint {
            out.push(&tokens[start..at]);
            start = at + 1;
        }
        at += 1;
    }
    out.push(&tokens[start..]);
    out.retain(|clause| {
        clause.iter().any(|t| {
            !matches!(t, Token::Comma | Token::Stop)
                && t.word().is_none_or(|w| !["then", "and", "please"].contains(&w))
        })
    });
    out
}

/// Whether a clause begins here: a verb after lead words. Nouns that are verbs too ("bolt") need an article or pronoun after them.
fn verb_at(tokens: &[Token]) -> bool {
    let skipped = tokens
        .iter()
        .take_while(|t| t.word().is_some_and(|w| lexicon::LEADS.contains(&w)));
    let rest = &tokens[skipped.count()..];
    let Some(word) = rest.first().and_then(Token::word) else {
        return false;
    };
    let Some(class) = lexicon::verb(word) else {
        return false;
    };
    if class == VerbClass::Other {
        return false;
    }
    let noun = lexicon::SYNONYMS.iter().any(|group| group.contains(&word))
        || ["crank", "seat", "thread", "turn", "set"].contains(&word);
    let follows = rest.get(1).and_then(Token::word);
    !noun || follows.is_some_and(|w| ["the", "it", "them", "all", "both", "a", "in", "out"].contains(&w))
}

fn command(mut input: Input<'_>, before: Option<&Command>) -> Result<Command, Puzzle> {
    let whole = input;
    let text = shown(whole);
    while let Some(first) = input.first() {
        let lead = first
            .word()
            .is_some_and(|w| lexicon::LEADS.contains(&w) && lexicon::verb(w).is_none());
        if lead || matches!(first, Token::Comma) {
            input = &input[1..];
        } else {
            break;
        }
    }
    let Some(word) = input.first().and_then(Token::word).map(str::to_owned) else {
        return Err(no_verb(&text, whole));
    };
    if lexicon::QUESTIONS.contains(&word.as_str()) {
        return Err(Puzzle::NotAnAction(format!(
            "\"{text}\" asks for nothing that can be done with parts"
        )));
    }
    let Some(class) = lexicon::verb(&word) else {
        return Err(no_verb(&text, whole));
    };
    if class == VerbClass::Other {
        return Err(Puzzle::NotAnAction(format!(
            "\"{word}\" is no assembly operation; parts can be connected, disconnected, adjusted and turned"
        )));
    }
    input = &input[1..];
    let back_again = class == VerbClass::Undo && input.iter().all(|t| t.word().is_some_and(undone));
    if class == VerbClass::Redo || back_again {
        let rest = input.iter().find(|t| t.word().is_none_or(|w| !undone(w)));
        return match (rest, class) {
            (Some(token), _) => Err(unread(token, &text)),
            (None, VerbClass::Redo) => Ok(Command::Redo),
            (None, _) => Ok(Command::Undo),
        };
    }
    let loose_in = !matches!(class, VerbClass::Connect | VerbClass::Push | VerbClass::Move);
    let pieces: Vec<Piece> = repeat(0.., |input: &mut Input<'_>| piece(input, loose_in))
        .parse_next(&mut input)
        .unwrap_or_default();
    if let Some(token) = input.first() {
        return Err(unread(token, &text));
    }
    Clause::new(pieces).command(class, &word, &text, before)
}

fn undone(word: &str) -> bool {
    [
        "that",
        "it",
        "this",
        "the",
        "last",
        "step",
        "move",
        "one",
        "please",
        "action",
        "change",
        "again",
        "operation",
        "previous",
        "turn",
    ]
    .contains(&word)
}

fn shown(tokens: &[Token]) -> String {
    let words: Vec<String> = tokens.iter().map(Token::shown).collect();
    let mut text = words.join(" ");
    if text.chars().count() > 80 {
        text = text.chars().take(77).collect::<String>() + "…";
    }
    text
}

fn unread(token: &Token, text: &str) -> Puzzle {
    Puzzle::NotUnderstood(format!(
        "cannot follow \"{text}\" at \"{}\"; say it in shorter words",
        token.shown()
    ))
}

/// A sentence with a part in it and no verb is no action; anything else is not understood.
fn no_verb(text: &str, tokens: &[Token]) -> Puzzle {
    if tokens.iter().any(|t| matches!(t, Token::Name { .. })) && tokens.len() > 1 {
        Puzzle::NotAnAction(format!(
            "\"{text}\" names a part and no operation; say what to do with it"
        ))
    } else {
        Puzzle::NotUnderstood(format!(
            "no verb is understood in \"{text}\"; say, for example, \"remove the cover\""
        ))
    }
}

fn piece(input: &mut Input<'_>, loose_in: bool) -> winnow::Result<Piece> {
    let measure = alt((
        amount.map(Piece::Amount),
        clockwise.map(Piece::Clockwise),
        own_axis.value(Piece::Filler),
        side.map(Piece::Side),
        way.map(Piece::Way),
    ));
    alt((
        measure,
        |input: &mut Input<'_>| into(input, loose_in),
        from,
        one_of(lexicon::OUT).value(Piece::Out),
        one_of(lexicon::IN).value(Piece::In),
        |input: &mut Input<'_>| phrase(input, loose_in).map(Piece::Thing),
        one_of(lexicon::FILLERS).value(Piece::Filler),
        any.verify(|t: &Token| matches!(t, Token::Comma | Token::Stop))
            .value(Piece::Filler),
    ))
    .parse_next(input)
}

/// "by 12 mm", "90 degrees", "a quarter turn", "halfway", "fully".
fn amount(input: &mut Input<'_>) -> winnow::Result<Amount> {
    let by = |input: &mut Input<'_>| {
        one_of(&[
            "by",
            "about",
            "approximately",
            "roughly",
            "for",
            "through",
            "around",
            "another",
            "exactly",
            "further",
        ])
        .parse_next(input)
    };
    let _: Vec<()> = repeat(0..3, by).parse_next(input)?;
    let angle = alt((
        (
            number,
            one_of(&["and"]),
            opt(article),
            fraction,
            of_table(lexicon::ANGLES),
        )
            .map(|(n, (), _, f, u)| Amount::Angle((n + f) * u)),
        (number, of_table(lexicon::LENGTHS)).map(|(n, u)| Amount::Length(n * u)),
        (number, of_table(lexicon::ANGLES)).map(|(n, u)| Amount::Angle(n * u)),
        (
            opt(alt((article, one_of(&["one"])))),
            fraction,
            opt(one_of(&["of"])),
            opt(article),
            of_table(&lexicon::ANGLES[2..]),
        )
            .map(|(_, f, _, _, turn)| Amount::Angle(f * turn)),
        (
            opt(article),
            one_of(&["full", "complete", "whole"]),
            of_table(&lexicon::ANGLES[2..]),
        )
            .map(|(_, (), turn)| Amount::Angle(turn)),
        (article, of_table(&lexicon::ANGLES[2..])).map(|((), turn)| Amount::Angle(turn)),
        (opt(article), fraction)
            .verify(|(_, f)| (*f - 0.5).abs() > 1e-9)
            .map(|(_, f)| Amount::Angle(f * std::f64::consts::TAU)),
    ));
    let share = alt((
        (article, fraction, of_table(lexicon::LENGTHS)).map(|((), f, u)| Amount::Length(f * u)),
        one_of(&["halfway", "half"])
            .then_ignore(opt(one_of(&["way"])))
            .value(Amount::Half),
        one_of(lexicon::FULLY).value(Amount::Full),
        (one_of(&["all"]), one_of(&["the"]), one_of(&["way"])).value(Amount::Full),
        (
            one_of(&["as"]),
            one_of(&["far"]),
            one_of(&["as"]),
            any,
            opt(one_of(&["goes", "go", "will"])),
            opt(one_of(&["go"])),
        )
            .value(Amount::Full),
        (
            article,
            opt(one_of(&["little", "tiny", "small"])),
            one_of(&["bit", "little", "touch", "hair"]),
        )
            .value(Amount::Vague),
        one_of(&["slightly", "somewhat"]).value(Amount::Vague),
    ));
    alt((angle, share)).parse_next(input)
}

fn article(input: &mut Input<'_>) -> winnow::Result<()> {
    one_of(&["a", "an", "the"]).parse_next(input)
}

/// "half", "quarter", "three quarters", "third".
fn fraction(input: &mut Input<'_>) -> winnow::Result<f64> {
    alt((
        (number, one_of(&["quarters", "quarter"])).map(|(n, ())| n / 4.0),
        one_of(&["quarter"]).value(0.25),
        one_of(&["half"]).value(0.5),
        (number, one_of(&["thirds"])).map(|(n, ())| n / 3.0),
    ))
    .parse_next(input)
}

fn clockwise(input: &mut Input<'_>) -> winnow::Result<bool> {
    alt((
        one_of(&["clockwise"]).value(true),
        one_of(&["anticlockwise", "counterclockwise"]).value(false),
        (one_of(&["counter", "anti"]), one_of(&["clockwise"])).value(false),
    ))
    .parse_next(input)
}

/// "about its own axis": what a turn does anyway.
fn own_axis(input: &mut Input<'_>) -> winnow::Result<()> {
    alt((
        (
            one_of(&["about", "around"]),
            one_of(&["its", "their", "the"]),
            opt(one_of(&["own"])),
            one_of(&["axis", "axes"]),
        )
            .void(),
        (
            one_of(&["on"]),
            one_of(&["its", "their"]),
            opt(one_of(&["own"])),
            one_of(&["axis", "axes"]),
        )
            .void(),
    ))
    .parse_next(input)
}

/// "from above".
fn side(input: &mut Input<'_>) -> winnow::Result<Place> {
    preceded(
        (one_of(&["from"]), opt(one_of(&["the"]))),
        of_table(lexicon::SIDES),
    )
    .then_ignore(opt(one_of(&["side"])))
    .parse_next(input)
}

/// "upwards", "to the left".
fn way(input: &mut Input<'_>) -> winnow::Result<Place> {
    alt((
        of_table(lexicon::WAYS),
        preceded(
            (one_of(&["to", "towards"]), one_of(&["the"])),
            of_table(lexicon::PLACES),
        )
        .verify(|place| *place != Place::Middle),
    ))
    .parse_next(input)
    .and_then(|found| {
        // "to the left bearing" is a destination.
        match input.first() {
            Some(Token::Name { .. }) => Err(winnow::error::ContextError::new()),
            Some(Token::Word { text, .. }) if !lexicon::known(text) || crate::noun::is_noun(text) => {
                Err(winnow::error::ContextError::new())
            }
            _ => Ok(found),
        }
    })
}

/// "into the rear bearing", "back onto the rod".
fn into(input: &mut Input<'_>, loose_in: bool) -> winnow::Result<Piece> {
    let back: Vec<()> = repeat(0..2, one_of(&["back", "down", "up"])).parse_next(input)?;
    let relation = any
        .verify_map(|token: Token| {
            lexicon::INTO
                .iter()
                .find(|(w, _)| Some(*w) == token.word())
                .map(|&(_, r)| r)
        })
        .parse_next(input)?;
    let _ = opt(one_of(&["to"])).parse_next(input)?;
    let what = phrase(input, loose_in)?;
    let _ = back;
    Ok(Piece::Into(relation, what))
}

/// "from the plate", "off the rod", "out of the hole"; true: a bare "off" or "out", which may precede the object itself.
fn from(input: &mut Input<'_>) -> winnow::Result<Piece> {
    let bare = alt((
        (one_of(&["out", "off", "away"]), one_of(&["of", "from"])).value(false),
        one_of(&["from"]).value(false),
        one_of(&["off", "out"]).value(true),
    ))
    .parse_next(input)?;
    let what = phrase(input, true)?;
    Ok(Piece::From(what, bare))
}

trait ThenIgnore<'a, O>: Parser<Input<'a>, O, winnow::error::ContextError> + Sized {
    fn then_ignore<P>(
        self,
        then: impl Parser<Input<'a>, P, winnow::error::ContextError>,
    ) -> impl Parser<Input<'a>, O, winnow::error::ContextError> {
        winnow::combinator::terminated(self, then)
    }
}

impl<'a, O, T: Parser<Input<'a>, O, winnow::error::ContextError>> ThenIgnore<'a, O> for T {}
