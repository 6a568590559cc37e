//! Text to tokens: words, numbers and names of parts; misspelt words are corrected.

use winnow::ascii::{digit1, multispace0};
use winnow::combinator::{alt, opt, preceded, repeat};
use winnow::prelude::*;
use winnow::token::{any, take_while};

use crate::lexicon::{self, VerbClass};

/// Longest instruction that is read, bytes: far more than a sentence, so that garbage costs nothing.
pub const LONGEST: usize = 2000;

/// One token.
#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    /// A word in lower case; `joined`: written together with the token before it ("two-pin").
    Word {
        /// The word.
        text: String,
        /// Joined by a hyphen or underscore to the token after it.
        joined: bool,
    },
    /// A number.
    Number {
        /// Its value.
        value: f64,
        /// As for a word.
        joined: bool,
    },
    /// A part named in full, by index.
    Name {
        /// Index of the part.
        part: usize,
        /// The name.
        text: String,
    },
    /// A comma or semicolon.
    Comma,
    /// End of a sentence.
    Stop,
}

impl Token {
    /// The word, if it is one.
    pub fn word(&self) -> Option<&str> {
        match self {
            Self::Word { text, .. } => Some(text),
            _ => None,
        }
    }

    /// Text for messages.
    pub fn shown(&self) -> String {
        match self {
            Self::Word { text, .. } | Self::Name { text, .. } => text.clone(),
            Self::Number { value, .. } => value.to_string(),
            Self::Comma => ",".into(),
            Self::Stop => ".".into(),
        }
    }
}

/// Words and numbers of a part's name or of a text, in lower case: `pin-in-hole-3` has pin, in, hole, 3.
pub fn split(text: &str) -> Vec<Token> {
    let lower = text.to_lowercase().replace(['\'', '’'], "");
    let mut rest = lower.as_str();
    tokens(&mut rest).unwrap_or_default()
}

fn tokens(input: &mut &str) -> winnow::Result<Vec<Token>> {
    let found: Vec<Option<Token>> = repeat(0.., preceded(multispace0, token)).parse_next(input)?;
    Ok(found.into_iter().flatten().collect())
}

fn token(input: &mut &str) -> winnow::Result<Option<Token>> {
    alt((
        ordinal.map(Some),
        number.map(Some),
        word.map(Some),
        any.map(|c| match c {
            ',' | ';' => Some(Token::Comma),
            '.' | '!' | '?' => Some(Token::Stop),
            _ => None,
        }),
    ))
    .parse_next(input)
}

/// "2nd" is one word.
fn ordinal(input: &mut &str) -> winnow::Result<Token> {
    (digit1, alt(("st", "nd", "rd", "th")))
        .take()
        .map(|text: &str| Token::Word {
            text: text.into(),
            joined: false,
        })
        .parse_next(input)
}

fn number(input: &mut &str) -> winnow::Result<Token> {
    // A hyphen after a word is taken with the word, so this one is a sign.
    let sign = opt(alt(('-', '−'))).parse_next(input)?;
    let text = (digit1, opt((alt(('.', ',')), digit1)))
        .take()
        .parse_next(input)?;
    let value: f64 = text.replace(',', ".").parse().unwrap_or(f64::INFINITY);
    let value = if sign.is_some() { -value } else { value };
    let joined = hyphen(input);
    Ok(Token::Number { value, joined })
}

fn word(input: &mut &str) -> winnow::Result<Token> {
    let text = take_while(1.., |c: char| c.is_alphabetic() || matches!(c, '°' | 'µ' | 'μ'))
        .parse_next(input)?
        .to_owned();
    let joined = hyphen(input);
    Ok(Token::Word { text, joined })
}

/// Whether a hyphen or underscore joins the token to the next; it is taken.
fn hyphen(input: &mut &str) -> bool {
    let next = input.chars().nth(1);
    let joins = input.starts_with(['-', '_']) && next.is_some_and(char::is_alphanumeric);
    if joins {
        *input = &input[1..];
    }
    joins
}

/// Names of the parts of an assembly, as tokens.
#[derive(Clone, Debug, Default)]
pub struct Names {
    parts: Vec<(String, Vec<Token>)>,
}

impl Names {
    /// Of the parts in file order.
    pub fn new<'a>(parts: impl IntoIterator<Item = &'a str>) -> Self {
        Self {
            parts: parts
                .into_iter()
                .map(|name| (name.to_owned(), split(name)))
                .collect(),
        }
    }

    /// Words of part `part`, singular.
    pub fn words(&self, part: usize) -> Vec<String> {
        let words = self.parts[part].1.iter().filter_map(Token::word);
        words.map(lexicon::singular).collect()
    }

    /// Numbers of part `part`.
    pub fn numbers(&self, part: usize) -> Vec<u32> {
        let tokens = self.parts[part].1.iter();
        tokens
            .filter_map(|token| match token {
                Token::Number { value, .. } => Some(*value as u32),
                _ => None,
            })
            .collect()
    }

    /// Number of parts.
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    fn has_word(&self, word: &str) -> bool {
        self.parts
            .iter()
            .any(|(_, tokens)| tokens.iter().any(|t| t.word() == Some(word)))
    }
}

/// Tokens of an instruction: spelling corrected, parts named in full recognised.
///
/// A word is corrected when neither the vocabulary nor a part's name has it: to the only nearest word at one slip (omitted, added, changed or
/// swapped letter; optimal string alignment distance) from four letters on, two from eight on. Names of two tokens or more count when all of them
/// stand there in order: "screw 1" is `screw-1`.
pub fn read(text: &str, names: &Names) -> Vec<Token> {
    let mut tokens = split(text);
    let mut verb_expected = true;
    for token in &mut tokens {
        match token {
            Token::Word { text, .. } => {
                if let Some(better) = correct(text, names, verb_expected) {
                    *text = better;
                }
                verb_expected = lexicon::LEADS.contains(&text.as_str());
            }
            _ => verb_expected = matches!(token, Token::Comma | Token::Stop),
        }
    }
    named(tokens, names)
}

fn correct(word: &str, names: &Names, verb_expected: bool) -> Option<String> {
    let one = lexicon::singular(word);
    let length = word.chars().count();
    if length < 4
        || [word, &one]
            .iter()
            .any(|w| lexicon::known(w) || names.has_word(w))
    {
        return None;
    }
    let slips = if length >= 8 { 2 } else { 1 };
    let of_parts = names
        .parts
        .iter()
        .flat_map(|(_, tokens)| tokens.iter().filter_map(Token::word));
    let nouns = lexicon::SYNONYMS.iter().flat_map(|group| group.iter().copied());
    let verbs: Vec<&str> = lexicon::verbs().collect();
    let others = lexicon::SIZES
        .iter()
        .flat_map(|(_, w)| w.iter())
        .chain(lexicon::PLACES.iter().flat_map(|(_, w)| w.iter()))
        .chain(lexicon::ORDINALS.iter().flat_map(|(_, w)| w.iter()))
        .chain(lexicon::LENGTHS.iter().flat_map(|(_, w)| w.iter()))
        .chain(lexicon::ANGLES.iter().flat_map(|(_, w)| w.iter()))
        .chain(lexicon::FULLY.iter())
        .chain(
            [
                "quarter", "halfway", "other", "another", "above", "below", "into", "from",
            ]
            .iter(),
        )
        .copied();
    let candidates: Vec<&str> = if verb_expected {
        verbs
    } else {
        of_parts.chain(nouns).chain(others).collect()
    };
    let mut best: Option<(usize, &str)> = None;
    let mut tied = false;
    for candidate in candidates {
        let distance = [word, &one]
            .iter()
            .map(|w| strsim::osa_distance(w, candidate))
            .min()
            .unwrap_or(usize::MAX);
        match best {
            Some((d, c)) if distance == d && c != candidate => tied = true,
            Some((d, _)) if distance >= d => {}
            _ => {
                best = Some((distance, candidate));
                tied = false;
            }
        }
    }
    let (distance, found) = best?;
    (distance <= slips && !tied).then(|| {
        let plural = word.ends_with('s') && !found.ends_with('s');
        if plural {
            format!("{found}s")
        } else {
            found.to_owned()
        }
    })
}

/// Replaces parts named in full by [`Token::Name`], the longest name first.
fn named(tokens: Vec<Token>, names: &Names) -> Vec<Token> {
    let same = |a: &Token, b: &Token| match (a, b) {
        (Token::Word { text: a, .. }, Token::Word { text: b, .. }) => a == b,
        (Token::Number { value: a, .. }, Token::Number { value: b, .. }) => a == b,
        _ => false,
    };
    let mut out = Vec::new();
    let mut at = 0;
    // Whether the clause so far has a verb that puts something somewhere.
    let mut puts = false;
    while at < tokens.len() {
        let rest = &tokens[at..];
        match &rest[0] {
            Token::Comma | Token::Stop => puts = false,
            token => puts |= token.word().and_then(lexicon::verb) == Some(VerbClass::Connect),
        }
        let fits = |name: &[Token]| {
            let unit = rest.get(name.len()).and_then(Token::word).is_some_and(|word| {
                let word = lexicon::singular(word);
                lexicon::find(lexicon::LENGTHS, &word).is_some()
                    || lexicon::find(lexicon::ANGLES, &word).is_some()
            });
            let counted = matches!(name.last(), Some(Token::Number { .. })) && unit;
            name.len() >= 2
                && name.len() <= rest.len()
                && !counted
                && !(puts && ends_in_particle(name, rest))
                && name.iter().zip(rest).all(|(a, b)| same(a, b))
        };
        let found = names
            .parts
            .iter()
            .enumerate()
            .filter(|(_, (_, name))| fits(name))
            .max_by_key(|(index, (_, name))| (name.len(), usize::MAX - index));
        match found {
            Some((part, (text, name))) => {
                out.push(Token::Name {
                    part,
                    text: text.clone(),
                });
                at += name.len();
            }
            None => {
                out.push(tokens[at].clone());
                at += 1;
            }
        }
    }
    out
}

/// Whether the last word of a name that stands before `rest` is a particle of the clause there: "put the front rotor back", and not `rotor-back`.
fn ends_in_particle(name: &[Token], rest: &[Token]) -> bool {
    let is_last = matches!(rest.get(name.len()), None | Some(Token::Comma | Token::Stop));
    let is_particle = name
        .last()
        .and_then(Token::word)
        .is_some_and(|word| lexicon::IN.contains(&word));
    let before = name.len().checked_sub(2).and_then(|at| rest.get(at));
    is_last && is_particle && matches!(before, Some(Token::Word { joined: false, .. }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str, names: &[&str]) -> Vec<String> {
        read(text, &Names::new(names.iter().copied()))
            .iter()
            .map(Token::shown)
            .collect()
    }

    #[test]
    fn names_are_recognised_however_they_are_joined() {
        let names = ["screw-1", "pin-in-hole-3", "nut_3", "nut_3 (2)"];
        assert_eq!(shown("take screw 1 out", &names), ["take", "screw-1", "out"]);
        assert_eq!(shown("nut 3 (2)", &names), ["nut_3 (2)"]);
        assert_eq!(shown("the pin in hole 3", &names), ["the", "pin-in-hole-3"]);
        let rotors = ["rotor-back", "rotor-front"];
        assert_eq!(
            shown("put the front rotor back", &rotors),
            ["put", "the", "front", "rotor", "back"]
        );
        assert_eq!(
            shown("put the rotor-back in", &rotors),
            ["put", "the", "rotor-back", "in"]
        );
        assert_eq!(
            shown("remove the rotor back", &rotors),
            ["remove", "the", "rotor-back"]
        );
        assert_eq!(
            shown("pull the nut 3 mm", &names),
            ["pull", "the", "nut", "3", "mm"]
        );
    }

    #[test]
    fn slips_are_corrected_and_known_words_kept() {
        let names = ["rotor", "stator"];
        assert_eq!(shown("remvoe the satator", &names), ["remove", "the", "stator"]);
        assert_eq!(shown("remove the motor", &names), ["remove", "the", "motor"]);
        assert_eq!(shown("asdf qwer", &names), ["asdf", "qwer"]);
    }
}
