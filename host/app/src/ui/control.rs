//! Small building blocks: buttons that show why they are disabled, chips, section headings.

use egui::text::{LayoutJob, TextWrapping};
use egui::{
    Align2, Button, CollapsingHeader, Color32, CornerRadius, FontId, Pos2, Response, RichText, Role, Sense,
    Stroke, TextFormat, Ui, Vec2, WidgetInfo,
};

use super::theme;
use crate::session::{Intent, Session, obstacle};

/// A button for `intent`, greyed out with the reason as hover text when the intent is not possible. A click adds the intent to `wanted`.
pub fn intent_button(
    ui: &mut Ui,
    session: &Session,
    wanted: &mut Vec<Intent>,
    button: Button<'_>,
    intent: Intent,
    hint: &str,
) -> Response {
    let reason = obstacle(session, &intent);
    let response = ui.add_enabled(reason.is_none(), button);
    if response.clicked() {
        wanted.push(intent);
    }
    match reason {
        Some(reason) => response.on_disabled_hover_text(reason),
        None if hint.is_empty() => response,
        None => response.on_hover_text(hint),
    }
}

/// A line of a list that can be chosen: a text and a value.
pub struct Line {
    /// The text, which is cut where there is no room.
    pub left: String,
    /// The value.
    pub right: String,
    /// Colour of the value.
    pub color: Color32,
    /// Name for programs that read the window.
    pub named: String,
    /// Hover text.
    pub hint: String,
    /// Whether it is the chosen one.
    pub chosen: bool,
}

impl Line {
    /// Draws it; returns whether it was clicked.
    pub fn show(self, ui: &mut Ui) -> bool {
        let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 24.0), Sense::click());
        response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, self.chosen, &self.named));
        let ink = theme::of(ui);
        let painter = ui.painter_at(rect);
        let fill = match (self.chosen, response.hovered()) {
            (true, _) => ink.accent_dim.gamma_multiply(0.8),
            (_, true) => ink.card,
            _ => Color32::TRANSPARENT,
        };
        painter.rect_filled(rect, CornerRadius::same(6), fill);
        let font = FontId::proportional(12.5);
        let end = rect.right_center() - Vec2::new(6.0, 0.0);
        let value = painter.text(end, Align2::RIGHT_CENTER, self.right, font.clone(), self.color);
        let format = TextFormat::simple(font, ink.text_strong);
        let mut job = LayoutJob::single_section(self.left, format);
        job.wrap = TextWrapping::truncate_at_width((value.left() - rect.left() - 14.0).max(10.0));
        let galley = painter.layout_job(job);
        let at = Pos2::new(rect.left() + 6.0, rect.center().y - 0.5 * galley.size().y);
        painter.galley(at, galley, ink.text_strong);
        let clicked = response.clicked();
        response.on_hover_text(self.hint);
        clicked
    }
}

/// Draws another frame when a panel's height is no longer `last`: the panel has the size of its contents a frame later.
pub fn settle(ui: &Ui, height: f32, last: &mut f32) {
    if (std::mem::replace(last, height) - height).abs() > 0.5 {
        ui.ctx().request_repaint();
    }
}

/// A small button over the view, in the accent colour while it is on.
pub fn flat<'a>(ui: &Ui, text: &'a str, chosen: bool) -> Button<'a> {
    let ink = theme::of(ui);
    let fill = if chosen {
        ink.accent_dim
    } else {
        ink.control.gamma_multiply(0.85)
    };
    Button::new(RichText::new(text).size(12.5))
        .selected(chosen)
        .fill(fill)
}

/// A button in the accent colour: the suggested next action.
pub fn primary<'a>(ui: &Ui, text: &'a str) -> Button<'a> {
    let ink = theme::of(ui);
    Button::new(RichText::new(text).color(ink.text_strong)).fill(ink.accent_dim)
}

/// Narrowest chip, points; chips of short words stay as easy to find as those of long ones.
const CHIP_MIN: f32 = 64.0;

/// A small rounded label with a dot that shows a state, never wider than `width` unless that is less than [`CHIP_MIN`].
pub fn chip(ui: &mut Ui, color: Color32, text: &str, width: f32) -> Response {
    let ink = theme::of(ui).text_strong;
    let mut job = LayoutJob::simple_singleline(text.to_owned(), FontId::proportional(13.0), ink);
    job.wrap = TextWrapping::truncate_at_width((width - 34.0).max(0.0));
    let galley = ui.painter().layout_job(job);
    let size = Vec2::new((galley.size().x + 34.0).max(CHIP_MIN), 28.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::hover());
    let painter = ui.painter();
    painter.rect(
        rect,
        CornerRadius::same(14),
        color.gamma_multiply(0.16),
        Stroke::new(1.0, color.gamma_multiply(0.45)),
        egui::StrokeKind::Inside,
    );
    painter.circle_filled(rect.left_center() + Vec2::new(14.0, 0.0), 4.0, color);
    let at = rect.left_center() + Vec2::new(24.0, -0.5 * galley.size().y);
    painter.galley(at, galley, ink);
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, text));
    response
}

/// Heading of a section, with space above.
pub fn section(ui: &mut Ui, text: &str) {
    ui.label(
        RichText::new(text.to_uppercase())
            .size(11.0)
            .color(theme::of(ui).text_weak)
            .strong(),
    );
}

/// A section that is folded until it is opened, under a low heading; `None` while it is folded.
pub fn folded<R>(ui: &mut Ui, title: &str, body: impl FnOnce(&mut Ui) -> R) -> Option<R> {
    let heading = RichText::new(title).size(12.5).color(theme::of(ui).text_weak);
    let usual = ui.ctx().global_style().spacing.clone();
    ui.scope(|ui| {
        ui.spacing_mut().interact_size.y = 20.0;
        ui.spacing_mut().button_padding.y = 3.0;
        let contents = |ui: &mut Ui| {
            *ui.spacing_mut() = usual;
            body(ui)
        };
        CollapsingHeader::new(heading)
            .default_open(false)
            .show(ui, contents)
            .body_returned
    })
    .inner
}

/// A line between sections, with space around it.
pub fn divider(ui: &mut Ui) {
    ui.add_space(8.0);
    let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 1.0), Sense::hover());
    ui.painter().hline(
        rect.x_range(),
        rect.center().y,
        Stroke::new(1.0, theme::of(ui).line),
    );
    ui.add_space(8.0);
}

/// A name on the left and a value on the right.
pub fn row(ui: &mut Ui, name: &str, value: impl Into<String>) -> Response {
    rich_row(ui, name, RichText::new(value.into()))
}

/// A [`row`] whose value has its own colour.
pub fn rich_row(ui: &mut Ui, name: &str, value: RichText) -> Response {
    ui.scope(|ui| {
        ui.spacing_mut().interact_size.y = 21.0;
        ui.horizontal(|ui| {
            ui.label(RichText::new(name).color(theme::of(ui).text_weak));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.add(egui::Label::new(value).truncate());
            });
        });
    })
    .response
}

/// The mark of the program: a tenon over its mortise.
pub fn mark(ui: &Ui, rect: egui::Rect, color: Color32) {
    let at = |x: f32, y: f32| rect.min + Vec2::new(x * rect.width(), y * rect.height());
    let fill = |a: (f32, f32), b: (f32, f32), color: Color32| {
        ui.painter().rect_filled(
            egui::Rect::from_two_pos(at(a.0, a.1), at(b.0, b.1)),
            CornerRadius::same((rect.width() * 0.05) as u8),
            color,
        );
    };
    fill((0.36, 0.02), (0.64, 0.50), theme::of(ui).held);
    fill((0.08, 0.56), (0.32, 0.98), color);
    fill((0.68, 0.56), (0.92, 0.98), color);
    fill((0.08, 0.82), (0.92, 0.98), color);
}

/// Text centred in a rectangle.
pub fn centered(painter: &egui::Painter, rect: egui::Rect, text: &str, size: f32, color: Color32) {
    painter.text(
        rect.center(),
        Align2::CENTER_CENTER,
        text,
        FontId::proportional(size),
        color,
    );
}
