//! The text for the kernel, and the tokens that protect names from it.

use super::exchange::Exchange;
use super::text;

/// Renders the file: entities numbered from 1 in file order (so any 64-bit number is safe), one per line, without comments, strings in ASCII, names
/// of products and occurrences replaced by tokens. [`name`] decodes a token. Cost: one pass.
pub fn render(file: &Exchange) -> Vec<u8> {
    let mut out = Vec::with_capacity(file.bodies.len() + file.header.len() + 16 * file.entities.len());
    out.extend_from_slice(b"ISO-10303-21;\nHEADER;\n");
    ascii(&file.header, &mut out);
    out.extend_from_slice(b"ENDSEC;\nDATA;\n");
    for entity in 0..file.entities.len() {
        out.extend_from_slice(format!("#{}=", entity + 1).as_bytes());
        let body = file.body(entity);
        match named(file, entity) {
            Some(name) => {
                // The name is a slice of the body; the rest is unchanged.
                let start = name.as_ptr() as usize - body.as_ptr() as usize;
                renumbered(file, &body[..start], &mut out);
                out.extend_from_slice(format!("'{}'", token(file, entity)).as_bytes());
                renumbered(file, &body[start + name.len()..], &mut out);
            }
            None => renumbered(file, body, &mut out),
        }
        out.extend_from_slice(b";\n");
    }
    out.extend_from_slice(b"ENDSEC;\nEND-ISO-10303-21;\n");
    out
}

/// Entity of the token in a name; `None` when the text is not a token.
pub fn entity_of(token: &str) -> Option<usize> {
    let number = token.strip_prefix("mortise-")?;
    number
        .split_once('*')
        .map_or(number, |(number, _)| number)
        .parse()
        .ok()
}

/// Name of the product or occurrence of a token, or the text itself when it is not a token.
pub fn name(file: &Exchange, token: &str) -> String {
    match entity_of(token).filter(|&entity| entity < file.entities.len()) {
        Some(entity) => named(file, entity)
            .and_then(text::decode)
            .unwrap_or_default()
            .trim()
            .into(),
        None => token.trim().into(),
    }
}

/// Identifier of the product of a token.
pub fn product_id(file: &Exchange, token: &str) -> Option<String> {
    let entity = entity_of(token).filter(|&entity| entity < file.entities.len())?;
    let id = text::decode(file.arguments(entity).first()?)?;
    Some(id.trim().to_string()).filter(|id| !id.is_empty())
}

/// `mortise-12`, or `mortise-12*-2.0` for an occurrence that mirrors and doubles: kernel.cc reads the scale.
fn token(file: &Exchange, entity: usize) -> String {
    match file.scales.get(&entity) {
        Some(scale) => format!("mortise-{entity}*{scale:?}"),
        None => format!("mortise-{entity}"),
    }
}

/// The name argument of a product or occurrence.
fn named(file: &Exchange, entity: usize) -> Option<&[u8]> {
    matches!(file.kind(entity), "PRODUCT" | "NEXT_ASSEMBLY_USAGE_OCCURRENCE")
        .then(|| file.arguments(entity).get(1).copied())
        .flatten()
}

fn renumbered(file: &Exchange, body: &[u8], out: &mut Vec<u8>) {
    let (mut i, mut quoted) = (0, false);
    while let Some(&byte) = body.get(i) {
        i += 1;
        match byte {
            b'\'' => {
                quoted = !quoted;
                out.push(byte);
            }
            b'#' if !quoted => {
                let digits = body[i..].iter().take_while(|b| b.is_ascii_digit()).count();
                let id = super::exchange::reference(&body[i - 1..i + digits]).and_then(|id| file.find(id));
                // A dangling reference (outside the shapes; otherwise the check rejects it) becomes "not given".
                match id {
                    Some(entity) => out.extend_from_slice(format!("#{}", entity + 1).as_bytes()),
                    None => out.push(b'$'),
                }
                i += digits;
            }
            _ => out.push(if byte.is_ascii() { byte } else { b'?' }),
        }
    }
}

fn ascii(text: &[u8], out: &mut Vec<u8>) {
    out.extend(text.iter().map(|&byte| if byte.is_ascii() { byte } else { b'?' }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_tokens_and_come_back() {
        let text = "ISO-10303-21;HEADER;FILE_NAME('機');ENDSEC;DATA;#70000000000=PRODUCT('id','機体, ''#5''','',(#5));\
                    #5=PRODUCT_CONTEXT('#5',#70000000000,$);ENDSEC;END-ISO-10303-21;";
        let file = super::super::parse(text.as_bytes()).unwrap();
        let out = String::from_utf8(render(&file)).unwrap();
        assert_eq!(
            out,
            "ISO-10303-21;\nHEADER;\nFILE_NAME('???');\nENDSEC;\nDATA;\n#1=PRODUCT('id','mortise-0','',(#2));\n\
             #2=PRODUCT_CONTEXT('#5',#1,$);\nENDSEC;\nEND-ISO-10303-21;\n"
        );
        assert_eq!(name(&file, "mortise-0"), "機体, '#5'");
        assert_eq!(product_id(&file, "mortise-0").as_deref(), Some("id"));
        assert_eq!(name(&file, "plain"), "plain");
    }
}
