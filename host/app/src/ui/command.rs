//! The command line (Ctrl+K): instructions in plain words, under the bar at the top.

use egui::text::{CCursor, CCursorRange};
use egui::text_edit::TextEditState;
use egui::{Button, Id, Key, Modifiers, RichText, Spinner, TextEdit, Ui, Vec2};
use mortise_words::Outcome;

use super::{control, theme};
use crate::session::instructions::{Answer, completions};
use crate::session::{Intent, Session, obstacle};
use crate::viewport::gesture::{Marked, Viewpoint};

/// Longest list of completions shown.
const SHOWN: usize = 6;

/// State of the command line.
#[derive(Default)]
pub struct CommandLine {
    open: bool,
    /// Whether the field is to have the keyboard.
    fresh: bool,
    text: String,
    /// Instruction from the history that is shown, counted from the newest.
    recalled: Option<usize>,
    /// What Tab offers, and which of them is in the field.
    offered: Option<(Vec<String>, usize)>,
    /// The answer whose parts were marked last.
    marked: Option<Answer>,
    height: f32,
}

fn field_id() -> Id {
    Id::unique("instruction")
}

impl CommandLine {
    /// Opens and closes the line by Ctrl+K.
    pub fn keys(&mut self, ui: &Ui) {
        if ui.input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::K)) {
            self.open = !self.open;
            self.fresh = self.open;
        }
    }

    /// Draws the line while it is open.
    pub fn show(&mut self, ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
        if !self.open {
            return;
        }
        let drawn = egui::Panel::top("command line")
            .resizable(false)
            .frame(theme::panel().inner_margin(egui::Margin::symmetric(14, 8)))
            .show(ui, |ui| {
                self.line(ui, session, wanted);
                self.below(ui, session, wanted);
            });
        control::settle(ui, drawn.response.rect.height(), &mut self.height);
        if !session_takes_escape(session) && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape)) {
            self.open = false;
        }
    }

    fn line(&mut self, ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
        let running = session.instructions.under_way();
        ui.horizontal(|ui| {
            self.field(ui, session, wanted);
            match running {
                Some(_) => {
                    ui.add(Spinner::new().size(16.0));
                    let cancel = Button::new("Cancel");
                    let hint = "Nothing is moved by it";
                    let cancel =
                        control::intent_button(ui, session, wanted, cancel, Intent::CancelInstruction, hint);
                    self.fresh |= cancel.clicked();
                }
                None => {
                    let intent = Intent::Instruct(self.text.trim().to_owned());
                    let button = control::primary(ui, "Do it");
                    let hint = "Carry out the instruction (Enter)";
                    let button = control::intent_button(ui, session, wanted, button, intent, hint);
                    if button.clicked() {
                        self.given();
                    }
                }
            }
            let close = ui.add(Button::new("×").frame(false));
            self.open &= !close.clicked();
            close
                .accessible_name("Close the command line")
                .on_hover_text("Close (Ctrl+K)");
        });
    }

    fn field(&mut self, ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
        let has_focus = ui.memory(|m| m.has_focus(field_id()));
        let offers = self.offers(session);
        if has_focus {
            self.history(ui, session);
            if !offers.is_empty() && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Tab)) {
                self.complete(ui, offers.clone());
            }
        }
        let edit = TextEdit::singleline(&mut self.text)
            .id(field_id())
            .hint_text("Instruction, such as: remove the cover")
            .lock_focus(!offers.is_empty())
            .desired_width((ui.available_width() - 150.0).max(60.0))
            .margin(Vec2::new(8.0, 5.0));
        let field = ui.add(edit);
        if field.changed() {
            (self.offered, self.recalled) = (None, None);
        }
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
        if entered && !self.text.trim().is_empty() {
            let intent = Intent::Instruct(self.text.trim().to_owned());
            if obstacle(session, &intent).is_none() {
                self.given();
            }
            wanted.push(intent);
        }
        if self.fresh || entered {
            field.request_focus();
            self.fresh = false;
        }
        field
            .accessible_name("Instruction")
            .on_hover_text("Up and down: earlier instructions; Tab: completes a part's name");
    }

    /// Empties the field, for its instruction is carried out.
    fn given(&mut self) {
        self.text.clear();
        (self.offered, self.recalled) = (None, None);
        self.fresh = true;
    }

    /// What Tab offers.
    fn offers(&self, session: &Session) -> Vec<String> {
        if let Some((offered, _)) = &self.offered {
            return offered.clone();
        }
        let Some(document) = &session.document else {
            return Vec::new();
        };
        let names = document.model.parts.iter().map(|part| part.name.as_str());
        completions(&self.text, names)
    }

    fn complete(&mut self, ui: &Ui, offers: Vec<String>) {
        let next = self.offered.as_ref().map_or(0, |(_, at)| (at + 1) % offers.len());
        self.put(ui, offers[next].clone());
        self.offered = Some((offers, next));
    }

    fn history(&mut self, ui: &Ui, session: &Session) {
        let given = &session.instructions.given;
        let older = ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::ArrowUp));
        let newer = ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::ArrowDown));
        let next = match (older, newer, self.recalled) {
            (true, _, None) => Some(0),
            (true, _, Some(at)) => Some(at + 1),
            (_, true, Some(at)) => at.checked_sub(1),
            _ => return,
        };
        let text = next.map(|at| given.iter().rev().nth(at).cloned());
        match text {
            Some(Some(text)) => self.put(ui, text),
            // At the oldest one.
            Some(None) => return,
            None => self.put(ui, String::new()),
        }
        (self.recalled, self.offered) = (next, None);
    }

    /// Puts a text into the field, with the cursor behind it.
    fn put(&mut self, ui: &Ui, text: String) {
        let end = CCursor::new(text.chars().count());
        let mut state = TextEditState::load(ui.ctx(), field_id()).unwrap_or_default();
        state.cursor.set_char_range(Some(CCursorRange::one(end)));
        state.store(ui.ctx(), field_id());
        self.text = text;
    }

    /// Draws what became of the last instruction, or what Tab offers.
    fn below(&mut self, ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
        let ink = theme::of(ui);
        let small = |text: String, color| RichText::new(text).size(12.5).color(color);
        if let Some(text) = session.instructions.under_way() {
            ui.label(small(format!("Under way: {text}"), ink.text_weak));
            return;
        }
        let offers = self.offers(session);
        if !self.text.trim().is_empty() && !offers.is_empty() {
            let more = if offers.len() > SHOWN { ", …" } else { "" };
            let list = offers.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
            ui.add(egui::Label::new(small(format!("Tab: {list}{more}"), ink.text_weak)).truncate());
            return;
        }
        let Some(answer) = &session.instructions.answer else {
            return;
        };
        let (head, color) = match answer.outcome {
            Outcome::Done => ("Done", ink.good),
            Outcome::Ask => ("Which one?", ink.warning),
            Outcome::Refuse => ("Not done", ink.warning),
        };
        ui.label(small(
            format!("{head} – {}: {}", answer.text, answer.words),
            color,
        ));
        let document = session.document.as_ref();
        ui.horizontal_wrapped(|ui| {
            for &part in session.instructions.candidates() {
                let name = document.map_or("?", |document| document.part_name(part));
                let intent = Intent::Instruct(name.to_owned());
                let button = Button::new(small(name.to_owned(), ink.text_strong));
                let hint = "This one is meant; a click on it in the view or in the list says the same";
                let response = control::intent_button(ui, session, wanted, button, intent, hint);
                self.fresh |= response.clicked();
                response.accessible_name(format!("Answer {name}"));
            }
        });
    }

    /// Call it once everything else is drawn. A click on a candidate, in the view or in the list of parts, is the answer to the question; the parts of a question
    /// or refusal are marked there.
    pub fn finish(&mut self, ui: &Ui, session: &Session, view: &mut Viewpoint, wanted: &mut Vec<Intent>) {
        let candidates = session.instructions.candidates();
        let chosen = wanted.iter().find_map(|intent| match intent {
            Intent::Select(Some(part)) if candidates.contains(part) => Some(*part),
            _ => None,
        });
        if let (true, Some(part), Some(document)) = (self.open, chosen, &session.document) {
            wanted.push(Intent::Instruct(document.part_name(part).to_owned()));
        }
        if self.mark(session, view) {
            ui.ctx().request_repaint();
        }
    }

    /// Marks the parts of an answer; returns whether the answer is a new one.
    fn mark(&mut self, session: &Session, view: &mut Viewpoint) -> bool {
        let answer = session.instructions.answer.as_ref();
        let answer = answer.filter(|answer| self.open && answer.outcome != Outcome::Done);
        let is_new = answer != self.marked.as_ref();
        if let (true, Some(old)) = (is_new, &self.marked)
            && view.marked.parts == old.parts
        {
            view.marked = Marked::default();
        }
        if let Some(answer) = answer
            && (is_new || (answer.outcome == Outcome::Ask && view.marked == Marked::default()))
        {
            view.marked.parts.clone_from(&answer.parts);
            view.marked.place = None;
        }
        if is_new {
            self.marked = answer.cloned();
        }
        is_new
    }
}

/// Whether Esc stops the motors.
fn session_takes_escape(session: &Session) -> bool {
    session.connection().is_some()
}
