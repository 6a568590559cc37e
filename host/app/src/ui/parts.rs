//! The list of parts on the left: groups, the assembly as a tree, and a search in both. Under it the selected part, and what groups the selected ones.

use std::cell::Cell;

use egui::collapsing_header::CollapsingState;
use egui::{Align, Id, Layout, RichText, ScrollArea, TextEdit, Ui, Vec2};
use mortise_brep::Surface;

use super::part_line::{self, Listed};
use super::{control, motion, theme};
use crate::session::document::Document;
use crate::session::grouping::GroupIntent;
use crate::session::tree::{self, Branch};
use crate::session::{Intent, Session};
use crate::viewport::gesture::Viewpoint;

/// Height of the line on groups, points.
const GROUPING: f32 = 28.0;

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
    let found = (!search.trim().is_empty()).then(|| tree::found(&document.tree, &document.model, search));
    let shown = found.as_ref().unwrap_or(&document.tree);
    let order: Vec<usize> = shown.iter().flat_map(Branch::parts).collect();
    let listed = Listed {
        session,
        document,
        order: &order,
        marked: &view.marked.parts,
        over: view.over.before,
        pair: view.pair,
        under: &under,
    };
    let details = session.selected.filter(|&p| p < document.model.parts.len());
    let groups = |part: &usize| document.groups().of(*part).is_some() || session.selection().len() > 1;
    let groups = details.filter(groups);
    let room = match (details, groups) {
        (None, _) => 0.0,
        (Some(_), None) => 188.0 + fields.height(ui),
        (Some(_), Some(_)) => 188.0 + GROUPING + fields.height(ui),
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
                if groups.is_some() {
                    grouping(ui, session, document, wanted, part);
                }
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

fn branches(ui: &mut Ui, listed: Listed<'_>, wanted: &mut Vec<Intent>, branches: &[Branch], id: Id) {
    for (index, branch) in branches.iter().enumerate() {
        match branch {
            Branch::Part(part) => {
                let name = listed.document.part_name(*part);
                part_line::show(ui, listed, wanted, name, &[*part]);
            }
            Branch::Group { name, parts } => {
                let id = id.with(("group", parts));
                let first = listed.document.groups().first(parts[0]);
                // A search shows some of the parts; the line is of all.
                let all = listed.document.groups().together(first);
                CollapsingState::load_with_default_open(ui.ctx(), id, true)
                    .show_header(ui, |ui| part_line::show(ui, listed, wanted, name, &all))
                    .body(|ui| {
                        for &part in parts {
                            let name = listed.document.part_name(part);
                            part_line::show(ui, listed, wanted, name, &[part]);
                        }
                    });
            }
            Branch::Assembly { name, children } => {
                let id = id.with((index, name));
                CollapsingState::load_with_default_open(ui.ctx(), id, true)
                    .show_header(ui, |ui| {
                        part_line::assembly(ui, listed, wanted, name, &branch.parts());
                    })
                    .body(|ui| self::branches(ui, listed, wanted, children, id));
            }
        }
    }
}

/// What the selection is of a group, or could be: with the button that does it.
fn grouping(ui: &mut Ui, session: &Session, document: &Document, wanted: &mut Vec<Intent>, part: usize) {
    let selection = session.selection();
    let together = document.groups().together(part);
    let is_of_group = selection.iter().all(|part| together.contains(part));
    let (text, name, intent, hint) = match is_of_group {
        true => (
            format!("{} parts as one", together.len()),
            "Ungroup",
            GroupIntent::Ungroup(part),
            "Let every part of the group move by itself (Ctrl+Shift+G)",
        ),
        false => (
            format!("{} parts selected", selection.len()),
            "Group",
            GroupIntent::Group(selection),
            "Grab and move them as one, as they are to one another (Ctrl+G)",
        ),
    };
    ui.horizontal(|ui| {
        ui.label(RichText::new(text).color(theme::of(ui).text_strong));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let button = egui::Button::new(name);
            control::intent_button(ui, session, wanted, button, Intent::Group(intent), hint);
        });
    });
}

fn details(ui: &mut Ui, session: &Session, document: &Document, wanted: &mut Vec<Intent>, part: usize) {
    let is_group =
        document.groups().of(part).is_some() && session.selection() == document.groups().together(part);
    let (model, name) = match is_group {
        true => (&document.grouped.model, document.moving_name(part)),
        false => (&document.model, document.part_name(part)),
    };
    let shown = if is_group {
        document.groups().first(part)
    } else {
        part
    };
    let Some(shape) = model.shapes.get(model.parts[shown].shape) else {
        return;
    };
    ui.spacing_mut().item_spacing.y = 3.0;
    let name = RichText::new(name).color(theme::of(ui).text_strong);
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
    if session.is_held(part) {
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
