//! Conversion of strings of ISO 10303-21 clause 6.4.3 to Unicode.

/// Decodes a string argument `'…'`; `None` when the argument is not a string.
///
/// `''` is one quote, `\\` one backslash; `\S\x` is x with its eighth bit set in the page chosen by `\Pn\` (writers use only page A, ISO 8859-1;
/// others are read as that one), `\X\hh` one character of ISO 8859-1, `\X2\…\X0\` UTF-16, `\X4\…\X0\` UTF-32. Bytes beyond ASCII, which many systems
/// write raw, are read as UTF-8 if valid, else as ISO 8859-1. A damaged directive is left as written.
pub fn decode(argument: &[u8]) -> Option<String> {
    let inner = argument.strip_prefix(b"'")?.strip_suffix(b"'")?;
    let mut out = String::with_capacity(inner.len());
    let mut rest = inner;
    while let Some(&byte) = rest.first() {
        let used = match byte {
            b'\'' => {
                out.push('\'');
                if rest.get(1) == Some(&b'\'') { 2 } else { 1 }
            }
            b'\\' => directive(rest, &mut out).unwrap_or_else(|| {
                out.push('\\');
                1
            }),
            0..=0x7f => {
                out.push(char::from(byte));
                1
            }
            _ => {
                let run = rest.iter().take_while(|b| !b.is_ascii()).count();
                match std::str::from_utf8(&rest[..run]) {
                    Ok(text) => out.push_str(text),
                    Err(_) => out.extend(rest[..run].iter().map(|&b| char::from(b))),
                }
                run
            }
        };
        rest = &rest[used..];
    }
    Some(out)
}

/// Decodes the directive at the start of `text` and returns its length.
fn directive(text: &[u8], out: &mut String) -> Option<usize> {
    match text.get(1)? {
        b'\\' => {
            out.push('\\');
            Some(2)
        }
        b'S' if text.get(2) == Some(&b'\\') => {
            let low = *text.get(3)?;
            out.push(char::from(low | 0x80));
            // The character after \S\ may itself be a quote, which is doubled.
            Some(if low == b'\'' && text.get(4) == Some(&b'\'') {
                5
            } else {
                4
            })
        }
        b'P' if text.get(3) == Some(&b'\\') => Some(4),
        b'X' if text.get(2) == Some(&b'\\') => {
            out.push(char::from(u8::try_from(hex(text.get(3..5)?)?).ok()?));
            Some(5)
        }
        b'X' if text.get(3) == Some(&b'\\') => {
            let end = text.windows(4).position(|w| w == b"\\X0\\")?;
            let digits = &text[4..end];
            match text.get(2)? {
                b'2' if digits.len().is_multiple_of(4) => {
                    let units = digits
                        .chunks(4)
                        .map(|d| hex(d).and_then(|u| u16::try_from(u).ok()));
                    out.push_str(&String::from_utf16_lossy(&units.collect::<Option<Vec<u16>>>()?));
                }
                b'4' if digits.len().is_multiple_of(8) => {
                    let characters = digits.chunks(8).map(|d| hex(d).and_then(char::from_u32));
                    out.push_str(&characters.collect::<Option<String>>()?);
                }
                _ => return None,
            }
            Some(end + 4)
        }
        _ => None,
    }
}

fn hex(digits: &[u8]) -> Option<u32> {
    // from_str_radix would accept a sign.
    if !digits.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn every_directive_of_the_standard() {
        let is = |text: &[u8], want: &str| assert_eq!(decode(text).as_deref(), Some(want));
        is(b"'cover ''back'' \\\\ 1'", "cover 'back' \\ 1");
        is(b"'h\\S\\drs'", "h\u{e4}rs");
        is(b"'\\PA\\\\S\\D'", "\u{c4}");
        is(b"'\\X\\E9t\\X\\E9'", "\u{e9}t\u{e9}");
        is(b"'\\X2\\6A5F4F53\\X0\\-1'", "\u{6a5f}\u{4f53}-1");
        is(b"'\\X2\\D83DDD29\\X0\\'", "\u{1f529}");
        is(b"'\\X4\\0001F529\\X0\\'", "\u{1f529}");
        is("'Дихтунг-ß'".as_bytes(), "Дихтунг-ß");
        is(b"'Welle \xd8 8'", "Welle \u{d8} 8");
        assert_eq!(decode(b"$"), None);
    }

    #[test]
    fn damaged_directives_are_kept() {
        assert_eq!(decode(b"'\\X2\\6A5'").as_deref(), Some("\\X2\\6A5"));
        assert_eq!(decode(b"'a\\'").as_deref(), Some("a\\"));
        assert_eq!(decode(b"'\\X\\+1'").as_deref(), Some("\\X\\+1"));
    }
}
