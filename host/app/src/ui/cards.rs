//! Cards over the view: progress of reading or baking, a lost link, the outcome of an insertion.

use egui::{Align2, Area, Id, Order, Pos2, Rect, RichText, Ui, Vec2};

use super::{control, theme};
use crate::session::notes::Severity;
use crate::session::{Intent, Job, Session, remaining};

/// Widest card, points.
const WIDTH: f32 = 380.0;

/// Draws the cards inside `rect`.
pub fn show(ui: &Ui, rect: Rect, session: &Session, wanted: &mut Vec<Intent>) {
    if let Some(lost) = &session.lost {
        card(ui, rect, "lost", Align2::CENTER_CENTER, rect.center(), |ui| {
            let ink = theme::of(ui);
            ui.label(RichText::new("Link lost").size(17.0).color(ink.fault_text));
            let why = RichText::new(&lost.why).color(ink.text);
            ui.add(egui::Label::new(why).wrap());
            let what = "The board switches its motors off by itself.";
            ui.label(RichText::new(what).small().color(ink.text_weak));
            ui.add_space(2.0);
            let again = control::primary(ui, "Reconnect").min_size(Vec2::new(120.0, 30.0));
            let hint = "Reopen the same link. Motors stay off until armed";
            control::intent_button(ui, session, wanted, again, Intent::Reconnect, hint);
        });
    }
    if let Some(verdict) = &session.verdict {
        // Below the bars and the held part's card.
        let at = rect.center_top() + Vec2::new(0.0, 116.0);
        card(ui, rect, "verdict", Align2::CENTER_TOP, at, |ui| {
            let ink = theme::of(ui);
            let color = match verdict.severity() {
                Severity::Good => ink.good,
                _ => ink.warning,
            };
            let words = RichText::new(verdict.to_string()).size(15.0).color(color);
            ui.add(egui::Label::new(words).wrap().halign(egui::Align::Center));
        });
    }
    if let Some(job) = &session.job {
        let at = rect.center_bottom() - Vec2::new(0.0, 44.0);
        card(ui, rect, "job", Align2::CENTER_BOTTOM, at, |ui| {
            self::job(ui, session, job, wanted);
        });
    }
}

fn card(ui: &Ui, rect: Rect, id: &str, pivot: Align2, at: Pos2, contents: impl FnOnce(&mut Ui)) {
    Area::new(Id::unique(id))
        .pivot(pivot)
        .fixed_pos(at)
        .constrain_to(rect)
        .order(Order::Middle)
        .show(ui.ctx(), |ui| {
            theme::card(theme::of(ui)).show(ui, |ui| {
                ui.set_width(WIDTH.min(rect.width() - 40.0).max(80.0));
                contents(ui);
            });
        });
}

fn job(ui: &mut Ui, session: &Session, job: &Job, wanted: &mut Vec<Intent>) {
    let ink = theme::of(ui);
    ui.horizontal(|ui| {
        ui.add(egui::Spinner::new().size(16.0).color(ink.accent));
        let text = RichText::new(&job.doing).color(ink.text_strong);
        let room = (ui.available_width() - 70.0).max(20.0);
        ui.add_sized(
            Vec2::new(room, 20.0),
            egui::Label::new(text).truncate().halign(egui::Align::Min),
        );
        let cancel = egui::Button::new("Cancel").small();
        control::intent_button(ui, session, wanted, cancel, Intent::CancelWork, "");
    });
    let elapsed = job.since.elapsed();
    let bar = match job.fraction {
        Some(fraction) => egui::ProgressBar::new(fraction),
        None => egui::ProgressBar::new(1.0).animate(true),
    };
    ui.add(bar.desired_height(6.0).fill(ink.accent));
    let left = job
        .fraction
        .and_then(|fraction| remaining::left(elapsed, fraction));
    let time = match (left, job.limit) {
        (Some(left), _) => remaining::words(left),
        (None, Some(limit)) => format!("{} s, at most {} s", elapsed.as_secs(), limit.as_secs()),
        (None, None) => "…".to_owned(),
    };
    ui.label(RichText::new(time).small().color(ink.text_weak));
}
