//! Lexer, from bytes to entities: one pass, no recursion, no backtracking.

use super::exchange::{Entity, Exchange, LARGEST_LENGTH, Part21Error};

/// Deepest nesting of parentheses; real files have fewer than ten.
const MAX_DEPTH: usize = 1000;

/// Scans a STEP text.
///
/// # Errors
/// When the text is not STEP, is truncated, or violates the grammar of ISO 10303-21 clause 6.
pub fn parse(text: &[u8]) -> Result<Exchange, Part21Error> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let mut lexer = Lexer {
        text,
        at: 0,
        line: 1,
        out: Exchange::default(),
    };
    lexer.file()?;
    Ok(lexer.out)
}

/// Kind of the last token of a list.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Last {
    /// `(`, `)` or a comma.
    Mark,
    Keyword,
    Value,
}

struct Lexer<'a> {
    text: &'a [u8],
    at: usize,
    line: u32,
    out: Exchange,
}

impl Lexer<'_> {
    fn file(&mut self) -> Result<(), Part21Error> {
        self.space()?;
        if !self.text[self.at..].starts_with(b"ISO-10303-21") {
            let found = self.text[self.at..]
                .iter()
                .take(24)
                .take_while(|&&b| b != b'\n' && b != b'\r');
            return Err(Part21Error::NotStep(found.map(|&b| char::from(b)).collect()));
        }
        self.at += b"ISO-10303-21".len();
        self.expect(b';', "after ISO-10303-21")?;
        let mut sections = 0;
        loop {
            self.space()?;
            let section = self.keyword();
            match section.as_str() {
                "HEADER" => {
                    self.expect(b';', "after HEADER")?;
                    self.header()?;
                }
                "DATA" => {
                    self.space()?;
                    if self.peek() == Some(b'(') {
                        // Edition 2 names its data sections; the names do not concern shapes.
                        let mut skipped = Vec::new();
                        self.group(&mut skipped, u32::MAX)?;
                    }
                    self.expect(b';', "after DATA")?;
                    self.data()?;
                    sections += 1;
                }
                "ANCHOR" | "REFERENCE" | "SIGNATURE" => {
                    if section == "REFERENCE" {
                        let warning = "parts kept in other files (REFERENCE section) are not read";
                        self.out.warnings.push(warning.into());
                    }
                    self.skip_section(&section)?;
                }
                "END-ISO-10303-21" if sections > 0 => {
                    return match self.expect(b';', "after END-ISO-10303-21") {
                        // Only this one character can still be missing.
                        Err(Part21Error::Truncated { .. }) | Ok(()) => Ok(()),
                        Err(other) => Err(other),
                    };
                }
                "END-ISO-10303-21" => return Err(self.invalid("no DATA section")),
                _ if self.at >= self.text.len() || is_prefix_of_end(&section, self.rest_is_empty()) => {
                    return Err(self.truncated("END-ISO-10303-21 is missing"));
                }
                _ => {
                    return Err(
                        self.invalid(format!("{} where a section is expected", self.excerpt(&section)))
                    );
                }
            }
        }
    }

    fn header(&mut self) -> Result<(), Part21Error> {
        loop {
            self.space()?;
            let keyword = self.keyword();
            if keyword == "ENDSEC" {
                return self.expect(b';', "after ENDSEC");
            }
            if keyword.is_empty() {
                return Err(self.unexpected("in the header"));
            }
            let mut body = keyword.into_bytes();
            self.space()?;
            self.group(&mut body, u32::MAX)?;
            self.expect(b';', "after a header entity")?;
            self.out.header.extend_from_slice(&body);
            self.out.header.extend_from_slice(b";\n");
        }
    }

    fn skip_section(&mut self, name: &str) -> Result<(), Part21Error> {
        loop {
            self.space()?;
            match self.peek() {
                None => return Err(self.truncated(format!("the {name} section has no ENDSEC"))),
                Some(b'\'') => self.string(&mut Vec::new())?,
                Some(_) if self.text[self.at..].starts_with(b"ENDSEC") => {
                    self.at += b"ENDSEC".len();
                    return self.expect(b';', "after ENDSEC");
                }
                Some(_) => self.at += 1,
            }
        }
    }

    fn data(&mut self) -> Result<(), Part21Error> {
        loop {
            self.space()?;
            match self.peek() {
                None => return Err(self.truncated("the DATA section has no ENDSEC")),
                Some(b'#') => self.entity()?,
                Some(_) => {
                    let word = self.keyword();
                    return match word.as_str() {
                        "ENDSEC" => self.expect(b';', "after ENDSEC"),
                        _ if self.at >= self.text.len() => {
                            Err(self.truncated("the DATA section has no ENDSEC"))
                        }
                        _ => {
                            Err(self.invalid(format!("{} where an entity is expected", self.excerpt(&word))))
                        }
                    };
                }
            }
        }
    }

    fn entity(&mut self) -> Result<(), Part21Error> {
        let line = self.line;
        let id = self.number_of_reference()?;
        self.body(id, line).map_err(|error| match error {
            Part21Error::Truncated { line, .. } => Part21Error::Truncated {
                line,
                missing: format!("it ends within entity #{id}"),
            },
            other => other,
        })
    }

    fn body(&mut self, id: u64, line: u32) -> Result<(), Part21Error> {
        let number = self.out.entities.len() as u32;
        self.expect(b'=', &format!("after #{id}"))?;
        self.space()?;
        let start = self.out.bodies.len();
        let first = self.out.references.len();
        let mut bodies = std::mem::take(&mut self.out.bodies);
        let keyword = self.keyword();
        bodies.extend_from_slice(keyword.as_bytes());
        self.space()?;
        let result = self.group(&mut bodies, number);
        self.out.bodies = bodies;
        result?;
        self.expect(b';', &format!("at the end of #{id}"))?;
        if let Some(earlier) = self.out.index.insert(id, number) {
            let earlier = self.out.entities[earlier as usize].line;
            let what = format!("#{id} is defined twice, first at line {earlier}");
            return Err(Part21Error::Invalid { line, what });
        }
        self.out.largest = self.out.largest.max(id);
        let body = start..self.out.bodies.len();
        let references = first..self.out.references.len();
        self.out.entities.push(Entity {
            id,
            written: id,
            file: 0,
            line,
            body,
            references,
        });
        Ok(())
    }

    /// Reads a parenthesised list up to its closing parenthesis. `entity` is [`u32::MAX`] outside DATA.
    fn group(&mut self, out: &mut Vec<u8>, entity: u32) -> Result<(), Part21Error> {
        if self.peek() != Some(b'(') {
            return Err(self.unexpected("where ( is expected"));
        }
        let mut depth = 0;
        // Spaces are not kept: two values without a comma between them would read as one.
        let mut last = Last::Mark;
        loop {
            self.space()?;
            let Some(byte) = self.peek() else {
                return Err(self.truncated("an entity is not closed"));
            };
            let separates = matches!(byte, b',' | b')') || (last == Last::Keyword && byte == b'(');
            if last != Last::Mark && !separates {
                return Err(self.unexpected("where a comma or ) is expected"));
            }
            last = match byte {
                b'(' | b')' | b',' => Last::Mark,
                b'A'..=b'Z' | b'a'..=b'z' | b'_' | b'!' => Last::Keyword,
                _ => Last::Value,
            };
            match byte {
                b'(' => {
                    depth += 1;
                    if depth > MAX_DEPTH {
                        return Err(self.invalid("lists nested more than 1000 deep"));
                    }
                    out.push(byte);
                    self.at += 1;
                }
                b')' => {
                    depth -= 1;
                    out.push(byte);
                    self.at += 1;
                    if depth == 0 {
                        return Ok(());
                    }
                }
                b',' | b'$' | b'*' => {
                    out.push(byte);
                    self.at += 1;
                }
                b'\'' => self.string(out)?,
                b'"' => self.until(b'"', out)?,
                b'.' if self.text.get(self.at + 1).is_some_and(u8::is_ascii_alphabetic) => {
                    self.until(b'.', out)?
                }
                b'#' if entity != u32::MAX => {
                    let id = self.number_of_reference()?;
                    self.out.references.push(id);
                    out.extend_from_slice(format!("#{id}").as_bytes());
                }
                b'0'..=b'9' | b'+' | b'-' | b'.' => self.number(out, entity)?,
                b'A'..=b'Z' | b'a'..=b'z' | b'_' | b'!' => {
                    let word = self.keyword();
                    out.extend_from_slice(word.as_bytes());
                }
                _ => return Err(self.unexpected("in an entity")),
            }
        }
    }

    fn number(&mut self, out: &mut Vec<u8>, entity: u32) -> Result<(), Part21Error> {
        let start = self.at;
        while self
            .peek()
            .is_some_and(|b| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.' | b'#'))
        {
            self.at += 1;
        }
        let number = &self.text[start..self.at];
        let value = std::str::from_utf8(number)
            .ok()
            .and_then(|n| n.parse::<f64>().ok());
        if let Some(value) = value.filter(|value| value.is_finite()) {
            if value.abs() > LARGEST_LENGTH {
                self.out.large_numbers.push((entity, value));
            }
            // Upper case: the kernel (7.6) reads 6.1e-17, which some writers write for 6.1E-17, as 6.1.
            out.extend(number.iter().map(u8::to_ascii_uppercase));
        } else {
            // The check rejects it in entities that matter; elsewhere the kernel, which crashes on some such numbers, gets "not given".
            out.push(b'$');
            self.out
                .bad_numbers
                .push((entity, String::from_utf8_lossy(number).into_owned()));
        }
        Ok(())
    }

    fn number_of_reference(&mut self) -> Result<u64, Part21Error> {
        self.at += 1;
        let mut id = 0u64;
        let start = self.at;
        while let Some(digit @ b'0'..=b'9') = self.peek() {
            let next = id
                .checked_mul(10)
                .and_then(|id| id.checked_add(u64::from(digit - b'0')));
            id = next.ok_or_else(|| self.invalid("an entity number beyond 64 bits"))?;
            self.at += 1;
        }
        match self.at == start {
            true => Err(self.unexpected("where an entity number is expected")),
            false => Ok(id),
        }
    }

    /// Reads a string with its quotes; line breaks within it are ignored (clause 6.4.3).
    fn string(&mut self, out: &mut Vec<u8>) -> Result<(), Part21Error> {
        let line = self.line;
        out.push(b'\'');
        self.at += 1;
        loop {
            match self.peek() {
                None => return Err(self.truncated(format!("the string begun at line {line} is not closed"))),
                Some(b'\'') if self.text.get(self.at + 1) == Some(&b'\'') => {
                    out.extend_from_slice(b"''");
                    self.at += 2;
                }
                Some(b'\'') => {
                    out.push(b'\'');
                    self.at += 1;
                    return Ok(());
                }
                Some(byte) => {
                    if byte == b'\n' {
                        self.line += 1;
                    } else if byte != b'\r' {
                        out.push(byte);
                    }
                    self.at += 1;
                }
            }
        }
    }

    /// Reads an enumeration or binary up to and including its closing mark.
    fn until(&mut self, end: u8, out: &mut Vec<u8>) -> Result<(), Part21Error> {
        out.push(end);
        self.at += 1;
        while let Some(byte) = self.peek() {
            self.at += 1;
            out.push(byte.to_ascii_uppercase());
            if byte == end {
                return Ok(());
            }
            if !byte.is_ascii_alphanumeric() && byte != b'_' {
                self.at -= 1;
                return Err(self.unexpected("in an enumeration or binary"));
            }
        }
        Err(self.truncated("an entity is not closed"))
    }

    /// Reads letters, digits, `_`, and `-` (for the file's end mark); returns them in upper case.
    fn keyword(&mut self) -> String {
        let start = self.at;
        while self
            .peek()
            .is_some_and(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-' | b'!'))
        {
            self.at += 1;
        }
        String::from_utf8_lossy(&self.text[start..self.at]).to_ascii_uppercase()
    }

    /// Skips white space, comments and print controls.
    fn space(&mut self) -> Result<(), Part21Error> {
        while let Some(byte) = self.peek() {
            match byte {
                b'\n' => {
                    self.line += 1;
                    self.at += 1;
                }
                b' ' | b'\t' | b'\r' | 0x0b | 0x0c | 0 => self.at += 1,
                b'/' if self.text.get(self.at + 1) == Some(&b'*') => {
                    let line = self.line;
                    self.at += 2;
                    loop {
                        match self.peek() {
                            None => {
                                let missing = format!("the comment begun at line {line} is not closed");
                                return Err(self.truncated(missing));
                            }
                            Some(b'*') if self.text.get(self.at + 1) == Some(&b'/') => break,
                            Some(b'\n') => self.line += 1,
                            Some(_) => {}
                        }
                        self.at += 1;
                    }
                    self.at += 2;
                }
                b'\\'
                    if matches!(self.text.get(self.at + 1), Some(b'N' | b'F'))
                        && self.text.get(self.at + 2) == Some(&b'\\') =>
                {
                    self.at += 3;
                }
                _ => break,
            }
        }
        Ok(())
    }

    fn expect(&mut self, byte: u8, place: &str) -> Result<(), Part21Error> {
        self.space()?;
        match self.peek() {
            Some(found) if found == byte => {
                self.at += 1;
                Ok(())
            }
            None => Err(self.truncated(format!("{} is missing {place}", char::from(byte)))),
            Some(_) => Err(self.unexpected(&format!("where {} is expected {place}", char::from(byte)))),
        }
    }

    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    fn rest_is_empty(&self) -> bool {
        self.text[self.at..].iter().all(u8::is_ascii_whitespace)
    }

    fn unexpected(&self, place: &str) -> Part21Error {
        match self.peek() {
            // The last byte may be the first half of a comment mark.
            Some(byte) if byte != b'/' || self.at + 1 < self.text.len() => {
                self.invalid(format!("unexpected {:?} {place}", char::from(byte)))
            }
            _ => self.truncated(format!("it ends {place}")),
        }
    }

    /// A word for a message, or the character there when it is not a word.
    fn excerpt(&self, word: &str) -> String {
        let rest = self.text[self.at..]
            .iter()
            .take(16)
            .take_while(|b| !b.is_ascii_whitespace());
        format!(
            "{:?}",
            word.chars()
                .take(40)
                .chain(rest.map(|&b| char::from(b)))
                .collect::<String>()
        )
    }

    fn invalid(&self, what: impl Into<String>) -> Part21Error {
        Part21Error::Invalid {
            line: self.line,
            what: what.into(),
        }
    }

    fn truncated(&self, missing: impl Into<String>) -> Part21Error {
        Part21Error::Truncated {
            line: self.line,
            missing: missing.into(),
        }
    }
}

/// Whether `word` is a prefix of the end mark, which may itself be truncated.
fn is_prefix_of_end(word: &str, at_end: bool) -> bool {
    at_end && "END-ISO-10303-21".starts_with(word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GOOD: &[u8] =
        b"ISO-10303-21;\nHEADER;\nFILE_NAME('a','b');\nENDSEC;\nDATA;\n#1=A('it''s',#2,(1.E5,-.5),.T.);\n#2 /* x; */ = B(*,$,\"0F\");\nENDSEC;\nEND-ISO-10303-21;\n";

    #[test]
    fn a_text_cut_anywhere_is_truncated_and_never_read_as_less() {
        let end = GOOD.len() - 2; // the last ; and line end may go
        for cut in 1..end {
            match parse(&GOOD[..cut]) {
                Err(Part21Error::Truncated { .. } | Part21Error::NotStep(_)) => {}
                other => panic!("cut at {cut}: {other:?}"),
            }
        }
        assert_eq!(parse(GOOD).unwrap().entities.len(), 2);
        assert_eq!(parse(&GOOD[..end]).unwrap().entities.len(), 2);
    }

    #[test]
    fn comments_and_line_breaks_are_nothing() {
        let file = parse(GOOD).unwrap();
        assert_eq!(file.body(0), b"A('it''s',#2,(1.E5,-.5),.T.)");
        assert_eq!(file.body(1), b"B(*,$,\"0F\")");
        assert_eq!(file.entities[1].line, 7);
    }

    #[test]
    fn a_lower_case_exponent_is_an_exponent() {
        let text = b"ISO-10303-21;HEADER;ENDSEC;DATA;#1=P((0.25,-6.1e-17,.t.));ENDSEC;END-ISO-10303-21;";
        assert_eq!(parse(text).unwrap().body(0), b"P((0.25,-6.1E-17,.T.))");
    }

    #[test]
    fn numbers_beyond_a_double_and_duplicates_are_named() {
        let text = |body: &str| format!("ISO-10303-21;HEADER;ENDSEC;DATA;\n{body}ENDSEC;END-ISO-10303-21;");
        let file = parse(text("#1=P((0.,1.E400));\n#2=P(1.#INF);\n").as_bytes()).unwrap();
        assert_eq!(file.bad_numbers, [(0, "1.E400".into()), (1, "1.#INF".into())]);
        let twice = parse(text("#1=P();\n#1=Q();\n").as_bytes());
        assert_eq!(
            twice.unwrap_err(),
            Part21Error::Invalid {
                line: 3,
                what: "#1 is defined twice, first at line 2".into()
            }
        );
    }

    #[test]
    fn values_without_a_comma_between_them_are_not_one_value() {
        let text =
            |list: &str| format!("ISO-10303-21;HEADER;ENDSEC;DATA;\n#1=A({list});\nENDSEC;END-ISO-10303-21;");
        for list in [
            "'a' 'b'", "''#2", "1. 2.", "#2 3", ".T. .F.", "1.A('b')", "B #2", "$ 'a'", "'a'(1)", ". T.",
        ] {
            let error = parse(text(list).as_bytes()).unwrap_err();
            assert!(
                matches!(&error, Part21Error::Invalid { line: 2, what } if what.contains("where a comma or ) is expected")),
                "{list}: {error:?}"
            );
        }
        for list in ["'a',B(1.),(),(#2,$)", "", "B ( 'a' )"] {
            assert!(parse(text(list).as_bytes()).is_ok(), "{list}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_end_in_a_result(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = parse(&bytes);
            let _ = parse(&[b"ISO-10303-21;HEADER;ENDSEC;DATA;#1=", &bytes[..]].concat());
        }
    }

    #[test]
    fn a_complex_entity_gives_its_types_and_arguments() {
        let text =
            b"ISO-10303-21;HEADER;ENDSEC;DATA;#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));\
            #2=A('x,(''y',(1.,#1),$);ENDSEC;END-ISO-10303-21;";
        let file = parse(text).unwrap();
        assert_eq!(file.kinds(0), ["LENGTH_UNIT", "NAMED_UNIT", "SI_UNIT"]);
        assert_eq!(
            file.arguments_as(0, "SI_UNIT").unwrap(),
            [&b".MILLI."[..], b".METRE."]
        );
        assert_eq!(file.kind(1), "A");
        assert_eq!(file.arguments(1), [&b"'x,(''y'"[..], b"(1.,#1)", b"$"]);
        assert_eq!(file.references_of(1), [1]);
    }
}
