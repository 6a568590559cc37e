//! Memory regions of a board, read from the `MEMORY` block of its linker script.
//!
//! Source: GNU ld manual, "MEMORY Command". Lengths may be sums and differences of numbers with
//! the suffixes `K` and `M`; that is all our boards use.

use anyhow::{Context, Result, bail};

use crate::elf::Segment;

/// One region of the linker script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// Name in the script, such as `FLASH`.
    pub name: String,
    /// First address.
    pub origin: u64,
    /// Bytes.
    pub length: u64,
}

impl Region {
    fn contains(&self, address: u32) -> bool {
        (self.origin..self.origin + self.length).contains(&u64::from(address))
    }

    /// Bytes that `segments` take in this region: those that run in it, and those only stored in it.
    pub fn used(&self, segments: &[Segment]) -> u64 {
        segments
            .iter()
            .map(|segment| {
                if self.contains(segment.address) {
                    u64::from(segment.bytes)
                } else if self.contains(segment.stored_at) {
                    u64::from(segment.stored_bytes)
                } else {
                    0
                }
            })
            .sum()
    }
}

/// Regions of the `MEMORY` block in `script`, in its order.
///
/// # Errors
/// When there is no such block, or a line of it is in a form not read here.
pub fn parse(script: &str) -> Result<Vec<Region>> {
    let script = without_comments(script);
    let block = script
        .split_once("MEMORY")
        .and_then(|(_, rest)| rest.split_once('{'))
        .and_then(|(_, rest)| rest.split_once('}'))
        .map(|(block, _)| block)
        .context("the linker script has no MEMORY block")?;
    let mut regions = Vec::new();
    for line in block.lines().map(str::trim).filter(|line| !line.is_empty()) {
        regions.push(parse_line(line).with_context(|| format!("in the line `{line}` of the linker script"))?);
    }
    Ok(regions)
}

fn parse_line(line: &str) -> Result<Region> {
    let (head, values) = line.split_once(':').context("`:` is missing")?;
    // `RAM (rwx) : …`: the attributes say nothing about size.
    let name = head.split('(').next().unwrap_or_default().trim();
    let (origin, length) = values.split_once(',').context("`,` is missing")?;
    Ok(Region {
        name: name.to_owned(),
        origin: value(origin, "ORIGIN")?,
        length: value(length, "LENGTH")?,
    })
}

/// `NAME = a + b - c`.
fn value(text: &str, name: &str) -> Result<u64> {
    let (key, sum) = text.split_once('=').context("`=` is missing")?;
    if key.trim() != name {
        bail!("expected {name}, found `{}`", key.trim());
    }
    let spaced = sum.replace('+', " + ").replace('-', " - ");
    let mut total: u64 = 0;
    let mut add = true;
    for word in spaced.split_whitespace() {
        match word {
            "+" => add = true,
            "-" => add = false,
            _ => {
                let number = number(word)?;
                let sum = if add {
                    total.checked_add(number)
                } else {
                    total.checked_sub(number)
                };
                total = sum.with_context(|| format!("`{}` is out of range", text.trim()))?;
            }
        }
    }
    Ok(total)
}

fn number(word: &str) -> Result<u64> {
    let (digits, unit) = match word.as_bytes().last() {
        Some(b'K' | b'k') => (&word[..word.len() - 1], 1024),
        Some(b'M' | b'm') => (&word[..word.len() - 1], 1024 * 1024),
        _ => (word, 1),
    };
    let parsed = match digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        Some(hex) => u64::from_str_radix(hex, 16),
        None => digits.parse(),
    };
    parsed
        .ok()
        .and_then(|number| number.checked_mul(unit))
        .with_context(|| format!("`{word}` is not a number read here"))
}

fn without_comments(script: &str) -> String {
    let mut text = String::new();
    let mut rest = script;
    while let Some((before, comment)) = rest.split_once("/*") {
        text.push_str(before);
        rest = comment.split_once("*/").map_or("", |(_, after)| after);
    }
    text.push_str(rest);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_with_attributes_sums_and_comments() {
        let script = "/* STM32H743: 2 MiB */\nMEMORY\n{\n  FLASH (rx) : ORIGIN = 0x08000000, LENGTH = 1024K - 128K\n\
            \n  RAM : ORIGIN = 0x20000000 + 0x100, LENGTH = 0x1FF00 /* DTCM */\n  CODE(rx):ORIGIN=0,LENGTH=4M\n}\n\
            SECTIONS { }\n";
        let regions = parse(script).unwrap();
        let of = |name: &str, origin, length| Region {
            name: name.into(),
            origin,
            length,
        };
        assert_eq!(
            regions,
            [
                of("FLASH", 0x0800_0000, 896 * 1024),
                of("RAM", 0x2000_0100, 0x1_ff00),
                of("CODE", 0, 4 * 1024 * 1024),
            ]
        );
    }

    #[test]
    fn what_is_not_understood_is_refused() {
        assert!(parse("SECTIONS { }").is_err());
        let bad = parse("MEMORY {\nRAM : ORIGIN = 0, LENGTH = LENGTH(FLASH)\n}").unwrap_err();
        assert!(format!("{bad:#}").contains("LENGTH(FLASH)"), "{bad:#}");
        assert!(parse("MEMORY {\nRAM : ORIGIN = 0, LENGTH = 1K - 2K\n}").is_err());
    }

    #[test]
    fn initialised_data_counts_in_flash_and_in_ram() {
        let regions = parse(
            "MEMORY {\nFLASH : ORIGIN = 0x08000000, LENGTH = 1K\nRAM : ORIGIN = 0x20000000, LENGTH = 1K\n}",
        )
        .unwrap();
        let segments = [
            Segment {
                address: 0x0800_0000,
                stored_at: 0x0800_0000,
                stored_bytes: 100,
                bytes: 100,
            },
            Segment {
                address: 0x2000_0000,
                stored_at: 0x0800_0064,
                stored_bytes: 8,
                bytes: 24,
            },
        ];
        assert_eq!(regions[0].used(&segments), 108);
        assert_eq!(regions[1].used(&segments), 24);
    }
}
