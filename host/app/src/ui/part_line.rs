//! A line of the list of parts: of a part, of a group, or of a subassembly. A click selects it, with Ctrl beside others, with Shift up to there; a double click
//! grabs it; the eye hides it. Enter on the line does what a click does.

use std::cell::Cell;

use egui::{
    Align, Align2, Button, Color32, CornerRadius, FontId, Layout, Painter, Pos2, Rect, RichText, Role, Sense,
    Ui, Vec2, WidgetInfo,
};

use super::{control, eye, theme};
use crate::session::document::Document;
use crate::session::grouping::GroupIntent;
use crate::session::{Intent, Session, obstacle};

/// What lines are drawn of.
#[derive(Clone, Copy)]
pub struct Listed<'a> {
    /// The session.
    pub session: &'a Session,
    /// Its document.
    pub document: &'a Document,
    /// The parts in the order of the list.
    pub order: &'a [usize],
    /// Parts that are pointed out.
    pub marked: &'a [usize],
    /// The part under the pointer in the frame before.
    pub over: Option<usize>,
    /// The parts of the connection under the pointer.
    pub pair: Option<[usize; 2]>,
    /// The part whose line is under the pointer.
    pub under: &'a Cell<Option<usize>>,
}

impl Listed<'_> {
    fn is_selected(&self, parts: &[usize]) -> bool {
        parts.iter().all(|&part| self.session.is_selected(part))
    }

    /// What a click on a line of `parts` selects.
    fn click(&self, ui: &Ui, parts: &[usize]) -> Intent {
        let modifiers = ui.input(|input| input.modifiers);
        if modifiers.ctrl || modifiers.command {
            return Intent::SelectAlso(parts.to_vec());
        }
        let anchor = self.session.selected.filter(|_| modifiers.shift);
        if let Some(range) = anchor.and_then(|anchor| range(self.order, anchor, parts)) {
            return Intent::SelectThese(range);
        }
        match parts {
            [part] => Intent::Select(Some(*part)),
            _ => Intent::SelectThese(parts.to_vec()),
        }
    }
}

/// The parts of the list from `anchor`, which comes first, to `parts`.
fn range(order: &[usize], anchor: usize, parts: &[usize]) -> Option<Vec<usize>> {
    let place = |part: &usize| order.iter().position(|other| other == part);
    let from = place(&anchor)?;
    let ends = parts.iter().filter_map(place);
    let (low, high) = ends.fold((from, from), |(low, high), end| (low.min(end), high.max(end)));
    let others = order[low..=high].iter().copied().filter(|part| *part != anchor);
    Some(std::iter::once(anchor).chain(others).collect())
}

/// Draws the line of a part, or of a group with several.
pub fn show(ui: &mut Ui, listed: Listed<'_>, wanted: &mut Vec<Intent>, name: &str, parts: &[usize]) {
    let Listed {
        session, document, ..
    } = listed;
    let Some(&first) = parts.first() else { return };
    let (selected, held) = (listed.is_selected(parts), session.is_held(first));
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 28.0), Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, selected, name));
    let painter = ui.painter_at(rect);
    if response.hovered() && parts.len() == 1 {
        listed.under.set(Some(first));
    }
    let pointed =
        |part: &usize| listed.over == Some(*part) || listed.pair.is_some_and(|pair| pair.contains(part));
    let pointed = response.hovered() || parts.iter().any(pointed);
    let fill = match (held, selected, pointed) {
        (true, ..) => theme::of(ui).held.gamma_multiply(0.22),
        (_, true, _) => theme::of(ui).accent_dim.gamma_multiply(0.8),
        _ if parts.iter().any(|part| listed.marked.contains(part)) => {
            theme::of(ui).accent_dim.gamma_multiply(0.5)
        }
        (_, _, true) => theme::of(ui).card,
        _ => Color32::TRANSPARENT,
    };
    painter.rect_filled(rect, CornerRadius::same(6), fill);
    let left = swatches(&painter, rect, document, parts);
    // A group states it for its parts.
    let states = parts.len() > 1 || document.groups().of(first).is_none();
    let note = if held && states {
        Some(("held", theme::of(ui).held))
    } else if document.baked.is_some() && states && !document.is_grabbable(first) {
        Some(("fixed", theme::of(ui).text_weak))
    } else {
        None
    };
    let mut right = rect.right() - eye::WIDTH;
    if let Some((note, color)) = note {
        let at = Pos2::new(right, rect.center().y);
        let drawn = painter.text(at, Align2::RIGHT_CENTER, note, FontId::proportional(11.5), color);
        right = drawn.left() - 8.0;
    }
    let is_seen = parts.iter().any(|&part| !document.is_hidden(part));
    let ink = match is_seen {
        true => theme::of(ui).text_strong,
        false => theme::of(ui).text_weak,
    };
    text(&painter, rect, left..right, name, ink);
    eye::show(ui, session, rect, response.hovered(), (name, parts), wanted);
    if response.clicked() {
        wanted.push(listed.click(ui, parts));
    }
    if response.double_clicked() {
        wanted.push(Intent::Grab(first));
    }
    response.on_hover_ui(|ui| {
        ui.label(name);
        let hint = obstacle(session, &Intent::Grab(first)).unwrap_or_else(|| "Double click to grab".into());
        ui.label(RichText::new(hint).small().color(theme::of(ui).text_weak));
    });
}

/// Draws the colours of up to three parts behind one another; returns where they end.
fn swatches(painter: &Painter, rect: Rect, document: &Document, parts: &[usize]) -> f32 {
    let shown = parts.len().min(3);
    for (number, &part) in parts.iter().take(shown).enumerate().rev() {
        let at = rect.left_center() + Vec2::new(15.0 + 5.0 * number as f32, 0.0);
        let [r, g, b] = document.colors[part];
        let square = Rect::from_center_size(at, Vec2::splat(12.0));
        painter.rect_filled(square, CornerRadius::same(3), Color32::from_rgb(r, g, b));
    }
    rect.left() + 21.0 + 5.0 * (shown - 1) as f32 + 8.0
}

fn text(painter: &Painter, rect: Rect, room: std::ops::Range<f32>, name: &str, ink: Color32) {
    let format = egui::TextFormat::simple(FontId::proportional(13.5), ink);
    let mut job = egui::text::LayoutJob::single_section(name.to_owned(), format);
    job.wrap = egui::text::TextWrapping::truncate_at_width((room.end - room.start).max(10.0));
    let galley = painter.layout_job(job);
    let at = Pos2::new(room.start, rect.center().y - 0.5 * galley.size().y);
    painter.galley(at, galley, ink);
}

/// Draws the line of a subassembly with what groups its parts.
pub fn assembly(ui: &mut Ui, listed: Listed<'_>, wanted: &mut Vec<Intent>, name: &str, parts: &[usize]) {
    let ink = theme::of(ui);
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        if parts.len() > 1 {
            ui.add_space(6.0);
            let text = RichText::new("Group").small().color(ink.text_weak);
            let button = Button::new(text).frame(false);
            let intent = Intent::Group(GroupIntent::Group(parts.to_vec()));
            let hint = "Grab and move its parts as one, as they are to one another";
            control::intent_button(ui, listed.session, wanted, button, intent, hint)
                .accessible_name(format!("Group {name}"));
        }
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
            let color = match listed.is_selected(parts) {
                true => ink.text_strong,
                false => ink.text_weak,
            };
            let button = Button::new(RichText::new(name).color(color))
                .frame(false)
                .truncate();
            let response = ui.add(button).on_hover_text("Select its parts");
            if response.clicked() {
                wanted.push(listed.click(ui, parts));
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use super::range;

    #[test]
    fn a_range_goes_from_the_first_selected_part_to_the_line() {
        let order = [3, 1, 4, 0, 2];
        assert_eq!(range(&order, 1, &[0]), Some(vec![1, 4, 0]));
        assert_eq!(range(&order, 0, &[1]), Some(vec![0, 1, 4]));
        assert_eq!(range(&order, 4, &[4]), Some(vec![4]));
        assert_eq!(range(&order, 1, &[0, 2]), Some(vec![1, 4, 0, 2]), "a group");
        assert_eq!(range(&order, 9, &[0]), None, "it is not in the list");
    }
}
