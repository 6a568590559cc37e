//! The steps of the sequence as a strip of pictures: a row each, with what moves, from where and how near it passes. A click goes to where the step begins; the
//! next step is marked, and kept in sight as the parts move.

use std::sync::Arc;

use egui::text::{LayoutJob, TextWrapping};
use egui::{
    Color32, ColorImage, CornerRadius, FontId, Image, Pos2, Rect, RectAlign, Response, Role, ScrollArea,
    Sense, Stroke, StrokeKind, TextFormat, TextureHandle, TextureOptions, Tooltip, Ui, Vec2, WidgetInfo,
};
use mortise_page::Picture;

use super::theme;
use crate::session::sequence::{Sequence, Step};
use crate::session::{Intent, Session, obstacle};

/// Largest height of the strip, points.
const HEIGHT: f32 = 224.0;
/// Size of a picture in its row, points: half of its pixels, for screens of two pixels a point.
const FRAME: Vec2 = Vec2::new(76.0, 56.0);
/// Space around what a row has, points.
const AROUND: f32 = 4.0;
/// Space between rows, points.
const GAP: f32 = 2.0;
/// Brightness of the pictures, whose paper is white, beside dark panels.
const DIMMED: u8 = 205;

/// The pictures that a graphics card has, and the step that was next in the frame before.
#[derive(Default)]
pub struct Filmstrip {
    textures: Vec<Option<(Arc<Picture>, TextureHandle)>>,
    next: Option<usize>,
    /// By how much the strip is scrolled, points.
    offset: f32,
}

impl Filmstrip {
    /// Draws the strip.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        session: &Session,
        found: &Sequence,
        done: Option<f64>,
        wanted: &mut Vec<Intent>,
    ) {
        self.textures.resize_with(found.steps.len(), || None);
        let next = done
            .map(|done| done as usize)
            .filter(|next| *next < found.steps.len());
        let has_pictures = found.steps.iter().any(|step| step.picture.is_some());
        let height = if has_pictures { FRAME.y } else { 36.0 } + 2.0 * AROUND;
        let mut area = ScrollArea::vertical()
            .id_salt("sequence")
            .auto_shrink([false, true])
            .max_height(HEIGHT)
            .min_scrolled_height(HEIGHT);
        if let Some(next) = next.filter(|_| self.next != next) {
            area = area.vertical_scroll_offset(in_sight(self.offset, next as f32 * (height + GAP), height));
        }
        self.next = next;
        let drawn = area.show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = GAP;
            for (number, step) in found.steps.iter().enumerate() {
                let row = self.row(ui, height, number, step, next == Some(number));
                let intent = Intent::GoToStep {
                    done: number as f64,
                    goes_on: false,
                };
                if row.clicked() && obstacle(session, &intent).is_none() {
                    wanted.push(intent);
                }
            }
        });
        self.offset = drawn.state.clamped_offset().y;
    }

    fn row(&mut self, ui: &mut Ui, height: f32, number: usize, step: &Step, is_next: bool) -> Response {
        let (rect, response) =
            ui.allocate_exact_size(Vec2::new(ui.available_width(), height), Sense::click());
        let named = format!("{}. {}", number + 1, step.words);
        response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, is_next, &named));
        if !ui.is_rect_visible(rect) {
            return response;
        }
        background(ui, rect, &response, is_next);
        let image = self.image(ui, number, step);
        let mut left = rect.left() + AROUND;
        if let Some(image) = &image {
            let frame = Rect::from_min_size(rect.min + Vec2::splat(AROUND), FRAME);
            image.paint_at(ui, frame);
            let line = Stroke::new(1.0, theme::of(ui).line);
            (ui.painter()).rect_stroke(frame, CornerRadius::same(3), line, StrokeKind::Outside);
            left = frame.right() + 2.0 * AROUND;
        }
        let room = Rect::from_min_max(Pos2::new(left, rect.top()), rect.max).shrink(AROUND);
        words(ui, room, number, step);
        let mut hint = Tooltip::for_enabled(&response);
        // Beside the strip, of which it would cover the next rows.
        hint.popup = hint.popup.align(RectAlign::RIGHT_START);
        hint.show(|ui| {
            if let Some(image) = image {
                ui.add(image.fit_to_exact_size(2.5 * FRAME));
            }
            ui.label(named);
            ui.weak("A click goes to where this step begins");
        });
        response
    }

    /// The picture of a step, which is sent to the graphics card when it is first seen.
    fn image(&mut self, ui: &Ui, number: usize, step: &Step) -> Option<Image<'static>> {
        let picture = step.picture.as_ref()?;
        let slot = self.textures.get_mut(number)?;
        if !(slot.as_ref()).is_some_and(|(of, _)| Arc::ptr_eq(of, picture)) {
            let pixels = ColorImage::from_rgb([picture.width, picture.height], &picture.rgb);
            let name = format!("step {}", number + 1);
            let texture = ui.ctx().load_texture(name, pixels, TextureOptions::LINEAR);
            *slot = Some((Arc::clone(picture), texture));
        }
        let (_, texture) = slot.as_ref()?;
        let light = if ui.visuals().dark_mode { DIMMED } else { 255 };
        let image = Image::new((texture.id(), texture.size_vec2()));
        Some(image.corner_radius(3).tint(Color32::from_gray(light)))
    }
}

fn background(ui: &Ui, rect: Rect, response: &Response, is_next: bool) {
    let ink = theme::of(ui);
    let fill = match (is_next, response.hovered()) {
        (true, _) => ink.accent_dim.gamma_multiply(0.8),
        (_, true) => ink.card,
        _ => Color32::TRANSPARENT,
    };
    let line = match response.has_focus() {
        true => Stroke::new(1.5, ink.accent),
        false => Stroke::NONE,
    };
    (ui.painter()).rect(rect, CornerRadius::same(6), fill, line, StrokeKind::Inside);
}

/// How far to scroll so that a row is seen, no farther than needed.
fn in_sight(offset: f32, top: f32, height: f32) -> f32 {
    offset.min(top).max(top + height - HEIGHT)
}

/// What moves, in one line, and how, in two.
fn words(ui: &Ui, room: Rect, number: usize, step: &Step) {
    let ink = theme::of(ui);
    let painter = ui.painter_at(room);
    let lay = |text: String, size: f32, color: Color32, rows: usize| {
        let format = TextFormat::simple(FontId::proportional(size), color);
        let mut job = LayoutJob::single_section(text, format);
        job.wrap = TextWrapping {
            max_rows: rows,
            ..TextWrapping::truncate_at_width(room.width().max(10.0))
        };
        job.wrap.break_anywhere = rows == 1;
        painter.layout_job(job)
    };
    let name = lay(
        format!("{}. {}", number + 1, step.names),
        12.5,
        ink.text_strong,
        1,
    );
    let how = lay(step.how().replacen(": ", "\n", 1), 11.5, ink.text, 2);
    let top = room.center().y - 0.5 * (name.size().y + how.size().y);
    let below = top + name.size().y;
    painter.galley(Pos2::new(room.left(), top), name, ink.text_strong);
    painter.galley(Pos2::new(room.left(), below), how, ink.text);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_next_row_is_in_sight(offset in 0.0f32..5000.0, top in 0.0f32..5000.0, height in 10.0f32..80.0) {
            let to = in_sight(offset, top, height);
            prop_assert!(to <= top && top + height <= to + HEIGHT + 1e-2);
            let was = offset <= top && top + height <= offset + HEIGHT;
            prop_assert!(!was || to == offset, "it stays");
        }
    }
}
