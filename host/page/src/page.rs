//! The page.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use glam::{DAffine3, DVec3};
use mortise_task::Assembly;
use mortise_task::report::{self, Sense, SequenceReport};
use mortise_task::sequence::{Sequence, Step};
use rayon::prelude::*;

use crate::picture::{Drawn, Picture, picture};

/// Size of a picture, pixels.
const SIZE: [usize; 2] = [380, 280];
/// Most steps with a picture: a page of 10 MB.
const MOST_PICTURES: usize = 100;
/// Least and most that a group is drawn out, over the radius of what is drawn: beyond the end of a short way, it is drawn on.
const OUT: [f64; 2] = [0.45, 1.2];
/// Points of a leg of a way.
const POINTS: usize = 16;
/// Colour of what moves, sRGB, and how far other parts' colours are from grey.
const MOVING: [f64; 3] = [0.96, 0.62, 0.25];
const CALM: f64 = 0.35;
const GREY: f64 = 0.78;
const STYLE: &str = "body{font:14px/1.5 system-ui,sans-serif;max-width:1240px;margin:2rem auto;padding:0 1rem;color:#1b2430}\
    h2{font-size:1rem;margin:1.6rem 0 .3rem}table{border-collapse:collapse}td,th{padding:.2rem .8rem;border-bottom:1px solid #d5dbe3;text-align:left}\
    td.n{text-align:right}.steps{display:grid;grid-template-columns:repeat(auto-fill,minmax(380px,1fr));gap:1rem}\
    figure{margin:0;border:1px solid #d5dbe3;border-radius:6px;overflow:hidden}figcaption{padding:.4rem .7rem}img{display:block;width:100%}\
    .stuck{color:#9a3412}";

/// The page of a sequence that was found for `assembly`, in the order of assembly, with its [`pictures()`]. `felt` has a sentence on how each step is felt,
/// or nothing.
pub fn page(
    title: &str,
    assembly: &Assembly,
    found: &Sequence,
    pictures: &[Picture],
    felt: &[String],
) -> String {
    let report = report::sequence(assembly, found, Sense::Assembly);
    let title = escaped(title);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head><body>\n\
         <h1>{title}</h1>\n<p><strong>{}</strong></p>\n",
        verdict(&report)
    );
    for stuck in &report.stuck {
        let _ = writeln!(page, "<p class=\"stuck\">{}</p>", escaped(&stuck.words()));
    }
    figures(&mut page, pictures, &report);
    table(&mut page, &report);
    if !felt.is_empty() {
        page.push_str("<h2>Put together by a simulated hand, with contact</h2>\n<ol>\n");
        for sentence in felt {
            let _ = writeln!(page, "<li>{}</li>", escaped(sentence));
        }
        page.push_str("</ol>\n");
    }
    if !report.pressed.is_empty() {
        page.push_str("<h2>Parts that overlap as placed in the file</h2>\n<table><tr><th>parts</th><th>depth, µm</th></tr>\n");
        for pressed in &report.pressed {
            let [a, b] = pressed.parts.map(escaped);
            let _ = writeln!(
                page,
                "<tr><td>{a}, {b}</td><td class=\"n\">{:.1}</td></tr>",
                pressed.overlap_um
            );
        }
        page.push_str("</table>\n");
    }
    let _ = write!(
        page,
        "<p>Found in {:.1} s by Mortise {}. Clearances are least distances of the exact surfaces on the way in.</p>\n</body></html>\n",
        report.time_s,
        env!("CARGO_PKG_VERSION")
    );
    page
}

fn verdict(report: &SequenceReport<'_>) -> String {
    let (count, parts) = (report.steps.len(), report.parts.len());
    match report.verdict {
        "assembles" if count == 1 => format!("{parts} parts, together in 1 step"),
        "assembles" => format!("{parts} parts, together in {count} steps"),
        "timed_out" => format!("{parts} parts: the time ended after {count} steps"),
        _ => format!("{parts} parts: they do not come apart completely; {count} steps were found"),
    }
}

/// A figure a step.
fn figures(page: &mut String, pictures: &[Picture], report: &SequenceReport<'_>) {
    if report.steps.is_empty() {
        return;
    }
    if pictures.is_empty() {
        let _ = writeln!(page, "<p>Without pictures: more than {MOST_PICTURES} steps.</p>");
        return;
    }
    let figures: Vec<String> = (pictures.par_iter().zip(&report.steps))
        .map(|(picture, words)| {
            let data = BASE64_STANDARD.encode(png(picture));
            let words = escaped(&format!("{}. {}", words.step, words.words()));
            format!("<figure><img alt=\"{words}\" src=\"data:image/png;base64,{data}\"><figcaption>{words}</figcaption></figure>\n")
        })
        .collect();
    let _ = write!(
        page,
        "<h2>Steps</h2>\n<div class=\"steps\">\n{}</div>\n",
        figures.concat()
    );
}

/// A picture of each step, in the order of assembly; none where there are more than 100 steps.
///
/// Cost: on all cores, some milliseconds for 10,000 triangles of a picture.
pub fn pictures(assembly: &Assembly, found: &Sequence) -> Vec<Picture> {
    if found.steps.len() > MOST_PICTURES {
        return Vec::new();
    }
    let steps = found.steps.par_iter().rev();
    steps.map(|step| step_picture(assembly, step)).collect()
}

/// The parts that are on before a step, and the group beside its place with its way in.
fn step_picture(assembly: &Assembly, step: &Step) -> Picture {
    let all: Vec<usize> = [&step.onto[..], &step.group[..]].concat();
    let (low, high) = assembly.bounds_of(&all, DAffine3::IDENTITY);
    let (own_low, own_high) = assembly.bounds_of(&step.group, DAffine3::IDENTITY);
    let middle = (own_low + own_high) / 2.0;
    let [least, most] = OUT.map(|share| share * 0.5 * low.distance(high));
    // The way out, as far as it is drawn.
    let (mut by, mut way, mut travel) = (DAffine3::IDENTITY, vec![middle], 0.0);
    'legs: for leg in &step.path.legs {
        let start = by;
        for i in 1..=POINTS {
            let next = leg.at(i as f64 / POINTS as f64) * start;
            let at = next.transform_point3(middle);
            travel += way.last().map_or(0.0, |last| last.distance(at));
            way.push(at);
            by = next;
            if travel > most {
                break 'legs;
            }
        }
    }
    let last = step.path.legs.last().map_or(DVec3::ZERO, |leg| leg.slide);
    let beyond = last.normalize_or_zero() * (least - travel).max(0.0);
    by = DAffine3::from_translation(beyond) * by;
    way.push(by.transform_point3(middle));
    let part = |&part: &usize, by: DAffine3, moves: bool| {
        let of = &assembly.model.parts[part];
        Drawn {
            shape: &assembly.model.shapes[of.shape],
            pose: by * assembly.placement(part),
            color: if moves { MOVING } else { calmed(of.color) },
        }
    };
    let stay = step.onto.iter().map(|p| part(p, DAffine3::IDENTITY, false));
    let drawn: Vec<Drawn<'_>> = stay.chain(step.group.iter().map(|p| part(p, by, true))).collect();
    picture(&drawn, &way, SIZE)
}

/// A part's colour (linear, if the file gives one) as sRGB near grey, so that what moves stands out.
fn calmed(color: Option<[f32; 3]>) -> [f64; 3] {
    let Some(color) = color else { return [GREY; 3] };
    color.map(|c| GREY + CALM * (f64::from(c).clamp(0.0, 1.0).powf(1.0 / 2.2) - GREY))
}

/// A picture as a PNG file.
fn png(picture: &Picture) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, picture.width as u32, picture.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let written = (encoder.write_header()).and_then(|mut writer| writer.write_image_data(&picture.rgb));
    // Memory takes all that is written.
    written.map_or_else(|_| Vec::new(), |()| file)
}

fn table(page: &mut String, report: &SequenceReport<'_>) {
    page.push_str(
        "<h2>Clearances</h2>\n<table><tr><th>step</th><th>moves</th><th>from</th><th>legs</th><th>clearance, µm</th><th>overlap, µm</th><th>nearest</th></tr>\n",
    );
    let number = |value: Option<f64>| value.map_or(String::new(), |um| format!("{um:.1}"));
    for step in &report.steps {
        let nearest = step
            .nearest
            .map_or(String::new(), |pair| escaped(&pair.join(", ")));
        let _ = writeln!(
            page,
            "<tr><td class=\"n\">{}</td><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{nearest}</td></tr>",
            step.step,
            escaped(&step.moving.join(", ")),
            step.way(),
            step.legs,
            number(step.clearance_um),
            number(step.overlap_um.filter(|um| *um > 0.0)),
        );
    }
    page.push_str("</table>\n");
}

/// Text that HTML takes as it is.
pub fn escaped(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '&' => "&amp;".into(),
            '<' => "&lt;".into(),
            '>' => "&gt;".into(),
            '"' => "&quot;".into(),
            c => String::from(c),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_of_names_is_text() {
        assert_eq!(escaped("a<b>&\"c\""), "a&lt;b&gt;&amp;&quot;c&quot;");
    }

    #[test]
    fn colours_are_near_grey() {
        for color in [None, Some([1.0, 0.0, 0.0]), Some([f32::NAN, -1.0, 9.0])] {
            let calm = calmed(color);
            let far = calm.map(|c| (c - GREY).abs());
            assert!(far.iter().all(|d| d.is_nan() || *d <= CALM), "{calm:?}");
        }
        assert!(calmed(Some([1.0, 0.0, 0.0]))[0] > GREY);
    }
}
