//! Figures quoted by pages: each measured number in README, `docs/*.md` or the page of sweeps is followed by a comment that names its row,
//!
//! ```text
//! stay within 9.06 µm<!-- row end-to-end: hole wall, 5 N + penetration -->
//! ```
//!
//! with the table, then parts of the row's text that together match exactly one row. The number is right when the row's value, in the unit that
//! follows the number, rounds to it at its written precision; a machine-dependent value that is measured anew, when the two differ by at most a factor
//! of two. Notes are not read: they are dated.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::row::Row;

const README: &str = "README.md";
const PAGES: &str = "docs";
const SWEEPS: &str = "docs/figures/sweeps.md";
const PAGE: &str = "the page of figures";
const START: &str = "<!-- row ";
const END: &str = "-->";
/// Largest ratio of values from two machines.
const VARIES: f64 = 2.0;
/// Largest relative difference between a page's value and a measured one that is the same everywhere: the effect of another mathematical library.
const SAME: f64 = 1e-3;

/// A number that a page quotes.
#[derive(Clone, Debug, PartialEq)]
pub struct Quoted {
    /// Path of the page, from the root.
    pub page: PathBuf,
    /// Line, counted from one.
    pub line: usize,
    /// The number as written.
    pub number: String,
    /// The word that follows it.
    unit: String,
    /// Its table.
    pub table: String,
    parts: Vec<String>,
}

/// All numbers quoted by README, the pages in `docs`, and that of the sweeps.
///
/// # Errors
/// When a page cannot be read or a comment is malformed.
pub fn of_pages(root: &Path) -> Result<Vec<Quoted>> {
    let mut pages = vec![PathBuf::from(README), PathBuf::from(SWEEPS)];
    for entry in std::fs::read_dir(root.join(PAGES)).with_context(|| format!("reading {PAGES}"))? {
        let path = Path::new(PAGES).join(entry?.file_name());
        if path.extension().is_some_and(|end| end == "md") {
            pages.push(path);
        }
    }
    pages.sort();
    let mut found = Vec::new();
    for page in pages {
        let text = std::fs::read_to_string(root.join(&page))
            .with_context(|| format!("reading {}", page.display()))?;
        found.extend(of_text(&page, &text)?);
    }
    Ok(found)
}

fn of_text(page: &Path, text: &str) -> Result<Vec<Quoted>> {
    let mut found = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let mut rest = line;
        while let Some((before, after)) = rest.split_once(START) {
            let place = || format!("{}:{}", page.display(), index + 1);
            let (name, after) = after
                .split_once(END)
                .with_context(|| format!("{}: the comment has no end", place()))?;
            let (table, parts) = name.split_once(':').with_context(|| {
                format!(
                    "{}: the comment must be `{START}TABLE: PART + PART {END}`",
                    place()
                )
            })?;
            let Some((number, unit)) = last_number(before) else {
                bail!("{}: there is no number before the comment", place());
            };
            found.push(Quoted {
                page: page.to_path_buf(),
                line: index + 1,
                number,
                unit,
                table: table.trim().to_owned(),
                parts: parts.split(" + ").map(|part| part.trim().to_owned()).collect(),
            });
            rest = after;
        }
    }
    Ok(found)
}

/// The last number of a text and the word that follows it.
fn last_number(text: &str) -> Option<(String, String)> {
    let end = text.rfind(|letter: char| letter.is_ascii_digit())? + 1;
    let start = text[..end]
        .rfind(|letter: char| !(letter.is_ascii_digit() || ",.".contains(letter)))
        .map_or(0, |at| at + text[at..].chars().next().map_or(1, char::len_utf8));
    let number = text[start..end].trim_start_matches([',', '.']);
    let unit = text[end..].split_whitespace().next().unwrap_or("");
    let unit = unit.trim_matches(|letter: char| !letter.is_alphanumeric() && letter != '%');
    Some((number.to_owned(), unit.to_owned()))
}

impl Quoted {
    /// True if README quotes it: it is compared with what is measured anew as well.
    pub fn is_of_readme(&self) -> bool {
        self.page == Path::new(README)
    }

    /// The one row that contains all of its parts.
    fn row<'a>(&self, rows: &'a [Row], place: &str) -> Result<&'a Row> {
        let fits = |row: &&Row| self.parts.iter().all(|part| row.what.contains(part.as_str()));
        let found: Vec<&Row> = rows.iter().filter(fits).collect();
        match found.as_slice() {
            [row] => Ok(row),
            rows => bail!("{self}: {} rows of {place} have its parts, one must", rows.len()),
        }
    }

    /// Fails when `row` does not round to the number.
    fn agrees(&self, row: &Row, place: &str) -> Result<()> {
        let written: f64 = self
            .number
            .replace(',', "")
            .parse()
            .with_context(|| format!("{self}: not a number"))?;
        let value = row
            .number()
            .with_context(|| format!("{self}: {place} has `{}`", row.value))?;
        let Some(scale) = scale(&row.unit, &self.unit) else {
            bail!("{self}: {place} has {value} {}", row.unit);
        };
        let value = value * scale;
        let digits = self.number.split_once('.').map_or(0, |(_, behind)| behind.len());
        let agree = if row.varies {
            value > 0.0 && written > 0.0 && (value / written).max(written / value) <= VARIES
        } else {
            (value - written).abs() <= 0.500_001 * 10f64.powi(-(digits as i32))
        };
        if !agree {
            bail!("{self}: {place} has {value} {}", self.unit);
        }
        Ok(())
    }

    /// Fails when the number, the page of figures and the measured value differ.
    ///
    /// # Errors
    /// When they differ; the message has all three.
    pub fn check(&self, measured: &[Row], page: &[Row]) -> Result<()> {
        let now = self.row(measured, "what was measured")?;
        self.agrees(now, "what was measured")?;
        let mut kept = self.row(page, PAGE)?.clone();
        kept.varies = now.varies;
        self.agrees(&kept, PAGE)
    }

    /// Fails when the number and the page of figures differ.
    ///
    /// # Errors
    /// When they differ; the message has both.
    pub fn check_page(&self, page: &[Row]) -> Result<()> {
        self.agrees(self.row(page, PAGE)?, PAGE)
    }
}

impl std::fmt::Display for Quoted {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            page,
            line,
            number,
            unit,
            table,
            parts,
        } = self;
        write!(
            formatter,
            "{}:{line}: {number} {unit} ({table}: {})",
            page.display(),
            parts.join(" + ")
        )
    }
}

/// Factor from one unit to another; 1 where either is a word, `None` where they measure different things.
fn scale(from: &str, to: &str) -> Option<f64> {
    match (of_base(from), of_base(to)) {
        (Some((from, base)), Some((to, other))) => (base == other).then_some(from / to),
        _ => Some(1.0),
    }
}

/// The factor of a unit's prefix, and the unit without it.
fn of_base(unit: &str) -> Option<(f64, &'static str)> {
    const BASES: [&str; 6] = ["m", "s", "N", "J", "N/m", "Hz"];
    const PREFIXES: [(&str, f64); 4] = [("µ", 1e-6), ("m", 1e-3), ("", 1.0), ("k", 1e3)];
    PREFIXES.iter().find_map(|(prefix, factor)| {
        let rest = unit.strip_prefix(prefix)?;
        let base = BASES.iter().find(|base| **base == rest)?;
        Some((*factor, *base))
    })
}

/// Tables that README quotes, and those of promises: they are measured whenever figures are checked. Numbers on other pages are compared with the
/// pages of figures, whose own sources are recorded.
pub fn measured(quoted: &[Quoted]) -> BTreeSet<String> {
    let of_readme = quoted.iter().filter(|quoted| quoted.is_of_readme());
    let mut tables: BTreeSet<String> = of_readme.map(|quoted| quoted.table.clone()).collect();
    tables.extend(["end-to-end", "promises"].map(str::to_owned));
    tables
}

/// The rows of a page of figures.
pub fn page_rows(text: &str) -> Vec<Row> {
    let cells = |line: &str| -> Vec<String> {
        let line = line.replace("\\|", "\u{0}");
        let inner = line.trim().trim_matches('|');
        inner
            .split('|')
            .map(|cell| cell.trim().replace('\u{0}', "|"))
            .collect()
    };
    (text.lines().filter(|line| line.starts_with("| ")).skip(1))
        .map(cells)
        .filter(|cells| cells.len() >= 3)
        .map(|cells| Row {
            what: cells[0].clone(),
            value: cells[1].clone(),
            unit: cells[2].clone(),
            holds: match cells.get(5).map(String::as_str) {
                Some(cell) if cell.starts_with("yes") => Some(true),
                Some(cell) if cell.starts_with("**no**") => Some(false),
                _ => None,
            },
            ..Row::default()
        })
        .collect()
}

/// Differences between a page of figures and measured values, for rows of the same text whose number is the same everywhere.
pub fn differences(table: &str, measured: &[Row], page: &[Row]) -> Vec<String> {
    let mut found = Vec::new();
    for row in measured.iter().filter(|row| !row.varies && row.claim.is_some()) {
        let Some(kept) = page.iter().find(|kept| kept.key() == row.key()) else {
            continue;
        };
        if let (Some(now), Some(then)) = (row.number(), kept.number())
            && (now - then).abs() > SAME * then.abs().max(now.abs())
        {
            found.push(format!(
                "{FOLDER}/{table}.md: {}: {then} there, {now} measured",
                row.what
            ));
        }
    }
    found
}

const FOLDER: &str = super::artefacts::FOLDER;

#[cfg(test)]
mod tests {
    use super::*;

    fn row(what: &str, value: f64, unit: &str) -> Row {
        Row {
            what: what.into(),
            value: value.to_string(),
            unit: unit.into(),
            ..Row::default()
        }
    }

    fn quoted(text: &str) -> Vec<Quoted> {
        of_text(Path::new("README.md"), text).unwrap()
    }

    #[test]
    fn numbers_and_their_rows_are_read() {
        let found =
            quoted("1 N | 9.06 µm<!-- row a: wall + depth -->, 72,480 instructions<!-- row b: tick -->");
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].number.as_str(), found[0].unit.as_str()), ("9.06", "µm"));
        assert_eq!(
            (found[1].number.as_str(), found[1].table.as_str()),
            ("72,480", "b")
        );
        assert_eq!(found[0].parts, ["wall", "depth"]);
        assert!(of_text(Path::new("a"), "none <!-- row a: b -->").is_err());
        assert!(of_text(Path::new("a"), "1 <!-- row a b -->").is_err());
    }

    /// The first sentence of README once stated 2 µm where 9.06 µm were measured and the page had 1.62.
    #[test]
    fn a_number_that_is_not_measured_is_found() {
        let depth = |value: f64| {
            [
                row("wall, 5 N: depth", value, "mm"),
                row("wall, 1 N: depth", 0.0, "mm"),
            ]
        };
        let said = |text: &str| quoted(&format!("{text}<!-- row a: 5 N + depth -->")).remove(0);
        assert!(said("2 µm").check(&depth(0.00906), &depth(0.00162)).is_err());
        assert!(said("9.06 µm").check(&depth(0.00906), &depth(0.00162)).is_err());
        assert!(said("9.1 µm").check(&depth(0.00906), &depth(0.009_06)).is_ok());
        assert!(said("9.2 µm").check(&depth(0.00906), &depth(0.009_06)).is_err());
        assert!(said("9.1 µm").check_page(&depth(0.009_06)).is_ok());
        assert!(said("9.2 µm").check_page(&depth(0.009_06)).is_err());
        let two = quoted("9 µm<!-- row a: depth -->").remove(0);
        assert!(two.check(&depth(0.009), &depth(0.009)).is_err());
    }

    #[test]
    fn values_of_a_machine_have_a_spread() {
        let time = |value: f64| {
            [Row {
                varies: true,
                ..row("ratio", value, "")
            }]
        };
        let said = quoted("131<!-- row a: ratio -->").remove(0);
        assert!(said.check(&time(100.0), &[row("ratio", 150.0, "")]).is_ok());
        assert!(said.check(&time(60.0), &[row("ratio", 131.0, "")]).is_err());
    }

    #[test]
    fn a_page_that_differs_from_the_run_is_found() {
        let page = "| what | value | unit | claim | bound | holds |\n|---|---:|---|---:|---|---|\n| a\\|b (1) | 2 | mm | 2 | ≤ 2.2 | yes |\n";
        let rows = page_rows(page);
        assert_eq!(rows.last().map(|row| row.what.as_str()), Some("a|b (1)"));
        assert_eq!(rows.last().map(|row| row.holds), Some(Some(true)));
        assert!(page_rows(&page.replace("yes", "**no**"))[0].fails());
        let now = |value: f64| {
            [Row {
                claim: Some(2.0),
                ..row("a|b (3)", value, "mm")
            }]
        };
        assert!(differences("t", &now(2.0), &rows).is_empty());
        assert_eq!(differences("t", &now(2.1), &rows).len(), 1);
    }

    #[test]
    fn a_number_may_have_another_prefix_than_its_row_but_not_another_unit() {
        let energy = [row("at the handle", 0.002_573, "mJ")];
        let said = |text: &str| quoted(&format!("{text}<!-- row a: handle -->")).remove(0);
        assert!(said("2.57 µJ").check_page(&energy).is_ok());
        assert!(said("2.8 µJ").check_page(&energy).is_err());
        assert!(said("0 µm").check_page(&energy).is_err());
        let stiffness = [row("at the handle", 18_481.9, "N/m")];
        assert!(said("18.5 kN/m").check_page(&stiffness).is_ok());
        assert!(said("18.5 N/m").check_page(&stiffness).is_err());
    }

    /// README alone decides what is measured anew: pages in `docs` may quote rows that only a whole page holds.
    #[test]
    fn pages_of_docs_are_read_and_their_tables_are_not_measured() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(root.path().join("docs/figures")).unwrap();
        std::fs::create_dir_all(root.path().join("docs/notes")).unwrap();
        for (page, table) in [
            ("README.md", "contact"),
            ("docs/stability.md", "stability"),
            ("docs/figures/sweeps.md", "constraints"),
            ("docs/figures/plan.md", "plan"),
            ("docs/notes/2026-11-21-first.md", "notes"),
        ] {
            std::fs::write(root.path().join(page), format!("1 µm<!-- row {table}: a -->\n")).unwrap();
        }
        let found = of_pages(root.path()).unwrap();
        let tables: Vec<&str> = found.iter().map(|quoted| quoted.table.as_str()).collect();
        assert_eq!(tables, ["contact", "constraints", "stability"]);
        let measured = measured(&found);
        assert_eq!(
            measured.iter().map(String::as_str).collect::<Vec<_>>(),
            ["contact", "end-to-end", "promises"]
        );
    }

    #[test]
    fn the_repositorys_own_comments_are_read() {
        let root = crate::shell::root().unwrap();
        let found = of_pages(&root).unwrap();
        for page in [README, "docs/stability.md"] {
            assert!(
                found.iter().any(|quoted| quoted.page == Path::new(page)),
                "{page}"
            );
        }
    }
}
