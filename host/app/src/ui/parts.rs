//! The list of parts on the left: groups, the assembly as a tree, and a search in both. Under it the selected part, and what groups the selected ones.

use std::cell::Cell;

use egui::collapsing_header::CollapsingState;
use egui::{Align, Id, Layout, RichText, ScrollArea, TextEdit, Ui, Vec2};
use mortise_brep::{Shape, Surface};

use super::part_line::{self, Listed};
use super::{control, motion, theme};
use crate::session::document::Document;
use crate::session::grouping::GroupIntent;
use crate::session::groups::Group;
use crate::session::tree::{self, Branch};
use crate::session::{Intent, Session};
use crate::viewport::gesture::Viewpoint;

/// Height of what is known of a part and its buttons, points.
const DETAILS: f32 = 218.0;
/// By how much a name with a button beside it is higher than one without, points.
const UNGROUP: f32 = 12.0;
/// Distance of the parts of a group from the left, points.
const INDENT: f32 = 34.0;

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
    let room = match details {
        None => 0.0,
        Some(part) if document.groups().of(part).is_some() => DETAILS + UNGROUP + fields.height(ui),
        Some(_) => DETAILS + fields.height(ui),
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
                    .body_unindented(|ui| members(ui, listed, wanted, parts));
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

/// The lines of the parts of a group.
fn members(ui: &mut Ui, listed: Listed<'_>, wanted: &mut Vec<Intent>, parts: &[usize]) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 0.0;
        ui.add_space(INDENT);
        ui.vertical(|ui| {
            for &part in parts {
                let name = listed.document.part_name(part);
                part_line::show(ui, listed, wanted, name, &[part]);
            }
        });
    });
}

/// What details are shown of: the selected part, its group where all of that is selected, or several parts.
enum Subject<'a> {
    Part,
    Group(&'a Group),
    Several(Vec<usize>),
}

impl<'a> Subject<'a> {
    fn of(session: &Session, document: &'a Document, part: usize) -> Self {
        let selection = session.selection();
        match document.groups().of(part) {
            Some(group) if selection == group.parts() => Self::Group(group),
            _ if selection.len() > 1 => Self::Several(selection),
            _ => Self::Part,
        }
    }
}

fn details(ui: &mut Ui, session: &Session, document: &Document, wanted: &mut Vec<Intent>, part: usize) {
    let subject = Subject::of(session, document, part);
    let (name, parts) = match &subject {
        Subject::Part => (document.part_name(part).to_owned(), vec![part]),
        Subject::Group(group) => (group.name.clone(), group.parts().to_vec()),
        Subject::Several(parts) => (format!("{} parts selected", parts.len()), parts.clone()),
    };
    ui.spacing_mut().item_spacing.y = 3.0;
    heading_of(ui, session, document, wanted, &name, part);
    let model = &document.model;
    let shapes: Vec<&Shape> = (parts.iter())
        .filter_map(|&part| model.shapes.get(model.parts.get(part)?.shape))
        .collect();
    let faces = || shapes.iter().flat_map(|shape| &shape.faces);
    let exact = faces().filter(|face| !matches!(face.surface, Surface::Spline));
    let volume: f64 = shapes.iter().map(|shape| shape.volume_mm3).sum();
    control::row(ui, "Faces", faces().count().to_string());
    control::row(ui, "in closed form", exact.count().to_string());
    control::row(ui, "Volume", format!("{} mm³", grouped(volume)));
    let open: usize = shapes.iter().map(|shape| shape.open_edges).sum();
    let closed = match shapes.iter().all(|shape| shape.closed) {
        true => "closed".to_owned(),
        false => format!("{open} open edges"),
    };
    control::row(ui, "Shell", closed);
    ui.add_space(4.0);
    ui.vertical_centered_justified(|ui| match subject {
        Subject::Several(parts) => group(ui, session, wanted, parts),
        Subject::Part | Subject::Group(_) => grab(ui, session, document, wanted, part),
    });
}

/// The name of what is shown, and what takes the group of the part apart.
fn heading_of(
    ui: &mut Ui,
    session: &Session,
    document: &Document,
    wanted: &mut Vec<Intent>,
    name: &str,
    part: usize,
) {
    let label = egui::Label::new(RichText::new(name).color(theme::of(ui).text_strong)).truncate();
    if document.groups().of(part).is_none() {
        ui.add(label);
        return;
    }
    ui.horizontal(|ui| {
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let button = egui::Button::new(RichText::new("Ungroup").size(12.5));
            let intent = Intent::Group(GroupIntent::Ungroup(part));
            let group = document.moving_name(part);
            let hint = format!("Let every part of {group} move by itself (Ctrl+Shift+G)");
            control::intent_button(ui, session, wanted, button, intent, &hint);
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| ui.add(label));
        });
    });
}

fn group(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, parts: Vec<usize>) {
    let button = control::primary(ui, "Group").min_size(Vec2::new(0.0, 30.0));
    let intent = Intent::Group(GroupIntent::Group(parts));
    let hint = "Grab and move them as one, as they are to one another (Ctrl+G)";
    control::intent_button(ui, session, wanted, button, intent, hint);
}

fn grab(ui: &mut Ui, session: &Session, document: &Document, wanted: &mut Vec<Intent>, part: usize) {
    let wide = Vec2::new(0.0, 30.0);
    if session.is_held(part) {
        let button = egui::Button::new("Release").min_size(wide);
        let hint = "The part stays where it is";
        control::intent_button(ui, session, wanted, button, Intent::Release, hint);
        return;
    }
    let locked = document.grouped.is_locked(part);
    let (text, hint) = match locked {
        true => ("Unlock", "Let it be grabbed; it is fixed where it is now"),
        false => (
            "Lock to ground",
            "Fix it where it is; what is grabbed touches it, but does not move it",
        ),
    };
    let lock = Intent::Lock(part, !locked);
    control::intent_button(ui, session, wanted, egui::Button::new(text), lock, hint);
    let button = control::primary(ui, "Grab").min_size(wide);
    let hint = match document.groups().of(part) {
        None => "Couple the handle to this part at their present positions".to_owned(),
        Some(group) => format!("Couple the handle to {} as one", group.name),
    };
    control::intent_button(ui, session, wanted, button, Intent::Grab(part), &hint);
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
