//! STEP files dragged onto the window.

use egui::{Color32, CornerRadius, Id, LayerId, Order, Stroke, Ui};

use super::{control, header, theme};
use crate::session::{Intent, Session, obstacle};

/// Highlights the drop target while a file is dragged over the window, and opens dropped files.
pub fn show(ui: &Ui, session: &mut Session, wanted: &mut Vec<Intent>) {
    let ctx = ui.ctx();
    let (hovering, dropped) = ctx.input(|i| {
        let dropped: Vec<_> = (i.raw.dropped_files.iter())
            .map(|file| file.path().to_owned())
            .collect();
        (!i.raw.hovered_files.is_empty(), dropped)
    });
    if hovering {
        // Starts below the bar, which leaves STOP and the state visible.
        let mut rect = ctx.content_rect();
        rect.min.y += header::height(rect.width());
        let painter = ctx.layer_painter(LayerId::new(Order::Foreground, Id::unique("drop")));
        painter.rect(
            rect.shrink(10.0),
            CornerRadius::same(12),
            Color32::from_black_alpha(170),
            Stroke::new(2.0, theme::of(ui).accent),
            egui::StrokeKind::Inside,
        );
        let text = match obstacle(session, &Intent::OpenSample) {
            None => "Drop to open".to_owned(),
            Some(reason) => reason,
        };
        control::centered(&painter, rect, &text, 26.0, Color32::WHITE);
    }
    match dropped.len() {
        0 => {}
        1 => wanted.extend(dropped.into_iter().map(Intent::Open)),
        n => session.notes.add(
            crate::session::notes::Severity::Warning,
            format!("{n} files were dropped: drop one file, which is one assembly"),
        ),
    }
}
