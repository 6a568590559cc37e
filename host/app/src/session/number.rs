//! Numbers as text in the window. Pure.

/// A number with three digits, or all digits of a whole one.
pub fn number(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 100.0 || v == 0.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 => 2,
        v => (2.0 - v.log10().floor()).min(9.0) as usize,
    };
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (3141.6, "3142"),
            (12.34, "12.3"),
            (1.234, "1.23"),
            (0.066_4, "0.0664"),
            (0.000_5, "0.0005"),
            (1000.0, "1000"),
            (0.5, "0.5"),
            (8.0, "8"),
            (12.25, "12.2"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
