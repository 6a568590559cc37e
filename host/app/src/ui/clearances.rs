//! The list of gaps and clashes under the parts, folded until it is opened: searched on request; a click shows the place and marks both parts.

use std::sync::Arc;

use egui::{Button, DragValue, RichText, ScrollArea, Ui};

use super::{control, theme};
use crate::session::Session;
use crate::session::clearances::{self, Near, Search};
use crate::session::document::Document;
use crate::viewport::gesture::{Marked, Viewpoint};

/// Largest height of the list, points.
const LIST_HEIGHT: f32 = 130.0;

/// State of the list.
pub struct Clearances {
    search: Search,
    /// Largest gap searched for, µm.
    within_um: f64,
}

impl Default for Clearances {
    fn default() -> Self {
        Self {
            search: Search::default(),
            within_um: 1000.0,
        }
    }
}

impl Clearances {
    /// Takes in a finished search.
    pub fn poll(&mut self) {
        self.search.poll();
    }

    /// Draws the list.
    pub fn show(&mut self, ui: &mut Ui, session: &Session, view: &mut Viewpoint) {
        ui.take_available_width();
        let Some(document) = &session.document else { return };
        control::folded(ui, "Clearances", |ui| self.list(ui, document, view));
    }

    fn list(&mut self, ui: &mut Ui, document: &Document, view: &mut Viewpoint) {
        self.request(ui, document);
        let weak_ink = theme::of(ui).text_weak;
        let weak = |text: &str| RichText::new(text).size(12.0).color(weak_ink);
        if self.search.has_failed() {
            ui.label(RichText::new(clearances::FAILED).color(theme::of(ui).fault_text));
        }
        let Some(found) = self.search.found(document) else {
            return;
        };
        if self.search.is_outdated(document) {
            ui.label(weak("Parts have moved since: search again"));
        }
        let pairs: Vec<Near> = found.loose(document).copied().collect();
        if pairs.is_empty() {
            ui.label(weak("No two parts are this near"));
        }
        ScrollArea::vertical()
            .id_salt("clearances")
            .auto_shrink([false, true])
            .max_height(LIST_HEIGHT)
            .min_scrolled_height(LIST_HEIGHT)
            .show(ui, |ui| {
                ui.spacing_mut().item_spacing.y = 2.0;
                for pair in &pairs {
                    let marked = Marked {
                        place: Some(pair.place),
                        parts: pair.parts.to_vec(),
                    };
                    if line(ui, document, pair, view.marked == marked) {
                        view.frame(marked, document.extent);
                    }
                }
            });
    }

    fn request(&mut self, ui: &mut Ui, document: &Document) {
        ui.horizontal(|ui| {
            let button = Button::new(RichText::new("Search").size(12.5));
            let response = ui
                .add_enabled(!self.search.is_busy(), button)
                .accessible_name("Search clearances")
                .on_hover_text("List the pairs of parts that overlap or are this near, by exact distances");
            if response.clicked() {
                let ctx = ui.ctx().clone();
                let wake = Arc::new(move || ctx.request_repaint());
                self.search.start(document, 1e-3 * self.within_um, wake);
            }
            ui.label(RichText::new("gaps up to").size(12.5));
            ui.add(
                DragValue::new(&mut self.within_um)
                    .range(1.0..=20_000.0)
                    .speed(5.0)
                    .max_decimals(1)
                    .suffix(" µm"),
            );
            if self.search.is_busy() {
                ui.add(egui::Spinner::new().size(14.0));
            }
        });
    }
}

/// Draws one pair; returns whether it was clicked.
fn line(ui: &mut Ui, document: &Document, pair: &Near, chosen: bool) -> bool {
    let [a, b] = pair.parts.map(|part| document.part_name(part));
    let (left, right) = (format!("{a} – {b}"), pair.words());
    let named = format!("{left}: {right}");
    let [x, y, z] = pair.place.to_array();
    let ink = theme::of(ui);
    let line = control::Line {
        left,
        right,
        color: if pair.clashes() { ink.contact } else { ink.text },
        hint: format!("{named}, at {x:.3}, {y:.3}, {z:.3} mm; a click shows it and marks both parts"),
        named,
        chosen,
    };
    line.show(ui)
}
