//! The graph: a dot in each part's colour with its name, and a line for each pair that is connected, stronger from the selected part. A click selects a part; the
//! pointer on a line or a dot marks the parts in the view and in the list.

use std::sync::Arc;

use egui::text::{LayoutJob, TextWrapping};
use egui::{
    Color32, CornerRadius, FontId, Galley, Id, Pos2, Rect, Response, Role, Sense, Stroke, TextFormat, Ui,
    Vec2, WidgetInfo,
};
use glam::DVec2;

use super::super::theme;
use super::labels::{self, Label};
use crate::session::connections::{Connected, Graph};
use crate::session::document::Document;
use crate::session::{Intent, Session};
use crate::viewport::gesture::Viewpoint;

/// Least and largest height of the drawing, and the largest as a share of the window's, points.
const HEIGHT: (f32, f32, f32) = (110.0, 320.0, 0.27);
/// Height for each part, beside that of the first ones, points: names take room.
const HEIGHT_A_PART: f32 = 9.0;
/// Space between the border and the dots, points.
const MARGIN: Vec2 = Vec2::new(16.0, 14.0);
/// Radius of a dot; distance at which the pointer is on a dot, and on a line, points.
const DOT: f32 = 5.0;
const REACH: f32 = 9.0;
const LINE_REACH: f32 = 5.0;
/// Widest name, points.
const WIDEST: f32 = 96.0;

/// What is drawn.
pub struct Drawing<'a> {
    pub session: &'a Session,
    pub document: &'a Document,
    pub graph: &'a Graph,
    /// Parts, and their places in the unit square.
    pub parts: &'a [usize],
    pub places: &'a [DVec2],
}

impl<'g> Drawing<'g> {
    /// Draws the graph, as wide as there is room.
    pub fn show(&self, ui: &mut Ui, view: &mut Viewpoint, wanted: &mut Vec<Intent>) {
        let most = HEIGHT.1.min(HEIGHT.2 * ui.ctx().content_rect().height());
        let height = (100.0 + HEIGHT_A_PART * self.parts.len() as f32).min(most);
        let size = Vec2::new(ui.available_width(), height.max(HEIGHT.0));
        let (rect, area) = ui.allocate_exact_size(size, Sense::hover());
        let (ink, corners) = (theme::of(ui), CornerRadius::same(6));
        ui.painter().rect_filled(rect, corners, ink.card);
        let inner = rect.shrink2(MARGIN);
        let dots: Vec<Pos2> = (self.places.iter())
            .map(|place| inner.min + inner.size() * Vec2::new(place.x as f32, place.y as f32))
            .collect();
        let responses: Vec<Response> = (self.parts.iter().zip(&dots))
            .map(|(part, dot)| self.dot(ui, *part, *dot))
            .collect();
        for (part, dot) in self.parts.iter().zip(&responses) {
            if dot.clicked() {
                wanted.push(Intent::Select(Some(*part)));
            }
            if dot.hovered() || dot.has_focus() {
                view.over.now = Some(*part);
            }
        }
        let pointer = area.contains_pointer().then(|| ui.ctx().pointer_hover_pos());
        let edge = (pointer.flatten()).and_then(|pointer| self.edge_at(&dots, pointer));
        if let Some(edge) = edge {
            view.pair = Some(edge.parts);
            area.on_hover_text_at_pointer(self.words(edge));
        }
        self.lines(ui, rect, &dots, view.pair);
        self.paint(ui, rect, &dots, &responses, view);
        for (part, dot) in self.parts.iter().zip(responses) {
            dot.on_hover_text(self.named(*part));
        }
    }

    fn dot(&self, ui: &Ui, part: usize, at: Pos2) -> Response {
        let touched = Rect::from_center_size(at, Vec2::splat(2.0 * REACH));
        let response = ui.interact(touched, Id::unique(("connections", part)), Sense::click());
        let selected = self.session.selected == Some(part);
        response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, selected, self.named(part)));
        response
    }

    /// A part with the number of its connections.
    fn named(&self, part: usize) -> String {
        let name = self.document.part_name(part);
        match self.graph.of(part).count() {
            1 => format!("{name}: 1 connection"),
            count => format!("{name}: {count} connections"),
        }
    }

    fn words(&self, edge: &Connected) -> String {
        let [a, b] = edge.parts.map(|part| self.document.part_name(part));
        format!("{a} – {b}\n{}", edge.words().replace("; ", "\n"))
    }

    fn number(&self, part: usize) -> Option<usize> {
        self.parts.iter().position(|drawn| *drawn == part)
    }

    /// Ends of the lines that are drawn.
    fn drawn<'a>(&'a self, dots: &'a [Pos2]) -> impl Iterator<Item = (&'g Connected, [Pos2; 2])> {
        self.graph.edges.iter().filter_map(|edge| {
            let [a, b] = edge.parts.map(|part| self.number(part));
            Some((edge, [dots[a?], dots[b?]]))
        })
    }

    /// The connection whose line is under the pointer, if no dot is.
    fn edge_at(&self, dots: &[Pos2], pointer: Pos2) -> Option<&'g Connected> {
        if dots.iter().any(|dot| dot.distance(pointer) < REACH) {
            return None;
        }
        let away = |[a, b]: [Pos2; 2]| distance(a, b, pointer);
        let near = self.drawn(dots).map(|(edge, ends)| (edge, away(ends)));
        let nearest = near.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest
            .filter(|(_, away)| *away < LINE_REACH)
            .map(|(edge, _)| edge)
    }

    fn lines(&self, ui: &Ui, rect: Rect, dots: &[Pos2], pair: Option<[usize; 2]>) {
        let (ink, painter) = (theme::of(ui), ui.painter_at(rect));
        let weak = Stroke::new(1.0, ink.text_weak.gamma_multiply(0.65));
        // Those of the selected part are drawn over the others.
        let rank = |edge: &Connected| match self.session.selected {
            _ if pair == Some(edge.parts) => 2,
            Some(part) if edge.other(part).is_some() => 1,
            _ => 0,
        };
        for layer in 0..3 {
            let stroke = [weak, Stroke::new(2.0, ink.accent), Stroke::new(3.2, ink.accent)][layer];
            for (_, ends) in self.drawn(dots).filter(|(edge, _)| rank(edge) == layer) {
                painter.line_segment(ends, stroke);
            }
        }
    }

    /// Dots and names.
    fn paint(&self, ui: &Ui, rect: Rect, dots: &[Pos2], responses: &[Response], view: &Viewpoint) {
        let (ink, painter) = (theme::of(ui), ui.painter_at(rect));
        let selected = self.session.selected;
        let is_pointed = |part: usize| {
            [view.over.now, view.over.before].contains(&Some(part))
                || view.pair.is_some_and(|pair| pair.contains(&part))
        };
        let names: Vec<Arc<Galley>> = self.parts.iter().map(|part| self.name(ui, *part)).collect();
        let wanted: Vec<Label> = (self.parts.iter().zip(dots).zip(&names))
            .map(|((part, dot), name)| Label {
                dot: *dot,
                size: name.size(),
                rank: match selected {
                    Some(own) if own == *part => 0,
                    _ if is_pointed(*part) => 1,
                    Some(own) if self.graph.of(own).any(|(other, _)| other == *part) => 2,
                    _ => 3,
                },
            })
            .collect();
        for (name, at) in names
            .into_iter()
            .zip(labels::place(&wanted, DOT, rect.shrink(2.0)))
        {
            if let Some(at) = at {
                // Lines end before names.
                painter.rect_filled(at, CornerRadius::same(3), ink.card.gamma_multiply(0.85));
                painter.galley(at.min, name, ink.text);
            }
        }
        for ((part, dot), response) in self.parts.iter().zip(dots).zip(responses) {
            let [r, g, b] = self.document.colors[*part];
            let (radius, ring) = match (selected == Some(*part), is_pointed(*part)) {
                (true, _) => (DOT + 2.0, Stroke::new(2.0, ink.accent)),
                (_, true) => (DOT + 1.0, Stroke::new(2.0, ink.text_strong)),
                _ => (DOT, Stroke::new(1.0, ink.text_weak)),
            };
            painter.circle(*dot, radius, Color32::from_rgb(r, g, b), ring);
            if response.has_focus() {
                painter.circle_stroke(*dot, REACH, Stroke::new(1.5, ink.accent));
            }
        }
    }

    fn name(&self, ui: &Ui, part: usize) -> Arc<Galley> {
        let ink = theme::of(ui);
        let color = match self.session.selected == Some(part) {
            true => ink.text_strong,
            false => ink.text,
        };
        let format = TextFormat::simple(FontId::proportional(11.5), color);
        let mut job = LayoutJob::single_section(self.document.part_name(part).to_owned(), format);
        job.wrap = TextWrapping::truncate_at_width(WIDEST);
        ui.painter().layout_job(job)
    }
}

/// Distance of a point from the line between two others.
fn distance(a: Pos2, b: Pos2, point: Pos2) -> f32 {
    let (along, from) = (b - a, point - a);
    let share = (from.dot(along) / along.length_sq().max(1e-9)).clamp(0.0, 1.0);
    (from - share * along).length()
}
