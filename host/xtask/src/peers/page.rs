//! The tables of the comparison, and its page.

use super::row::{Row, count};

/// The scene whose table comes first.
const THESIS: &str = "scene P";

/// Our method that the requirement is about, and its bounds on scene P, µs.
const OURS: &str = "mortise, default bake";
const MEDIAN_US: f64 = 10.0;
const WORST_US: f64 = 60.0;

/// What each peer's figure means, for the page.
const MEANING: &str = include_str!("meaning.md");

/// The page.
pub fn text(rows: &[Row], quick: bool, date: &str) -> String {
    let option = if quick { " --quick" } else { "" };
    let (thesis, others): (Vec<&Row>, Vec<&Row>) = rows.iter().partition(|row| row.scene == THESIS);
    let mut text = format!(
        "# Figures: Peers\n\n\
         Written by `cargo xtask peers{option} --write` on {date}; {} scenes, {}. Every method answers the same poses in one run on one\n\
         thread. Times are this one machine's; compare the ratios. All figures: [peers.csv](peers.csv).\n\n\
         {MEANING}\n## Scene P\n\n{}\n\n{}",
        scenes(&rows.iter().collect::<Vec<_>>()).len(),
        count(rows),
        required(rows),
        table(&thesis)
    );
    for (what, file) in [("gaps", "peers"), ("depths", "peers-depths")] {
        text.push_str(&format!(
            "\n![Error of {what} over the time of a query, scene P]({file}.png)\n"
        ));
    }
    let pairs = scenes(&others).len();
    text.push_str(&format!("\n## All other scenes together\n\n{}", summary(&others)));
    if pairs > 1
        && others
            .iter()
            .any(|row| row.skipped.is_none() && row.method.contains("planned"))
    {
        text.push_str("\n![Error of gaps over the time of a query, all other scenes](peers-free-form.png)\n");
    }
    for scene in scenes(&others) {
        let own: Vec<&Row> = others.iter().copied().filter(|row| row.scene == scene).collect();
        text.push_str(&format!("\n## {scene}\n\n{}", table(&own)));
    }
    text
}

/// A table for each scene, for the terminal.
pub fn tables(rows: &[Row]) -> String {
    let all: Vec<&Row> = rows.iter().collect();
    let of = |scene: &str| {
        let own: Vec<&Row> = all.iter().copied().filter(|row| row.scene == scene).collect();
        format!("{scene}\n\n{}\n", table(&own))
    };
    scenes(&all).into_iter().map(of).collect()
}

/// Verdict on our query on scene P. What is not measured does not hold.
pub fn required(rows: &[Row]) -> String {
    let ours = rows.iter().find(|row| row.scene == THESIS && row.method == OURS);
    let Some((median, worst)) = ours.and_then(|row| row.median_us.zip(row.worst_us)) else {
        let why = ours
            .and_then(|row| row.skipped.as_deref())
            .unwrap_or("not measured");
        return format!(
            "Required of {OURS}, median ≤ {MEDIAN_US} µs and worst ≤ {WORST_US} µs: skipped: {why}."
        );
    };
    let verdict = |value: f64, bound: f64| {
        let holds = if value <= bound {
            "holds"
        } else {
            "**does not hold**"
        };
        format!("{} µs, ≤ {bound} required: {holds}", short(Some(value)))
    };
    format!(
        "{OURS}: median {}; worst {}.",
        verdict(median, MEDIAN_US),
        verdict(worst, WORST_US)
    )
}

/// Each scene once, in the order of its first row.
fn scenes<'r>(rows: &[&'r Row]) -> Vec<&'r str> {
    let mut scenes: Vec<&str> = Vec::new();
    for row in rows {
        if !scenes.contains(&row.scene.as_str()) {
            scenes.push(&row.scene);
        }
    }
    scenes
}

/// The rows of a scene as Markdown, every column as wide as its widest cell.
fn table(rows: &[&Row]) -> String {
    let head = [
        "method",
        "version",
        "mesh, µm",
        "median, µs",
        "worst, µs",
        "two balls, µs",
        "× ours",
        "wrong signs",
        "gap error, µm",
        "depth error, µm",
    ];
    let line = |row: &&Row| {
        let mut cells = vec![row.method.clone(), row.version.clone().unwrap_or_default()];
        if let Some(reason) = &row.skipped {
            cells.push(format!("skipped: {}", reason.replace('|', "\\|")));
            cells.resize(head.len(), String::new());
            return cells;
        }
        let wrong = (row.wrong_signs).map_or(String::new(), |wrong| format!("{wrong} of {}", row.poses));
        cells.extend([
            row.mesh_um.map_or(String::new(), |um| um.to_string()),
            short(row.median_us),
            short(row.worst_us),
            short(row.floor_us),
            short(row.over_ours),
            wrong,
            short(row.gap_error_um),
            short(row.depth_error_um),
        ]);
        cells
    };
    markdown(&head, rows.iter().map(line).collect())
}

/// Each method over all scenes it answered: how many of them, the median of medians, the slowest query, all wrong signs, the largest error of a gap.
fn summary(rows: &[&Row]) -> String {
    let mut methods: Vec<&str> = Vec::new();
    for row in rows {
        if !methods.contains(&row.method.as_str()) {
            methods.push(&row.method);
        }
    }
    let all = scenes(rows).len();
    let line = |method: &str| {
        let own: Vec<&&Row> = (rows.iter())
            .filter(|row| row.method == method && row.skipped.is_none())
            .collect();
        let largest =
            |of: fn(&Row) -> Option<f64>| own.iter().filter_map(|row| of(row)).max_by(f64::total_cmp);
        let mut medians: Vec<f64> = own.iter().filter_map(|row| row.median_us).collect();
        medians.sort_unstable_by(f64::total_cmp);
        let (wrong, poses) = own.iter().fold((0.0, 0.0), |(wrong, poses), row| {
            (wrong + row.wrong_signs.unwrap_or_default(), poses + row.poses)
        });
        vec![
            method.to_owned(),
            format!("{} of {all}", own.len()),
            short(medians.get(medians.len() / 2).copied()),
            short(largest(|row| row.worst_us)),
            format!("{wrong} of {poses}"),
            short(largest(|row| row.gap_error_um)),
        ]
    };
    let head = [
        "method",
        "scenes",
        "median, µs",
        "worst, µs",
        "wrong signs",
        "gap error, µm",
    ];
    markdown(&head, methods.into_iter().map(line).collect())
}

/// Three significant digits; a dash where there is nothing.
fn short(value: Option<f64>) -> String {
    let Some(value) = value else { return "–".into() };
    let digits = if value == 0.0 {
        0.0
    } else {
        value.abs().log10().floor()
    };
    let decimals = (2.0 - digits).clamp(0.0, 3.0) as usize;
    format!("{value:.decimals$}")
}

fn markdown(head: &[&str], lines: Vec<Vec<String>>) -> String {
    let widths: Vec<usize> = (0..head.len())
        .map(|at| {
            // A reason is as long as it is, and its column is not widened for it.
            let cells = lines
                .iter()
                .map(|line| &line[at])
                .filter(|cell| !cell.starts_with("skipped: "));
            let widest = cells.map(|cell| cell.chars().count()).max().unwrap_or(0);
            widest.max(head[at].chars().count())
        })
        .collect();
    let row = |cells: &[&str]| {
        let padded = cells.iter().zip(&widths).enumerate().map(|(at, (cell, &width))| {
            if at == 0 {
                format!("{cell:<width$}")
            } else {
                format!("{cell:>width$}")
            }
        });
        format!("| {} |\n", padded.collect::<Vec<_>>().join(" | "))
    };
    let rule = widths.iter().enumerate().map(|(at, width)| {
        let dashes = "-".repeat(width + 1);
        if at == 0 {
            format!("{dashes}-")
        } else {
            format!("{dashes}:")
        }
    });
    let mut text = row(head);
    text.push_str(&format!("|{}|\n", rule.collect::<Vec<_>>().join("|")));
    for line in &lines {
        text.push_str(&row(&line.iter().map(String::as_str).collect::<Vec<_>>()));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(scene: &str, method: &str, wrong: f64) -> Row {
        Row {
            scene: scene.into(),
            method: method.into(),
            poses: 20.0,
            median_us: Some(1234.5),
            worst_us: Some(2000.0),
            wrong_signs: Some(wrong),
            gap_error_um: Some(0.0125),
            ..Row::default()
        }
    }

    fn skipped(scene: &str, method: &str) -> Row {
        Row {
            scene: scene.into(),
            method: method.into(),
            poses: 20.0,
            skipped: Some("no | package".into()),
            ..Row::default()
        }
    }

    #[test]
    fn a_skip_is_named_with_its_reason_and_has_no_verdict() {
        let text = text(
            &[measured(THESIS, "m", 3.0), skipped(THESIS, "n")],
            true,
            "2024-02-29",
        );
        assert!(
            text.contains("on 2024-02-29; 1 scenes, 1 measured, 1 skipped."),
            "{text}"
        );
        assert!(text.contains("skipped: no \\| package"), "{text}");
        let row = text.lines().find(|line| line.starts_with("| m ")).unwrap();
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        assert_eq!(
            cells[4..],
            ["1234", "2000", "–", "–", "3 of 20", "0.013", "–", ""][..],
            "{row}"
        );
        assert!(
            !text
                .lines()
                .any(|line| line.starts_with("| n ") && line.contains(" of ")),
            "{text}"
        );
    }

    #[test]
    fn a_skipped_scene_is_not_counted_in_the_summary() {
        let rows = [
            measured("a", "m", 1.0),
            measured("b", "m", 2.0),
            skipped("a", "n"),
            measured("b", "n", 0.0),
        ];
        let all: Vec<&Row> = rows.iter().collect();
        let text = summary(&all);
        let line = |method: &str| {
            let line = text
                .lines()
                .find(|line| line.starts_with(&format!("| {method} ")))
                .unwrap();
            line.split('|')
                .map(str::trim)
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (line("m")[2].as_str(), line("m")[5].as_str()),
            ("2 of 2", "3 of 40")
        );
        assert_eq!(
            (line("n")[2].as_str(), line("n")[5].as_str()),
            ("1 of 2", "0 of 20")
        );
    }

    #[test]
    fn a_skip_does_not_hold_the_requirement() {
        assert!(required(&[skipped(THESIS, OURS)]).ends_with("skipped: no | package."));
        assert!(required(&[measured("bars", OURS, 0.0)]).ends_with("skipped: not measured."));
        let row = |median_us, worst_us| Row {
            median_us: Some(median_us),
            worst_us: Some(worst_us),
            ..measured(THESIS, OURS, 0.0)
        };
        let holds = |row| required(&[row]).matches(": holds").count();
        assert_eq!(
            [
                holds(row(10.0, 60.0)),
                holds(row(9.0, 61.0)),
                holds(row(11.0, 61.0))
            ],
            [2, 1, 0]
        );
    }

    #[test]
    fn three_digits() {
        let numbers = [
            (0.0, "0.00"),
            (0.0125, "0.013"),
            (5.678, "5.68"),
            (12.34, "12.3"),
            (123_456.7, "123457"),
        ];
        for (value, wanted) in numbers {
            assert_eq!(short(Some(value)), wanted);
        }
    }
}
