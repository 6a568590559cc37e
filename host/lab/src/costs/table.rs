//! The board's cost table in its source: measured numbers in place of its own.

use mortise_output::Output;

use crate::LabError;

/// Replaces the number of each named row of the table in `source`, the text of `firmware/haptics/src/collision/cost.rs`.
///
/// # Errors
/// The name of a row that the source does not have exactly once.
pub fn rewritten<'n>(source: &str, rows: &[(&'n str, u32)]) -> Result<String, &'n str> {
    let mut text = source.to_owned();
    for &(name, instructions) in rows {
        let begins = format!("    {name} = ");
        let mut lines = text.lines().filter(|line| line.starts_with(&begins));
        let (Some(line), None) = (lines.next(), lines.next()) else {
            return Err(name);
        };
        let row = format!("{begins}{instructions};");
        text = text.replacen(&format!("{line}\n"), &format!("{row}\n"), 1);
    }
    Ok(text)
}

/// Writes the measured instructions into the table's file, all or nothing.
///
/// # Errors
/// `Unreadable`, `Output`; `Input` when the file has no such table.
pub fn rewrite(table: &Output, rows: &[(&str, u32)]) -> Result<(), LabError> {
    let path = table.path();
    let source = std::fs::read_to_string(path).map_err(|source| LabError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    let text = rewritten(&source, rows).map_err(|row| LabError::Input {
        name: path.display().to_string(),
        what: format!("it has no row {row}: name firmware/haptics/src/collision/cost.rs"),
    })?;
    Ok(table.write(text.as_bytes())?)
}

#[cfg(test)]
mod tests {
    use mortise_haptics::cost::TABLE;

    use super::*;

    const SOURCE: &str = include_str!("../../../../firmware/haptics/src/collision/cost.rs");

    #[test]
    fn every_row_is_found_and_nothing_else_changes() {
        for row in TABLE {
            let text = rewritten(SOURCE, &[(row.name, 4242)]).unwrap();
            let changed: Vec<_> = SOURCE.lines().zip(text.lines()).filter(|(a, b)| a != b).collect();
            assert_eq!(text.lines().count(), SOURCE.lines().count());
            let new = format!("    {} = 4242;", row.name);
            assert!(matches!(changed[..], [(_, line)] if line == new), "{changed:?}");
        }
    }

    #[test]
    fn a_row_that_is_not_there_is_named() {
        assert_eq!(rewritten(SOURCE, &[("LEAF", 1), ("TEA", 2)]), Err("TEA"));
    }
}
