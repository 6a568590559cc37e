//! Report of a recorded run, beside another one where there is one, as a page (HTML) that needs no other file. Pure.

use std::fmt::Write as _;

use mortise_page::escaped;

use super::history::{Quantity, SIGNALS, Signal, distribution, envelope};
use super::run::Run;

/// Size of a chart, pixels.
const CHART: [f64; 2] = [860.0, 180.0];
/// Room for the labels of a chart: left and below.
const LABELS: [f64; 2] = [64.0, 22.0];
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
/// Colours of the signals of a chart.
const COLORS: [&str; 4] = ["#1f6fc4", "#c2571a", "#2c8a4b", "#8a4bb0"];
const STYLE: &str = "body{font:14px/1.5 system-ui,sans-serif;max-width:900px;margin:2rem auto;padding:0 1rem;color:#1b2430}\
    table{border-collapse:collapse}td,th{padding:.2rem .8rem;border-bottom:1px solid #d5dbe3;text-align:right}\
    td:first-child,th:first-child{text-align:left}h2{font-size:1rem;margin:1.6rem 0 .3rem}svg{display:block}\
    .key{font-size:12px;margin-right:1rem}text{font:11px system-ui,sans-serif;fill:#566274}";

/// The page. The compared run is drawn dashed, `shift_s` later.
pub fn html(run: &Run, compared: Option<(&Run, f64)>) -> String {
    let mut page = String::new();
    let title = escaped(&run.name());
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    );
    table(&mut page, run, compared.map(|(other, _)| other));
    for quantity in Quantity::ALL {
        let signals: Vec<&Signal> = (SIGNALS.iter())
            .filter(|signal| signal.quantity == quantity && DRAWN.contains(&signal.key))
            .collect();
        chart(&mut page, quantity, &signals, run, compared);
    }
    let _ = write!(
        page,
        "<p>Written by Mortise {}. Forces are magnitudes; loop time is in the board's unit.</p>\n</body></html>\n",
        env!("CARGO_PKG_VERSION")
    );
    page
}

/// The figures, a column for each run.
fn table(page: &mut String, run: &Run, other: Option<&Run>) {
    let runs: Vec<&Run> = [Some(run), other].into_iter().flatten().collect();
    page.push_str("<table><tr><th></th>");
    for run in &runs {
        let _ = write!(page, "<th>{}</th>", escaped(&run.name()));
    }
    page.push_str("</tr>\n");
    type Cell = fn(&Run) -> String;
    let rows: [(&str, Cell); 9] = [
        ("Length, s", |run| format!("{:.1}", run.duration_s())),
        ("First touch, s", |run| {
            run.touch_s
                .map_or("none".to_owned(), |touch| format!("{touch:.2}"))
        }),
        ("From the touch to the deepest insertion, s", |run| {
            format!("{:.2}", run.figures.insertion_s)
        }),
        ("Deepest insertion, mm", |run| {
            format!("{:.2}", run.figures.insertion_mm)
        }),
        ("Largest contact force, N", |run| {
            format!("{:.2}", run.figures.contact_n)
        }),
        ("Largest force on the handle, N", |run| {
            format!("{:.2}", run.figures.handle_n)
        }),
        ("Deepest penetration, µm", |run| {
            format!("{:.0}", run.figures.depth_um)
        }),
        ("Loop time: half, 99 %, all within", loop_time),
        ("Collision models (checksums)", |run| {
            let scenes: Vec<String> = run.scenes.iter().map(|crc| format!("{crc:08x}")).collect();
            scenes.join(" ")
        }),
    ];
    for (name, value) in rows {
        let _ = write!(page, "<tr><td>{name}</td>");
        for run in &runs {
            let _ = write!(page, "<td>{}</td>", value(run));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table>\n");
}

fn loop_time(run: &Run) -> String {
    let found = Signal::named("loop_cost").and_then(|signal| distribution(&run.history, signal, 1));
    found.map_or("none".to_owned(), |found| {
        found.quantiles.map(|value| format!("{value:.0}")).join(", ")
    })
}

/// A chart of the signals of one quantity over the time of the run.
fn chart(
    page: &mut String,
    quantity: Quantity,
    signals: &[&Signal],
    run: &Run,
    compared: Option<(&Run, f64)>,
) {
    let [wide, high] = CHART;
    let length_s = run.duration_s().max(1e-3);
    // Of the run, then of the other: signal, lines, whether dashed.
    let mut lines = Vec::new();
    for (index, signal) in signals.iter().enumerate() {
        for line in envelope(&run.history, signal, 0.0, length_s, wide as usize) {
            lines.push((index, line, false));
        }
        if let Some((other, shift_s)) = compared {
            for mut line in envelope(
                &other.history,
                signal,
                -shift_s,
                length_s - shift_s,
                wide as usize,
            ) {
                line.iter_mut().for_each(|point| point[0] += shift_s);
                lines.push((index, line, true));
            }
        }
    }
    let values = || {
        lines
            .iter()
            .flat_map(|(_, line, _)| line.iter().map(|point| point[1]))
    };
    let (mut low, mut most) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    if low > most {
        return;
    }
    if quantity.has_zero() {
        (low, most) = (low.min(0.0), most.max(0.0));
    }
    most = most.max(low + quantity.least_span());
    let unit = match quantity.unit() {
        "" => String::new(),
        unit => format!(", {unit}"),
    };
    let _ = write!(page, "<h2>{}{unit}</h2>\n<div>", quantity.name());
    for (signal, color) in signals.iter().zip(COLORS) {
        let _ = write!(
            page,
            "<span class=\"key\" style=\"color:{color}\">&#9632; {}</span>",
            escaped(signal.name)
        );
    }
    let [left, below] = LABELS;
    let _ = write!(
        page,
        "</div>\n<svg viewBox=\"0 0 {} {}\" width=\"100%\" role=\"img\" aria-label=\"{} over time\">",
        wide + left,
        high + below + 8.0,
        quantity.name()
    );
    let x = |time: f64| left + wide * time / length_s;
    let y = |value: f64| 8.0 + high * (most - value) / (most - low);
    for value in [low, 0.5 * (low + most), most] {
        let at = y(value);
        let _ = write!(
            page,
            "<line x1=\"{left}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#d5dbe3\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left + wide,
            left - 6.0,
            at + 4.0,
            label(value, most - low)
        );
    }
    for time in [0.0, 0.5 * length_s, length_s] {
        let _ = write!(
            page,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{} s</text>",
            x(time).min(left + wide - 16.0),
            high + below,
            label(time, length_s)
        );
    }
    for (index, line, dashed) in &lines {
        let dash = if *dashed {
            " stroke-dasharray=\"4 3\" opacity=\".75\""
        } else {
            ""
        };
        let _ = write!(
            page,
            "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"{dash} points=\"",
            COLORS[index % COLORS.len()]
        );
        for [time, value] in line {
            let at = x(*time).clamp(left, left + wide);
            let _ = write!(page, "{at:.1},{:.1} ", y(*value));
        }
        page.push_str("\"/>");
    }
    page.push_str("</svg>\n");
}

/// A number with as many digits as a span needs.
fn label(value: f64, span: f64) -> String {
    let digits = (2.0 - span.max(1e-9).log10()).clamp(0.0, 4.0) as usize;
    format!("{value:.digits$}")
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
        let (own, other) = (run("<a & b>.mcap", 300), run("b.mcap", 200));
        let page = html(&own, Some((&other, 0.5)));
        assert!(page.contains("<h1>&lt;a &amp; b&gt;.mcap</h1>") && page.contains("<th>b.mcap</th>"));
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
        let page = html(&run("none.mcap", 0), None);
        assert!(page.contains("<td>none</td>") && !page.contains("<svg"));
    }
}
