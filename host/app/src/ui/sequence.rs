//! The steps in which the assembly goes together, under the parts, folded until they are opened: searched on request; a slider takes the parts apart and puts
//! them together, a strip of pictures shows the steps.

use std::time::Duration;

use egui::{Button, Label, RichText, Slider, Ui};

use super::filmstrip::Filmstrip;
use super::{control, theme};
use crate::session::sequence::Sequence;
use crate::session::{Intent, Session, obstacle};
use crate::viewport::gesture::Viewpoint;

/// Time between two pictures of a search, which shows the time passed.
const TICK: Duration = Duration::from_millis(500);

/// Draws the section.
pub fn show(
    ui: &mut Ui,
    strip: &mut Filmstrip,
    session: &Session,
    view: &mut Viewpoint,
    wanted: &mut Vec<Intent>,
) {
    ui.take_available_width();
    if session.document.is_none() {
        return;
    }
    control::folded(ui, "Sequence", |ui| contents(ui, strip, session, view, wanted));
}

fn contents(
    ui: &mut Ui,
    strip: &mut Filmstrip,
    session: &Session,
    view: &mut Viewpoint,
    wanted: &mut Vec<Intent>,
) {
    let Some(document) = &session.document else { return };
    request(ui, session, wanted);
    if let Some(why) = session.sequencing.failure(document) {
        ui.label(RichText::new(why).size(12.0).color(theme::of(ui).fault_text));
    }
    let Some(found) = session.sequencing.found(document) else {
        return;
    };
    ui.add(Label::new(RichText::new(&found.verdict).color(theme::of(ui).text_strong)).truncate());
    for stuck in &found.stuck {
        ui.label(RichText::new(stuck).size(12.0).color(theme::of(ui).warning));
    }
    if found.steps.is_empty() {
        return;
    }
    let done = session.sequencing.done();
    slide(ui, session, found, done, view, wanted);
    strip.show(ui, session, found, done, wanted);
}

fn request(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    ui.horizontal(|ui| match session.sequencing.since() {
        None => {
            let button = Button::new(RichText::new("Find the steps").size(12.5));
            let hint =
                "Search an order and ways in which the parts go together without overlap, up to a minute";
            control::intent_button(ui, session, wanted, button, Intent::FindSequence, hint);
            let button = Button::new(RichText::new("Report…").size(12.5));
            let hint = "Write the order with a picture of each step and the clearances to a page (HTML)";
            control::intent_button(ui, session, wanted, button, Intent::SaveSteps, hint)
                .accessible_name("Report of the steps");
        }
        Some(since) => {
            let seconds = since.elapsed().as_secs();
            ui.label(RichText::new(format!("Searching, {seconds} s")).size(12.5));
            let button = Button::new(RichText::new("Cancel").size(12.5));
            control::intent_button(ui, session, wanted, button, Intent::CancelSequence, "")
                .accessible_name("Cancel search for the steps");
            ui.ctx().request_repaint_after(TICK);
        }
    });
}

/// The slider from apart to together, and its ends.
fn slide(
    ui: &mut Ui,
    session: &Session,
    found: &Sequence,
    done: Option<f64>,
    view: &mut Viewpoint,
    wanted: &mut Vec<Intent>,
) {
    let count = found.steps.len() as f64;
    let whole = |done: f64| Intent::GoToStep { done, goes_on: false };
    let mut value = done.unwrap_or(count);
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let mut go = |ui: &mut Ui, text: &str, done: f64, hint: &str| {
            let button = Button::new(RichText::new(text).size(12.5));
            control::intent_button(ui, session, wanted, button, whole(done), hint)
        };
        let apart = go(ui, "Apart", 0.0, "Move every part to the start of its way");
        let together = go(ui, "Together", count, "Move every part to its place");
        view.wants_all |= apart.clicked() || together.clicked();
        let before = (value - 1.0).ceil().max(0.0);
        go(ui, "‹", before, "Take the last part off again").accessible_name("Step back");
        let after = (value + 1.0).floor().min(count);
        go(ui, "›", after, "Put the next part on").accessible_name("Step on");
    });
    let why = obstacle(session, &whole(value));
    ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(40.0);
    let slider = Slider::new(&mut value, 0.0..=count)
        .show_value(false)
        .smart_aim(false);
    let response = ui
        .add_enabled(why.is_none(), slider)
        .accessible_name("Steps done")
        .on_hover_text(
            "Left: apart. Right: together. The parts are moved, so a hand can take the next one from there",
        );
    // All of a drag is one step of the history, which begins with its first motion.
    let has_moved = response.id.with("has moved");
    if response.drag_started() {
        ui.data_mut(|data| data.remove::<bool>(has_moved));
    }
    if response.changed() {
        let dragged = response.dragged();
        let goes_on = dragged && ui.data(|data| data.get_temp(has_moved).unwrap_or(false));
        ui.data_mut(|data| data.insert_temp(has_moved, dragged));
        wanted.push(Intent::GoToStep { done: value, goes_on });
    }
    if let Some(why) = why {
        response.on_disabled_hover_text(why);
    }
    let text = match done {
        Some(done) if done >= count => "All parts are in place".to_owned(),
        Some(done) => format!("{} of {count} steps done", done.floor()),
        None => "Parts have been moved otherwise".to_owned(),
    };
    ui.label(RichText::new(text).size(12.0).color(theme::of(ui).text_weak));
}
