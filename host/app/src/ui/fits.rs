//! Fits of the selected part: their search, the list of what was found, and the choice among them. The view shows the chosen one as a ghost, with its way in.

use std::time::Duration;

use egui::text::LayoutJob;
use egui::{Align2, FontId, Pos2, Rect, RichText, ScrollArea, Stroke, TextFormat, Ui, UiBuilder, Vec2};

use super::{control, theme, way};
use crate::session::document::Document;
use crate::session::fitting::{Fitting, Offer, Search, is_closed};
use crate::session::{Intent, Session};
use crate::viewport::gesture::{Viewpoint, on_screen};

/// Highest list of fits, points.
const LIST_HEIGHT: f32 = 190.0;
/// Time between two pictures of a search, which shows the time passed.
const TICK: Duration = Duration::from_millis(500);
/// Words for all parts near the selected one.
const NEAREST: &str = "the nearest parts";

/// Draws the section of the panel.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    control::section(ui, "Fits");
    ui.add_space(2.0);
    let Some(document) = &session.document else {
        explain(ui, "Poses at which a part fits another, found on request.");
        return;
    };
    partner(ui, session, document, wanted);
    find(ui, session, wanted);
    let Some(fitting) = &session.fitting else {
        explain(
            ui,
            "Finds the poses at which the selected part fits another, of any shape, and the way in. Nothing moves before you place it.",
        );
        return;
    };
    for why in &fitting.failures {
        ui.label(RichText::new(why).small().color(theme::of(ui).warning));
    }
    if let Some(search) = &fitting.search {
        searching(ui, session, fitting.parts, search, wanted);
    }
    list(ui, session, document, fitting, wanted);
}

fn explain(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).small().color(theme::of(ui).text_weak));
}

/// The choice of the other part.
fn partner(ui: &mut Ui, session: &Session, document: &Document, wanted: &mut Vec<Intent>) {
    let subject = session.fit_subject();
    ui.horizontal(|ui| {
        let label = ui.label(RichText::new("Fits with").color(theme::of(ui).text_weak));
        let chosen = session.partner.map_or(NEAREST, |part| document.moving_name(part));
        let list = egui::ComboBox::from_id_salt("fits with")
            .width(ui.available_width() - 8.0)
            .selected_text(chosen)
            .truncate()
            .show_ui(ui, |ui| {
                if ui.selectable_label(session.partner.is_none(), NEAREST).clicked() {
                    wanted.push(Intent::FitWith(None));
                }
                for part in 0..document.model.parts.len() {
                    if Some(part) == subject || !is_closed(&document.grouped.model, part) {
                        continue;
                    }
                    let name = document.moving_name(part);
                    if ui.selectable_label(session.partner == Some(part), name).clicked() {
                        wanted.push(Intent::FitWith(Some(part)));
                    }
                }
            });
        list.response
            .labelled_by(label.id)
            .on_hover_text("The part that stays where it is");
    });
}

fn find(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let part = match (&session.document, session.fit_subject()) {
        (Some(document), Some(part)) => document.moving_name(part),
        _ => "the selected part",
    };
    let hint = format!("Search the poses at which {part} fits (M). It moves only when you place it");
    ui.vertical_centered_justified(|ui| {
        let button = egui::Button::new("Find fits").min_size(Vec2::new(0.0, 28.0));
        control::intent_button(ui, session, wanted, button, Intent::FindFits, &hint);
    });
}

fn searching(ui: &mut Ui, session: &Session, parts: usize, search: &Search, wanted: &mut Vec<Intent>) {
    ui.horizontal(|ui| {
        let number = parts - search.left + 1;
        let seconds = search.since.elapsed().as_secs();
        let text = match parts {
            1 => format!("Searching, {seconds} s"),
            _ => format!("Searching part {number} of {parts}, {seconds} s"),
        };
        let room = (ui.available_width() - 74.0).max(20.0);
        let label = egui::Label::new(text).truncate().halign(egui::Align::Min);
        ui.add_sized(Vec2::new(room, 24.0), label);
        let cancel = egui::Button::new("Cancel").min_size(Vec2::new(64.0, 24.0));
        let hint = "What was found so far stays";
        control::intent_button(ui, session, wanted, cancel, Intent::CancelFits, hint)
            .accessible_name("Cancel search for fits");
    });
    ui.ctx().request_repaint_after(TICK);
}

/// What was found, and what can be done with it.
fn list(ui: &mut Ui, session: &Session, document: &Document, fitting: &Fitting, wanted: &mut Vec<Intent>) {
    let part = document.moving_name(fitting.moving);
    let heading = match (fitting.offers.len(), &fitting.search) {
        (0, Some(_)) => return,
        (0, None) if fitting.parts > 1 => {
            format!(
                "{part} fits none of the {} nearest parts; choose another one",
                fitting.parts
            )
        }
        (0, None) => format!("No fit of {part} was found"),
        (1, _) => format!("1 fit of {part}"),
        (count, _) => format!("{count} fits of {part}, the best first"),
    };
    ui.add(egui::Label::new(RichText::new(heading).color(theme::of(ui).text_strong)).truncate());
    ScrollArea::vertical()
        .id_salt("fits")
        .max_height(LIST_HEIGHT)
        .show(ui, |ui| {
            for (number, offer) in fitting.offers.iter().enumerate() {
                line(ui, document, fitting, number, offer, wanted);
            }
        });
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let follows = session.follows_shown_fit();
        let mut button = |text: &str, name: &str, intent: Intent, hint: &str| {
            let chosen = follows && intent == Intent::FollowFit;
            let button = egui::Button::new(text).selected(chosen);
            control::intent_button(ui, session, wanted, button, intent, hint).accessible_name(name);
        };
        let place = "Put the part there (P). Only while the motors are off";
        button("Place", "Place part in fit", Intent::PlaceFit, place);
        let guide = "Guide the held part along its way into this fit, from where the parts meet (G); again: no longer";
        button("Guide", "Guide along the way in", Intent::FollowFit, guide);
        button("Next", "Next fit", Intent::NextFit, "Show the next fit (N)");
        let over = "Show the fit in which the part goes in the other way round (T)";
        button("Turn over", "Turn part over", Intent::TurnOver, over);
        button("Close", "Close fits", Intent::DropFits, "Show no fits any more");
    });
}

fn line(
    ui: &mut Ui,
    document: &Document,
    fitting: &Fitting,
    number: usize,
    offer: &Offer,
    wanted: &mut Vec<Intent>,
) {
    let ink = theme::of(ui);
    let format = |size, color| TextFormat::simple(FontId::proportional(size), color);
    let title = format!("{}. with {}", number + 1, document.moving_name(offer.against));
    let mut job = LayoutJob::default();
    job.append(&title, 0.0, format(13.0, ink.text_strong));
    job.append("\n", 0.0, format(13.0, ink.text));
    job.append(&measures(offer), 0.0, format(11.5, ink.text_weak));
    job.wrap.max_width = ui.available_width() - 16.0;
    let size = Vec2::new(ui.available_width(), 0.0);
    let chosen = fitting.chosen == number;
    let row = ui.add(egui::Button::selectable(chosen, job).wrap().min_size(size));
    let row = row.on_hover_ui(|ui| {
        ui.label(way_in(offer));
        ui.label(format!(
            "{} motions stay free",
            match offer.fit.freedom {
                0 => "No".to_owned(),
                count => count.to_string(),
            }
        ));
    });
    if row.clicked() {
        wanted.push(Intent::ChooseFit(number));
    }
    row.accessible_name(format!("Fit {title}"));
}

/// Length in the unit in which it is read easily.
fn length(mm: f64) -> String {
    if mm.abs() < 0.1 {
        // Adding zero takes the sign off a zero.
        format!("{:.1} µm", (1e4 * mm).round() / 10.0 + 0.0)
    } else {
        format!("{mm:.3} mm")
    }
}

/// Area, clearance and residual of a fit.
fn measures(offer: &Offer) -> String {
    let (fit, gap) = (&offer.fit, offer.fit.clearance);
    let way = match fit.path {
        Some(_) => "",
        None => ", no way in is known",
    };
    let (least, most) = (length(gap.min_mm), length(gap.max_mm));
    let clearance = match least == most {
        true => least,
        false => format!("{least} to {most}"),
    };
    let residual = length(fit.residual_mm);
    format!(
        "{:.1} mm², clearance {clearance}, residual {residual}{way}",
        fit.area_mm2
    )
}

/// The way in, in words.
fn way_in(offer: &Offer) -> String {
    let Some(path) = &offer.fit.path else {
        return "No way in is known: none was found, or none was searched".to_owned();
    };
    let kind = match path.kind {
        mortise_fit::PathKind::Line => "a straight line",
        mortise_fit::PathKind::Screw => "a screw",
        mortise_fit::PathKind::Polyline => "two straight lines",
    };
    let (long, gap) = (path.length_mm, length(path.smallest_clearance_mm));
    format!("Goes in by {kind} of {long:.1} mm, with a clearance of at least {gap}")
}

/// Draws the way of the chosen fit over the view, and under the bars, which end at `top`, what the keys do; returns the lower end.
pub fn over_view(ui: &mut Ui, rect: Rect, top: f32, session: &Session, view: &mut Viewpoint) -> f32 {
    let (Some(document), Some(fitting)) = (&session.document, &session.fitting) else {
        return top;
    };
    let Some(offer) = fitting.offer() else { return top };
    draw_way(ui, rect, document, fitting, offer, view);
    let place = Rect::from_min_size(
        Pos2::new(rect.left() + 14.0, top + 8.0),
        Vec2::new((rect.width() - 28.0).max(10.0), 20.0),
    );
    let text = format!(
        "Fit {} of {}: {} with {}. N: next, T: turn over, G: guide, P: place",
        fitting.chosen + 1,
        fitting.offers.len(),
        document.moving_name(fitting.moving),
        document.moving_name(offer.against)
    );
    let drawn = ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.horizontal(|ui| {
            let see = egui::Button::new(RichText::new("See").size(12.5));
            let hint = "Move the view until the part and its place in the fit are seen";
            let see = ui.add(see).on_hover_text(hint);
            if let Some(extent) = fitting.extent(document).filter(|_| see.clicked()) {
                view.fit(extent, rect);
            }
            see.accessible_name("See fit");
            let text = RichText::new(text).size(12.5).color(theme::of(ui).mates);
            ui.add(egui::Label::new(text).truncate());
        });
    });
    drawn.response.rect.bottom()
}

/// The way in as a line with an arrowhead at the place, and a thin line from where the part is to its beginning.
fn draw_way(ui: &Ui, rect: Rect, document: &Document, fitting: &Fitting, offer: &Offer, view: &Viewpoint) {
    let points = offer.way(document, fitting.moving);
    let Some(seen) = way::seen(&points, rect, view) else {
        return;
    };
    let painter = ui.painter_at(rect);
    let (color, first) = (theme::of(ui).mates, seen[0]);
    let here = fitting.middle(document);
    if let Some(here) = here.and_then(|here| on_screen(&view.camera, rect, here)) {
        let thin = Stroke::new(1.2, color.gamma_multiply(0.8));
        painter.extend(egui::Shape::dashed_line(&[here, first], thin, 5.0, 4.0));
    }
    way::draw(&painter, &seen, 2.4, color);
    painter.text(
        first,
        Align2::LEFT_BOTTOM,
        "way in",
        FontId::proportional(11.5),
        color,
    );
}
