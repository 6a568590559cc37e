//! The window: draws a [`Session`] and passes the operator's intents to it. Works without a graphics device, so that tests can drive it.

pub mod app;
#[cfg(target_os = "linux")]
mod appearance;
mod arrange;
mod below;
mod bottom;
mod cards;
mod clearances;
mod clutch;
mod command;
mod commissioning;
mod connections;
mod control;
mod cube;
mod description;
mod diagram;
mod drop;
mod eye;
mod file_menu;
mod filmstrip;
mod firmware;
mod fits;
pub mod fonts;
mod gaps;
mod guidance;
mod handles;
mod header;
mod joints;
pub mod keys;
mod loop_time;
mod margin;
mod measure;
mod mechanism;
mod messages;
mod motion;
mod nudge;
mod open;
mod parameters;
mod part_line;
mod parts;
mod playback;
pub mod plots;
mod recent;
mod rig;
mod rig_page;
mod runs;
mod scale;
mod section;
mod sequence;
#[cfg(unix)]
pub mod space_mouse;
mod stop;
pub mod theme;
mod undo;
mod view;
mod way;
mod workspaces;

use std::time::{Duration, Instant};

use egui::{Key, Modifiers, Ui};

use self::arrange::{Arrangement, Tab};
use crate::session::grouping::GroupIntent;
use crate::session::link::Link;
#[cfg(unix)]
use crate::session::notes::Severity;
use crate::session::workspace::Workspace;
use crate::session::{Intent, Session};
use crate::viewport::gesture::Viewpoint;
use crate::viewport::surface::Surface;

/// Style, colours and fonts of the window; from then on dark or light follows the desktop.
pub fn set_up(ctx: &egui::Context) {
    theme::apply(ctx);
    fonts::install(ctx);
    #[cfg(target_os = "linux")]
    appearance::follow(ctx);
}

/// Time between redraws while the motors are off and the handle rests. With software rendering a redraw of 1600 × 1000 pixels costs up to 0.25 s of a core.
/// Motion and changes of state are drawn at once.
const CALM: Duration = Duration::from_secs(60);

/// State of the window between session and screen.
pub struct Window {
    /// Session shown.
    pub session: Session,
    /// Viewpoint of the 3D view.
    pub view: Viewpoint,
    path: open::PathDialog,
    tabs: arrange::Tabs,
    /// What is searched for in the list of parts.
    search: String,
    /// What the plots show.
    pub plots: plots::View,
    below: below::Below,
    command: command::CommandLine,
    motion: motion::Fields,
    runs: runs::Fields,
    help: keys::Help,
    /// A six-axis device, if one is followed.
    #[cfg(unix)]
    pub space_mouse: Option<space_mouse::SpaceMouse>,
}

impl Window {
    /// A window that shows `session`.
    pub fn new(session: Session) -> Self {
        let mut plots = plots::View::default();
        if let Some(signals) = &session.preferences.signals {
            plots.choose(signals);
        }
        Self {
            session,
            view: Viewpoint::default(),
            path: open::PathDialog::default(),
            tabs: arrange::Tabs::default(),
            search: String::new(),
            plots,
            below: below::Below::default(),
            command: command::CommandLine::default(),
            motion: motion::Fields::default(),
            runs: runs::Fields::default(),
            help: keys::Help::default(),
            #[cfg(unix)]
            space_mouse: None,
        }
    }

    /// Draws one frame. `surface` draws the 3D view where there is a graphics device.
    pub fn show(&mut self, ui: &mut Ui, surface: Option<&mut Surface>) {
        self.session.poll();
        self.view.begin();
        self.below.poll();
        if self.session.play(Instant::now()) {
            ui.ctx().request_repaint();
        }
        let mut wanted = Vec::new();
        stop::keys(ui.ctx(), &self.session, &mut wanted);
        let stops = wanted.contains(&Intent::Stop);
        self.view.handles.keys(ui, &mut self.session, stops);
        #[cfg(unix)]
        self.steer(ui);
        self.command.keys(ui);
        self.help.keys(ui);
        shortcuts(ui, &self.session, &mut wanted);
        clutch::keys(ui, &self.session, &mut wanted);
        undo::keys(ui, &mut wanted);
        nudge::keys(ui, &self.session, &self.view, &mut wanted);
        let size = ui.max_rect().size();
        header::show(ui, &self.session, &mut self.help.open, &mut wanted);
        self.command.show(ui, &self.session, &mut wanted);
        match Arrangement::of(size) {
            Arrangement::Wide => self.wide(ui, surface, &mut wanted),
            other => self.compact(ui, other, surface, &mut wanted),
        }
        drop::show(ui, &mut self.session, &mut wanted);
        self.path.show(ui, &mut self.session, &mut wanted);
        self.help.show(ui, header::height(size.x));
        self.command
            .finish(ui, &self.session, &mut self.view, &mut wanted);
        // STOP is handled before the other intents of the same frame.
        wanted.sort_by_key(|intent| *intent != Intent::Stop);
        for intent in wanted {
            self.session.act(intent);
        }
        self.keep(ui.ctx());
        if self.view.wants_all || self.view.over.now != self.view.over.before {
            ui.ctx().request_repaint();
        }
        if !matches!(self.session.link, Link::None) {
            // A request without delay would draw two frames.
            ui.ctx().request_repaint_after(CALM);
        }
    }

    /// Moves what the cap of a SpaceMouse moves, and takes its buttons.
    #[cfg(unix)]
    fn steer(&mut self, ui: &Ui) {
        let Some(mouse) = &mut self.space_mouse else {
            return;
        };
        self.view.six_axis.is_there = mouse.is_there();
        for why in mouse.refusals() {
            self.session.notes.add(Severity::Warning, why);
        }
        let wanted = mouse.frame(Instant::now(), ui.input(|input| input.focused));
        for button in wanted.pressed {
            match button {
                0 => self.view.six_axis.switch(),
                1 => self.view.wants_all = true,
                _ => {}
            }
        }
        self.view
            .steer(&wanted.deflection, wanted.seconds, &mut self.session);
        if !wanted.deflection.is_rest() {
            ui.ctx().request_repaint();
        }
    }

    /// Keeps what has changed for the next start.
    fn keep(&mut self, ctx: &egui::Context) {
        let session = &mut self.session;
        if let (Some(looks), Some(document)) = (session.looks.take(), &session.document) {
            if let Some(signals) = looks.signals {
                self.plots.choose(signals);
            }
            if let Some(view) = &looks.view {
                self.view.restore(view, document);
            }
        }
        if let Some(document) = &session.document {
            session.view = self.view.kept(document).or(session.view.take());
        }
        let keys = self.plots.keys();
        let preferences = &mut self.session.preferences;
        let changed = match &preferences.signals {
            Some(kept) => *kept != keys,
            None => keys != plots::View::default().keys(),
        };
        if changed {
            preferences.signals = Some(keys.into_iter().map(str::to_owned).collect());
        }
        if let Some(again) = self.session.keep() {
            ctx.request_repaint_after(again);
        }
    }

    /// Draws every panel around the view.
    fn wide(&mut self, ui: &mut Ui, surface: Option<&mut Surface>, wanted: &mut Vec<Intent>) {
        if self.session.workspace == Workspace::Analyse {
            // Runs are analysed without a rig, and their list is as high as the window.
            self.runs(ui, wanted);
            bottom::show(ui, &mut self.session, &mut self.plots, wanted);
        } else {
            bottom::show(ui, &mut self.session, &mut self.plots, wanted);
            if self.session.workspace == Workspace::Assemble {
                self.parts(ui, wanted);
            }
            let session = &self.session;
            egui::Panel::right("rig")
                .exact_size(336.0)
                .resizable(false)
                .frame(theme::panel())
                .show(ui, |ui| rig::show(ui, session, wanted));
        }
        self.picture(ui, surface, wanted);
    }

    /// Draws the panel of runs at the left.
    fn runs(&mut self, ui: &mut Ui, wanted: &mut Vec<Intent>) {
        egui::Panel::left("runs")
            .default_size(420.0)
            .size_range(260.0..=700.0)
            .frame(theme::panel())
            .show(ui, |ui| runs::show(ui, &self.session, &mut self.runs, wanted));
    }

    /// Draws the panel of parts at the left.
    fn parts(&mut self, ui: &mut Ui, wanted: &mut Vec<Intent>) {
        let session = &mut self.session;
        egui::Panel::left("parts")
            .default_size(248.0)
            .size_range(180.0..=420.0)
            .frame(theme::panel())
            .show(ui, |ui| {
                self.below.show(ui, session, &mut self.view, wanted);
                egui::CentralPanel::default()
                    .frame(egui::Frame::NONE)
                    .show(ui, |ui| {
                        parts::show(
                            ui,
                            session,
                            &mut self.view,
                            &mut self.motion,
                            &mut self.search,
                            wanted,
                        )
                    });
            });
    }

    /// Draws the view and a drawer, or one panel at a time.
    fn compact(
        &mut self,
        ui: &mut Ui,
        arrangement: Arrangement,
        surface: Option<&mut Surface>,
        wanted: &mut Vec<Intent>,
    ) {
        let tight = theme::panel().inner_margin(egui::Margin::symmetric(8, 6));
        egui::Panel::top("tabs")
            .resizable(false)
            .frame(tight)
            .show(ui, |ui| self.tabs.show(ui, arrangement, self.session.workspace));
        let tab = self.tabs.chosen(arrangement);
        match arrangement {
            _ if tab == Tab::Middle => self.picture(ui, surface, wanted),
            Arrangement::Beside(width) => {
                egui::Panel::right("drawer")
                    .exact_size(width)
                    .resizable(false)
                    .frame(tight)
                    .show(ui, |ui| self.panel(ui, tab, wanted));
                self.picture(ui, surface, wanted);
            }
            Arrangement::Wide | Arrangement::Single => {
                egui::CentralPanel::default()
                    .frame(tight)
                    .show(ui, |ui| self.panel(ui, tab, wanted));
            }
        }
    }

    /// Draws the panel of a tab.
    fn panel(&mut self, ui: &mut Ui, tab: Tab, wanted: &mut Vec<Intent>) {
        let session = &mut self.session;
        match tab {
            Tab::Middle => {}
            Tab::Rig => rig::show(ui, session, wanted),
            Tab::Left if session.workspace == Workspace::Analyse => {
                runs::show(ui, session, &mut self.runs, wanted);
            }
            Tab::Left => {
                self.below.show(ui, session, &mut self.view, wanted);
                parts::show(
                    ui,
                    session,
                    &mut self.view,
                    &mut self.motion,
                    &mut self.search,
                    wanted,
                );
            }
            Tab::Messages => messages::show(ui, session, |_| {}),
            Tab::Plots => plots::show(ui, session, &mut self.plots, wanted),
        }
    }

    /// Draws the view and its overlays, or the page on the rig.
    fn picture(&mut self, ui: &mut Ui, surface: Option<&mut Surface>, wanted: &mut Vec<Intent>) {
        let session = &mut self.session;
        if session.workspace == Workspace::Rig {
            egui::CentralPanel::default()
                .frame(theme::panel())
                .show(ui, |ui| rig_page::show(ui, session, wanted));
            return;
        }
        egui::CentralPanel::default()
            .frame(egui::Frame::NONE)
            .show(ui, |ui| {
                let rect = ui.available_rect_before_wrap();
                view::show(ui, session, &mut self.view, surface, wanted);
                recent::on_empty_page(ui, rect, session, wanted);
                cards::show(ui, rect, session, wanted);
            });
    }
}

fn shortcuts(ui: &Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let typing = ui.ctx().text_edit_focused();
    ui.input_mut(|input| {
        if input.consume_key(Modifiers::COMMAND, Key::O) {
            wanted.push(Intent::Browse);
        }
        let Some(document) = session.document.as_ref().filter(|_| !typing) else {
            return;
        };
        let selection = session.selection();
        // First, because a key without Shift also fits the one with it.
        if input.consume_key(Modifiers::COMMAND | Modifiers::SHIFT, Key::G) {
            let part = session.selected.unwrap_or(usize::MAX);
            wanted.push(Intent::Group(GroupIntent::Ungroup(part)));
        }
        if input.consume_key(Modifiers::COMMAND, Key::G) {
            wanted.push(Intent::Group(GroupIntent::Group(selection.clone())));
        }
        // First, because a key without modifiers also fits the one with Shift.
        if input.consume_key(Modifiers::SHIFT, Key::H) {
            wanted.push(Intent::ShowAll);
        }
        if let Some(part) = session.selected {
            if input.consume_key(Modifiers::NONE, Key::H) {
                let hides = !document.is_hidden(part);
                wanted.extend(selection.into_iter().map(|part| Intent::Hide(part, hides)));
            }
            if input.consume_key(Modifiers::NONE, Key::I) {
                wanted.push(Intent::Isolate(part));
            }
        }
        if session.fit_subject().is_some() && input.consume_key(Modifiers::NONE, Key::M) {
            wanted.push(Intent::FindFits);
        }
        if session.fitting.is_some() {
            let keys = [
                (Key::N, Intent::NextFit),
                (Key::T, Intent::TurnOver),
                (Key::P, Intent::PlaceFit),
                (Key::G, Intent::FollowFit),
            ];
            for (key, intent) in keys {
                if input.consume_key(Modifiers::NONE, key) {
                    wanted.push(intent);
                }
            }
        }
    });
}
