//! Rust sources cut into words, by hand: what checks need of a source is its words without comments, and where they stand.

/// A word, a literal or a single sign, and its line, counted from one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word<'s> {
    /// As written.
    pub text: &'s str,
    /// Line.
    pub line: usize,
}

/// Words, literals and single signs, without comments.
pub fn words(source: &str) -> Vec<Word<'_>> {
    let letters: Vec<char> = source.chars().collect();
    // Where each letter begins, and the end.
    let mut starts: Vec<usize> = source.char_indices().map(|(start, _)| start).collect();
    starts.push(source.len());
    let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    let mut found = Vec::new();
    let (mut at, mut line, mut counted) = (0, 1, 0);
    while at < letters.len() {
        let rest = &letters[at..];
        let length = match rest[0] {
            letter if letter.is_whitespace() => {
                at += 1;
                continue;
            }
            '/' if rest.starts_with(&['/', '/']) => {
                at += rest
                    .iter()
                    .position(|&letter| letter == '\n')
                    .unwrap_or(rest.len());
                continue;
            }
            '/' if rest.starts_with(&['/', '*']) => {
                at += block_comment(rest);
                continue;
            }
            '"' => quoted(rest),
            'r' | 'b' | 'c' if raw(rest).is_some() => raw(rest).unwrap_or(1),
            '\'' => quote(rest),
            letter if is_word(letter) => rest
                .iter()
                .position(|&letter| !is_word(letter))
                .unwrap_or(rest.len()),
            _ => 1,
        };
        line += letters[counted..at]
            .iter()
            .filter(|&&letter| letter == '\n')
            .count();
        counted = at;
        let text = &source[starts[at]..starts[at + length]];
        found.push(Word { text, line });
        at += length;
    }
    found
}

/// Length of a comment, others within it included.
fn block_comment(rest: &[char]) -> usize {
    let (mut depth, mut at) = (0usize, 0);
    while at < rest.len() {
        if rest[at..].starts_with(&['/', '*']) {
            depth += 1;
            at += 2;
        } else if rest[at..].starts_with(&['*', '/']) {
            depth -= 1;
            at += 2;
            if depth == 0 {
                break;
            }
        } else {
            at += 1;
        }
    }
    at
}

/// Length of a string in quotes.
fn quoted(rest: &[char]) -> usize {
    let mut at = 1;
    while at < rest.len() && rest[at] != '"' {
        at += if rest[at] == '\\' { 2 } else { 1 };
    }
    (at + 1).min(rest.len())
}

/// Length of a raw string, `r"…"` or `r#"…"#`, bytes too.
fn raw(rest: &[char]) -> Option<usize> {
    let start = rest
        .iter()
        .position(|&letter| letter == 'r')
        .filter(|&at| at <= 1)?
        + 1;
    let hashes = rest[start..].iter().take_while(|&&letter| letter == '#').count();
    if rest.get(start + hashes) != Some(&'"') {
        return None;
    }
    let mut end = vec!['"'];
    end.resize(hashes + 1, '#');
    let text = &rest[start + hashes + 1..];
    let length = text.windows(end.len()).position(|window| window == end)?;
    Some(start + hashes + 1 + length + end.len())
}

/// Length of a character in quotes, or of the quote of a lifetime.
fn quote(rest: &[char]) -> usize {
    if rest.get(1) == Some(&'\\') {
        let end = rest.iter().skip(3).position(|&letter| letter == '\'');
        end.map_or(1, |end| end + 4)
    } else if rest.get(2) == Some(&'\'') {
        3
    } else {
        1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_have_their_lines_and_comments_are_left_out() {
        let source = "// µ\nlet a = \"b // c\nd\"; /* e\n f */ x::y";
        let found: Vec<(&str, usize)> = words(source).iter().map(|word| (word.text, word.line)).collect();
        assert_eq!(
            found,
            [
                ("let", 2),
                ("a", 2),
                ("=", 2),
                ("\"b // c\nd\"", 2),
                (";", 3),
                ("x", 4),
                (":", 4),
                (":", 4),
                ("y", 4)
            ]
        );
    }
}
