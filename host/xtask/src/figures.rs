//! `cargo xtask figures NAME`: measures and keeps the figures of one part of the product.
//!
//! The program prints one JSON object a row, `{"what","value","unit","bound","holds"}`; this writes
//! them as a table to `docs/figures/NAME.md`.

use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, bail};
use tinyjson::JsonValue;

use crate::setup::{self, Consent, Group};
use crate::{firmware, program, shell};

/// One measured figure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    what: String,
    value: String,
    unit: String,
    bound: String,
    /// Whether the value keeps its bound.
    pub holds: bool,
}

/// What one run of `mortise lab figures` gave.
#[derive(Debug)]
pub struct Measured {
    /// The rows, in the program's order.
    pub rows: Vec<Row>,
    /// True if the program ended with success.
    pub success: bool,
}

/// A sweep that belongs to a table: the experiment of `mortise lab` that makes it, and the charts it leaves in `docs/figures`, drawn from one table
/// of the experiment's name, or each from one of its own.
struct Sweep {
    table: &'static str,
    experiment: &'static str,
    charts: &'static [(&'static str, &'static str)],
    own_tables: bool,
}

const SWEEPS: &[Sweep] = &[
    Sweep {
        table: "contact",
        experiment: "clearance",
        charts: &[(
            "clearance",
            "Smallest clearance that assembles, by method and cell",
        )],
        own_tables: false,
    },
    Sweep {
        table: "contact",
        experiment: "pareto",
        charts: &[
            (
                "pareto-ticks",
                "Accuracy against instructions of the longest tick on the board",
            ),
            (
                "pareto-time",
                "Accuracy against nanoseconds of a query, parry3d beside it",
            ),
        ],
        own_tables: false,
    },
    Sweep {
        table: "stability",
        experiment: "stability",
        charts: &[
            ("stability-z-width", "Largest stable wall over its damping"),
            ("stability-rate", "Largest stable stiffness over the rate"),
            (
                "stability-mass",
                "Largest stable stiffness over the handle's mass",
            ),
            ("stability-hand", "Largest stable stiffness, hand loose to tight"),
            (
                "stability-encoder",
                "Largest stiffness that rests over the encoder's step",
            ),
            (
                "stability-jam",
                "How far to the side a peg may be pushed and still goes in",
            ),
            (
                "stability-contacts",
                "Unrest of the force over the number of touching points",
            ),
            ("stability-impact", "A blow on a wall of a millimetre"),
            ("stability-shell", "Where a flat wall is felt"),
            ("stability-lapses", "Targets lost and late"),
        ],
        own_tables: true,
    },
];

/// `cargo xtask figures NAME [--quick]`.
pub fn command(arguments: &[String]) -> Result<ExitCode> {
    let root = shell::root()?;
    let mut arguments = arguments.to_vec();
    let consent = Consent::take(&mut arguments);
    let (options, names): (Vec<String>, Vec<String>) = arguments
        .into_iter()
        .partition(|argument| argument.starts_with('-'));
    if let Some(unknown) = options.iter().find(|option| *option != "--quick") {
        bail!("`figures` does not know `{unknown}`; see `cargo xtask figures --help`");
    }
    let [name] = names.as_slice() else {
        bail!("say which figures, for example `cargo xtask figures end-to-end`");
    };
    if !name
        .bytes()
        .all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-')
    {
        bail!("`{name}` is not a name of figures: small letters, digits and `-` only");
    }
    if !setup::ensure(&[Group::Build, Group::Board], consent)? {
        return Ok(ExitCode::FAILURE);
    }
    firmware::build(&root, firmware::EMULATED)?;
    let program = program::build_mortise(&root)?;
    let quick = !options.is_empty();
    let measured = measure(&root, &program, name, quick)?;

    let mut page = page(name, quick, &measured.rows, &today());
    let folder = root.join("docs/figures");
    std::fs::create_dir_all(&folder)?;
    for sweep in SWEEPS.iter().filter(|sweep| sweep.table == name) {
        // The shorter form leaves the charts as they are: it would show a part of them.
        if !quick {
            run_sweep(&root, &program, sweep)?;
        }
        page.push_str(&charts(sweep));
    }
    let file = folder.join(format!("{name}.md"));
    std::fs::write(&file, page).with_context(|| format!("writing {}", file.display()))?;
    eprintln!("written: docs/figures/{name}.md");
    let all_hold = measured.success && measured.rows.iter().all(|row| row.holds);
    Ok(if all_hold {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn run_sweep(root: &Path, program: &Path, sweep: &Sweep) -> Result<()> {
    let experiment = sweep.experiment;
    let mut command = Command::new(program);
    command
        .current_dir(root)
        .args(["lab", experiment, "--out", "docs/figures"]);
    shell::run(&mut command).with_context(|| format!("`mortise lab {experiment}` made no charts"))
}

/// The charts of a sweep as a page shows them.
fn charts(sweep: &Sweep) -> String {
    let experiment = sweep.experiment;
    let mut text = format!("\n`mortise lab {experiment} --out docs/figures` makes the following");
    if sweep.own_tables {
        text.push_str(".\n");
    } else {
        text.push_str(&format!(" from [{experiment}.csv]({experiment}.csv).\n"));
    }
    for (file, title) in sweep.charts {
        text.push_str(&format!("\n![{title}]({file}.svg)\n"));
        if sweep.own_tables {
            text.push_str(&format!("\n[{file}.csv]({file}.csv)\n"));
        }
    }
    text
}

/// Runs `mortise lab figures NAME --json` and prints each row as it comes.
///
/// # Errors
/// When the program cannot be started or prints no rows, or something that is not a row.
pub fn measure(root: &Path, program: &Path, name: &str, quick: bool) -> Result<Measured> {
    let mut command = Command::new(program);
    command.current_dir(root).args(["lab", "figures", name, "--json"]);
    if quick {
        command.arg("--quick");
    }
    let mut rows = Vec::new();
    let mut foreign = Vec::new();
    let run = shell::run_lines(&mut command, |line| match parse_row(line) {
        Ok(row) => {
            println!("  {}", line_of(&row));
            rows.push(row);
        }
        Err(_) if line.trim().is_empty() => {}
        Err(error) => foreign.push(format!("{error:#}: {line}")),
    });
    if let Some(first) = foreign.first() {
        bail!("`mortise lab figures {name} --json` printed what is not a row ({first})");
    }
    if rows.is_empty() {
        run?;
        bail!("`mortise lab figures {name} --json` printed no row");
    }
    Ok(Measured {
        rows,
        success: run.is_ok(),
    })
}

fn line_of(row: &Row) -> String {
    let mark = if row.holds { "ok  " } else { "FAIL" };
    format!(
        "{mark} {}: {} {} (bound: {})",
        row.what, row.value, row.unit, row.bound
    )
}

fn parse_row(line: &str) -> Result<Row> {
    let value: JsonValue = line.parse().map_err(|error| anyhow::anyhow!("{error}"))?;
    let fields: &HashMap<String, JsonValue> = value.get().context("not a JSON object")?;
    let field = |name: &str| fields.get(name).with_context(|| format!("`{name}` is missing"));
    Ok(Row {
        what: plain(field("what")?)?,
        value: plain(field("value")?)?,
        unit: plain(field("unit")?)?,
        bound: plain(field("bound")?)?,
        holds: *field("holds")?
            .get::<bool>()
            .context("`holds` is neither true nor false")?,
    })
}

/// A value as a person reads it: text without quotes, the shortest number that reads back the same.
fn plain(value: &JsonValue) -> Result<String> {
    Ok(match value {
        JsonValue::String(text) => text.clone(),
        JsonValue::Number(number) => number.to_string(),
        JsonValue::Boolean(truth) => truth.to_string(),
        JsonValue::Null => String::new(),
        other => other.stringify().map_err(|error| anyhow::anyhow!("{error}"))?,
    })
}

fn page(name: &str, quick: bool, rows: &[Row], date: &str) -> String {
    let option = if quick { " --quick" } else { "" };
    let title = name.replace('-', " ");
    let title = title[..1].to_uppercase() + &title[1..];
    let held = rows.iter().filter(|row| row.holds).count();
    let mut text = format!(
        "# Figures: {title}\n\n\
         Written by `cargo xtask figures {name}{option}` on {date} from what `mortise lab figures {name}{option} --json`\n\
         measured; {held} of {} bounds hold. Ticks, instructions, bytes, forces and lengths come out the same on every\n\
         machine. Times do not: take them as this one machine's.\n\n\
         | what | value | unit | bound | holds |\n|---|---:|---|---|---|\n",
        rows.len()
    );
    for row in rows {
        let cell = |text: &str| text.replace('|', "\\|").replace('\n', " ");
        let holds = if row.holds { "yes" } else { "**no**" };
        text.push_str(&format!(
            "| {} | {} | {} | {} | {holds} |\n",
            cell(&row.what),
            cell(&row.value),
            cell(&row.unit),
            cell(&row.bound)
        ));
    }
    text
}

/// Today's date in UTC, `YYYY-MM-DD`.
fn today() -> String {
    let seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |elapsed| elapsed.as_secs());
    let (year, month, day) = civil_from_days(seconds / 86_400);
    format!("{year:04}-{month:02}-{day:02}")
}

/// Gregorian date from days since 1970-01-01.
///
/// Source: H. Hinnant, *chrono-compatible low-level date algorithms*, `civil_from_days`, for days ≥ 0.
fn civil_from_days(days: u64) -> (u64, u64, u64) {
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    // Months counted from March.
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 {
        month_from_march + 3
    } else {
        month_from_march - 9
    };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    (year, month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_shows_the_charts_of_its_sweeps() {
        let page: String = SWEEPS.iter().map(charts).collect();
        for (file, _) in SWEEPS.iter().flat_map(|sweep| sweep.charts) {
            assert!(page.contains(&format!("({file}.svg)")), "{page}");
        }
    }

    #[test]
    fn dates() {
        // `date -u -d @0`, and leap days either side of a century that is one.
        assert_eq!(civil_from_days(0), (1970, 1, 1));
        assert_eq!(civil_from_days(11_016), (2000, 2, 29));
        assert_eq!(civil_from_days(19_782), (2024, 2, 29));
        assert_eq!(civil_from_days(19_783), (2024, 3, 1));
    }

    #[test]
    fn rows_keep_numbers_as_they_were_measured() {
        let row = parse_row(r#"{"what":"gap","value":0.0031,"unit":"mm","bound":"<= 0.005","holds":true}"#)
            .unwrap();
        assert_eq!(row.value, "0.0031");
        assert!(row.holds);
        let error = parse_row(r#"{"what":"gap","value":1,"unit":"mm","bound":null}"#).unwrap_err();
        assert!(error.to_string().contains("`holds`"), "{error}");
        assert!(parse_row("measuring…").is_err());
    }

    #[test]
    fn a_bound_that_does_not_hold_stands_out() {
        let rows = [
            Row {
                what: "a|b".into(),
                value: "1".into(),
                unit: "N".into(),
                bound: "≤ 2".into(),
                holds: true,
            },
            Row {
                what: "c".into(),
                value: "3".into(),
                unit: "N".into(),
                bound: "≤ 2".into(),
                holds: false,
            },
        ];
        let page = page("end-to-end", true, &rows, "2024-02-29");
        assert!(page.starts_with("# Figures: End to end\n"), "{page}");
        assert!(page.contains("1 of 2 bounds hold"));
        assert!(page.contains("| a\\|b | 1 | N | ≤ 2 | yes |"));
        assert!(page.contains("| c | 3 | N | ≤ 2 | **no** |"));
    }
}
