//! Parsers of single words and numbers.

use winnow::prelude::*;
use winnow::token::any;

use crate::lexicon;
use crate::token::Token;

/// Tokens still to be parsed.
pub(crate) type Input<'a> = &'a [Token];

/// A word of a list.
pub(crate) fn one_of<'a>(list: &'static [&'static str]) -> impl FnMut(&mut Input<'a>) -> winnow::Result<()> {
    move |input: &mut Input<'a>| {
        any.verify(|token: &Token| token.word().is_some_and(|w| list.contains(&w)))
            .void()
            .parse_next(input)
    }
}

/// A word with a value in a table.
pub(crate) fn of_table<'a, T: Copy + 'static>(
    table: &'static [(T, &'static [&'static str])],
) -> impl FnMut(&mut Input<'a>) -> winnow::Result<T> {
    move |input: &mut Input<'a>| {
        any.verify_map(|token: Token| {
            let word = token.word()?.to_owned();
            lexicon::find(table, &word).or_else(|| lexicon::find(table, &lexicon::singular(&word)))
        })
        .parse_next(input)
    }
}

/// A number in digits or as a word.
pub(crate) fn number(input: &mut Input<'_>) -> winnow::Result<f64> {
    any.verify_map(|token: Token| match token {
        Token::Number { value, .. } => Some(value),
        Token::Word { text, joined: false } => {
            lexicon::NUMBERS.iter().find(|(_, w)| *w == text).map(|&(n, _)| n)
        }
        _ => None,
    })
    .parse_next(input)
}
