//! Charts of signals over time as SVG, of recorded runs beside each other or of what the plots show. Pure.

use std::fmt::Write as _;

use mortise_page::escaped;

use super::history::{History, Line, Quantity, Signal, envelope};
use super::runs::{MOST_RUNS, Playback};

/// Size of the part of a chart that has lines, pixels.
const SIZE: [f64; 2] = [860.0, 180.0];
/// Space for the labels of a chart: left and below.
const LABELS: [f64; 2] = [64.0, 22.0];
/// Space above the lines, without and with a heading.
const ABOVE: [f64; 2] = [8.0, 26.0];
/// Colours of the signals of a chart.
const COLORS: [&str; 4] = ["#1f6fc4", "#c2571a", "#2c8a4b", "#8a4bb0"];
/// Dashes of runs, by their place among all.
const DASHES: [&str; MOST_RUNS] = ["4 6", "1.5 4", "10 10", "1.5 8", "18 12", "2 3"];

/// Traces as they were when they were exported, in each form in which they can be written.
pub struct TracesFile {
    /// A table of comma-separated values.
    pub csv: String,
    /// A picture.
    pub svg: String,
}

/// A line of a chart.
struct Drawn {
    signal: usize,
    /// Place of its run among all; `None`: the chosen run, or what is live.
    run: Option<usize>,
    points: Line,
}

/// A chart: the signals of one quantity from one time to another.
pub struct Chart<'s> {
    quantity: Quantity,
    signals: Vec<&'s Signal>,
    range_s: [f64; 2],
    lines: Vec<Drawn>,
}

/// A chart for each quantity that one of the signals has; those without a value are left out.
pub fn charts<'s>(
    history: &History,
    playback: Option<&Playback>,
    signals: &[&'s Signal],
    range_s: [f64; 2],
) -> Vec<Chart<'s>> {
    let chart = |quantity: &Quantity| {
        let of = signals
            .iter()
            .copied()
            .filter(|signal| signal.quantity == *quantity);
        Chart::new(history, playback, *quantity, of.collect(), range_s)
    };
    Quantity::ALL
        .iter()
        .map(chart)
        .filter(|chart| !chart.lines.is_empty())
        .collect()
}

/// The lines of a signal of the other runs that are drawn, with their place among all, aligned by the first touch.
pub fn beside(
    playback: &Playback,
    signal: &Signal,
    [from, to]: [f64; 2],
    columns: usize,
) -> Vec<(usize, Line)> {
    let mut all = Vec::new();
    for (index, run, shift_s) in playback.others() {
        let lines = envelope(&run.history, signal, from - shift_s, to - shift_s, columns);
        all.extend(lines.into_iter().map(|mut line| {
            line.iter_mut().for_each(|[time, _]| *time += shift_s);
            (index, line)
        }));
    }
    all
}

/// Charts below each other as one picture, which needs no other file.
pub fn picture(charts: &[Chart<'_>]) -> String {
    let high = ABOVE[1] + SIZE[1] + LABELS[1] + 8.0;
    let [width, height] = [SIZE[0] + LABELS[0], high * charts.len() as f64];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\">\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
    );
    for (index, chart) in charts.iter().enumerate() {
        let _ = write!(svg, "<g transform=\"translate(0 {})\">", high * index as f64);
        chart.heading(&mut svg);
        chart.body(&mut svg, ABOVE[1]);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

impl<'s> Chart<'s> {
    fn new(
        history: &History,
        playback: Option<&Playback>,
        quantity: Quantity,
        signals: Vec<&'s Signal>,
        range_s: [f64; 2],
    ) -> Self {
        let [from, to] = range_s;
        let columns = SIZE[0] as usize;
        let mut lines = Vec::new();
        for (place, signal) in signals.iter().enumerate() {
            let drawn = |run, points| Drawn {
                signal: place,
                run,
                points,
            };
            let own = envelope(history, signal, from, to, columns);
            lines.extend(own.into_iter().map(|points| drawn(None, points)));
            let others = playback.map(|playback| beside(playback, signal, range_s, columns));
            let others = others.into_iter().flatten();
            lines.extend(others.map(|(run, points)| drawn(Some(run), points)));
        }
        Self {
            quantity,
            signals,
            range_s,
            lines,
        }
    }

    /// Title and the names of the signals, as elements of a page (HTML), and the chart.
    pub fn html(&self, page: &mut String) {
        let _ = write!(page, "<h2>{}</h2>\n<div>", self.title());
        for (color, name) in self.names() {
            let _ = write!(
                page,
                "<span class=\"key\" style=\"color:{color}\">&#9632; {name}</span>"
            );
        }
        let [width, height] = [SIZE[0] + LABELS[0], ABOVE[0] + SIZE[1] + LABELS[1]];
        let _ = write!(
            page,
            "</div>\n<svg viewBox=\"0 0 {width} {height}\" width=\"100%\" role=\"img\" aria-label=\"{} over time\">",
            self.quantity.name()
        );
        self.body(page, ABOVE[0]);
        page.push_str("</svg>\n");
    }

    fn title(&self) -> String {
        match self.quantity.unit() {
            "" => self.quantity.name().to_owned(),
            unit => format!("{}, {unit}", self.quantity.name()),
        }
    }

    /// Colour and name of each signal.
    fn names(&self) -> impl Iterator<Item = (&'static str, String)> {
        let colors = COLORS.iter().copied().cycle();
        colors.zip(self.signals.iter().map(|signal| escaped(signal.name)))
    }

    /// Title and names in one line of the picture.
    fn heading(&self, svg: &mut String) {
        let at = format!("x=\"{}\" y=\"18\" font-family=\"sans-serif\"", LABELS[0]);
        let _ = write!(svg, "<text {at} font-size=\"13\"><tspan>{}</tspan>", self.title());
        for (color, name) in self.names() {
            let _ = write!(
                svg,
                "<tspan dx=\"16\" font-size=\"11\" fill=\"{color}\">&#9632; {name}</tspan>"
            );
        }
        svg.push_str("</text>");
    }

    /// Lowest and highest value of the scale.
    fn scale(&self) -> [f64; 2] {
        let values = || (self.lines.iter()).flat_map(|line| line.points.iter().map(|point| point[1]));
        let mut low = values().fold(f64::INFINITY, f64::min);
        let mut high = values().fold(f64::NEG_INFINITY, f64::max);
        if self.quantity.has_zero() {
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        [low, high.max(low + self.quantity.least_span())]
    }

    /// Lines, marks and labels; the lines begin `above` pixels below the top.
    fn body(&self, svg: &mut String, above: f64) {
        let ([wide, high], [left, below]) = (SIZE, LABELS);
        let ([low, most], [from, to]) = (self.scale(), self.range_s);
        let length_s = (to - from).max(1e-3);
        let x = |time: f64| left + (wide * (time - from) / length_s).clamp(0.0, wide);
        let y = |value: f64| above + high * (most - value) / (most - low);
        let font = "font-family=\"sans-serif\" font-size=\"11\" fill=\"#566274\"";
        for value in [low, 0.5 * (low + most), most] {
            let at = y(value);
            let _ = write!(
                svg,
                "<line x1=\"{left}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#d5dbe3\"/><text {font} x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left + wide,
                left - 6.0,
                at + 4.0,
                label(value, most - low)
            );
        }
        for time in [from, from + 0.5 * length_s, to] {
            let _ = write!(
                svg,
                "<text {font} x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{} s</text>",
                x(time).min(left + wide - 16.0),
                above + high + below - 8.0,
                label(time, length_s)
            );
        }
        for line in &self.lines {
            let dash = line.run.map(|run| DASHES[run % DASHES.len()]);
            let dash = dash.map_or(String::new(), |dash| {
                format!(" stroke-dasharray=\"{dash}\" opacity=\".75\"")
            });
            let color = COLORS[line.signal % COLORS.len()];
            let _ = write!(
                svg,
                "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"1.2\"{dash} points=\""
            );
            for [time, value] in &line.points {
                let _ = write!(svg, "{:.1},{:.1} ", x(*time), y(*value));
            }
            svg.push_str("\"/>");
        }
    }
}

/// A number with as many digits as a span needs.
fn label(value: f64, span: f64) -> String {
    let digits = (2.0 - span.max(1e-9).log10()).clamp(0.0, 4.0) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::super::history::Sample;
    use super::super::run::Run;
    use super::*;

    fn run(touch_s: f64) -> Run {
        let sample = |i: usize| Sample {
            time_s: 0.01 * i as f64,
            contact_n: if 0.01 * i as f64 >= touch_s { 2.0 } else { 0.0 },
            ..Sample::default()
        };
        let mut run = Run::of("a.mcap", (0..200).map(sample));
        run.touch_s = Some(touch_s);
        run
    }

    #[test]
    fn runs_beside_the_chosen_one_rise_where_it_rises() {
        let mut playback = Playback::new(run(0.8), false);
        playback.push(run(0.3), false);
        let signal = Signal::named("contact_force_n").expect("a signal");
        let lines = beside(&playback, signal, [0.0, 2.0], 500);
        let rises: Vec<f64> = (lines.iter())
            .filter_map(|(_, line)| Some(line.iter().find(|point| point[1] > 0.0)?[0]))
            .collect();
        assert_eq!(lines[0].0, 1);
        assert!((rises[0] - 0.8).abs() < 0.011, "{rises:?}");
    }

    #[test]
    fn a_picture_has_a_chart_for_each_quantity_that_has_values() {
        let playback = Playback::new(run(0.5), false);
        let keys = ["contact_force_n", "handle_force_n", "points"];
        let chosen = keys.map(|key| Signal::named(key).expect("a signal"));
        let charts = charts(&playback.run().history, Some(&playback), &chosen, [0.0, 2.0]);
        let svg = picture(&charts);
        assert_eq!(svg.matches("<g ").count(), charts.len());
        assert_eq!(charts.len(), 2, "force and number");
        assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count());
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(picture(&[]).ends_with("</svg>\n"), "no signal has values");
    }
}
