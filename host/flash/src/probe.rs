//! Debug probes as `probe-rs` lists them.

use std::fmt;

/// A debug probe.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Probe {
    /// Its product name.
    pub name: String,
    /// Vendor, product and serial number: `0483:374b:066F…`.
    pub selector: String,
    /// Whether the operator may use it.
    pub accessible: bool,
}

impl fmt::Display for Probe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.selector)
    }
}

impl Probe {
    /// A line of the list: `[0]: STLink V2-1 -- 0483:374b:066FFF (ST-LINK)`, with ` (inaccessible)` at its end if it may not be used.
    pub(crate) fn in_line(line: &str) -> Option<Self> {
        let (number, rest) = line.strip_prefix('[')?.split_once("]: ")?;
        number.parse::<u32>().ok()?;
        let (name, rest) = rest.rsplit_once(" -- ")?;
        let selector = rest.split_whitespace().next()?;
        let hexadecimal = |digits: &str| digits.len() == 4 && u16::from_str_radix(digits, 16).is_ok();
        let mut numbers = selector.splitn(3, ':');
        let vendor = numbers.next().is_some_and(hexadecimal);
        let product = numbers
            .next()
            .is_some_and(|product| product.get(..4).is_some_and(hexadecimal));
        (vendor && product).then(|| Self {
            name: name.to_owned(),
            selector: selector.to_owned(),
            accessible: !rest.ends_with("(inaccessible)"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probes_are_read_from_the_list() {
        let read =
            |line: &str| Probe::in_line(line).map(|probe| (probe.name, probe.selector, probe.accessible));
        let nucleo = |accessible| {
            Some((
                "STLink V2-1".to_owned(),
                "0483:374b:066FFF485550755187121723".to_owned(),
                accessible,
            ))
        };
        let line = "[0]: STLink V2-1 -- 0483:374b:066FFF485550755187121723 (ST-LINK)";
        assert_eq!(read(line), nucleo(true));
        assert_eq!(read(&format!("{line} (inaccessible)")), nucleo(false));
        let channel = read("[1]: FT2232H -- two -- 0403:6010-1: (FTDI)");
        assert_eq!(
            channel,
            Some(("FT2232H -- two".to_owned(), "0403:6010-1:".to_owned(), true))
        );
        for other in [
            "The following debug probes were found:",
            "No debug probes were found.",
            "[x]: a -- 0483:374b:1 (b)",
            "[0]: a -- b",
            "[0]: a -- 0483:37",
            "[0]: a -- --chip-erase:374b:0",
            "",
        ] {
            assert_eq!(read(other), None, "{other}");
        }
    }
}
