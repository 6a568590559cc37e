//! The list of parts on the left: the assembly as a tree, and a search in it. A click selects a part, a double click grabs it, the eye hides it.

use std::cell::Cell;

use egui::collapsing_header::CollapsingState;
use egui::{
    Align, Color32, CornerRadius, Id, Layout, RichText, Role, ScrollArea, Sense, TextEdit, Ui, Vec2,
    WidgetInfo,
};
use mortise_brep::Surface;

use super::{control, eye, motion, theme};
use crate::session::document::Document;
use crate::session::tree::{self, Branch};
use crate::session::{Intent, Session, obstacle};
use crate::viewport::gesture::Viewpoint;

/// Draws the list.
pub fn show(
    ui: &mut Ui,
    session: &Session,
    view: &mut Viewpoint,
    fields: &mut motion::Fields,
    search: &mut String,
    wanted: &mut Vec<Intent>,
) {
    ui.take_available_width();
    heading(ui, session, wanted);
    ui.add_space(4.0);
    let Some(document) = &session.document else {
        ui.label(RichText::new("Nothing is open").color(theme::of(ui).text_weak));
        return;
    };
    field(ui, search);
    let under = Cell::new(None);
    let listed = Listed {
        session,
        document,
        marked: &view.marked.parts,
        over: view.over.before,
        pair: view.pair,
        under: &under,
    };
    let found = (!search.trim().is_empty()).then(|| tree::found(&document.tree, &document.model, search));
    let details = session.selected.filter(|&p| p < document.model.parts.len());
    let room = if details.is_some() {
        188.0 + fields.height(ui)
    } else {
        0.0
    };
    ScrollArea::vertical()
        .id_salt("tree")
        .auto_shrink([false, false])
        .max_height((ui.available_height() - room).max(80.0))
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 2.0;
            match &found {
                None => branches(ui, listed, wanted, &document.tree, Id::unique("parts")),
                Some(found) if found.is_empty() => {
                    ui.label(RichText::new("No part has this name").color(theme::of(ui).text_weak));
                }
                // Subassemblies are open, whichever are folded in the whole tree.
                Some(found) => branches(ui, listed, wanted, found, Id::unique("found parts")),
            }
        });
    view.over.now = under.get().or(view.over.now);
    if let Some(part) = details {
        control::divider(ui);
        // Where the sections below are open there may be less room than they take.
        ScrollArea::vertical()
            .id_salt("details")
            .auto_shrink([false, true])
            .max_height(ui.available_height())
            .show(ui, |ui| {
                self::details(ui, session, document, wanted, part);
                ui.add_space(2.0);
                motion::show(ui, session, view, fields, wanted, part);
            });
    }
}

/// The heading, and the way back to all parts while some are hidden.
fn heading(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    ui.horizontal(|ui| {
        control::section(ui, "Parts");
        let hidden = session.document.as_ref().map_or(&[][..], |d| &d.hidden);
        let hidden = hidden.iter().filter(|hidden| **hidden).count();
        if hidden == 0 {
            return;
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let button = egui::Button::new(RichText::new("Show all").small());
            let hint = format!("{hidden} hidden (Shift+H)");
            control::intent_button(ui, session, wanted, button, Intent::ShowAll, &hint);
        });
    });
}

/// The field for a search.
fn field(ui: &mut Ui, search: &mut String) {
    ui.horizontal(|ui| {
        let clear = if search.is_empty() { 0.0 } else { 26.0 };
        let edit = TextEdit::singleline(search)
            .hint_text("Search")
            .desired_width((ui.available_width() - clear - 12.0).max(40.0));
        let response = ui
            .add(edit)
            .on_hover_text("Parts and subassemblies by words of their names");
        response.accessible_name("Search parts");
        if clear > 0.0
            && ui
                .add(egui::Button::new("×").frame(false))
                .accessible_name("Clear search")
                .clicked()
        {
            search.clear();
        }
    });
    ui.add_space(4.0);
}

/// What lines are drawn of.
#[derive(Clone, Copy)]
struct Listed<'a> {
    session: &'a Session,
    document: &'a Document,
    /// Parts that are pointed out.
    marked: &'a [usize],
    /// The part under the pointer in the frame before.
    over: Option<usize>,
    /// The parts of the connection under the pointer.
    pair: Option<[usize; 2]>,
    /// The part whose line is under the pointer.
    under: &'a Cell<Option<usize>>,
}

fn branches(ui: &mut Ui, listed: Listed<'_>, wanted: &mut Vec<Intent>, branches: &[Branch], id: Id) {
    for (index, branch) in branches.iter().enumerate() {
        match branch {
            Branch::Part(part) => line(ui, listed, wanted, *part),
            Branch::Assembly { name, children } => {
                let id = id.with((index, name));
                CollapsingState::load_with_default_open(ui.ctx(), id, true)
                    .show_header(ui, |ui| {
                        ui.add(
                            egui::Label::new(RichText::new(name).color(theme::of(ui).text_weak)).truncate(),
                        );
                    })
                    .body(|ui| self::branches(ui, listed, wanted, children, id));
            }
        }
    }
}

fn line(ui: &mut Ui, listed: Listed<'_>, wanted: &mut Vec<Intent>, part: usize) {
    let Listed {
        session,
        document,
        marked,
        over,
        pair,
        under,
    } = listed;
    let pointed = over == Some(part) || pair.is_some_and(|pair| pair.contains(&part));
    let (name, color) = (document.part_name(part), document.colors[part]);
    let (selected, held) = (session.selected == Some(part), session.grabbed() == Some(part));
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 28.0), Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, selected, name));
    let painter = ui.painter_at(rect);
    if response.hovered() {
        under.set(Some(part));
    }
    let fill = match (held, selected, response.hovered() || pointed) {
        (true, ..) => theme::of(ui).held.gamma_multiply(0.22),
        (_, true, _) => theme::of(ui).accent_dim.gamma_multiply(0.8),
        _ if marked.contains(&part) => theme::of(ui).accent_dim.gamma_multiply(0.5),
        (_, _, true) => theme::of(ui).card,
        _ => Color32::TRANSPARENT,
    };
    painter.rect_filled(rect, CornerRadius::same(6), fill);
    let swatch = egui::Rect::from_center_size(rect.left_center() + Vec2::new(15.0, 0.0), Vec2::splat(12.0));
    let [r, g, b] = color;
    painter.rect_filled(swatch, CornerRadius::same(3), Color32::from_rgb(r, g, b));
    let note = if held {
        Some(("held", theme::of(ui).held))
    } else if document.baked.is_some() && !document.is_grabbable(part) {
        Some(("fixed", theme::of(ui).text_weak))
    } else {
        None
    };
    let mut right = rect.right() - eye::WIDTH;
    if let Some((note, color)) = note {
        let drawn = painter.text(
            egui::Pos2::new(right, rect.center().y),
            egui::Align2::RIGHT_CENTER,
            note,
            egui::FontId::proportional(11.5),
            color,
        );
        right = drawn.left() - 8.0;
    }
    let ink = match document.is_hidden(part) {
        true => theme::of(ui).text_weak,
        false => theme::of(ui).text_strong,
    };
    let mut job = egui::text::LayoutJob::single_section(
        name.to_owned(),
        egui::TextFormat::simple(egui::FontId::proportional(13.5), ink),
    );
    job.wrap = egui::text::TextWrapping::truncate_at_width((right - swatch.right() - 8.0).max(10.0));
    let galley = painter.layout_job(job);
    let at = egui::Pos2::new(swatch.right() + 8.0, rect.center().y - 0.5 * galley.size().y);
    painter.galley(at, galley, ink);
    eye::show(ui, session, rect, response.hovered(), part, wanted);
    if response.clicked() {
        wanted.push(Intent::Select(Some(part)));
    }
    if response.double_clicked() {
        wanted.push(Intent::Grab(part));
    }
    response.on_hover_ui(|ui| {
        ui.label(name);
        let hint = obstacle(session, &Intent::Grab(part)).unwrap_or_else(|| "Double click to grab".into());
        ui.label(RichText::new(hint).small().color(theme::of(ui).text_weak));
    });
}

fn details(ui: &mut Ui, session: &Session, document: &Document, wanted: &mut Vec<Intent>, part: usize) {
    let Some(shape) = document.model.shapes.get(document.model.parts[part].shape) else {
        return;
    };
    ui.spacing_mut().item_spacing.y = 3.0;
    let name = RichText::new(document.part_name(part)).color(theme::of(ui).text_strong);
    ui.add(egui::Label::new(name).truncate());
    control::row(ui, "Faces", shape.faces.len().to_string());
    let exact = shape
        .faces
        .iter()
        .filter(|f| !matches!(f.surface, Surface::Spline))
        .count();
    control::row(ui, "in closed form", exact.to_string());
    control::row(ui, "Volume", format!("{} mm³", grouped(shape.volume_mm3)));
    let closed = if shape.closed {
        "closed".to_owned()
    } else {
        format!("{} open edges", shape.open_edges)
    };
    control::row(ui, "Shell", closed);
    ui.add_space(4.0);
    ui.vertical_centered_justified(|ui| grab(ui, session, wanted, part));
}

fn grab(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, part: usize) {
    let wide = Vec2::new(0.0, 30.0);
    if session.grabbed() == Some(part) {
        let button = egui::Button::new("Release").min_size(wide);
        control::intent_button(
            ui,
            session,
            wanted,
            button,
            Intent::Release,
            "The part stays where it is",
        );
    } else {
        let button = control::primary(ui, "Grab").min_size(wide);
        control::intent_button(
            ui,
            session,
            wanted,
            button,
            Intent::Grab(part),
            "Couple the handle to this part at their present positions",
        );
    }
}

/// A number with its digits in groups of three.
fn grouped(value: f64) -> String {
    let digits = format!("{:.0}", value.abs());
    let mut text = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{a0}');
        }
        text.push(c);
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn thousands_are_set_apart() {
        assert_eq!(super::grouped(88_955.4), "88\u{a0}955");
        assert_eq!(super::grouped(12.0), "12");
        assert_eq!(super::grouped(1_000_000.0), "1\u{a0}000\u{a0}000");
    }
}
