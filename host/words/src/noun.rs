//! Noun phrases: articles, quantities, adjectives, nouns, numbers, and what follows them.

use winnow::combinator::{alt, opt, preceded, repeat};
use winnow::error::ContextError;
use winnow::prelude::*;
use winnow::token::any;

use crate::lexicon;
use crate::phrase::{Phrase, Pronoun, Quantity};
use crate::token::Token;
use crate::word::{Input, number, of_table, one_of};

/// Words that can never be a noun.
const NEVER: &[&str] = &[
    "and",
    "or",
    "by",
    "from",
    "to",
    "into",
    "onto",
    "through",
    "with",
    "until",
    "if",
    "not",
    "dont",
    "never",
    "off",
    "out",
    "along",
    "it",
    "them",
    "they",
    "then",
    "is",
    "are",
    "but",
    "while",
    "without",
    "than",
    "up",
    "down",
    "upwards",
    "downwards",
    "about",
    "around",
    "own",
    "towards",
    "toward",
    "next",
    "near",
    "beside",
    "between",
    "under",
    "above",
    "below",
    "behind",
    "except",
    "instead",
    "before",
    "after",
];

/// Words for a part that is connected to nothing.
const FREE: &[&str] = &["free", "loose", "unused", "spare", "remaining"];

/// Whether `word` may be a noun of a part.
pub(crate) fn is_noun(word: &str) -> bool {
    let one = lexicon::singular(word);
    lexicon::SYNONYMS
        .iter()
        .any(|group| group.contains(&one.as_str()))
        || lexicon::HOLES.contains(&one.as_str())
}

/// A noun phrase, with those that "and" adds; `loose_in`: "in" after the noun says where the part is ("the pin in hole 4").
pub(crate) fn phrase(input: &mut Input<'_>, loose_in: bool) -> winnow::Result<Phrase> {
    let before = *input;
    let mut first = simple(input, loose_in)?;
    loop {
        let start = *input;
        let joint = (
            opt(any.verify(|t: &Token| matches!(t, Token::Comma))),
            opt(one_of(&["and"])),
        )
            .parse_next(input)?;
        if joint.0.is_none() && joint.1.is_none() {
            *input = start;
            break;
        }
        match simple(input, loose_in) {
            Ok(next) => first.and.push(next),
            Err(_) => {
                *input = start;
                break;
            }
        }
    }
    let taken = &before[..before.len() - input.len()];
    let words: Vec<String> = taken.iter().map(Token::shown).collect();
    first.text = words.join(" ");
    Ok(first)
}

fn simple(input: &mut Input<'_>, loose_in: bool) -> winnow::Result<Phrase> {
    let before = *input;
    let found = alt((pronoun, |input: &mut Input<'_>| noun(input, loose_in))).parse_next(input);
    match found {
        Ok(mut phrase) => {
            let taken = &before[..before.len() - input.len()];
            let words: Vec<String> = taken.iter().map(Token::shown).collect();
            phrase.text = words.join(" ");
            Ok(phrase)
        }
        Err(error) => {
            *input = before;
            Err(error)
        }
    }
}

fn pronoun(input: &mut Input<'_>) -> winnow::Result<Phrase> {
    let start = *input;
    let found = alt((
        (
            opt(one_of(&["all"])),
            opt(one_of(&["of"])),
            one_of(&["them", "they"]),
        )
            .value((Pronoun::Them, Quantity::All)),
        (one_of(&["both"]), opt(one_of(&["of"])), one_of(&["them"])).value((Pronoun::Them, Quantity::Both)),
        one_of(&["it", "itself"]).value((Pronoun::It, Quantity::One)),
        (
            opt(one_of(&["all"])),
            opt(one_of(&["the"])),
            one_of(&["others", "rest"]),
        )
            .value((Pronoun::Others, Quantity::All)),
        (
            one_of(&["the", "that"]),
            one_of(&["other"]),
            opt(one_of(&["one"])),
        )
            .verify(|_| true)
            .value((Pronoun::Other, Quantity::One)),
        (one_of(&["these", "those"]), opt(one_of(&["ones"]))).value((Pronoun::Them, Quantity::All)),
        (one_of(&["this", "that"]), opt(one_of(&["one"]))).value((Pronoun::It, Quantity::One)),
    ))
    .parse_next(input)?;
    // "that screw", "the other screw": the noun follows.
    let follows = match input.first() {
        Some(Token::Name { .. } | Token::Number { .. }) => true,
        Some(Token::Word { text, .. }) => !starts_constituent(text),
        _ => false,
    };
    if follows && !matches!(found.0, Pronoun::It) && found.0 != Pronoun::Other {
        *input = start;
        return Err(ContextError::new());
    }
    if follows {
        let Pronoun::Other = found.0 else {
            if input.len() + 1 < start.len() || start[0].word() == Some("it") {
                return Err(ContextError::new());
            }
            return Err(ContextError::new());
        };
        // The class of the noun limits what "other" can mean.
        let mut named = noun(input, true)?;
        named.pronoun = Some(match named.quantity {
            Quantity::All => Pronoun::Others,
            _ => Pronoun::Other,
        });
        return Ok(named);
    }
    Ok(Phrase {
        pronoun: Some(found.0),
        quantity: found.1,
        ..Phrase::new(String::new())
    })
}

/// Whether a word stands behind the phrase before it, which has its noun or not; `last` is whether no other word follows.
fn ends_phrase(text: &str, has_noun: bool, last: bool) -> bool {
    const BEHIND_NOUNS: [&str; 5] = ["the", "of", "number", "no", "nr"];
    let is_never = NEVER.contains(&text) || lexicon::INTO.iter().any(|(w, _)| *w == text);
    let is_place = || lexicon::PLACES.iter().any(|(_, w)| w.contains(&text));
    is_never
        || (has_noun && BEHIND_NOUNS.contains(&text))
        || (starts_constituent(text) && (has_noun || last || !is_place()))
}

/// Whether `word` begins something other than a noun.
fn starts_constituent(word: &str) -> bool {
    NEVER.contains(&word)
        || lexicon::INTO.iter().any(|(w, _)| *w == word)
        || [lexicon::FILLERS, lexicon::OUT, lexicon::IN, lexicon::FULLY]
            .iter()
            .any(|list| list.contains(&word))
        || [
            "a",
            "an",
            "half",
            "halfway",
            "quarter",
            "one",
            "all",
            "slightly",
            "clockwise",
            "anticlockwise",
            "counterclockwise",
        ]
        .contains(&word)
}

fn noun(input: &mut Input<'_>, loose_in: bool) -> winnow::Result<Phrase> {
    let mut phrase = Phrase::new(String::new());
    let counted = quantity(input, &mut phrase)?;
    let mut plural = false;
    let mut one = false;
    loop {
        let start = *input;
        let ends = |rest: Input<'_>| {
            !rest
                .iter()
                .take_while(|t| !matches!(t, Token::Comma | Token::Stop))
                .any(may_be_noun)
        };
        let Some(token) = input.first() else { break };
        match token {
            Token::Name { part, .. } => {
                phrase.names.push(*part);
                *input = &input[1..];
                break;
            }
            Token::Word { text, joined } => {
                let (text, joined) = (text.clone(), *joined);
                let word = lexicon::singular(&text);
                let next_joined = joined;
                if ["one", "ones"].contains(&text.as_str()) && !next_joined {
                    one = true;
                    plural |= text == "ones";
                    *input = &input[1..];
                    break;
                }
                if next_joined && lexicon::NUMBERS.iter().any(|(_, w)| *w == text) {
                    phrase.nouns.push(word);
                    *input = &input[1..];
                    continue;
                }
                let rest = &input[1..];
                let last = ends(rest);
                if let (Some(ordinal), true) = (
                    lexicon::find(lexicon::ORDINALS, &text),
                    phrase.nouns.is_empty() || !last,
                ) {
                    phrase.ordinals.push(ordinal);
                } else if let (Some(place), false) = (lexicon::find(lexicon::PLACES, &text), last) {
                    if phrase.nouns.is_empty() {
                        phrase.places.push(place);
                    } else {
                        // After the noun it is a particle: "put the screw back".
                        *input = start;
                        break;
                    }
                } else if let (Some(size), false) = (lexicon::find(lexicon::SIZES, &text), last) {
                    phrase.sizes.push(size);
                } else if let (true, Some(n)) =
                    (phrase.nouns.is_empty() && counted.is_none(), count_word(&text))
                {
                    phrase.quantity = Quantity::Count(n);
                } else if phrase.nouns.is_empty() && !last && FREE.contains(&text.as_str()) {
                    phrase.free = true;
                } else if text == "half" && !phrase.places.is_empty() && phrase.nouns.is_empty() {
                    phrase.nouns.push(word);
                } else if !phrase.nouns.is_empty() && count_word(&text).is_some() {
                    // "screw two": a number after the noun.
                    break;
                } else if phrase.nouns.is_empty() && ["the", "of"].contains(&text.as_str()) {
                    // "all of the screws".
                } else if ends_phrase(&text, !phrase.nouns.is_empty(), last) {
                    break;
                } else {
                    plural = word != text;
                    phrase.nouns.push(word);
                }
                *input = &input[1..];
            }
            Token::Number { value, joined } if phrase.nouns.is_empty() && *joined => {
                phrase.nouns.push(value.to_string());
                *input = &input[1..];
            }
            _ => break,
        }
    }
    let is_empty = phrase.nouns.is_empty() && phrase.names.is_empty() && !one;
    // An ordinal alone is a phrase: "the last", "the second".
    if is_empty && (phrase.ordinals.is_empty() || phrase.quantity == Quantity::Any) {
        return Err(ContextError::new());
    }
    plural |= phrase.nouns.last().is_some_and(|head| head == "everything");
    if plural && phrase.quantity == Quantity::One {
        phrase.quantity = Quantity::All;
    }
    if one
        && counted.is_none()
        && phrase.ordinals.is_empty()
        && phrase.places.is_empty()
        && phrase.sizes.is_empty()
    {
        return Err(ContextError::new());
    }
    after(input, &mut phrase, loose_in);
    state_words(&mut phrase);
    Ok(phrase)
}

fn may_be_noun(token: &Token) -> bool {
    match token {
        Token::Name { .. } => true,
        Token::Word { text, .. } => {
            (!starts_constituent(text) || ["half", "one", "ones"].contains(&text.as_str()))
                && !["the", "of", "number"].contains(&text.as_str())
                || (lexicon::PLACES.iter().any(|(_, w)| w.contains(&text.as_str())) && text != "back")
        }
        _ => false,
    }
}

fn count_word(word: &str) -> Option<u32> {
    lexicon::NUMBERS
        .iter()
        .find(|(_, w)| *w == word)
        .map(|&(n, _)| n as u32)
}

/// "all four of the", "both", "a", "any"; `Some` when a count or totality is stated.
fn quantity(input: &mut Input<'_>, phrase: &mut Phrase) -> winnow::Result<Option<()>> {
    let _: Vec<()> = repeat(0..2, one_of(lexicon::DETERMINERS)).parse_next(input)?;
    let total = opt(one_of(&["all", "every", "each"])).parse_next(input)?;
    let both = opt(one_of(&["both"])).parse_next(input)?;
    let any_one = opt(one_of(&["any", "some", "whichever"])).parse_next(input)?;
    let _: Vec<()> = repeat(
        0..3,
        one_of(&[
            "of", "the", "a", "an", "its", "their", "these", "those", "another", "single",
        ]),
    )
    .parse_next(input)?;
    let start = *input;
    let count = opt(number.verify(|n| (0.0..=1e6).contains(n)))
        .parse_next(input)?
        .map(|n| n as u32);
    // "one" alone, a number with a unit, or a number joined to a noun is no count.
    let noun_follows = input.first().is_some_and(may_be_noun)
        || matches!(input.first(), Some(Token::Word { text, .. }) if text == "of");
    let joined = matches!(start.first(), Some(Token::Number { joined: true, .. }));
    let unit = input.first().and_then(Token::word).is_some_and(|w| {
        let w = lexicon::singular(w);
        lexicon::find(lexicon::LENGTHS, &w).is_some() || lexicon::find(lexicon::ANGLES, &w).is_some()
    });
    let count = if count.is_some() && (!noun_follows || unit || joined) {
        *input = start;
        if unit {
            return Err(ContextError::new());
        }
        None
    } else {
        count
    };
    phrase.quantity = match (total, both, any_one, count) {
        (Some(()), _, _, Some(n)) => Quantity::AllOf(n),
        (Some(()), ..) => Quantity::All,
        (_, Some(()), ..) => Quantity::Both,
        (_, _, Some(()), None | Some(1)) => Quantity::Any,
        (.., Some(n)) if n != 1 => Quantity::Count(n),
        _ => Quantity::One,
    };
    Ok((phrase.quantity != Quantity::One).then_some(()))
}

/// What follows the noun: numbers, "of the plate", "in hole 4", "on the left".
fn after(input: &mut Input<'_>, phrase: &mut Phrase, loose_in: bool) {
    let _ = opt(one_of(&["number", "no", "nr"])).parse_next(input);
    while let Some(n) = opt(number_without_unit).parse_next(input).ok().flatten() {
        phrase.numbers.push(n);
        let start = *input;
        let comma = matches!(input.first(), Some(Token::Comma)).then(|| *input = &input[1..]);
        let and = opt(one_of(&["and", "to", "through"]))
            .parse_next(input)
            .ok()
            .flatten();
        let range = and.is_some() && start.first().and_then(Token::word).is_some_and(|w| w != "and");
        if comma.is_none() && and.is_none() {
            break;
        }
        let ahead = *input;
        match number_without_unit(input) {
            Ok(m) if range => phrase.numbers.extend(n + 1..=m.min(n + 1000)),
            Ok(_) => *input = ahead,
            Err(_) => {
                *input = start;
                break;
            }
        }
        if range {
            break;
        }
    }
    if phrase.numbers.len() > 1 {
        phrase.quantity = Quantity::Count(phrase.numbers.len() as u32);
    }
    loop {
        let start = *input;
        let placed: winnow::Result<_> = preceded(
            (one_of(&["on", "at", "in"]), opt(one_of(&["the"]))),
            of_table(lexicon::PLACES),
        )
        .parse_next(input);
        if let Ok(place) = placed {
            let _ = opt(one_of(&["side", "end"])).parse_next(input);
            let more = input.first().is_some_and(may_be_noun);
            if !more {
                phrase.places.push(place);
                continue;
            }
        }
        *input = start;
        let preposition: winnow::Result<()> = one_of(&["of", "in", "belonging"]).parse_next(input);
        let word = start.first().and_then(Token::word).unwrap_or_default();
        if preposition.is_ok()
            && (word == "of" || loose_in)
            && let Ok(owner) = simple(input, loose_in)
        {
            phrase.of = Some(Box::new(owner));
            continue;
        }
        *input = start;
        break;
    }
    let head = phrase.nouns.last().cloned().unwrap_or_default();
    if phrase.names.is_empty() && lexicon::HOLES.contains(&head.as_str()) {
        phrase.hole = true;
    }
    if lexicon::PIECES.contains(&head.as_str())
        && phrase.nouns.len() == 1
        && let Some(owner) = phrase.of.take()
    {
        // "the upper half of the housing": the upper housing.
        let places = std::mem::take(&mut phrase.places);
        let text = phrase.text.clone();
        *phrase = *owner;
        phrase.places.extend(places);
        phrase.text = text;
    }
}

fn number_without_unit(input: &mut Input<'_>) -> winnow::Result<u32> {
    let start = *input;
    let n = number(input)?;
    let unit = input.first().and_then(Token::word).is_some_and(|w| {
        let w = lexicon::singular(w);
        lexicon::find(lexicon::LENGTHS, &w).is_some()
            || lexicon::find(lexicon::ANGLES, &w).is_some()
            || w == "quarter"
            || w == "third"
            || w == "full"
    });
    if unit || n.fract() != 0.0 || !(0.0..=1e6).contains(&n) {
        *input = start;
        return Err(ContextError::new());
    }
    Ok(n as u32)
}

/// "free" and "loose" say that a part is connected to nothing, unless its name has the word.
fn state_words(phrase: &mut Phrase) {
    if phrase.nouns.len() > 1 {
        let before = phrase.nouns.len();
        phrase.nouns.retain(|word| !FREE.contains(&word.as_str()));
        phrase.free |= phrase.nouns.len() < before;
    }
}
