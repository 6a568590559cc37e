//! The connections of the selected part: the other part, what connects them, and the diameters and clearances of fits. The pointer on a row marks both parts; a
//! click selects the other one.

use egui::text::{LayoutJob, TextWrapping};
use egui::{
    Color32, CornerRadius, FontId, Pos2, Response, RichText, Role, ScrollArea, Sense, Stroke, StrokeKind,
    TextFormat, Ui, Vec2, WidgetInfo,
};

use super::super::theme;
use crate::session::Intent;
use crate::session::connections::{Connected, Graph};
use crate::session::document::Document;

/// Largest height of the list, points.
const HEIGHT: f32 = 112.0;
/// Space around the words of a row, points.
const AROUND: Vec2 = Vec2::new(6.0, 3.0);

/// Draws the list, with the row of a `pair` marked; returns the parts of the row under the pointer.
pub fn show(
    ui: &mut Ui,
    document: &Document,
    graph: &Graph,
    part: usize,
    pair: Option<[usize; 2]>,
    wanted: &mut Vec<Intent>,
) -> Option<[usize; 2]> {
    let name = document.part_name(part);
    let count = graph.of(part).count();
    let text = match count {
        0 => format!("{name} is connected with no other part"),
        1 => format!("{name} is connected with 1 part"),
        count => format!("{name} is connected with {count} parts"),
    };
    let text = RichText::new(text).size(12.0).color(theme::of(ui).text_weak);
    ui.add(egui::Label::new(text).truncate());
    ScrollArea::vertical()
        .id_salt("connections")
        .auto_shrink([false, true])
        .max_height(HEIGHT)
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 2.0;
            let mut over = None;
            for (other, edge) in graph.of(part) {
                let row = row(ui, document.part_name(other), edge, pair == Some(edge.parts));
                // Keyboard and screen reader reach it by the focus.
                if row.hovered() || row.has_focus() {
                    over = Some(edge.parts);
                }
                if row.clicked() {
                    wanted.push(Intent::Select(Some(other)));
                }
            }
            over
        })
        .inner
}

fn row(ui: &mut Ui, name: &str, edge: &Connected, marked: bool) -> Response {
    let ink = theme::of(ui);
    let width = ui.available_width();
    let mut job = LayoutJob::default();
    let mut line = |text: &str, size: f32, color: Color32| {
        job.append(text, 0.0, TextFormat::simple(FontId::proportional(size), color));
    };
    line(name, 12.5, ink.text_strong);
    for words in std::iter::once(&edge.kinds).chain(&edge.fits) {
        line(&format!("\n{words}"), 11.5, ink.text);
    }
    job.wrap = TextWrapping::wrap_at_width(width - 2.0 * AROUND.x);
    let galley = ui.painter().layout_job(job);
    let size = Vec2::new(width, galley.size().y + 2.0 * AROUND.y);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let named = format!("{name}: {}", edge.words());
    response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, false, &named));
    let fill = match marked || response.hovered() {
        true => ink.card,
        false => Color32::TRANSPARENT,
    };
    let line = match response.has_focus() {
        true => Stroke::new(1.5, ink.accent),
        false => Stroke::NONE,
    };
    let painter = ui.painter_at(rect);
    painter.rect(rect, CornerRadius::same(6), fill, line, StrokeKind::Inside);
    painter.galley(Pos2::new(rect.left(), rect.top()) + AROUND, galley, ink.text);
    response
}
