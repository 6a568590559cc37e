//! The page of a table, `docs/figures/NAME.md`.

use std::time::{SystemTime, UNIX_EPOCH};

use super::row::{Row, count};

/// A sweep that belongs to a table: the experiment of `mortise-lab` that makes it, and its charts in `docs/figures`, drawn from one table with the
/// experiment's name, or each from a table of its own.
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

/// The page of a table: its rows, and its charts.
pub fn text(name: &str, quick: bool, rows: &[Row]) -> String {
    let mut text = page(name, quick, rows, &today());
    for sweep in SWEEPS.iter().filter(|sweep| sweep.table == name) {
        text.push_str(&charts(sweep));
    }
    text
}

/// The charts of a sweep, as Markdown.
fn charts(sweep: &Sweep) -> String {
    let experiment = sweep.experiment;
    let mut text = format!("\n`mortise-lab {experiment} --out docs/figures --force` makes the following");
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

fn page(name: &str, quick: bool, rows: &[Row], date: &str) -> String {
    let option = if quick { " --quick" } else { "" };
    let title = name.replace('-', " ");
    let title = title[..1].to_uppercase() + &title[1..];
    let mut text = format!(
        "# Figures: {title}\n\n\
         Written by `cargo xtask figures {name}{option}` on {date} from what `mortise-lab figures {name}{option} --json`\n\
         measured; {}. Ticks, instructions, bytes, forces and lengths come out the same on every\n\
         machine. Times do not: take them as this one machine's.\n\n\
         A claim is the figure that is stated for a row ([claims.json](claims.json)). The bound is the nearer of what is required and\n\
         1.1 times the claim, 1.5 times for what this machine decides; words, and numbers that must be met exactly, need no claim.\n\n\
         | what | value | unit | claim | bound | holds |\n|---|---:|---|---:|---|---|\n",
        count(rows)
    );
    for row in rows {
        let cell = |text: &str| text.replace('|', "\\|").replace('\n', " ");
        let holds = match row.holds {
            Some(true) => "yes",
            Some(false) => "**no**",
            None => "",
        };
        let remark = row
            .remark
            .as_deref()
            .map_or(String::new(), |remark| format!("; {remark}"));
        let claim = row.claim.map_or(String::new(), |claim| claim.to_string());
        text.push_str(&format!(
            "| {} | {} | {} | {claim} | {} | {holds}{remark} |\n",
            cell(&row.what),
            cell(&row.value),
            cell(&row.unit),
            cell(&row.bound)
        ));
    }
    text
}

/// Today's date in UTC, `YYYY-MM-DD`.
pub fn today() -> String {
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
    // Months are counted from March.
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
        // `date -u -d @0`, and leap days around a century that is a leap year.
        assert_eq!(civil_from_days(0), (1970, 1, 1));
        assert_eq!(civil_from_days(11_016), (2000, 2, 29));
        assert_eq!(civil_from_days(19_782), (2024, 2, 29));
        assert_eq!(civil_from_days(19_783), (2024, 3, 1));
    }

    #[test]
    fn a_bound_that_does_not_hold_stands_out() {
        let rows = [
            Row {
                what: "a|b".into(),
                value: "1".into(),
                unit: "N".into(),
                bound: "≤ 2".into(),
                holds: Some(true),
                ..Row::default()
            },
            Row {
                what: "c".into(),
                value: "3".into(),
                unit: "N".into(),
                bound: "≤ 2".into(),
                holds: Some(false),
                claim: Some(1.9),
                ..Row::default()
            },
        ];
        let page = page("end-to-end", true, &rows, "2024-02-29");
        assert!(page.starts_with("# Figures: End to end\n"), "{page}");
        assert!(page.contains("1 of 2 bounds hold, 0 unbounded, 0 skipped"));
        assert!(page.contains("| a\\|b | 1 | N |  | ≤ 2 | yes |"));
        assert!(page.contains("| c | 3 | N | 1.9 | ≤ 2 | **no** |"));
    }
}
