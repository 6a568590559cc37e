//! The measuring tool in the view: its button, what is picked and measured beside the view's bars, and the marks over the parts.

mod overlay;
mod words;

use std::sync::Arc;

use egui::{Area, Grid, Id, Order, Pos2, Rect, RichText, ScrollArea, Ui, Vec2};

use self::words::Line;
use super::{control, theme};
use crate::session::clearances;
use crate::session::document::Document;
use crate::viewport::gesture::Viewpoint;
use crate::viewport::measure::Measure;
use crate::viewport::snap::Wanted;

/// Width of the panel, points.
const WIDTH: f32 = 272.0;

/// What a click can pick: name and hint.
const KINDS: [(Wanted, &str, &str); 5] = [
    (
        Wanted::Anything,
        "Any",
        "The vertex, axis or edge near the pointer, or else the face",
    ),
    (
        Wanted::Point,
        "Point",
        "A vertex, or the centre of a circle or sphere",
    ),
    (Wanted::Edge, "Edge", "An edge"),
    (Wanted::Axis, "Axis", "The axis of a hole, shaft, cone or circle"),
    (Wanted::Face, "Face", "A face"),
];

/// Draws the button that switches the tool on and off.
pub fn toggle(ui: &mut Ui, view: &mut Viewpoint) {
    let button = control::flat(ui, "Measure", view.measure.on);
    let hint = "Measure vertices, edges, axes and faces, and what is between two of them (D)";
    if ui.add(button).on_hover_text(hint).clicked() {
        view.measure.toggle();
    }
}

/// Brings the measurement up to date and draws it: marks in `rect`, and a panel below the bars, which end at `top`. Returns the lower end of all.
pub fn show(ui: &mut Ui, rect: Rect, top: f32, document: &Document, view: &mut Viewpoint) -> f32 {
    if let Some(after) = view.measure.follow(document) {
        ui.ctx().request_repaint_after(after);
    }
    if !view.measure.on {
        return top;
    }
    overlay::show(ui, rect, document, view);
    let place = Pos2::new(rect.left() + 12.0, top + 6.0);
    let drawn = Area::new(Id::unique("measure"))
        .fixed_pos(place)
        .constrain_to(rect)
        .order(Order::Middle)
        .show(ui.ctx(), |ui| {
            theme::card(theme::of(ui)).show(ui, |ui| {
                ui.set_width(WIDTH.min(rect.width() - 60.0).max(80.0));
                let high = (rect.bottom() - place.y - 60.0).max(40.0);
                ScrollArea::vertical()
                    .max_height(high)
                    // An area offers the height that it had before, not that it may have.
                    .min_scrolled_height(high)
                    .show(ui, |ui| panel(ui, document, &mut view.measure));
            });
        });
    drawn.response.rect.bottom()
}

fn panel(ui: &mut Ui, document: &Document, measure: &mut Measure) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        ui.spacing_mut().button_padding = Vec2::new(7.0, 3.0);
        for (wanted, name, hint) in KINDS {
            let response = ui
                .add(control::flat(ui, name, measure.wanted == wanted))
                .accessible_name(format!("Pick {}", name.to_lowercase()))
                .on_hover_text(hint);
            if response.clicked() {
                measure.wanted = wanted;
            }
        }
    });
    let sections = sections(document, measure);
    for (index, (heading, lines)) in sections.iter().enumerate() {
        ui.add_space(2.0);
        let ink = theme::of(ui);
        ui.label(RichText::new(heading).size(12.5).color(ink.text_strong));
        Grid::new(("measured", index))
            .num_columns(2)
            .spacing([12.0, 2.0])
            .show(ui, |ui| {
                ui.spacing_mut().interact_size.y = 18.0;
                for line in lines {
                    ui.label(RichText::new(line.name).size(12.5).color(ink.text_weak));
                    ui.label(RichText::new(&line.value).size(12.5).color(ink.text));
                    ui.end_row();
                }
            });
    }
    let hint = match measure.picked().len() {
        0 => "Click a vertex, edge, axis or face",
        1 => "Click another one for what is between them",
        _ => "",
    };
    if !hint.is_empty() {
        let weak = theme::of(ui).text_weak;
        ui.label(RichText::new(hint).size(12.0).color(weak));
    }
    if !sections.is_empty() {
        buttons(ui, document, measure, &sections);
    }
}

/// What is picked and measured: headings, each with its lines.
fn sections(document: &Document, measure: &Measure) -> Vec<(String, Vec<Line>)> {
    let measured = measure.measured();
    let each = measure.picked().iter().zip(&measured.about);
    let mut sections: Vec<(String, Vec<Line>)> = each
        .map(|(picked, about)| {
            let heading = format!("{} of {}", words::kind(about), document.part_name(picked.part));
            (heading, words::one(about))
        })
        .collect();
    if let Some(found) = &measured.between {
        sections.push(("Between them".to_owned(), words::two(found)));
    }
    if let Some(line) = gap(document, measure) {
        sections.push(("The two parts".to_owned(), vec![line]));
    }
    sections
}

/// The two parts of the picked features, if they are two.
fn parts(measure: &Measure) -> Option<[usize; 2]> {
    let [a, b] = measure.picked() else { return None };
    (a.part != b.part).then(|| [a.part.min(b.part), a.part.max(b.part)])
}

/// The least gap of the two parts, where it is known for where they are.
fn gap(document: &Document, measure: &Measure) -> Option<Line> {
    let found = measure.gap.found(document)?;
    let pair = found
        .pairs
        .iter()
        .find(|pair| Some(pair.parts) == parts(measure))?;
    let value = if measure.gap.is_outdated(document) {
        "Parts have moved since".to_owned()
    } else if pair.clashes() {
        format!("overlap {}", words::mm(-pair.distance_mm))
    } else {
        words::mm(pair.distance_mm)
    };
    Some(Line {
        name: "Least gap",
        value,
    })
}

fn buttons(ui: &mut Ui, document: &Document, measure: &mut Measure, sections: &[(String, Vec<Line>)]) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().button_padding = Vec2::new(8.0, 3.0);
        let copy = ui
            .add(control::flat(ui, "Copy", false))
            .accessible_name("Copy measurement")
            .on_hover_text("Copy all of it as text");
        if copy.clicked() {
            ui.ctx().copy_text(text(sections));
        }
        let clear = ui
            .add(control::flat(ui, "Clear", false))
            .accessible_name("Clear measurement")
            .on_hover_text("Pick nothing any more (Backspace; Esc without a rig)");
        if clear.clicked() {
            measure.clear();
        }
        if let Some(parts) = parts(measure) {
            let response = ui
                .add_enabled(!measure.gap.is_busy(), control::flat(ui, "Gap of parts", false))
                .on_hover_text(
                    "The least gap of the two whole parts, or their deepest overlap, by exact distances",
                );
            if response.clicked() {
                let ctx = ui.ctx().clone();
                measure
                    .gap
                    .between(document, parts, Arc::new(move || ctx.request_repaint()));
            }
        }
        if measure.gap.is_busy() {
            ui.add(egui::Spinner::new().size(14.0));
        }
    });
    if measure.gap.has_failed() {
        ui.label(RichText::new(clearances::FAILED).color(theme::of(ui).fault_text));
    }
}

/// All as text: headings, and lines of name, tabulator and value.
fn text(sections: &[(String, Vec<Line>)]) -> String {
    let section = |(heading, lines): &(String, Vec<Line>)| {
        let lines = lines
            .iter()
            .map(|line| format!("{}\t{}\n", line.name, line.value));
        format!("{heading}\n{}", lines.collect::<String>())
    };
    sections.iter().map(section).collect::<Vec<_>>().join("\n")
}
