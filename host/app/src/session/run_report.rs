//! Report of recorded runs as a page (HTML) that needs no other file: figures, a column for each run, and charts in which the other runs are dashed. Pure.

use std::fmt::Write as _;

use mortise_page::escaped;

use super::chart::charts;
use super::history::{Signal, distribution};
use super::run::Run;
use super::run_table::{RUN_FIGURES, models};
use super::runs::{Playback, Shown};

/// Signals that are drawn.
const DRAWN: [&str; 8] = [
    "contact_force_n",
    "handle_force_n",
    "guidance_force_n",
    "contact_torque_mnm",
    "loop_cost",
    "insertion_mm",
    "depth_um",
    "points",
];
const STYLE: &str = "body{font:14px/1.5 system-ui,sans-serif;max-width:900px;margin:2rem auto;padding:0 1rem;color:#1b2430}\
    table{border-collapse:collapse}td,th{padding:.2rem .8rem;border-bottom:1px solid #d5dbe3;text-align:right}\
    td:first-child,th:first-child{text-align:left}h2{font-size:1rem;margin:1.6rem 0 .3rem}svg{display:block}\
    .key{font-size:12px;margin-right:1rem}";

/// The page; the chosen run is its title.
pub fn html(playback: &Playback) -> String {
    let run = playback.run();
    let mut page = String::new();
    let title = escaped(&run.name());
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    );
    table(&mut page, playback);
    let range_s = [0.0, run.duration_s().max(1e-3)];
    let signals: Vec<&Signal> = DRAWN.iter().filter_map(|key| Signal::named(key)).collect();
    for chart in charts(&run.history, Some(playback), &signals, range_s) {
        chart.html(&mut page);
    }
    let _ = write!(
        page,
        "<p>Written by Mortise {}. Forces are magnitudes; loop time is in the board's unit.</p>\n</body></html>\n",
        env!("CARGO_PKG_VERSION")
    );
    page
}

/// The figures, a column for each run, the chosen one first.
fn table(page: &mut String, playback: &Playback) {
    let others = playback.others().map(|(index, ..)| &playback.runs()[index]);
    let runs: Vec<&Shown> = [playback.shown()].into_iter().chain(others).collect();
    page.push_str("<table>");
    let mut row = |tag: &str, name: &str, value: &dyn Fn(&Shown) -> String| {
        let _ = write!(page, "<tr><{tag}>{name}</{tag}>");
        for run in &runs {
            let _ = write!(page, "<{tag}>{}</{tag}>", escaped(&value(run)));
        }
        page.push_str("</tr>\n");
    };
    row("th", "", &|shown| shown.run.name());
    for figure in &RUN_FIGURES {
        let text = |shown: &Shown| figure.text(&shown.run).unwrap_or("none".to_owned());
        row("td", figure.name, &text);
    }
    row("td", "Loop time: half, 99 %, all within", &|shown| {
        loop_time(&shown.run)
    });
    row("td", "Collision models (checksums)", &|shown| models(&shown.run));
    if runs.iter().any(|shown| shown.recomputed.is_some()) {
        let words = |shown: &Shown| shown.recomputed.as_ref().map_or(String::new(), |r| r.words());
        row("td", "Computed again", &words);
    }
    page.push_str("</table>\n");
}

fn loop_time(run: &Run) -> String {
    let found = Signal::named("loop_cost").and_then(|signal| distribution(&run.history, signal, 1));
    found.map_or("none".to_owned(), |found| {
        found.quantiles.map(|value| format!("{value:.0}")).join(", ")
    })
}

#[cfg(test)]
mod tests {
    use super::super::history::Sample;
    use super::*;

    fn run(name: &str, samples: usize) -> Run {
        let sample = |i: usize| Sample {
            time_s: 0.01 * i as f64,
            contact_n: (0.1 * i as f32).sin().abs(),
            cost: 100.0 + i as f32,
            ..Sample::default()
        };
        Run::of(name, (0..samples).map(sample))
    }

    #[test]
    fn a_page_has_the_figures_and_a_chart_and_needs_nothing_else() {
        let mut playback = Playback::new(run("<a & b>.mcap", 300), true);
        playback.push(run("b.mcap", 200), true);
        playback.push(run("c.mcap", 100), true);
        let page = html(&playback);
        assert!(
            page.contains("<h1>&lt;a &amp; b&gt;.mcap</h1>")
                && page.contains("<th>b.mcap</th><th>c.mcap</th>")
        );
        assert!(page.contains("<h2>Force, N</h2>") && page.contains("stroke-dasharray"));
        assert!(
            page.contains("<td>Loop time: half, 99 %, all within</td><td>249, 396, 399</td>"),
            "{page}"
        );
        for outside in ["http", "<script", "<link", "src="] {
            assert!(!page.contains(outside), "{outside}");
        }
        let tags = |tag: &str| page.matches(tag).count();
        assert_eq!(tags("<svg"), tags("</svg>"));
        assert!(!page.contains("NaN") && !page.contains("inf"));
    }

    #[test]
    fn an_empty_run_has_a_page_without_charts() {
        let page = html(&Playback::new(run("none.mcap", 0), false));
        assert!(page.contains("<td>none</td>") && !page.contains("<svg"));
    }
}
