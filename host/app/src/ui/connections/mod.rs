//! Connections of the parts, under the list of parts, folded until they are opened: the graph of what touches or fits, and under it those of the selected part.
//! The search starts when the section is first opened.

mod drawing;
mod labels;
mod rows;

use std::time::Duration;

use egui::{Button, RichText, Ui};
use glam::DVec2;

use super::{control, theme};
use crate::session::connections::Graph;
use crate::session::document::Document;
use crate::session::find_connections::ConnectionsIntent;
use crate::session::graph_layout::layout;
use crate::session::{Intent, Session, obstacle};
use crate::viewport::gesture::Viewpoint;

/// Most parts that are drawn at once.
const MOST: usize = 40;
/// Time between two pictures of a search, which shows the time passed.
const TICK: Duration = Duration::from_millis(500);

/// The graph as it was laid out last.
#[derive(Default)]
pub struct Connections {
    /// Number of the search.
    number: u64,
    /// Parts that are drawn, and their places in the unit square.
    parts: Vec<usize>,
    places: Vec<DVec2>,
    /// Parts of the row of the list that the pointer was on in the frame before.
    row: Option<[usize; 2]>,
}

impl Connections {
    /// Draws the section.
    pub fn show(&mut self, ui: &mut Ui, session: &Session, view: &mut Viewpoint, wanted: &mut Vec<Intent>) {
        ui.take_available_width();
        let Some(document) = &session.document else { return };
        control::folded(ui, "Connections", |ui| {
            self.contents(ui, session, document, view, wanted);
        });
    }

    fn contents(
        &mut self,
        ui: &mut Ui,
        session: &Session,
        document: &Document,
        view: &mut Viewpoint,
        wanted: &mut Vec<Intent>,
    ) {
        let state = &session.connections;
        request(ui, session, document, wanted);
        if let Some(why) = state.failure(document) {
            ui.label(RichText::new(why).size(12.0).color(theme::of(ui).fault_text));
        }
        let Some(graph) = state.found(document) else {
            return;
        };
        if graph.is_outdated(document) {
            weak(ui, "Parts have moved since: search again");
        }
        if graph.edges.is_empty() {
            weak(ui, "No two parts touch or fit where they are");
            return;
        }
        let count = document.model.parts.len();
        let selected = session.selected.filter(|part| *part < count);
        let parts = graph.to_draw(count, selected, MOST);
        if let Some(words) = graph.left_out(count, selected, MOST) {
            weak(ui, &words);
        }
        if !parts.is_empty() {
            self.lay_out(state.number(), graph, parts);
            let drawing = drawing::Drawing {
                session,
                document,
                graph,
                parts: &self.parts,
                places: &self.places,
            };
            view.pair = self.row;
            drawing.show(ui, view, wanted);
        }
        let before = std::mem::take(&mut self.row);
        match selected {
            Some(part) => self.row = rows::show(ui, document, graph, part, view.pair, wanted),
            None if count <= MOST => weak(ui, "Select a part for its connections"),
            None => {}
        }
        if self.row != before {
            ui.ctx().request_repaint();
        }
    }

    /// Lays the graph out, unless it is so already.
    fn lay_out(&mut self, number: u64, graph: &Graph, parts: Vec<usize>) {
        if (self.number, &self.parts) != (number, &parts) {
            let edges: Vec<[usize; 2]> = graph.edges.iter().map(|edge| edge.parts).collect();
            self.places = layout(&parts, &edges);
            (self.number, self.parts) = (number, parts);
        }
    }
}

fn weak(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).size(12.0).color(theme::of(ui).text_weak));
}

fn request(ui: &mut Ui, session: &Session, document: &Document, wanted: &mut Vec<Intent>) {
    let find = Intent::Connections(ConnectionsIntent::Find);
    let state = &session.connections;
    ui.horizontal(|ui| match state.since() {
        Some(since) => {
            let seconds = since.elapsed().as_secs();
            ui.label(RichText::new(format!("Searching, {seconds} s")).size(12.5));
            let button = Button::new(RichText::new("Cancel").size(12.5));
            let cancel = Intent::Connections(ConnectionsIntent::Cancel);
            control::intent_button(ui, session, wanted, button, cancel, "")
                .accessible_name("Cancel search for connections");
            ui.ctx().request_repaint_after(TICK);
        }
        None => {
            if !state.was_asked(document) && obstacle(session, &find).is_none() {
                wanted.push(find.clone());
                ui.ctx().request_repaint();
            }
            let button = Button::new(RichText::new("Search again").size(12.5));
            let hint = "Which parts touch or fit where they are now, and by what";
            control::intent_button(ui, session, wanted, button, find, hint)
                .accessible_name("Search connections again");
        }
    });
}
