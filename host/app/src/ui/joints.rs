//! Joints of the selected part, under the parts, folded until they are opened: what it touches, and how it can move. The pointer on a joint marks its faces; a
//! click on a freedom shows it by a motion.

use std::time::Duration;

use egui::{Button, RichText, ScrollArea, Ui};

use super::{control, theme};
use crate::session::document::Document;
use crate::session::joints::{JointIntent, PartJoints};
use crate::session::{Intent, Session};

/// Largest height of the list, points.
const LIST_HEIGHT: f32 = 160.0;
/// Time between two pictures of a search, which shows the time passed.
const TICK: Duration = Duration::from_millis(500);

/// Draws the section.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    ui.take_available_width();
    let Some(document) = &session.document else { return };
    let drawn = control::folded(ui, "Joints", |ui| match session.selected {
        Some(part) => contents(ui, session, document, part, wanted),
        None => {
            ui.label(RichText::new("Select a part").color(theme::of(ui).text_weak));
            None
        }
    });
    // The pointer has left, or the list is folded.
    let over = drawn.flatten();
    if over != session.joints.marked() {
        wanted.push(Intent::Joint(JointIntent::Mark(over)));
        ui.ctx().request_repaint();
    }
}

/// Draws the list; returns the joint under the pointer.
fn contents(
    ui: &mut Ui,
    session: &Session,
    document: &Document,
    part: usize,
    wanted: &mut Vec<Intent>,
) -> Option<usize> {
    match session.joints.search() {
        Some((_, since)) => {
            let seconds = since.elapsed().as_secs();
            ui.label(RichText::new(format!("Searching, {seconds} s")).size(12.5));
            ui.ctx().request_repaint_after(TICK);
        }
        None if session.joints.of(document, part).is_none() => {
            let button = Button::new(RichText::new("Find the joints").size(12.5));
            let hint = "What the selected part touches where it is, and how it can move there";
            let find = Intent::Joint(JointIntent::Find(part));
            control::intent_button(ui, session, wanted, button, find, hint);
        }
        None => {}
    }
    if let Some(why) = session.joints.failure(document) {
        ui.label(RichText::new(why).size(12.0).color(theme::of(ui).fault_text));
    }
    let found = session.joints.of(document, part)?;
    ScrollArea::vertical()
        .id_salt("joints")
        .max_height(LIST_HEIGHT)
        .show(ui, |ui| rows(ui, session, found, wanted))
        .inner
}

fn rows(ui: &mut Ui, session: &Session, found: &PartJoints, wanted: &mut Vec<Intent>) -> Option<usize> {
    let ink = theme::of(ui);
    ui.spacing_mut().item_spacing.y = 2.0;
    let mut over = None;
    if found.joints.is_empty() {
        ui.label(
            RichText::new("It touches nothing")
                .size(12.5)
                .color(ink.text_weak),
        );
    }
    for (number, joint) in found.joints.iter().enumerate() {
        let marked = session.joints.marked() == Some(number);
        let text = RichText::new(&joint.words).size(12.5).color(ink.text_strong);
        let line = ui.add(Button::selectable(marked, text).truncate());
        // Keyboard and screen reader reach it by the focus.
        if line.hovered() || line.has_focus() {
            over = Some(number);
        }
        line.on_hover_text(&joint.words);
    }
    if found.freedoms.is_empty() {
        let stuck = "It cannot move: whatever it does, it meets a part within 0.1 mm";
        ui.label(RichText::new(stuck).size(12.5).color(ink.text_weak));
    }
    for (number, freedom) in found.freedoms.iter().enumerate() {
        let shown = session.joints.shown() == Some(number);
        let button = Button::selectable(shown, RichText::new(&freedom.words).size(12.5)).truncate();
        let hint = format!("{}. Click: the picture shows it", freedom.words);
        let show = Intent::Joint(JointIntent::Show(number));
        control::intent_button(ui, session, wanted, button, show, &hint);
    }
    over
}
